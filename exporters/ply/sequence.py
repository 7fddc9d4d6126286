"""A folder of PLY files, one a frame: the exchange format that every splat viewer imports."""

import re
from pathlib import Path

from exporters.adaptation import adapt
from exporters.atomic import replacing_folder
from exporters.baking import Progress, bake_frames
from exporters.clip import Clip
from exporters.errors import WriteError
from exporters.options import ExportOptions
from exporters.ply import layout

_FRAME_FILE = re.compile(r"clip_\d{4,}\.ply")


def write_ply_sequence(
    clip: Clip,
    folder: str | Path,
    options: ExportOptions | None = None,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Write `clip_0000.ply`, `clip_0001.ply`, ...: Gaussian i is row i in all of them.

    The number is the time code: frame k is the clip at `k / fps` seconds. The folder appears whole.

    Args:
        clip: The clip.
        folder: The target; an older sequence in it is replaced, anything else is not.
        options: Choices, `rotate_sh` among them; None for the defaults.
        progress: Called with the frames done and their total.

    Returns:
        The files written, in order.

    Raises:
        ClipError: If the clip is not valid.
        WriteError: If the folder cannot be written, or holds files that are not of a sequence.
    """
    clip.validate()
    options = options or ExportOptions()
    clip = adapt(clip, options)
    folder = Path(folder)
    _refuse_foreign_files(folder)
    splat_count, sh_count = clip.splats.sh_coeffs.shape[:2]
    header = layout.header(splat_count, sh_count)
    rows = layout.rest_rows(clip)
    names = []
    with replacing_folder(folder) as staged:
        for frame in bake_frames(clip, progress, rotate_sh=options.rotate_sh):
            layout.put_frame(rows, frame)
            name = f"clip_{frame.code:04d}.ply"
            with (staged / name).open("wb") as stream:
                stream.write(header)
                stream.write(rows.data)
            names.append(name)
    return tuple(folder / name for name in names)


def _refuse_foreign_files(folder: Path) -> None:
    """Protect a folder of the user's: only an older sequence may be replaced."""
    if not folder.is_dir():
        return
    foreign = sorted(e.name for e in folder.iterdir() if not _FRAME_FILE.fullmatch(e.name))
    if foreign:
        raise WriteError(
            f"{folder}: holds {len(foreign)} files that are not of a sequence ({foreign[0]}, ...); "
            "choose a new folder, or move them away"
        )
