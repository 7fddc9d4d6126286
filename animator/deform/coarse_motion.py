"""Motions of many anchors at once, as unknowns of the image stage: of the whole object, of its regions.

An optimizer that moves anchors one by one is slow to move them together, and slowest where the image is blind:
farther away and larger by as much, an object looks the same, and only its stiffness knows its size. So there are
nodes besides, one for the whole and some for regions, each with a turn, a shift, and the dilation about the
camera's center that no image sees. They add no freedom, for the anchors could do all of it by themselves; they
turn long valleys of the energy into short ones.
"""

import dataclasses
from typing import Any

import numpy as np
import torch

from animator import quaternions
from animator.types import Anchors, Camera


@dataclasses.dataclass(frozen=True, kw_only=True)
class CoarseConfig:
    """The nodes, and how fast they move."""

    nodes: tuple[int, ...] = (10, 1)
    """Number of nodes of each level, the finest first; empty leaves the anchors to themselves."""
    turn_rate: float = 8e-3
    """Learning rate of a node's turn [rad]."""
    shift_rate: float = 2e-3
    """Learning rate of its shift [diagonals]."""
    dilation_rate: float = 2e-3
    """Learning rate of the logarithm of its dilation."""


class NodeLevel:
    """Some nodes, and how far each anchor follows each of them: constant over a clip."""

    def __init__(
        self,
        anchors: Anchors,
        distances: np.ndarray,
        count: int,
        diagonal: float,
        config: CoarseConfig,
    ) -> None:
        """Place nodes.

        Args:
            anchors: What they move.
            distances: How far the anchors are from each other, along the object or through space [scene unit],
                shape (A, A).
            count: Number of nodes.
            diagonal: The object's diagonal [scene unit].
            config: How fast they move.
        """
        self._shares = _shares_of_nodes(distances, count).to(anchors.positions)
        self._diagonal = diagonal
        self._config = config

    def begin(self, places: torch.Tensor, camera: Camera) -> "NodeMotion":
        """Start a solve: nothing moves yet.

        Args:
            places: World positions of the anchors [scene unit], shape (A, 3).
            camera: Sees them; dilations are about its center.
        """
        return NodeMotion(self._shares, places, camera, self._diagonal, self._config)


class NodeMotion:
    """What the nodes of one level do in one solve."""

    def __init__(
        self,
        shares: torch.Tensor,
        places: torch.Tensor,
        camera: Camera,
        diagonal: float,
        config: CoarseConfig,
    ) -> None:
        self._shares = shares
        self._middles = (shares / shares.sum(dim=0)).T @ places
        self._camera_position = torch.as_tensor(camera.position).to(places)
        self._diagonal = diagonal
        count = len(self._middles)
        self._turns = places.new_zeros(count, 3).requires_grad_()
        self._shifts = places.new_zeros(count, 3).requires_grad_()
        self._dilations = places.new_zeros(count, 1).requires_grad_()
        self.unknowns: list[dict[str, Any]] = [
            {"params": [self._turns], "lr": config.turn_rate},
            {"params": [self._shifts], "lr": config.shift_rate},
            {"params": [self._dilations], "lr": config.dilation_rate},
        ]

    def __call__(
        self, places: torch.Tensor, quats_wxyz: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Move anchors along, differentiable in the nodes' unknowns.

        Args:
            places: World positions [scene unit], shape (A, 3).
            quats_wxyz: Unit rotations from rest, shape (A, 4).

        Returns:
            Both, moved; exactly as given while nothing has moved.
        """
        scalars = torch.ones_like(self._turns[:, :1])
        turns = quaternions.normalize(torch.cat([scalars, 0.5 * self._turns], dim=1))
        # As displacements, which are exactly zero at first: rounding alone would set the optimizer off.
        arms = places[:, None] - self._middles  # (A, K, 3)
        moves = quaternions.rotate(turns[None], arms) - arms + self._shifts * self._diagonal
        moves = moves * self._dilations.exp()
        moves = moves + (places - self._camera_position)[:, None] * self._dilations.expm1()
        blended = quaternions.normalize(self._shares @ turns)
        return (
            places + (self._shares[:, :, None] * moves).sum(dim=1),
            quaternions.multiply(blended, quats_wxyz),
        )


def _shares_of_nodes(distances: np.ndarray, count: int) -> torch.Tensor:
    """Spread nodes evenly over the object and share the anchors among them, shape (A, K).

    A share falls with the distance d as exp(-d^2 / 2 h^2), h half the distance of neighboring nodes.
    """
    nodes = [int(distances.sum(axis=1).argmin())]
    while len(nodes) < min(count, len(distances)):
        nodes.append(int(distances[nodes].min(axis=0).argmax()))
    if len(nodes) == 1:
        return torch.ones(len(distances), 1)
    between = distances[np.ix_(nodes, nodes)] + np.diag(np.full(len(nodes), np.inf))
    reach = 0.5 * np.median(between.min(axis=1))
    to_nodes = distances[:, nodes]
    # Relative to the nearest node, so that an anchor far from all of them keeps finite shares.
    nearest = to_nodes.min(axis=1, keepdims=True)
    shares = np.exp((nearest**2 - to_nodes**2) / (2 * max(reach, 1e-12) ** 2))
    return torch.as_tensor(shares / shares.sum(axis=1, keepdims=True))
