"""The network with weights of chance: the true ones are the user's to bring."""

import numpy as np
import pytest
import torch

from animator.errors import InputError
from animator.evaluation.lpips import Lpips
from animator.evaluation.perceptual import load_judges

WIDTHS = (64, 192, 384, 256, 256)


@pytest.fixture
def files(tmp_path):
    torch.manual_seed(0)
    features = Lpips().state_dict()
    layers = {f"lin{k}.model.1.weight": torch.rand(1, w, 1, 1) for k, w in enumerate(WIDTHS)}
    paths = tmp_path / "alexnet.pth", tmp_path / "alex.pth"
    for weights, path in zip((features, layers), paths, strict=True):
        torch.save(weights, path)
    return paths


def pictures() -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.random.default_rng(0).random((2, 64, 80, 3), dtype=np.float32))


def test_alike_is_zero_and_the_order_does_not_matter(files):
    lpips = load_judges(files)["lpips"]
    first, second = pictures()
    assert lpips(first, first) == 0.0
    assert lpips(first, second) > 0
    assert lpips(first, second) == pytest.approx(lpips(second, first))


def test_channels_count_as_their_weights_say(files):
    first, second = pictures()
    before = load_judges(files)["lpips"](first, second)
    layers = torch.load(files[1], weights_only=True)
    torch.save({name: 3 * weight for name, weight in layers.items()}, files[1])
    assert load_judges(files)["lpips"](first, second) == pytest.approx(3 * before, rel=1e-5)


def test_weights_that_do_not_fit_are_refused(files, tmp_path):
    with pytest.raises(InputError, match="lin0"):
        load_judges(files[:1])
    (tmp_path / "text.pth").write_text("no weights")
    with pytest.raises(InputError, match=r"text\.pth"):
        load_judges([tmp_path / "text.pth"])
    torch.save({"features.0.weight": torch.zeros(1)}, tmp_path / "small.pth")
    with pytest.raises(InputError, match="not AlexNet"):
        load_judges([*files, tmp_path / "small.pth"])
