"""The rules for USD in a process of their own.

A damaged .usdc or .usdz can bring USD 26.11 down, and its process with it; a few bytes changed at
random are enough. So files that others wrote are read where nothing else can be lost.
"""

import dataclasses
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from exporters.check.problem import Problem


def check_usd_guarded(path: Path) -> Iterator[Problem]:
    """Check a file as `check_usd` does; if USD dies of it, that is the problem."""
    child = subprocess.run(
        [sys.executable, "-m", __name__, path.absolute()],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    try:
        yield from (Problem(**fields) for fields in json.loads(child.stdout))
    except ValueError:
        code = child.returncode
        reason = (
            signal.strsignal(-code) if code < 0 else child.stderr[-200:].decode(errors="replace")
        )
        expected = "a file that USD can read"
        yield Problem(place="stage", expected=expected, found=f"one it dies of ({reason})")


def main(arguments: Sequence[str]) -> int:
    """Write the problems of one file to stdout, as JSON."""
    from exporters.check.usd.file import check_usd

    problems = [dataclasses.asdict(problem) for problem in check_usd(Path(arguments[0]))]
    sys.stdout.write(json.dumps(problems))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
