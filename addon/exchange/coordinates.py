# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates that were computed elsewhere, and what they have to fulfil.

Everything is in rig space, and rows are in the rig's order: skins one after the other, joints as bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .text import Doubles, FileError, Ints

Describe = Callable[[int], str]  # names a row

ROW_LIMIT = 1e-6  # how far a row may be from a sum of 1, for each unit of the sum of its magnitudes
SHAPE_LIMIT = 1e-4  # how far coordinates may be from placing the rest shape, as a share of the character's size
SIX_DIGITS = 5e-7  # what rounding to the six decimals of the prototype's files may do to each coordinate


@dataclass(frozen=True)
class Coordinates:
    """What a bind can be given; None: it computes it."""

    cage_coords: Doubles | None = None  # Φ, #M by #C
    joint_coords: Doubles | None = None  # Ψ, #J by #C
    center_coords: Doubles | None = None  # Λ, #M by #C
    anchors: Ints | None = None  # #C skin vertices (#M where there are fewer)

    @property
    def names(self) -> list[str]:
        """What is given, in words."""
        words = {
            "cage_coords": "skin coordinates",
            "joint_coords": "joint coordinates",
            "center_coords": "centers of rotation",
            "anchors": "anchors",
        }
        return [word for name, word in words.items() if getattr(self, name) is not None]


@dataclass(frozen=True)
class Rest:
    """The rest shape that coordinates belong to, in rig space."""

    skin_names: list[str]
    skin_counts: list[int]
    skin_points: Doubles  # #M by 3
    joint_names: list[str]
    joints: Doubles  # #J by 3
    cage_points: Doubles  # #C by 3

    @property
    def size(self) -> float:
        """The diagonal of the skins' bounding box."""
        return float(np.linalg.norm(np.ptp(self.skin_points, axis=0)))

    def vertex(self, row: int) -> str:
        """Names a row of the skins."""
        for name, count in zip(self.skin_names, self.skin_counts, strict=True):
            if row < count:
                return f"vertex {row} of '{name}'"
            row -= count
        return f"vertex {row} after the last"

    def cage_vertex(self, row: int) -> str:
        """Names a vertex of the cage."""
        return f"cage vertex {row}"

    def joint(self, row: int) -> str:
        """Names a joint."""
        return f"joint '{self.joint_names[row]}'"


def checked(given: Coordinates, rest: Rest, source: str, *, rounding: float = 0.0) -> Coordinates:
    """The coordinates, if they fit the rest shape: sizes, finite, rows sum to 1, and they place skin and joints.

    `rounding`: by how much each was rounded in its file; rows are then brought back to a sum of 1. What is left of the
    joints' offsets within the limit is taken out by the smallest change that does, so that they stay where they are
    while the cage rests (the skin does anyway: it moves by differences of the cage). Raises `FileError`.
    """
    columns = len(rest.cage_points)
    shapes = {
        "cage_coords": len(rest.skin_points),
        "joint_coords": len(rest.joints),
        "center_coords": len(rest.skin_points),
    }
    if not given.names:
        raise FileError(f"{source} holds no coordinates: none of {', '.join(shapes)} and anchors")
    for name, rows in shapes.items():
        coords = getattr(given, name)
        if coords is not None:
            describe = rest.joint if name == "joint_coords" else rest.vertex
            coords = _summed(coords, (rows, columns), f"{source}: {name}", describe, rounding)
            given = replace(given, **{name: coords})
    if given.cage_coords is not None:
        _require_shape(given.cage_coords, rest, rest.skin_points, f"{source}: cage_coords", rest.vertex)
    if given.joint_coords is not None:
        _require_shape(given.joint_coords, rest, rest.joints, f"{source}: joint_coords", rest.joint)
        given = replace(given, joint_coords=_settled(given.joint_coords, rest))
    if given.anchors is not None:
        _require_anchors(given.anchors, rest, source)
    return given


def _summed(coords: Doubles, shape: tuple[int, int], what: str, describe: Describe, rounding: float) -> Doubles:
    if coords.shape != shape:
        raise FileError(f"{what} is {' by '.join(map(str, coords.shape))}, expected {shape[0]} by {shape[1]}")
    finite = np.isfinite(coords).all(axis=1)
    if not finite.all():
        raise FileError(f"{what} of {describe(int(np.flatnonzero(~finite)[0]))} are not finite")
    sums = coords.sum(axis=1)
    limit = ROW_LIMIT * np.maximum(np.abs(coords).sum(axis=1), 1.0) + rounding * shape[1]
    off = np.abs(sums - 1.0)
    worst = int((off / limit).argmax())
    if off[worst] > limit[worst]:
        raise FileError(
            f"{what} of {describe(worst)} sum to {sums[worst]:.8g}; rows have to sum to 1 within {limit[worst]:.1g}"
        )
    return coords / sums[:, None] if rounding else coords


def _require_shape(coords: Doubles, rest: Rest, places: Doubles, what: str, describe: Describe) -> None:
    off = np.linalg.norm(coords @ rest.cage_points - places, axis=1) / rest.size
    worst = int(off.argmax())
    if off[worst] > SHAPE_LIMIT:
        raise FileError(
            f"{what} put {describe(worst)} {off[worst]:.2g} of the character's size beside its place (the limit is "
            f"{SHAPE_LIMIT:g}): they are of another cage or rest shape, or not exact for linear functions"
        )


def _settled(joint_coords: Doubles, rest: Rest) -> Doubles:
    """The nearest coordinates that place the joints exactly."""
    center = rest.cage_points.mean(axis=0)
    linear = np.column_stack([(rest.cage_points - center) / rest.size, np.ones(len(rest.cage_points))])
    wanted = np.column_stack([(rest.joints - center) / rest.size, np.ones(len(rest.joints))])
    return joint_coords + (wanted - joint_coords @ linear) @ np.linalg.pinv(linear)


def _require_anchors(anchors: Ints, rest: Rest, source: str) -> None:
    count, wanted = len(rest.skin_points), min(len(rest.skin_points), len(rest.cage_points))
    if anchors.shape != (wanted,) or len(np.unique(anchors)) != wanted:
        raise FileError(
            f"{source}: anchors are {len(np.unique(anchors))} skin vertices, expected {wanted} different ones"
        )
    if anchors.min() < 0 or anchors.max() >= count:
        raise FileError(f"{source}: anchors are of {anchors.min()} to {anchors.max()}, expected 0 to {count - 1}")
