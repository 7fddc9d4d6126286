"""The camera of every frame: read from a file, found once from the capture's views, or followed as it moves."""

from animator.match.features import FeatureMatcher
from animator.match.flow import FlowMatcher
from animator.match.protocol import MaskedImage
from animator.render.protocol import Renderer
from animator.scene import Scene
from animator.sequence.camera_pose import CameraTools, find_camera, refine_camera
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.target import FrameView
from animator.types import Camera, Gaussians


def locate_cameras(scene: Scene, gaussians: Gaussians, renderer: Renderer) -> tuple[Camera, ...]:
    """Return one camera a frame.

    Args:
        scene: Frames, and their cameras if they were read from a file; else frame 0's is found.
        gaussians: The rest pose on the renderer's device.
        renderer: Draws the capture views that a missing camera is retrieved from.

    Returns:
        One camera a frame; all the same unless the file has one for each.

    Raises:
        InputError: If the camera is neither given nor found.
    """
    cameras = scene.frame_cameras
    if cameras is None:
        tools = CameraTools(renderer=renderer, features=FeatureMatcher(), matcher=FlowMatcher())
        first = FrameView.read(scene.frames, 0).masked()
        cameras = (find_camera(gaussians, scene.capture_cameras, first, tools).camera,)
    return cameras * len(scene.frames) if len(cameras) == 1 else cameras


def followed_camera(
    problem: ClipProblem, posed: Gaussians, previous: Camera, frame: MaskedImage
) -> Camera:
    """Find the camera of a frame near that of the frame before it.

    Args:
        problem: The clip, with the tools for it.
        posed: The Gaussians in the pose of the frame before it.
        previous: The camera of the frame before it.
        frame: The frame.

    Returns:
        The camera; the previous one's, as far as nothing says otherwise.
    """
    tools = CameraTools(
        renderer=problem.renderer, features=FeatureMatcher(), matcher=problem.matcher
    )
    return refine_camera(posed, previous, frame, tools).camera
