"""A tiny scene with truth on disk: a textured box that slides by a known step a frame."""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.spatial.transform import Rotation

from animator.render.cpu import CpuRenderer
from animator.types import Camera, Gaussians
from exporters.clip import Splats
from exporters.ply import layout
from tests.helpers import clips
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

FRAME_COUNT = 4
SIZE_PX = 64
STEP = np.array([0.06, 0.02, 0.0])
"""Motion a frame."""
FRONT = front_camera(3.0, size_px=SIZE_PX)


def side_camera() -> Camera:
    """The front camera, walked around the box by 70 degrees."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("y", 70, degrees=True).as_matrix()
    return FRONT.with_pose(FRONT.cam_from_world @ turn)


def write_ply(gaussians: Gaussians, path: Path) -> None:
    count = len(gaussians)
    splats = Splats(
        **{f.name: getattr(gaussians, name_of(f.name)).numpy() for f in dataclasses.fields(Splats)}
    )
    clip = dataclasses.replace(clips.static(), splats=splats, skin=clips.skin_to([0] * count))
    path.write_bytes(layout.header(count, 1) + layout.rest_rows(clip).tobytes())


def name_of(field: str) -> str:
    return "means" if field == "positions" else field


def write_pictures(renderer, posed: list[Gaussians], camera: Camera, folder: Path) -> list[dict]:
    """Write RGBA pictures; return the frames of a transforms.json."""
    folder.mkdir(parents=True)
    frames = filmed([draw(renderer, gaussians, camera) for gaussians in posed])
    world_from_gl = np.linalg.inv(camera.cam_from_world) @ np.diag([1.0, -1.0, -1.0, 1.0])
    records = []
    for number in range(len(posed)):
        rgba = np.dstack([frames.images[number], frames.alphas[number]])
        Image.fromarray(rgba).save(folder / f"{number:05d}.png")
        name = f"{folder.parent.name}/{folder.name}" if folder.name == "side" else folder.name
        records.append(
            {"file_path": f"{name}/{number:05d}.png", "transform_matrix": world_from_gl.tolist()}
        )
    return records


def write_transforms(records: list[dict], path: Path) -> None:
    lens = {
        "fl_x": FRONT.intrinsics[0, 0],
        "fl_y": FRONT.intrinsics[1, 1],
        "cx": SIZE_PX / 2,
        "cy": SIZE_PX / 2,
        "w": SIZE_PX,
        "h": SIZE_PX,
    }
    path.write_text(json.dumps({**lens, "frames": records}))


@pytest.fixture(scope="session")
def box() -> Gaussians:
    sparse = textured_box(400)
    return dataclasses.replace(sparse, scales=2 * sparse.scales)  # no longer seen through


@pytest.fixture(scope="session")
def master_scene(tmp_path_factory, box) -> Path:
    folder = tmp_path_factory.mktemp("scenes") / "box"
    folder.mkdir()
    renderer = CpuRenderer()
    shifts = [torch.tensor(STEP * k, dtype=torch.float32) for k in range(FRAME_COUNT)]
    posed = [box.posed(box.means + shift, box.quats_wxyz) for shift in shifts]
    write_ply(box, folder / "init.ply")
    write_transforms(
        write_pictures(renderer, posed, FRONT, folder / "frames"), folder / "transforms_frames.json"
    )
    write_transforms(
        write_pictures(renderer, posed, side_camera(), folder / "eval" / "side"),
        folder / "transforms_eval.json",
    )
    rest = box.means.numpy()[::2]
    np.savez(
        folder / "gt_points.npz",
        points=np.stack([rest + STEP * k for k in range(FRAME_COUNT)]).astype(np.float32),
        point_visible=np.tile(rest[:, 2] < 0, (FRAME_COUNT, 1)),
        point_train_views=(np.arange(len(rest)) % 10 > 0).astype(np.uint8),
        point_part=(rest[:, 0] > 0).astype(np.int32),
        part_group=np.array([0, 1]),
        part_names=np.array(["left", "right"]),
    )
    return folder


@pytest.fixture
def scene(master_scene, tmp_path) -> Path:
    """Return a copy of the scene to spoil."""
    return Path(shutil.copytree(master_scene, tmp_path / "box"))


@pytest.fixture(scope="session")
def renderer() -> CpuRenderer:
    return CpuRenderer()
