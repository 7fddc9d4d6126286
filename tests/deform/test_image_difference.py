import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.deform import losses
from animator.deform.image_difference import ImageOnBlack, ImageWeights, image_difference


def random_image(seed: int, height: int, width: int) -> ImageOnBlack:
    rng = np.random.default_rng(seed)
    rgb = torch.from_numpy(rng.random((height, width, 3), np.float32))
    alpha = torch.from_numpy(rng.random((height, width), np.float32))
    # Half of it empty in both images, where the slope is zero.
    rgb[: height // 2], alpha[: height // 2] = 0.0, 0.0
    return ImageOnBlack(rgb=rgb, alpha=alpha)


def sum_of_losses(drawn: ImageOnBlack, target: ImageOnBlack, weights: ImageWeights):
    area_px = target.area_px
    color = losses.rgb_loss(drawn.rgb, target.rgb, area_px=area_px)
    coverage = losses.silhouette_loss(drawn.alpha, target.alpha, area_px=area_px)
    differences = torch.cat(
        [drawn.rgb - target.rgb, (drawn.alpha - target.alpha)[..., None]], dim=-1
    )
    coarse = losses.coarse_image_loss(differences, area_px=area_px)
    return weights.rgb * color + weights.silhouette * coverage + weights.coarse * coarse


@settings(derandomize=True, max_examples=40, deadline=None)  # the first call compiles
@given(
    st.integers(0, 2**31),
    st.integers(1, 33),
    st.integers(1, 33),
    st.tuples(*[st.sampled_from([0.0, 0.3, 1.0])] * 3),
)
def test_is_the_sum_of_the_losses_with_its_slopes(seed, height, width, weights):
    weights = ImageWeights(rgb=weights[0], silhouette=weights[1], coarse=weights[2])
    drawn, target = (random_image(seed + k, height, width) for k in range(2))
    found, expected = [], []
    for loss_of, into in (
        (lambda d: image_difference(d, target, weights), found),
        (lambda d: sum_of_losses(d, target, weights), expected),
    ):
        live = ImageOnBlack(rgb=drawn.rgb.clone(), alpha=drawn.alpha.clone())
        live.rgb.requires_grad_(), live.alpha.requires_grad_()
        loss = 3.0 * loss_of(live)
        loss.backward()
        into.extend([loss.detach(), live.rgb.grad, live.alpha.grad])
    for one, other in zip(found, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-5)
