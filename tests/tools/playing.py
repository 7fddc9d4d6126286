"""Where real tools put the vertices of a written file, in meters, Y-up."""

import dataclasses
import json
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.helpers.node import run_script
from tests.tools.blender_env import blender_python

BLENDER_FPS = 24.0
"""Blender keeps its scene at this rate, whatever a USD or glTF file says."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PlayedMesh:
    """One skinned mesh as a tool shows it; its vertices in the tool's own order and number."""

    rest: np.ndarray
    """Rest pose [m], Y-up, shape (V, 3)."""
    posed: np.ndarray
    """Poses [m], Y-up, shape (T, V, 3)."""

    def at(self, moments: slice) -> "PlayedMesh":
        """Return the same mesh at some of the moments only."""
        return dataclasses.replace(self, posed=self.posed[moments])


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Played:
    """What a tool made of a file."""

    meshes: dict[str, PlayedMesh]
    """The skinned meshes, by lower-case name."""
    points: dict[str, PlayedMesh]
    """What has vertices but no skin: splats, in tools that do not know them."""
    scene: dict
    """What else the tool said about the import; differs by tool."""


def play_in_blender(path: Path, times_s: Sequence[float], *, fps: float) -> Played:
    """Import a file in Blender and evaluate it at some times.

    Args:
        path: A .glb, .usda, .usdc or .usdz.
        times_s: Times [s] of the clip.
        fps: Frames per second of the clip: a USD time code becomes a frame of Blender's, whatever
            the rate there; the seconds of glTF become `BLENDER_FPS` frames each.
    """
    rate = BLENDER_FPS if path.suffix in (".glb", ".gltf") else fps
    # Blender's own precision: a frame is a float32 in parts.
    frames = [round(time_s * rate, 6) for time_s in times_s]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "played.npz"
        run_blender("blender_play.py", path, out, json.dumps(frames))
        archive = np.load(out)
        scene = json.loads(str(archive["scene"]))
        names = {key.rpartition("/")[0] for key in archive.files if "/" in key}
        played = {
            name: PlayedMesh(
                rest=_y_up(archive[f"{name}/rest"]), posed=_y_up(archive[f"{name}/posed"])
            )
            for name in names
        }
    return _sorted_out(played, set(scene["skinned"]), scene)


def run_blender(script: str, *arguments: object) -> str:
    """Run a script of this folder in Blender's Python; return what it printed.

    Raises:
        RuntimeError: If it fails, with what it said.
    """
    command = [blender_python(), Path(__file__).with_name(script), *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{script} failed in Blender:\n{result.stdout}{result.stderr}")
    return result.stdout + result.stderr


def play_in_three(path: Path, times_s: Sequence[float]) -> Played:
    """Load a file with three.js' GLTFLoader or USDLoader and evaluate it at some times [s]."""
    with tempfile.TemporaryDirectory() as folder:
        described = json.loads(
            run_script("play_three.mjs", path, folder, json.dumps([float(t) for t in times_s]))
        )
        played = {}
        for mesh in described:
            values = np.fromfile(Path(folder) / f"{mesh['name']}.f32", np.float32)
            poses = values.reshape(len(times_s) + 1, mesh["vertices"], 3)
            played[mesh["name"]] = PlayedMesh(rest=poses[0], posed=poses[1:])
    skinned = {mesh["name"] for mesh in described if mesh["is_skinned"]}
    return _sorted_out(played, skinned, {"meshes": described})


def _sorted_out(played: dict[str, PlayedMesh], skinned: set[str], scene: dict) -> Played:
    return Played(
        meshes={name.lower(): mesh for name, mesh in played.items() if name in skinned},
        points={name: mesh for name, mesh in played.items() if name not in skinned},
        scene=scene,
    )


def _y_up(points: np.ndarray) -> np.ndarray:
    """Turn Blender's world: (x, y, z) to (x, z, -y)."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)
