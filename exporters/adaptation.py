"""A clip as its target wants it: axes, unit, rate and camera, changed once before anything is written."""

import dataclasses

from exporters.clip import Clip
from exporters.coordinates import in_world
from exporters.options import ExportOptions


def adapt(clip: Clip, options: ExportOptions) -> Clip:
    """Return the clip as the options want it; itself, if they want nothing else.

    Nothing that moves changes: keys keep their times and Gaussians their places in the world. Joints
    are another matter, see `exporters.joint_limit`: the caches have none, and stay exact.

    Args:
        clip: A valid clip.
        options: `camera`, `fps`, `up_axis` and `meters_per_unit` count here.
    """
    if clip.camera is not None and not options.camera:
        clip = dataclasses.replace(clip, camera=None)
    if options.fps is not None and options.fps != clip.fps:
        clip = dataclasses.replace(clip, fps=options.fps)
    return in_world(
        clip,
        up_axis=options.up_axis or clip.up_axis,
        meters_per_unit=options.meters_per_unit or clip.meters_per_unit,
    )


def adapt_to_gltf(clip: Clip, options: ExportOptions) -> Clip:
    """Return the clip as glTF wants it: +y up, in meters (glTF 2.0, section 3.4), whatever is asked.

    The clip keeps its rate, too: glTF counts seconds, and only notes the rate.
    """
    return adapt(clip, dataclasses.replace(options, up_axis="Y", meters_per_unit=1.0, fps=None))
