"""Splatimate: from an ordinary video and a Gaussian splat to an animated, rigged asset."""

import os

# OpenMP threads spin between two parallel loops by default. On a busy machine that costs four times
# the CPU time of the loops themselves, and the setting is only read when OpenMP loads, so it must
# be made before torch or numba is imported. A user's own choice stands.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
