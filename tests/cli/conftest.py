"""A tiny scene on disk whose frames show the splat at rest, and a fit that leaves it there."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from exporters.ply import layout
from tests.helpers import clips

FRAME_COUNT = 4
SIZE_PX = 64


@pytest.fixture(scope="session")
def master_scene(tmp_path_factory) -> Path:
    """Write splat, camera and frames once; tests copy it."""
    from animator.render.cpu import CpuRenderer
    from animator.scene import read_ply
    from tests.helpers.objects import box_points, front_camera

    folder = tmp_path_factory.mktemp("scene")
    still = clips.static()
    points = box_points((0.1, -0.05, 0.0), (1.2, 0.8, 0.6), 120, seed=3)
    splats = dataclasses.replace(
        clips.splats(points, seed=5), scales=np.full((120, 3), 0.08), opacities=np.full(120, 0.95)
    )
    clip = dataclasses.replace(still, splats=splats, skin=clips.skin_to([0] * 120))
    ply = layout.header(120, 1) + layout.rest_rows(clip).tobytes()
    (folder / "init.ply").write_bytes(ply)

    camera = front_camera(3.0, size_px=SIZE_PX)
    gl_world_from_cam = np.linalg.inv(camera.cam_from_world) @ np.diag([1.0, -1.0, -1.0, 1.0])
    transforms = {
        "fl_x": camera.intrinsics[0, 0],
        "fl_y": camera.intrinsics[1, 1],
        "cx": SIZE_PX / 2,
        "cy": SIZE_PX / 2,
        "w": SIZE_PX,
        "h": SIZE_PX,
        "frames": [{"file_path": "any.png", "transform_matrix": gl_world_from_cam.tolist()}],
    }
    (folder / "transforms_frames.json").write_text(json.dumps(transforms))

    rendering = CpuRenderer().render(read_ply(folder / "init.ply"), camera)
    alpha = rendering.alpha.numpy()[..., None]
    straight = np.where(alpha > 0, rendering.rgb.numpy() / np.maximum(alpha, 1e-6), 0.0)
    rgba = np.rint(np.concatenate([straight, alpha], axis=-1).clip(0, 1) * 255).astype(np.uint8)
    (folder / "frames").mkdir()
    for number in range(FRAME_COUNT):
        Image.fromarray(rgba).save(folder / "frames" / f"{number:04d}.png")
    return folder


@pytest.fixture
def scene(master_scene, tmp_path) -> Path:
    """Return a copy of the scene to spoil."""
    import shutil

    return Path(shutil.copytree(master_scene, tmp_path / "scene"))


class StubFit:
    """Stands in for `animator.pipeline.fit`: every frame is solved by a shift that tells its index."""

    def __init__(self) -> None:
        self.step = 0.0
        self.interrupt_at: int | None = None
        self.solved_indices: list[int] = []
        self.configs = []

    def __call__(self, scene, labels, config, *, resume_from=(), on_frame):
        import torch

        from animator.deform.anchors import build_anchors
        from animator.pipeline import Fit
        from animator.render.cpu import CpuRenderer
        from animator.rig.bake import Key, bake_clip
        from animator.sequence.solved_frame import FrameStats, SolvedFrame
        from animator.types import AnchorPoses, RigidGroups

        self.configs.append(config)
        anchors = build_anchors(scene.gaussians, target_count=6)
        rest = AnchorPoses.identity(anchors)
        labels_of = np.where(scene.gaussians.means[:, 0].numpy() > 0, 0, -1)
        solved = list(resume_from)
        for index in range(len(solved), len(scene.frames)):
            if index == self.interrupt_at:
                raise KeyboardInterrupt
            moved = rest.translations + self.step * index * torch.tensor([1.0, 0.3, 0.0])
            frame = SolvedFrame(
                poses=dataclasses.replace(rest, translations=moved),
                camera=scene.frame_cameras[0],
                groups=RigidGroups(labels=labels_of),
                stats=FrameStats(
                    matches=7 * index,
                    reprojection_px=0.5 if index else float("nan"),
                    start="stub",
                    groups=1,
                    seconds={"image stage": 0.25},
                ),
            )
            solved.append(frame)
            self.solved_indices.append(index)
            on_frame(index, frame)
        keys = [
            Key(
                time_s=index / labels.fps,
                source_frame=scene.frames.numbers[index],
                poses=frame.poses,
                camera=frame.camera,
            )
            for index, frame in enumerate(solved)
        ]
        nowhere = RigidGroups(labels=np.full(len(anchors), -1))
        return Fit(
            clip=bake_clip(scene.gaussians, anchors, nowhere, keys, labels),
            gaussians=scene.gaussians,
            anchors=anchors,
            solved=tuple(solved),
            renderer=CpuRenderer(),
        )


@pytest.fixture
def stub_fit(monkeypatch) -> StubFit:
    """Replace the fit of the command `animate`."""
    stub = StubFit()
    monkeypatch.setattr("animator.commands.animate.fit", stub)
    return stub
