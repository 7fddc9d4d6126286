"""Everything that is read: Gaussians, cameras, frames, masks, and the search for them.

`discover` chooses the files, `read_scene` reads them; the other functions read one thing each.
"""

from animator.scene.cameras import read_cameras
from animator.scene.depth_maps import read_depth_maps
from animator.scene.discovery import Found, SceneFiles, SceneOverrides, discover
from animator.scene.frames import FrameOptions, open_frames, read_frames, select_frames
from animator.scene.masks import Masks, find_masks
from animator.scene.pinhole import scale_camera
from animator.scene.ply import read_ply
from animator.scene.scene import Scene, read_scene

__all__ = [
    "Found",
    "FrameOptions",
    "Masks",
    "Scene",
    "SceneFiles",
    "SceneOverrides",
    "discover",
    "find_masks",
    "open_frames",
    "read_cameras",
    "read_depth_maps",
    "read_frames",
    "read_ply",
    "read_scene",
    "scale_camera",
    "select_frames",
]
