"""Matchers by name."""

import dataclasses
import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

from animator.errors import InputError
from animator.match.protocol import Matcher


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatcherOptions:
    """What a user can say about any matcher."""

    device: str = "cpu"
    """Torch device of learned matchers."""
    roma_weights: tuple[Path, ...] = ()
    """RoMa's and DINOv2's weight files, for `roma` only."""


MATCHERS: dict[str, str] = {
    "auto": "animator.match.registry:make_auto",
    "flow": "animator.match.registry:make_flow",
    "xfeat": "animator.match.registry:make_xfeat",
    "roma": "animator.match.registry:make_roma",
}
"""Name -> `module:function` from `MatcherOptions` to a `Matcher`, imported when asked for."""


def load_matcher(
    name: str, *, device: str = "cpu", roma_weights: Sequence[str | Path] = ()
) -> Matcher:
    """Make a matcher.

    Args:
        name: A key of `MATCHERS`.
        device: Torch device of learned matchers.
        roma_weights: RoMa's and DINOv2's weight files, for `roma` only.

    Returns:
        The matcher.

    Raises:
        InputError: If there is no such matcher, or it lacks something (weights, a package).
    """
    if name not in MATCHERS:
        raise InputError(f"--matcher: expected one of {', '.join(MATCHERS)}; got {name!r}")
    options = MatcherOptions(device=device, roma_weights=tuple(Path(path) for path in roma_weights))
    module_name, _, function_name = MATCHERS[name].partition(":")
    factory = getattr(importlib.import_module(module_name), function_name)
    return cast(Callable[[MatcherOptions], Matcher], factory)(options)


def make_flow(options: MatcherOptions) -> Matcher:
    """Make the optical-flow matcher."""
    from animator.match.flow import FlowMatcher

    return FlowMatcher()


def make_xfeat(options: MatcherOptions) -> Matcher:
    """Make the learned matcher."""
    from animator.match.features import FeatureMatcher
    from animator.match.xfeat import XFeatMatcher

    return XFeatMatcher(features=FeatureMatcher(device=options.device))


def make_auto(options: MatcherOptions) -> Matcher:
    """Make the matcher that chooses."""
    from animator.match.auto import AutoMatcher

    return AutoMatcher(load_large_motion=lambda: make_xfeat(options))


def make_roma(options: MatcherOptions) -> Matcher:
    """Make the RoMa adapter."""
    from animator.match.roma import load_roma

    return load_roma(options.roma_weights, device=options.device)
