"""How well each joint was observed, as attributes of the animation: USD has no schema for it."""

from collections.abc import Iterable

from pxr import Sdf, Usd

from exporters.clip import Uncertainty
from exporters.usd import values

ALONG_RAY = "splatimate:uncertainty:alongRay"
ACROSS_RAY = "splatimate:uncertainty:acrossRay"


def add_uncertainty(
    animation: Usd.Prim, uncertainty: Uncertainty, keys: Iterable[int], codes: Iterable[float]
) -> None:
    """Author both attributes, float[], one number a joint in the order of the animation's joints.

    Args:
        animation: The prim that holds the joints' motion.
        uncertainty: Of all keys.
        keys: Which keys to write.
        codes: Their time codes.
    """
    along_ray = _define(animation, ALONG_RAY, "along the viewing ray of the clip's camera")
    across_ray = _define(animation, ACROSS_RAY, "in a direction across that ray")
    for key, code in zip(keys, codes, strict=True):
        along_ray.Set(values.floats(uncertainty.along_ray[key]), float(code))
        across_ray.Set(values.floats(uncertainty.across_ray[key]), float(code))


def _define(animation: Usd.Prim, name: str, direction: str) -> Usd.Attribute:
    attribute = animation.CreateAttribute(name, Sdf.ValueTypeNames.FloatArray, True)
    attribute.SetDocumentation(
        f"Standard deviation of the place of each joint {direction}, in scene units."
    )
    return attribute
