# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sees: the panel, which knows properties and operator names only, and the overlays of the 3D View."""

from __future__ import annotations

import bpy

from . import overlays
from .panels import CLASSES


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    overlays.register()


def unregister() -> None:
    overlays.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
