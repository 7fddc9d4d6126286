"""Descent at a pace: full speed while the loss falls, then a few steps to settle.

A frame like the last one is solved in a few dozen steps, a large motion takes hundreds; one number of
steps for all leaves the large ones half way.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import torch

_BETAS = (0.9, 0.99)
"""Of Adam; an iteration is too short for the usual long memory of squared slopes."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class PaceConfig:
    """When the steps of an iteration get smaller, and when they end."""

    most_steps: int = 150
    """Steps after which it ends in any case."""
    window: int = 10
    """Steps over which losses are summed to tell whether they still fall."""
    gain: float = 0.02
    """Share by which a window must be better than the one before to go on at full speed."""
    settling_steps: int = 25
    """Steps from full speed to the end."""
    final_rate: float = 0.1
    """Share of the learning rate left at the last step (exponential decay)."""


class Pace:
    """Paces one solve: `rate` is the share of the learning rate for the next step."""

    def __init__(self, config: PaceConfig) -> None:
        self._config = config
        self._losses: list[float] = []
        self._settling_steps = min(config.settling_steps, config.most_steps)
        self._settles_at = config.most_steps - self._settling_steps

    @property
    def steps(self) -> int:
        """Steps made so far."""
        return len(self._losses)

    @property
    def settled_steps(self) -> int:
        """Steps made since the loss no longer falls; negative while it may still fall."""
        return self.steps - self._settles_at

    @property
    def goes_on(self) -> bool:
        """Whether there is a next step."""
        return self.steps < self._settles_at + self._settling_steps

    @property
    def rate(self) -> float:
        """Share of the learning rate for the next step."""
        settled_share = max(self.settled_steps, 0) / max(self._settling_steps, 1)
        return self._config.final_rate**settled_share

    def note(self, loss: float) -> None:
        """Take note of the loss before the step that was just made."""
        self._losses.append(loss)
        window = self._config.window
        count = self.steps
        if count >= self._settles_at or count % window or count < 2 * window:
            return
        before = sum(self._losses[-2 * window : -window])
        now = sum(self._losses[-window:])
        if before - now < self._config.gain * before:
            self._settles_at = count


def descend(
    unknowns: list[dict[str, Any]], config: PaceConfig, loss_at: Callable[[Pace], torch.Tensor]
) -> None:
    """Minimize a loss by Adam, in place.

    Args:
        unknowns: Groups of tensors with their learning rates, as `torch.optim.Adam` takes them.
        config: How many steps.
        loss_at: Returns the loss for the unknowns as they are, told how far it is.
    """
    optimizer = torch.optim.Adam(unknowns, betas=_BETAS)
    pace = Pace(config)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda _: pace.rate)
    while pace.goes_on:
        optimizer.zero_grad()
        loss = loss_at(pace)
        loss.backward()
        optimizer.step()
        pace.note(loss.item())
        schedule.step()
