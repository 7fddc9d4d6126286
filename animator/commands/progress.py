"""How far the run is, and how long it still takes: a bar on a terminal, else a line a frame."""

import contextlib
import logging
import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from animator.sequence.solved_frame import FrameStats

if TYPE_CHECKING:
    from rich.console import Console

logger = logging.getLogger(__name__)


class TimeLeft:
    """Estimates the rest from the frames solved so far.

    The first solved frame is left out: it compiles the kernels and loads the networks. Until
    another one is measured there is no estimate, rather than a wrong one.
    """

    def __init__(self, frame_count: int, done_count: int, now_s: float) -> None:
        self._frames_left = frame_count - done_count
        self._last_s = now_s
        self._measured_s: list[float] = []
        # Frame 0 is the rest pose and costs nothing; with it, two frames do not count.
        self._warm_up_left = 1 if done_count else 2

    def frame_done(self, now_s: float) -> float:
        """Count a frame; return its duration [s]."""
        duration_s = now_s - self._last_s
        self._last_s = now_s
        self._frames_left -= 1
        if self._warm_up_left:
            self._warm_up_left -= 1
        else:
            self._measured_s.append(duration_s)
        return duration_s

    @property
    def seconds(self) -> float | None:
        """Time left [s], None before a frame counts."""
        if not self._measured_s:
            return None
        return self._frames_left * math.fsum(self._measured_s) / len(self._measured_s)


class FrameProgress:
    """Reports frame after frame."""

    def __init__(
        self, numbers: tuple[int, ...], done_count: int, console: "Console | None"
    ) -> None:
        self._numbers = numbers
        self._time_left = TimeLeft(len(numbers), done_count, time.monotonic())
        self._console = console
        self._done_count = done_count
        self._bar = None
        self._task = None

    @contextlib.contextmanager
    def shown(self) -> Iterator["FrameProgress"]:
        """Show the bar for the block, if there is a terminal."""
        if self._console is None:
            yield self
            return
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        columns = (TextColumn("frames"), BarColumn(), MofNCompleteColumn())
        with Progress(*columns, TextColumn("{task.fields[rest]}"), console=self._console) as bar:
            self._bar = bar
            self._task = bar.add_task(
                "", total=len(self._numbers), completed=self._done_count, rest="warming up"
            )
            yield self

    def frame_done(self, index: int, stats: FrameStats) -> None:
        """Report a solved frame."""
        duration_s = self._time_left.frame_done(time.monotonic())
        rest = describe_time_left(self._time_left.seconds)
        level = logging.INFO
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=index + 1, rest=rest)
            level = logging.DEBUG
        logger.log(
            level,
            "frame %d (%d/%d): %s, %.1f s, %s",
            self._numbers[index],
            index + 1,
            len(self._numbers),
            describe_stats(stats),
            duration_s,
            rest,
        )


def describe_stats(stats: FrameStats) -> str:
    """Write what happened in one frame in a few words."""
    error = "" if math.isnan(stats.reprojection_px) else f" at {stats.reprojection_px:.2f} px"
    return f"{stats.matches} matches{error}, from {stats.start}, {stats.groups} rigid groups"


def describe_time_left(seconds: float | None) -> str:
    """Write a time left the way people say it."""
    if seconds is None:
        return "time left unknown"
    if seconds < 90:
        return f"{seconds:.0f} s left"
    if seconds < 5400:
        return f"about {seconds / 60:.0f} min left"
    return f"about {seconds / 3600:.1f} h left"
