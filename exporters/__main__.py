"""`python -m exporters CLIP.splatimate.npz OUT [OUT ...]`: write a saved clip in other formats."""

import argparse
import logging
import sys
from collections.abc import Sequence

from exporters.clip_io import load_clip
from exporters.errors import ClipError, WriteError
from exporters.profiles import PROFILES
from exporters.registry import EXPORTERS, export_clip

EXIT_BAD_INPUT = 3
EXIT_CANNOT_WRITE = 5


def main(arguments: Sequence[str] | None = None) -> int:
    """Export a saved clip; return the exit code.

    Args:
        arguments: Command-line arguments, by default those of the process.
    """
    parser = argparse.ArgumentParser(prog="python -m exporters", description=__doc__)
    parser.add_argument("clip", metavar="CLIP", help="a clip saved by splatimate (.splatimate.npz)")
    parser.add_argument(
        "outputs",
        metavar="OUT",
        nargs="+",
        help=f"files to write; the end of the name chooses the format: {', '.join(EXPORTERS)}",
    )
    parser.add_argument(
        "--profile",
        choices=PROFILES,
        default="generic",
        help="the choices that the tool you write for likes best (default: %(default)s)",
    )
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    log = logging.getLogger(__name__)
    try:
        clip = load_clip(given.clip)
        for output in given.outputs:
            first, *others = export_clip(clip, output, PROFILES[given.profile].options)
            log.info("wrote %s%s", first, f" and {len(others)} more" if others else "")
    except ClipError as error:
        log.error("%s", error)
        return EXIT_BAD_INPUT
    except WriteError as error:
        log.error("%s", error)
        return EXIT_CANNOT_WRITE
    return 0


if __name__ == "__main__":
    sys.exit(main())
