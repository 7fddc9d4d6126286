"""Frame by frame through the clip: the autoregressive driver, the camera's pose, the in-betweens."""
