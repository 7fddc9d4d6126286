"""The numpy side: a `Clip` and the files it is written to. Imports neither torch nor animator.

    clip = load_clip("clip.splatimate.npz")
    clip.pose_at(0.5)                     the truth every file is compared with
    export_clip(clip, "clip.usdc")        also .usd .usda .usdz .glb .gltf
    export_clip(clip, "clip_gaussians")   a folder of PLY files, one a frame
    export_clip(clip, "clip.usdz", PROFILES["arkit"].options)

The writers, and the packages they need, are imported when a file is written.
"""

from exporters.clip import Clip, ClipCamera, Posed, Rig, Skin, Splats, Tracks, Uncertainty
from exporters.clip_io import load_clip, save_clip
from exporters.errors import ClipError, WriteError
from exporters.options import ExportOptions
from exporters.profiles import PROFILES, Profile
from exporters.registry import EXPORTERS, export_clip

__all__ = [
    "EXPORTERS",
    "PROFILES",
    "Clip",
    "ClipCamera",
    "ClipError",
    "ExportOptions",
    "Posed",
    "Profile",
    "Rig",
    "Skin",
    "Splats",
    "Tracks",
    "Uncertainty",
    "WriteError",
    "export_clip",
    "load_clip",
    "save_clip",
]
