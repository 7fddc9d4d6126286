"""Motions that are smooth in space, as unknowns of the image stage: plants, fins, cloth in the wind.

Anchors that are free of each other explain every pixel, also where it says nothing: each leaf of a plant gets a depth
of its own. A few nodes spread through space (embedded deformation, Sumner et al. 2007), each with a turn, a shift and
a dilation that anchors near it share, cannot; what is near moves alike, whether it hangs together or not.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import torch

from animator.deform.anchors import distances_in_space
from animator.deform.coarse_motion import CoarseConfig, NodeLevel, NodeMotion
from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import ImageSolver
from animator.deform.pace import PaceConfig, descend
from animator.deform.robust_norm import RobustNorm
from animator.types import AnchorPoses, Anchors, Camera

_QUICK = PaceConfig(most_steps=300, window=20, gain=0.01, settling_steps=50)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SmoothFieldConfig:
    """The nodes, and how they approach a pose."""

    coarse: CoarseConfig = dataclasses.field(
        default_factory=lambda: CoarseConfig(nodes=(30, 10, 1))
    )
    """The finest nodes are all the freedom there is; coarser ones speed it up."""
    place_norm: RobustNorm = RobustNorm(reach=0.02)
    """What the distance from a pose costs [diagonals]: an anchor that went astray by itself is left alone."""
    turn: float = 0.05
    """Weight of 1 - cos^2(angle / 2) of turns against the cost of places, which comes to 1 far away."""
    pace: PaceConfig = _QUICK
    """How many steps it takes to approach a pose; no image is drawn in them."""


class SmoothField:
    """Poses that are smooth in space, for one clip."""

    def __init__(self, anchors: Anchors, diagonal: float, config: SmoothFieldConfig) -> None:
        self._anchors = anchors
        self._diagonal = diagonal
        self._config = config
        distances = distances_in_space(anchors)
        self._levels = [
            NodeLevel(anchors, distances, count, diagonal, config.coarse)
            for count in config.coarse.nodes
        ]

    def near(self, poses: AnchorPoses, camera: Camera) -> AnchorPoses:
        """Return the smooth pose that comes nearest to a pose.

        Args:
            poses: Any pose.
            camera: Sees it; dilations are about its center.
        """
        nodes = self._approach(poses, camera)
        with torch.no_grad():
            return self._posed(nodes)

    def solve(
        self, image_solver: ImageSolver, target: FrameTarget, start: AnchorPoses
    ) -> AnchorPoses:
        """Find the smooth pose that an image solver likes best.

        Args:
            image_solver: Says what a pose costs, and at what pace to descend.
            target: The frame.
            start: A pose, smooth or not; the search begins with what is near.
        """
        nodes = self._approach(start, target.camera)
        descend(
            _unknowns(nodes),
            image_solver.config.pace,
            lambda _: image_solver.loss(self._posed(nodes), target, start),
        )
        with torch.no_grad():
            return self._posed(nodes)

    def _approach(self, poses: AnchorPoses, camera: Camera) -> list[NodeMotion]:
        """Move nodes from rest to where a pose is."""
        config = self._config
        nodes = [level.begin(self._anchors.positions, camera) for level in self._levels]
        norm = config.place_norm

        def distance() -> torch.Tensor:
            smooth = self._posed(nodes)
            shifts = (smooth.translations - poses.translations) / self._diagonal
            places = norm.cost(shifts.square().sum(dim=1)).mean() / norm.reach**2
            cosines = (smooth.quats_wxyz * poses.quats_wxyz).sum(dim=1)
            return places + config.turn * (1.0 - cosines.square()).mean()

        descend(_unknowns(nodes), config.pace, lambda _: distance())
        return nodes

    def _posed(self, nodes: Sequence[NodeMotion]) -> AnchorPoses:
        rest = AnchorPoses.identity(self._anchors)
        places, quats_wxyz = self._anchors.positions, rest.quats_wxyz.to(self._anchors.positions)
        for level in nodes:
            places, quats_wxyz = level(places, quats_wxyz)
        return AnchorPoses(quats_wxyz=quats_wxyz, translations=places - self._anchors.positions)


def _unknowns(nodes: Sequence[NodeMotion]) -> list[dict[str, Any]]:
    return [group for level in nodes for group in level.unknowns]
