"""Our own checker: the errors of skins and splats that the official validators let pass.

    problems = check_file("clip.usdc")

UsdValidation 26.11 and gltf-validator 2.0.0-dev.3.10 accept joint indices out of range, weights of
another length, splat arrays too short, log scales, raw opacities and more; tools then drop the
animation, or the splats, without a word. Files are untrusted: counts are compared with sizes before
anything is allocated, and a broken file is a list of problems.
"""

from exporters.check.check_file import check_file, is_known
from exporters.check.problem import Problem

__all__ = ["Problem", "check_file", "is_known"]
