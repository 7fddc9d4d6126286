"""Rules for Skeleton and SkelAnimation (UsdSkel, "Skeletons" and "Animation")."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from pxr import Usd, UsdSkel

from exporters.check.problem import Problem, count_bad
from exporters.check.usd.values import place, rows, sample_times


def skeleton_problems(skeleton: UsdSkel.Skeleton) -> Iterator[Problem]:
    """Joints form one tree, with a bind and a rest matrix each, and an animation that fits."""
    joints = skeleton.GetJointsAttr().Get() or []
    yield from joint_problems(place(skeleton.GetJointsAttr()), joints)
    for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
        matrices = rows(attribute)
        if len(matrices) != len(joints):
            expected = f"{len(joints)} matrices, one a joint"
            yield Problem(place=place(attribute), expected=expected, found=str(len(matrices)))
        elif joints:
            yield from matrix_problems(place(attribute), matrices)
    source = UsdSkel.BindingAPI(skeleton.GetPrim()).GetAnimationSourceRel()
    for target in source.GetTargets():
        animation = UsdSkel.Animation(skeleton.GetPrim().GetStage().GetPrimAtPath(target))
        if not animation:
            where = f"{source.GetPrim().GetPath()}.{source.GetName()}"
            yield Problem(place=where, expected="a SkelAnimation", found=f"none at {target}")
            continue
        strangers = set(animation.GetJointsAttr().Get() or []) - set(joints)
        if strangers:
            yield Problem(
                place=place(animation.GetJointsAttr()),
                expected=f"joints of {skeleton.GetPrim().GetPath()}",
                found=f"{len(strangers)} others ({min(strangers)})",
            )


def joint_problems(where: str, joints: Sequence[str]) -> Iterator[Problem]:
    """Joints are paths, parents first, under one root, each with a last name of its own.

    UsdSkel demands all but the last two: Unreal and Quick Look want one root, and Blender names
    bones and vertex groups by the last part of the path.

    Args:
        where: Where they are.
        joints: Paths such as `root/arm`.
    """
    if not joints:
        yield Problem(place=where, expected="at least one joint", found="none")
    repeated = [joint for joint, count in Counter(joints).items() if count > 1]
    if repeated:
        found = f"{len(repeated)} more than once ({repeated[0]})"
        yield Problem(place=where, expected="different joints", found=found)
        return
    index_of = {joint: index for index, joint in enumerate(joints)}
    roots = []
    for index, joint in enumerate(joints):
        parent = joint.rpartition("/")[0]
        while parent and parent not in index_of:  # UsdSkel skips levels that are no joints
            parent = parent.rpartition("/")[0]
        if not parent:
            roots.append(joint)
        elif index_of[parent] > index:
            expected, found = "parents before children", f"{joint} before {parent}"
            yield Problem(place=where, expected=expected, found=found)
    if len(roots) > 1:
        found = f"{len(roots)} ({', '.join(roots[:3])})"
        yield Problem(place=where, expected="one root joint", found=found)
    leaves = Counter(joint.rpartition("/")[2] for joint in joints)
    clashes = [leaf for leaf, count in leaves.items() if count > 1]
    if clashes:
        found = f"{len(clashes)} more than once ({clashes[0]})"
        yield Problem(place=where, expected="different last names", found=found)


def matrix_problems(where: str, matrices: np.ndarray) -> Iterator[Problem]:
    """Matrices act on row vectors, so the last column is 0 0 0 1; and they can be inverted.

    Args:
        where: Where they are.
        matrices: Shape (J, 4, 4).
    """
    yield from count_bad(
        where,
        (matrices[:, :, 3] != [0, 0, 0, 1]).any(axis=1),
        expected="matrices with last column 0 0 0 1; are they transposed?",
        what="matrices with another",
    )
    yield from count_bad(
        where,
        np.linalg.det(np.nan_to_num(matrices[:, :3, :3])) == 0,
        expected="matrices that can be inverted",
        what="matrices that cannot",
    )


def animation_problems(animation: UsdSkel.Animation) -> Iterator[Problem]:
    """Translations, rotations and scales are all there, one a joint in every sample.

    Where a length differs UsdSkel ignores the animation; where scales are missing Blender 5.0 does.
    """
    joint_count = len(animation.GetJointsAttr().Get() or [])
    for attribute in (
        animation.GetTranslationsAttr(),
        animation.GetRotationsAttr(),
        animation.GetScalesAttr(),
    ):
        for time in sample_times([attribute]):
            found = len(rows(attribute, time))
            if found != joint_count:
                expected = f"{joint_count} values, one a joint"
                yield Problem(place=place(attribute, time), expected=expected, found=str(found))
                break


def rig_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Hold every Skeleton and SkelAnimation of a stage to the rules."""
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Skeleton):
            yield from skeleton_problems(UsdSkel.Skeleton(prim))
        elif prim.IsA(UsdSkel.Animation):
            yield from animation_problems(UsdSkel.Animation(prim))
