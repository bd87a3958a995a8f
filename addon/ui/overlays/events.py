# SPDX-License-Identifier: GPL-3.0-or-later
"""When Blender calls us. Changes of rigs are counted, so that a redraw knows that nothing changed without looking."""

from __future__ import annotations

import atexit

import bpy
from bpy.app.handlers import persistent

from ... import registry
from . import cursor

_count = [0]


def count() -> int:
    """Grows whenever a part of a rig may have changed, its selection included."""
    return _count[0]


@persistent
def depsgraph_update_post(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if registry.touched(depsgraph):
        _count[0] += 1


@persistent
def frame_change_post(*_: object) -> None:
    _count[0] += 1


@persistent
def undo_post(*_: object) -> None:
    _count[0] += 1


@persistent
def redo_post(*_: object) -> None:
    _count[0] += 1


@persistent
def load_pre(*_: object) -> None:
    cursor.leave()


HANDLERS = (depsgraph_update_post, frame_change_post, undo_post, redo_post, load_pre)


def register() -> None:
    for handler in HANDLERS:
        getattr(bpy.app.handlers, handler.__name__).append(handler)
    # The bpy module of 4.2 and 4.5 hangs or crashes at exit where a handler is still installed.
    atexit.register(_remove)


def unregister() -> None:
    atexit.unregister(_remove)
    _remove()


def _remove() -> None:
    for handler in HANDLERS:
        installed = getattr(bpy.app.handlers, handler.__name__)
        if handler in installed:
            installed.remove(handler)
