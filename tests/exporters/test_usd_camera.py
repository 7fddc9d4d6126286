import dataclasses

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from exporters.usd.write import write_usd_rig
from tests.helpers import clips


def written(clip, folder) -> Usd.Stage:
    return Usd.Stage.Open(str(write_usd_rig(clip, folder / "clip.usda")[0]))


def camera_of(stage: Usd.Stage) -> UsdGeom.Camera:
    return UsdGeom.Camera(stage.GetPrimAtPath(f"{stage.GetDefaultPrim().GetPath()}/Camera"))


def pixels_by_usd(gf_camera: Gf.Camera, points: np.ndarray, width: int, height: int) -> np.ndarray:
    """Project through USD's own frustum: view and projection matrix, then the viewport."""
    frustum = gf_camera.frustum
    clip_from_world = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    ndc = np.array([clip_from_world.Transform(Gf.Vec3d(*map(float, point))) for point in points])
    return np.stack([(ndc[:, 0] + 1) / 2 * width, (1 - ndc[:, 1]) / 2 * height], axis=-1)


def pixels_by_hand(camera, key: int, points: np.ndarray) -> np.ndarray:
    pose = camera.cam_from_world[min(key, len(camera.cam_from_world) - 1)]
    in_camera = points @ pose[:3, :3].T + pose[:3, 3]
    (fx, _, cx), (_, fy, cy), _ = camera.intrinsics
    depths = in_camera[:, 2]
    return np.stack(
        [fx * in_camera[:, 0] / depths + cx, fy * in_camera[:, 1] / depths + cy], axis=-1
    )


POINTS = np.array([[0.1, 0.2, 0.3], [-0.8, 0.4, 0.1], [0.5, -0.9, -0.2]])


@pytest.mark.parametrize("make", [clips.hinge, clips.chain], ids=["static", "moving"])
def test_points_project_to_the_same_pixels(make, tmp_path):
    clip = make()
    stage = written(clip, tmp_path)
    camera = camera_of(stage)
    for key, time_s in enumerate(clip.tracks.times_s):
        gf_camera = camera.GetCamera(Usd.TimeCode(time_s * clip.fps))
        np.testing.assert_allclose(
            pixels_by_usd(gf_camera, POINTS, 640, 480),
            pixels_by_hand(clip.camera, key, POINTS),
            atol=1e-3,
        )


def test_the_hand_computation_has_no_symmetry_to_hide_behind():
    pixels = pixels_by_hand(clips.camera(), 0, np.zeros((1, 3)))
    # The origin lies at (0.2, -0.1, 4) in the camera.
    np.testing.assert_allclose(pixels, [[301.5 + 700 * 0.05, 260.25 - 650 * 0.025]])


def test_an_ordinary_lens_has_no_offsets(tmp_path):
    clip = clips.hinge()
    intrinsics = [[800, 0, 320], [0, 800, 240], [0, 0, 1]]
    clip = dataclasses.replace(
        clip, camera=dataclasses.replace(clip.camera, intrinsics=np.array(intrinsics, float))
    )
    stage = written(clip, tmp_path)
    camera = camera_of(stage)
    assert camera.GetFocalLengthAttr().Get() == 45.0  # 800 px of a 640 px wide 36 mm film
    assert camera.GetVerticalApertureAttr().Get() == 27.0
    assert camera.GetHorizontalApertureOffsetAttr().Get() == 0
    assert camera.GetVerticalApertureOffsetAttr().Get() == 0


def test_a_still_camera_has_no_samples_and_a_moving_one_has_one_a_key(tmp_path):
    still, moving = written(clips.hinge(), tmp_path), written(clips.chain(), tmp_path / "moving")
    for stage, codes in ((still, []), (moving, [0, 1, 3])):
        translate, orient = camera_of(stage).GetOrderedXformOps()
        assert translate.GetTimeSamples() == orient.GetTimeSamples() == codes


def test_clipping_range_holds_the_motion(tmp_path):
    for clip in (clips.hinge(), clips.chain(), clips.z_up_centimeters()):
        stage = written(clip, tmp_path)
        near, far = camera_of(stage).GetClippingRangeAttr().Get()
        depths = []
        for key, time_s in enumerate(clip.tracks.times_s):
            pose = clip.camera.cam_from_world[min(key, len(clip.camera.cam_from_world) - 1)]
            depths.extend(clip.pose_at(time_s).positions @ pose[2, :3] + pose[2, 3])
        assert 0 < near < min(depths)
        assert max(depths) < far


def test_skew_is_said_to_be_lost(tmp_path, caplog):
    clip = clips.hinge()
    intrinsics = clip.camera.intrinsics.copy()
    intrinsics[0, 1] = 2.5
    clip = dataclasses.replace(clip, camera=dataclasses.replace(clip.camera, intrinsics=intrinsics))
    written(clip, tmp_path)
    assert "2.5 px" in caplog.text


def test_no_camera_no_prim(tmp_path):
    stage = written(clips.static(), tmp_path)
    assert not stage.GetPrimAtPath("/static/Camera")
