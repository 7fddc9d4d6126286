"""The renderer for CPUs: numba kernels behind torch's autograd."""

import logging
import weakref
from typing import Any

import numba
import numpy as np
import torch

from animator.render import blending, projection, tiles
from animator.render.pinhole import check_pinhole
from animator.render.projection import GaussianArrays, GaussianGradients, View
from animator.render.protocol import Rendering, Visibility
from animator.render.spherical_harmonics import evaluate_colors
from animator.render.workspace import Lease, Workspace, WorkspacePool
from animator.types import Camera, Gaussians

_log = logging.getLogger(__name__)

_GAUSSIANS_PER_CHUNK = 8192
"""Dealing fewer Gaussians than this to tiles is not worth another thread."""


class CpuRenderer:
    """Draws Gaussians on the CPU with gsplat's rules; implements `render.protocol.Renderer`.

    The same input gives the same bytes, in images and in gradients, for any number of threads.
    """

    device = torch.device("cpu")

    def __init__(self) -> None:
        self._pool = WorkspacePool()
        self._constant_colors = _ConstantColors()
        self._has_warned = False

    def render(
        self,
        gaussians: Gaussians,
        camera: Camera,
        *,
        background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Rendering:
        """Draw color and alpha, differentiable in all five Gaussian fields.

        Raises:
            InputError: If the camera is no pinhole, see `check_pinhole`.
        """
        rgb, alpha = self._draw(gaussians, camera, self._colors(gaussians, camera))
        if any(background):
            rgb = rgb + (1.0 - alpha)[:, :, None] * rgb.new_tensor(background)
        return Rendering(rgb=rgb, alpha=alpha)

    def depth(self, gaussians: Gaussians, camera: Camera) -> torch.Tensor:
        """Draw the alpha-weighted mean depth [scene unit], 0 where nothing is seen; (H, W)."""
        forward = torch.from_numpy(camera.cam_from_world[2, :3]).float()
        depths = gaussians.means @ forward + float(camera.cam_from_world[2, 3])
        drawn, alpha = self._draw(gaussians, camera, depths[:, None].expand(-1, 3))
        is_seen = alpha > 0
        return torch.where(is_seen, drawn[:, :, 0] / torch.where(is_seen, alpha, 1.0), 0.0)

    @torch.no_grad()
    def visibility(self, gaussians: Gaussians, camera: Camera) -> Visibility:
        """Measure how much of each Gaussian the camera sees.

        The share compares with the same Gaussian drawn alone, over exactly the same pixels: the
        kernel adds up alpha with and without the transmittance in one pass.
        """
        view = _checked_view(camera)
        arrays = _arrays(
            gaussians.means,
            gaussians.quats_wxyz,
            gaussians.scales,
            gaussians.opacities,
            torch.zeros_like(gaussians.means),
        )
        lease = self._prepare(arrays, view)
        work = lease.workspace
        slots = work.slots(with_colors=False)
        lists = (work.offsets, work.entries)
        blending.measure_contributions(work.records, lists, (view.width, view.height), slots)
        sums = np.zeros((len(gaussians), 2), np.float32)
        blending.add_contributions(work.records, work.spans, slots, sums)
        seen, alone = sums.T.astype(np.float64)
        shares = np.clip(np.divide(seen, alone, out=np.zeros_like(seen), where=alone > 0), 0, 1)
        centres_px, depths = camera.project(arrays.means.astype(np.float64))
        return Visibility(
            contributions=seen, visible_shares=shares, centres_px=centres_px, depths=depths
        )

    def _colors(self, gaussians: Gaussians, camera: Camera) -> torch.Tensor:
        """Return the Gaussians' colors; those that cannot change are evaluated once."""
        coefficients = gaussians.sh_coeffs
        if coefficients.shape[1] == 1 and not coefficients.requires_grad:
            return self._constant_colors.of(coefficients)
        position = torch.from_numpy(camera.position).float()
        return evaluate_colors(coefficients, gaussians.means, position)

    def _draw(
        self, gaussians: Gaussians, camera: Camera, colors: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw three channels over black, and alpha."""
        fields = (
            gaussians.means,
            gaussians.quats_wxyz,
            gaussians.scales,
            gaussians.opacities,
            colors,
        )
        return _Draw.apply(self, _checked_view(camera), *fields)  # type: ignore[return-value]

    def _prepare(self, arrays: GaussianArrays, view: View) -> Lease:
        """Project, sort and deal the Gaussians; the result is in the leased workspace."""
        count = len(arrays.means)
        chunk_count = min(numba.get_num_threads(), 1 + count // _GAUSSIANS_PER_CHUNK)
        lease = self._pool.lease(count, view.width, view.height, chunk_count)
        work = lease.workspace
        broken = projection.project(arrays, view, work.records)
        if broken and not self._has_warned:
            self._has_warned = True
            _log.warning(
                "%d of %d Gaussians are not drawn: a number that is not finite, a zero "
                "quaternion, or a size beyond float32",
                broken,
                count,
            )
        visible = tiles.sort_by_depth(work.records, work.sort_keys, work.order)
        needed = _deal(work, visible)
        if needed > work.touched.shape[1]:
            work.reserve_slots(needed + needed // 4)
            _deal(work, visible)
        return lease


def _deal(work: Workspace, visible: int) -> int:
    return tiles.deal_to_tiles(
        work.records,
        work.order[1, :visible],
        work.grid,
        work.touched,
        work.tallies,
        work.spans,
        work.offsets,
        work.entries,
    )


class _ConstantColors:
    """The colors of one tensor of degree-0 coefficients, kept until another one is asked for."""

    def __init__(self) -> None:
        self._source: Any = lambda: None
        self._version = -1
        self._colors = torch.zeros(0, 3)

    def of(self, coefficients: torch.Tensor) -> torch.Tensor:
        if self._source() is not coefficients or self._version != coefficients._version:
            self._colors = evaluate_colors(coefficients, coefficients[:, 0], torch.zeros(3))
            self._source = weakref.ref(coefficients)
            self._version = coefficients._version
        return self._colors


class _Draw(torch.autograd.Function):
    """Color and alpha of projected Gaussians."""

    @staticmethod
    def forward(ctx: Any, renderer: CpuRenderer, view: View, *fields: torch.Tensor) -> Any:
        arrays = _arrays(*fields)
        lease = renderer._prepare(arrays, view)
        work = lease.workspace
        rgb = torch.empty(view.height, view.width, 3)
        alpha = torch.empty(view.height, view.width)
        blending.blend(
            work.records, (work.offsets, work.entries), (rgb.numpy(), alpha.numpy()), work.lasts
        )
        ctx.save_for_backward(*fields, rgb, alpha)
        ctx.view, ctx.lease = view, lease
        return rgb, alpha

    @staticmethod
    def backward(ctx: Any, *image_gradients: torch.Tensor) -> Any:
        *fields, rgb, alpha = ctx.saved_tensors
        arrays = _arrays(*fields)
        work: Workspace = ctx.lease.workspace
        with_colors = ctx.needs_input_grad[6]
        slots = work.slots(with_colors)
        blend_backward = blending.blend_backward_colors if with_colors else blending.blend_backward
        blend_backward(
            work.records,
            (work.offsets, work.entries),
            (rgb.numpy(), alpha.numpy()),
            tuple(gradient.float().contiguous().numpy() for gradient in image_gradients),
            work.lasts,
            slots,
        )
        shapes = [field.shape for field in fields]
        if not with_colors:
            shapes[4] = torch.Size((0, 3))
        gradients = [torch.empty(shape) for shape in shapes]
        projection.project_backward(
            arrays,
            ctx.view,
            work.records,
            slots,
            work.spans,
            GaussianGradients(*(gradient.numpy() for gradient in gradients)),
        )
        needs = ctx.needs_input_grad[2:]
        return (
            None,
            None,
            *(
                gradient if needed else None
                for gradient, needed in zip(gradients, needs, strict=True)
            ),
        )


def _arrays(*fields: torch.Tensor) -> GaussianArrays:
    return GaussianArrays(*(field.detach().float().contiguous().numpy() for field in fields))


def _checked_view(camera: Camera) -> View:
    check_pinhole(camera)
    return projection.view_of(camera)
