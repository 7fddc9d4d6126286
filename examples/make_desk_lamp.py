"""Make the example object from nothing: a painted desk lamp that turns and bends.

Writes, into `examples/desk_lamp/`:

* `lamp.ply`                    the Gaussians at rest
* `frames/`                     the clip: 16 frames of the moving lamp from one static camera
* `transforms_frames.json`      that camera
* `views/`, `transforms_train.json`   24 posed views of the lamp at rest, as a capture has them
* `true_motion.npz`             how every part really moves; only tests read it

The pictures show another, four times denser covering of the same surfaces than the Gaussians, under
a light that does not turn with the lamp: no model can match them exactly, as in life.

Usage:
    python examples/make_desk_lamp.py [FOLDER]
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from animator.render.cpu import CpuRenderer
from toybox import desk_lamp, files
from toybox.pictures import Shot, lit_gaussians, photograph
from toybox.splats import SurfaceSplats, cover

FRAME_COUNT = 16
VIEW_COUNT = 24
GAUSSIAN_COUNT = 4800
PICTURE_GAUSSIAN_COUNT = 20_000

CLIP_SHOT = Shot(
    azimuth_deg=24.0,
    elevation_deg=14.0,
    distance=3.4,
    target=(0.22, 0.57, 0.0),
    field_of_view_deg=27.0,
    size_px=256,
)

Show = Callable[[str], None]


def main(folder: Path, show: Show = print) -> None:
    """Make everything.

    Args:
        folder: Where to; made if it is not there.
        show: Called with a line of text for each thing made.
    """
    for name in ("frames", "views"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    transforms = true_transforms()
    model = lamp_splats(GAUSSIAN_COUNT, seed=0)
    subject = lamp_splats(PICTURE_GAUSSIAN_COUNT, seed=1)

    files.write_ply(lit_gaussians(model.posed(transforms[0])), folder / "lamp.ply")
    show(f"lamp.ply: {len(model)} Gaussians")
    _take_clip(subject, transforms, folder)
    show(f"frames: {FRAME_COUNT} of {CLIP_SHOT.size_px} px")
    _take_views(subject.posed(transforms[0]), folder)
    show(f"views: {VIEW_COUNT} of {view_shot(0).size_px} px")
    np.savez_compressed(
        folder / "true_motion.npz",
        part_names=np.array(desk_lamp.PART_NAMES),
        part_ids=model.part_ids.astype(np.int8),
        posed_from_rest=transforms @ np.linalg.inv(transforms[0]),
    )
    show("true_motion.npz: part of each Gaussian, rigid motion of each part")


def true_transforms() -> np.ndarray:
    """Return the place of every part in every frame, shape (T, P, 4, 4)."""
    moments = np.linspace(0.0, 1.0, FRAME_COUNT)
    return np.stack([desk_lamp.world_from_part(moment) for moment in moments])


def lamp_splats(count: int, *, seed: int) -> SurfaceSplats:
    """Cover the lamp's surfaces, in the parts' frames."""
    return cover(desk_lamp.patches_by_part(), count, np.random.default_rng(seed))


def view_shot(index: int) -> Shot:
    """Return the camera of a view of the capture: three rings around the lamp."""
    ring = index % 3
    return Shot(
        azimuth_deg=7.0 + 360.0 * index / VIEW_COUNT,
        elevation_deg=(6.0, 26.0, 48.0)[ring],
        distance=3.2,
        target=(0.1, 0.52, 0.0),
        field_of_view_deg=27.0,
        size_px=192,
    )


def _take_clip(subject: SurfaceSplats, transforms: np.ndarray, folder: Path) -> None:
    renderer = CpuRenderer()
    names = [f"frames/{number:05d}.png" for number in range(FRAME_COUNT)]
    for name, transform in zip(names, transforms, strict=True):
        picture = photograph(subject.posed(transform), CLIP_SHOT, renderer)
        files.write_png(picture, folder / name)
    shots = [(name, CLIP_SHOT) for name in names]
    files.write_transforms(shots, folder / "transforms_frames.json")


def _take_views(subject: SurfaceSplats, folder: Path) -> None:
    renderer = CpuRenderer()
    shots = [(f"views/{index:03d}.png", view_shot(index)) for index in range(VIEW_COUNT)]
    for name, shot in shots:
        files.write_png(photograph(subject, shot, renderer), folder / name)
    files.write_transforms(shots, folder / "transforms_train.json")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default_folder = Path(__file__).parent / "desk_lamp"
    parser.add_argument("folder", metavar="FOLDER", nargs="?", type=Path, default=default_folder)
    main(parser.parse_args().folder)
