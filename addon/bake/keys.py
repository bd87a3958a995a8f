# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing keyframes in bulk: straight lines between values at given times."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import ArrayLike

from .. import compat
from .drafts import Draft

LINEAR = 1  # of `Keyframe.interpolation`


class Keys:
    """A new action of a datablock, made with its first curve, and part of a draft."""

    def __init__(self, owner: bpy.types.ID, name: str, made: Draft) -> None:
        self._owner, self._name, self._made = owner, name, made
        self._curves: Any = None

    def add(self, path: str, index: int, times: ArrayLike, values: ArrayLike) -> None:
        """A curve through `values` at `times` (frames, ascending), straight between them."""
        if self._curves is None:
            self._curves = compat.new_action(self._owner, self._name).fcurves
            self._made.add(self._owner.animation_data.action)
        points = self._curves.new(path, index=index).keyframe_points
        points.add(len(np.atleast_1d(times)))
        points.foreach_set("co", np.column_stack([times, values]).astype(np.float32).ravel())
        points.foreach_set("interpolation", np.full(len(points), LINEAR, np.int32))
