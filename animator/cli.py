"""The command line: `animate` and `splatimate animate|export|check|inspect|profiles|evaluate`.

Only flags are read here; the packages a command needs are imported when it runs, so that `--help`
is quick and `export` works without torch.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from animator.commands.arguments import (
    add_animate_arguments,
    add_option,
    animate_options,
    given_options,
)
from animator.commands.console import Verbosity, logging_to_stderr
from animator.commands.evaluate_arguments import add_evaluate_arguments, evaluate_choices
from animator.commands.exit_code import ExitCode
from animator.commands.export_choices import CHOICES, export_options
from animator.commands.outputs import (
    OutputNameError,
    OutputPlan,
    plan_animation,
    plan_export,
)
from animator.commands.version import program_version
from animator.config import AnimateOptions
from animator.errors import InputError
from exporters.options import ExportOptions

_ANIMATE_DESCRIPTION = "Animate a Gaussian splat so that it follows a video, and write it rigged."
_ANIMATE_EXAMPLE = """\
example:
  animate shot/frames --out walk.usd --out walk.glb
      reads shot/frames/*.png with the splat (*.ply) and cameras (transforms_train.json, ...)
      beside them; writes walk.usd, walk.glb, walk_gaussians/ (a PLY a frame),
      walk_gaussians.usdc, walk.splatimate.npz and walk_report.html

exit codes: 0 done, 2 usage, 3 bad input, 4 done but below the quality gate, 5 could not write or
a file breaks a rule of its format, 130 interrupted
"""
_EXPORT_DESCRIPTION = "Write a saved clip in other formats, without fitting."
_EXPORT_CACHE = "none"
"""The caches were written beside the clip already."""
_INSPECT_DESCRIPTION = (
    "Say what was found, what is missing, what would run, and how large the output gets."
)
_CHECK_DESCRIPTION = "Find what is wrong with files: USD, glTF, PLY or a saved clip."
_CHECK_EPILOG = """\
exit codes: 0 nothing found, 3 no such file or no known kind, 5 problems found
"""
_PROFILES_DESCRIPTION = "List the profiles: the choices of each, why, and how that is known."
_EVALUATE_DESCRIPTION = "Score the method, its parts and baselines on scenes whose motion is known."
_EVALUATE_EPILOG = """\
examples:
  splatimate evaluate scenes --out scores
      every scene in the folder: ours and the model at rest
  splatimate evaluate scenes/robot --out scores --methods ablation
  splatimate evaluate scenes/robot --out scores --clip walk.splatimate.npz
      a result that is there already, scored without fitting

Tables go to DIR/TASK.md and DIR/TASK.json, results to DIR/SCENE/METHOD: what is there is not fitted
again. docs/evaluation.md says how a scene is laid out, and what the figures, methods and tasks are.
"""
_DEFAULT_OUT = Path("clip.usd")
"""What `inspect` plans for without `--out`."""

Command = Callable[[argparse.Namespace, argparse.ArgumentParser], ExitCode]


def animate_main(argv: Sequence[str] | None = None) -> int:
    """Run `animate`; return the exit code."""
    parser = _new_parser("animate", _ANIMATE_DESCRIPTION, _ANIMATE_EXAMPLE)
    add_animate_arguments(parser)
    return _run(_animate, parser.parse_args(argv), parser)


def main(argv: Sequence[str] | None = None) -> int:
    """Run `splatimate`; return the exit code."""
    parser = _new_parser("splatimate", "From video and Gaussian splat to a rigged asset.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    example = _ANIMATE_EXAMPLE.replace("  animate ", "  splatimate animate ")
    animate = _add_command(commands, "animate", _animate, _ANIMATE_DESCRIPTION, example)
    add_animate_arguments(animate)

    export = _add_command(commands, "export", _export, _EXPORT_DESCRIPTION)
    export.add_argument("clip", metavar="CLIP", type=Path, help="NAME.splatimate.npz")
    for name in ("out", "profile", *CHOICES, "overwrite", "quiet", "verbose"):
        add_option(export, name)
    add_option(export, "cache", default=_EXPORT_CACHE)

    inspect = _add_command(commands, "inspect", _inspect, _INSPECT_DESCRIPTION)
    add_animate_arguments(inspect)

    check = _add_command(commands, "check", _check, _CHECK_DESCRIPTION, _CHECK_EPILOG)
    check.add_argument(
        "files", metavar="FILE", type=Path, nargs="+", help="a file, or a folder of PLY files"
    )
    for name in ("quiet", "verbose"):
        add_option(check, name)

    _add_command(commands, "profiles", _profiles, _PROFILES_DESCRIPTION)

    evaluate = _add_command(
        commands, "evaluate", _evaluate, _EVALUATE_DESCRIPTION, _EVALUATE_EPILOG
    )
    add_evaluate_arguments(evaluate)

    arguments = parser.parse_args(argv)
    return _run(arguments.command, arguments, arguments.parser)


def _animate(arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> ExitCode:
    options = animate_options(arguments)
    plan = _planned(parser, plan_animation, options)
    with logging_to_stderr(_verbosity(options)) as console:
        plan.check(overwrite=options.overwrite)
        from animator.commands.animate import run_animate

        return run_animate(arguments.source, options, plan, console)


def _export(arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> ExitCode:
    options = AnimateOptions(**{"cache": _EXPORT_CACHE, **given_options(arguments)})
    plan = _planned(parser, plan_export, options)
    with logging_to_stderr(_verbosity(options)):
        plan.check(overwrite=options.overwrite)
        from animator.commands.export import run_export

        return run_export(arguments.clip, plan, options)


def _inspect(arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> ExitCode:
    options = animate_options(arguments)
    plan = _planned(parser, plan_animation, options, default_outs=(_DEFAULT_OUT,))
    with logging_to_stderr(_verbosity(options)):
        from animator.commands.inspect import run_inspect

        return run_inspect(arguments.source, options, plan)


def _check(arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> ExitCode:
    with logging_to_stderr(_verbosity(AnimateOptions(**given_options(arguments)))):
        from animator.commands.check import run_check

        return run_check(arguments.files)


def _profiles(arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> ExitCode:
    from animator.commands.profile_text import describe_profiles

    sys.stdout.write(describe_profiles())
    return ExitCode.DONE


def _evaluate(arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> ExitCode:
    options = AnimateOptions(**given_options(arguments))
    with logging_to_stderr(_verbosity(options)):
        from animator.commands.evaluate import run_evaluate

        return run_evaluate(evaluate_choices(arguments), options)


def _run(command: Command, arguments: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run a command and turn what goes wrong into a message and an exit code."""
    try:
        return command(arguments, parser)
    except KeyboardInterrupt:
        message, code = "interrupted", ExitCode.INTERRUPTED
    except Exception as error:
        message, code = _explain(error)
    sys.stderr.write(f"{parser.prog}: error: {message}\n")
    return code


def _explain(error: Exception) -> tuple[str, ExitCode]:
    from exporters.errors import ClipError, WriteError

    if isinstance(error, InputError | ClipError):
        return str(error), ExitCode.BAD_INPUT
    if isinstance(error, WriteError):
        return str(error), ExitCode.NOT_WRITTEN
    kind = type(error).__name__
    message = f"{kind}: {error}; this is a bug, please report it with what --verbose says"
    return message, ExitCode.BUG


def _planned(
    parser: argparse.ArgumentParser,
    planner: Callable[[Sequence[Path], str, ExportOptions], OutputPlan],
    options: AnimateOptions,
    default_outs: tuple[Path, ...] = (),
) -> OutputPlan:
    """Plan the outputs; a bad `--out` ends the program as a usage error."""
    outs = options.out or default_outs
    if not outs:
        parser.error("give at least one --out FILE, such as --out clip.usd")
    try:
        return planner(outs, options.cache, export_options(options))
    except OutputNameError as error:
        parser.error(str(error))


def _verbosity(options: AnimateOptions) -> Verbosity:
    return Verbosity(is_quiet=options.quiet, is_verbose=options.verbose)


def _new_parser(prog: str, description: str, epilog: str = "") -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=prog, description=description, epilog=epilog, formatter_class=_HelpFormatter
    )
    version = f"%(prog)s {program_version()}"
    parser.add_argument("--version", action="version", version=version)
    return parser


def _add_command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    name: str,
    command: Command,
    description: str,
    epilog: str = "",
) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        name,
        help=description,
        description=description,
        epilog=epilog,
        formatter_class=_HelpFormatter,
    )
    parser.set_defaults(command=command, parser=parser)
    return parser


class _HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Keeps the lines of the example; gives flags room beside their help."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=32, width=100)
