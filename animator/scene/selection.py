"""Which frames of a clip to keep."""

import dataclasses
from collections.abc import Sequence

from animator.errors import InputError


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameSelection:
    """All frames, or some by their original numbers, or every N-th."""

    numbers: frozenset[int] | None = None
    """Original frame numbers to keep; None keeps all."""
    every: int = 1
    """Keep the first frame and every N-th after it."""

    @classmethod
    def parse(
        cls, *, numbers: Sequence[int] | None = None, every: int | None = None
    ) -> "FrameSelection":
        """Check the two options against each other.

        Raises:
            InputError: If both are given, one is empty, or a number makes no sense.
        """
        if numbers is not None and every is not None:
            raise InputError("Give --frames or --every, not both.")
        if numbers is not None and not numbers:
            raise InputError("--frames: expected at least one frame number, found none.")
        if every is not None and every < 1:
            raise InputError(f"--every: expected 1 or more, found {every}.")
        return cls(numbers=None if numbers is None else frozenset(numbers), every=every or 1)

    def includes(self, position: int, number: int | None = None) -> bool:
        """Return whether to keep the frame at a position (numbered like it, if not said)."""
        if self.numbers is None:
            return position % self.every == 0
        return (position if number is None else number) in self.numbers

    def count_in(self, frame_count: int) -> int:
        """Return how many frames of a clip of that length are kept."""
        return -(-frame_count // self.every) if self.numbers is None else len(self.numbers)

    def is_past(self, number: int) -> bool:
        """Return whether all selected frames lie before a number."""
        return self.numbers is not None and number > max(self.numbers)

    def positions(self, numbers: Sequence[int], where: str) -> list[int]:
        """Return the positions of the selected frames, ascending.

        Raises:
            InputError: If a selected number does not exist.
        """
        self.require(numbers, where)
        return [
            position for position, number in enumerate(numbers) if self.includes(position, number)
        ]

    def require(self, numbers: Sequence[int], where: str) -> None:
        """Check that all selected numbers exist.

        Raises:
            InputError: If one does not.
        """
        missing = sorted((self.numbers or frozenset()).difference(numbers))
        if missing:
            raise InputError(
                f"{where}: --frames: there is no frame {', '.join(map(str, missing[:8]))}"
                f"{' ...' if len(missing) > 8 else ''}; the clip has {len(numbers)} frames with "
                f"numbers from {numbers[0]} to {numbers[-1]}."
            )
