"""A USD file, rule after rule."""

from collections.abc import Iterator
from pathlib import Path

from pxr import Sdf, Usd, UsdUtils

from exporters.check.problem import Problem
from exporters.check.usd import attributes, meshes, skeleton, skins, splats, stage


def check_usd(path: Path) -> Iterator[Problem]:
    """Check a stage with all its payloads, if its layers stay in their folders."""
    # USD would print what it finds odd on stderr; here it is found and said by the rules.
    silence = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield from _stage_problems(path)
    except (RuntimeError, ValueError, TypeError, LookupError) as error:
        # Damaged values reach Python as whatever their bytes happen to mean.
        yield Problem(place="stage", expected="a file that USD can read", found=_reason(error))
    finally:
        silence.TakeUncoalescedDiagnostics()


def _stage_problems(path: Path) -> Iterator[Problem]:
    layer = Sdf.Layer.FindOrOpen(str(path))
    if not layer:
        yield Problem(place="stage", expected="a file that USD can read", found="none")
        return
    problems = [*stage.path_problems(layer)]
    yield from problems
    if problems:
        return
    opened = Usd.Stage.Open(layer)
    opened.Reload()  # a program that wrote the file may hold older layers
    yield from stage.composition_problems(opened)
    yield from stage.metadata_problems(opened)
    problems = [*attributes.type_problems(opened)]
    yield from problems
    if problems:
        return
    yield from attributes.time_problems(opened)
    yield from attributes.value_problems(opened)
    yield from meshes.mesh_problems(opened)
    yield from skeleton.rig_problems(opened)
    influence_problems = [*skins.skin_problems(opened)]
    yield from influence_problems
    if not influence_problems:
        yield from skins.root_extent_problems(opened)
    yield from splats.splat_problems(opened)


def _reason(error: Exception) -> str:
    """Return what USD says, without its function names and line numbers."""
    try:
        quoted = str(error).rpartition(" : '")[2] or str(error)
    except UnicodeDecodeError:
        return "text that is not UTF-8"
    return " ".join(quoted.split())[:200]
