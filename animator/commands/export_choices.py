"""From the options of the command line to what the writers are told: flag over profile over default."""

import dataclasses

from animator.config import AnimateOptions
from exporters.options import ExportOptions
from exporters.profiles import PROFILES

CHOICES = (
    "mesh",
    "faces",
    "splats",
    "usd_splats",
    "rotate_sh",
    "precision",
    "tolerance",
    "tolerance_degrees",
)
"""Options that are fields of `ExportOptions` too. Its `up_axis`, `meters_per_unit` and `fps` are not
among them: to the command line these say how the inputs are; what a tool wants, its profile says."""


def export_options(options: AnimateOptions) -> ExportOptions:
    """Return what goes into the files."""
    given = {name: getattr(options, name) for name in CHOICES}
    given = {name: value for name, value in given.items() if value is not None}
    return dataclasses.replace(PROFILES[options.profile].options, **given)
