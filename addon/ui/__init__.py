# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sees: panels only; knows properties and operator names."""

from __future__ import annotations

import bpy

from .panels import CLASSES


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
