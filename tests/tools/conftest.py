"""What the tests with real tools share."""

from pathlib import Path

import pytest

from exporters import load_clip
from exporters.clip import Clip

LAMP_FRAMES = Path(__file__).parents[2] / "examples" / "desk_lamp" / "frames"


@pytest.fixture(scope="session")
def fitted_lamp(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    """Fit three frames of the example once."""
    from animator.cli import animate_main

    out = tmp_path_factory.mktemp("lamp") / "lamp.usdc"
    arguments = [str(LAMP_FRAMES), "--frames", "0,6,12", "--out", str(out), "--cache", "none"]
    assert animate_main([*arguments, "--quiet"]) == 0
    return load_clip(out.with_suffix(".splatimate.npz"))
