"""The CPU renderer does not depend on the number of threads, and works with either vector width."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest
import torch
from splat_scenes import FIELDS, camera, gaussians

from animator.render import cpu
from animator.render.cpu import CpuRenderer
from animator.types import Gaussians


def _bytes_with(threads: int, fields: dict[str, torch.Tensor]) -> list[bytes]:
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        leaves = {name: value.clone().requires_grad_() for name, value in fields.items()}
        drawn = CpuRenderer().render(Gaussians(**leaves), camera(90, 70))
        (drawn.rgb.square().sum() + drawn.alpha.sum()).backward()
        grads = [leaf.grad.numpy().tobytes() for leaf in leaves.values()]
        return [drawn.rgb.detach().numpy().tobytes(), *grads]
    finally:
        numba.set_num_threads(before)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="needs two threads")
def test_one_and_two_threads_give_the_same_bytes(monkeypatch):
    monkeypatch.setattr(cpu, "_GAUSSIANS_PER_CHUNK", 100)  # or 300 Gaussians are dealt as one chunk
    scene = gaussians(0, 300)
    fields = {name: getattr(scene, name) for name in FIELDS}
    assert _bytes_with(1, fields) == _bytes_with(2, fields)


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [8, 16])
def test_either_vector_width_draws_the_same(lanes, tmp_path):
    tests = Path(__file__).parent
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            str(tests / "test_cpu_renderer.py"),
            str(tests.parent / "jit"),
        ],
        env=os.environ | {"SPLATIMATE_SIMD_LANES": str(lanes), "NUMBA_CACHE_DIR": str(tmp_path)},
        check=False,
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stdout[-3000:]
