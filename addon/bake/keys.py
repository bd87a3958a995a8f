# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing keyframes in bulk: straight lines between values at given times."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import compat
from .drafts import Draft

Array = NDArray[np.float64]
LINEAR = 1  # of `Keyframe.interpolation`
TRANSFORM = (("location", 0, 3, 0.0), ("rotation_quaternion", 3, 7, (1.0, 0.0, 0.0, 0.0)), ("scale", 7, 10, 1.0))


class Keys:
    """A new action of a datablock, made with its first curve, and part of a draft."""

    def __init__(self, owner: bpy.types.ID, name: str, made: Draft) -> None:
        self._owner, self._name, self._made = owner, name, made
        self._container: Any = None

    def add(self, path: str, index: int, times: ArrayLike, values: ArrayLike, *, group: str = "") -> None:
        """A curve through `values` at `times` (frames, ascending), straight between them, in a group of channels."""
        if self._container is None:
            self._container = compat.new_action(self._owner, self._name)
            self._made.add(self._owner.animation_data.action)
        curve = self._container.fcurves.new(path, index=index)
        if group:
            curve.group = self._container.groups.get(group) or self._container.groups.new(group)
        points = curve.keyframe_points
        points.add(len(np.atleast_1d(times)))
        points.foreach_set("co", np.column_stack([times, values]).astype(np.float32).ravel())
        points.foreach_set("interpolation", np.full(len(points), LINEAR, np.int32))
        curve.update()

    def add_transform(self, owner: bpy.types.bpy_struct, prefix: str, times: list[float], values: Array) -> None:
        """What of a place, turn and size (`#times by 10`) differs from rest: at every time where it moves, else once.

        `owner` is an object or a pose bone, and `prefix` the way to it from the datablock.
        """
        owner.rotation_mode = "QUATERNION"
        group = owner.name if prefix else "Object Transforms"
        for path, first, end, rest in TRANSFORM:
            part = values[:, first:end]
            setattr(owner, path, part[0])
            count = len(times) if np.ptp(part, axis=0).any() else int(np.abs(part[0] - rest).max() > 0.0)
            for k in range(end - first if count else 0):
                self.add(f"{prefix}{path}", k, times[:count], part[:count, k], group=group)
