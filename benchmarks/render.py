"""Time the CPU renderer and the skinning against the prototype they must not be slower than.

    python benchmarks/render.py [--gaussians 20000] [--size 400] [--prototype ../shared/prototypes]

Both take turns in one run, pair by pair, on the same scene, so that a busy machine disturbs both
alike. What counts is CPU time (`process_time`, all threads): medians, and the median of the ratios
within a pair. Without the prototype's folder only ours is timed.
"""

import argparse
import ast
import importlib
import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
import torch

from animator.deform.skinning import Skinner
from animator.render.cpu import CpuRenderer
from animator.types import AnchorPoses, Anchors, Camera, Gaussians

SH_C0 = 0.28209479177387814


def bumpy_sphere(count: int, seed: int) -> Gaussians:
    """Flat Gaussians on a closed surface about two units wide, as a fitted object has them."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    radii = 1 + 0.15 * np.sin(4 * normals[:, 0]) * np.cos(3 * normals[:, 1] + 1)
    spacing = math.sqrt(4 * math.pi / count)
    sizes = spacing * np.array([0.6, 0.6, 0.09]) * np.exp(rng.normal(0, 0.35, (count, 3)))
    # The rotation from +z to the normal is the half-way quaternion (1 + n_z, z x n).
    quats = np.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(count)], axis=1)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    means = normals * radii[:, None]
    colors = np.clip(0.5 + 0.3 * np.sin(5 * means) + 0.1 * rng.normal(size=(count, 3)), 0, 1)

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(values, np.float32))

    return Gaussians(
        means=tensor(means),
        quats_wxyz=tensor(quats),
        scales=tensor(sizes),
        opacities=tensor(1 / (1 + np.exp(-rng.normal(1.5, 1.5, count)))),
        sh_coeffs=tensor((colors - 0.5) / SH_C0)[:, None],
    )


def front_camera(size_px: int) -> Camera:
    """A square view that the object fills by three quarters."""
    cam_from_world = np.eye(4)
    cam_from_world[2, 3] = 4.0
    focal = 0.75 * size_px / 2 * math.sqrt(15)
    intrinsics = np.array([[focal, 0, size_px / 2], [0, focal, size_px / 2], [0, 0, 1.0]])
    return Camera(
        cam_from_world=cam_from_world, intrinsics=intrinsics, width_px=size_px, height_px=size_px
    )


def rendering_steps(
    count: int, size_px: int, prototype: Path | None
) -> tuple[Callable[[], Any], Callable[[], Any] | None]:
    """Return one forward and backward pass through ours, and through the prototype if there."""
    scene, view = bumpy_sphere(count, seed=0), front_camera(size_px)
    rng = np.random.default_rng(1)
    upstream = (
        torch.from_numpy(rng.normal(size=(size_px, size_px, 3)).astype(np.float32)),
        torch.from_numpy(rng.normal(size=(size_px, size_px)).astype(np.float32)),
    )
    means = scene.means.clone().requires_grad_()
    quats = scene.quats_wxyz.clone().requires_grad_()
    renderer = CpuRenderer()

    def ours() -> list[torch.Tensor]:
        drawn = renderer.render(scene.posed(means, quats), view)
        return list(torch.autograd.grad([drawn.rgb, drawn.alpha], [means, quats], upstream))

    if prototype is None:
        return ours, None
    engine = _prototype_module(prototype, "engine")
    colors = scene.sh_coeffs[:, 0] * SH_C0 + 0.5
    cam_from_world = torch.from_numpy(view.cam_from_world).float()
    intrinsics = view.intrinsics.astype(np.float32)
    black = np.zeros(3, np.float32)

    def theirs() -> list[torch.Tensor]:
        drawn = engine.Ras.apply(
            means,
            quats,
            scene.scales,
            scene.opacities,
            colors,
            cam_from_world,
            intrinsics,
            size_px,
            size_px,
            black,
        )
        return list(torch.autograd.grad(drawn, [means, quats], upstream))

    return ours, theirs


def skinning_steps(
    count: int, anchor_count: int, prototype: Path | None
) -> tuple[Callable[[], Any], Callable[[], Any] | None]:
    """Return one posing with gradients by ours, and by the prototype's kernels if there."""
    scene = bumpy_sphere(count, seed=0)
    rng = np.random.default_rng(2)
    positions = scene.means[torch.from_numpy(rng.permutation(count)[:anchor_count])]
    distances, ids = torch.cdist(scene.means, positions).topk(4, largest=False)
    weights = torch.softmax(-distances, dim=1)
    anchors = Anchors(
        positions=positions,
        spacing=0.1,
        skin_ids=ids.int(),
        skin_weights=weights,
        edges=torch.zeros((0, 2), dtype=torch.int64),
        edge_weights=torch.zeros(0),
    )
    turns = torch.tensor([1.0, 0, 0, 0]) + 0.1 * torch.from_numpy(
        rng.normal(size=(anchor_count, 4))
    )
    quats = torch.nn.functional.normalize(turns.float(), dim=1).requires_grad_()
    shifts = torch.from_numpy(0.1 * rng.normal(size=(anchor_count, 3))).float().requires_grad_()
    upstream = (
        torch.from_numpy(rng.normal(size=(count, 3)).astype(np.float32)),
        torch.from_numpy(rng.normal(size=(count, 4)).astype(np.float32)),
    )
    skinner = Skinner(anchors, scene.means, scene.quats_wxyz)

    # The prototype's gradients of the rotations also point along the quaternions, ours do not: both
    # compute them, only those of the translations are compared.
    def ours() -> list[torch.Tensor]:
        posed = skinner(AnchorPoses(quats_wxyz=quats, translations=shifts))
        return [torch.autograd.grad(posed, [quats, shifts], upstream)[1]]

    if prototype is None:
        return ours, None
    kernels = _prototype_functions(prototype / "lbs.py", constants={"F", "kw"})
    rest = scene.means.numpy(), scene.quats_wxyz.numpy()
    outputs = np.empty((count, 3), np.float32), np.empty((count, 4), np.float32)
    blends = np.empty((count, 4), np.float32)
    chunks = numba.get_num_threads()
    buffers = np.empty((chunks, anchor_count, 16), np.float32)
    ids_numpy, weights_numpy = anchors.skin_ids.numpy(), weights.numpy()

    class Blend(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, table: torch.Tensor) -> Any:
            kernels.nf(table.detach().numpy(), ids_numpy, weights_numpy, *rest, *outputs, blends)
            return torch.from_numpy(outputs[0]), torch.from_numpy(outputs[1])

        @staticmethod
        def backward(ctx: Any, *grads: torch.Tensor) -> Any:
            gradients = (gradient.contiguous().numpy() for gradient in grads)
            kernels.nb(ids_numpy, weights_numpy, *rest, blends, *gradients, buffers, chunks)
            return torch.from_numpy(buffers.sum(0))

    def theirs() -> list[torch.Tensor]:
        matrices = kernels.q2r(quats)
        offsets = positions + shifts - (matrices @ positions[:, :, None])[:, :, 0]
        table = torch.cat([matrices.reshape(-1, 9), offsets, quats], dim=1)
        return [torch.autograd.grad(Blend.apply(table), [quats, shifts], upstream)[1]]

    return ours, theirs


def compare(
    name: str, steps: tuple[Callable[[], Any], Callable[[], Any] | None], pairs: int
) -> None:
    """Time both steps in turns and print medians and their ratio."""
    ours, theirs = steps
    if theirs is not None:
        for found, expected in zip(ours(), theirs(), strict=True):
            error = float((found - expected).norm() / expected.norm())
            if error > 1e-2:
                raise SystemExit(f"{name}: gradients differ by {error:.1%}; nothing to compare")
    times_ms: list[list[float]] = [[], []]
    for _ in range(pairs):
        for step, times in zip((ours, theirs), times_ms, strict=True):
            if step is not None:
                begin = time.process_time()
                step()
                times.append(1e3 * (time.process_time() - begin))
    text = f"{name}: ours {statistics.median(times_ms[0]):.2f} CPU-ms"
    if theirs is not None:
        ratio = statistics.median(a / b for a, b in zip(*times_ms, strict=True))
        text += f", prototype {statistics.median(times_ms[1]):.2f}, ratio {ratio:.3f}"
    sys.stdout.write(text + "\n")


def _prototype_module(folder: Path, name: str) -> Any:
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    return importlib.import_module(name)


def _prototype_functions(path: Path, constants: set[str]) -> ModuleType:
    """Define a script's functions and named constants without running the rest of it."""
    script = ast.parse(path.read_text())
    script.body = [
        node
        for node in script.body
        if isinstance(node, ast.Import | ast.ImportFrom | ast.FunctionDef)
        or (isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in constants)
    ]
    module = ModuleType(path.stem)
    sys.modules[path.stem] = module  # where numba looks for the globals of what it compiles
    exec(compile(script, str(path), "exec"), module.__dict__)
    return module


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--gaussians", type=int, default=20000)
    parser.add_argument("--size", type=int, default=400, help="image width and height [px]")
    parser.add_argument("--pairs", type=int, default=31)
    parser.add_argument("--threads", type=int, default=numba.get_num_threads())
    parser.add_argument("--prototype", type=Path, default=Path("../shared/prototypes"))
    arguments = parser.parse_args()
    numba.set_num_threads(arguments.threads)
    torch.set_num_threads(arguments.threads)
    folder: Path | None = arguments.prototype / "rasterizer"
    if not (arguments.prototype / "rasterizer" / "engine.py").is_file():
        folder = None
        sys.stdout.write(f"no prototype at {arguments.prototype}: timing ours alone\n")
    compare(
        f"render forward + backward, {arguments.gaussians} Gaussians, {arguments.size} px",
        rendering_steps(arguments.gaussians, arguments.size, folder),
        arguments.pairs,
    )
    compare(
        f"skinning forward + backward, {arguments.gaussians} Gaussians, 300 anchors",
        skinning_steps(arguments.gaussians, 300, folder),
        arguments.pairs,
    )


if __name__ == "__main__":
    main()
