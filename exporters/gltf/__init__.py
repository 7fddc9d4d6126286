"""A `Clip` as glTF 2.0: a skinned carrier mesh, its animation, the camera and the rest splats."""
