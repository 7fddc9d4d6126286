"""The profiles in words: for `splatimate profiles` and for what a run says of its own."""

import dataclasses
import textwrap

from exporters.options import ExportOptions
from exporters.profiles import PROFILES

_WIDTH = 100
_KNOWN = {
    "ran": "ran: tried here with that tool",
    "read": "read: in its documentation or source",
    "rule": "rule: its maker states it, a test holds our files to it",
}


def describe_profiles() -> str:
    """List every profile: what for, what it chooses, why, and how that is known."""
    blocks = []
    for name, profile in PROFILES.items():
        changed = describe_changes(profile.options)
        paragraphs = [
            f"{name}: {profile.purpose}; best as {profile.suffix}",
            f"  chooses {', '.join(changed)}" if changed else "  the defaults",
            f"  {profile.because} ({profile.known})",
        ]
        wrapped = (textwrap.wrap(text, _WIDTH, subsequent_indent="    ") for text in paragraphs)
        blocks.append("\n".join(line for lines in wrapped for line in lines))
    legend = "\n".join(_KNOWN.values())
    return "\n\n".join([*blocks, legend]) + "\n"


def describe_changes(options: ExportOptions) -> list[str]:
    """List the choices that differ from the defaults, as `name = value`."""
    return [
        f"{field.name.replace('_', '-')} = {_word(getattr(options, field.name))}"
        for field in dataclasses.fields(options)
        if getattr(options, field.name) != field.default
    ]


def _word(value: object) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else f"{value}"
