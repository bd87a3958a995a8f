# SPDX-License-Identifier: GPL-3.0-or-later
"""While a file is written, and when the add-on goes, suspended Armature modifiers have their vertex groups.

So they do in whatever reads the file without Cage Rig: there nobody gives them back when an artist shows the modifier.
"""

from __future__ import annotations

import bpy

from . import layers, registry
from .adapters import stack


def begin() -> None:
    """Before the file is written, or the add-on goes."""
    stack.wake_suspended(_suspending(registry.rigs()))


def end() -> None:
    """After it was written, or could not be."""
    stack.let_suspended_rest(_suspending([cage for cage in registry.rigs() if cage.cage_rig.state == "LIVE"]))


def _suspending(cages: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Objects of this file whose Armature modifiers rigs stand in for."""
    return [obj for cage in cages for obj in (cage, *layers.skins_of(cage)) if layers.is_own(obj)]
