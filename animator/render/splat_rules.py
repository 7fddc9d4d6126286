"""The constants of 3D Gaussian splatting that every renderer must share to draw the same image.

Values as in gsplat 1.5 (`RasterizeToPixels3DGSFwd.cu`, `ProjectionEWA3DGSFused.cu`), which follow
Kerbl et al. 2023, "3D Gaussian Splatting for Real-Time Radiance Field Rendering".
"""

import math

ALPHA_MAX = 0.999
"""Opacity of one Gaussian at a pixel is clamped here; a clamped opacity has no gradient."""

ALPHA_MIN = 1.0 / 255.0
"""A Gaussian is skipped at pixels where its opacity is lower."""

TRANSMITTANCE_MIN = 1e-4
"""A pixel is finished before the Gaussian that would take its transmittance to this or below."""

BLUR_PX2 = 0.3
"""Variance added to every projected Gaussian [px^2], so that none falls between pixels."""

NEAR = 0.01
"""Gaussians whose centre is closer than this along +z are not drawn [scene unit]."""

FRUSTUM_MARGIN = 0.3
"""How far outside the image the projection is still linearized [share of its half size]."""

LOG2_ALPHA_MIN = math.log2(ALPHA_MIN)
LOG2_E = math.log2(math.e)
