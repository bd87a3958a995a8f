# SPDX-License-Identifier: GPL-3.0-or-later
"""When Blender calls us. Each handler is a door to `sync`, `leftovers` or `saving` and nothing more."""

from __future__ import annotations

import atexit

import bpy
from bpy.app.handlers import persistent

from . import leftovers, saving, sync


@persistent
def depsgraph_update_post(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    sync.edited(depsgraph)


@persistent
def frame_change_post(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    sync.frame_changed(depsgraph)


@persistent
def undo_pre(*_: object) -> None:
    sync.restoring()


@persistent
def redo_pre(*_: object) -> None:
    sync.restoring()


@persistent
def undo_post(*_: object) -> None:
    sync.restored()


@persistent
def redo_post(*_: object) -> None:
    sync.restored()


@persistent
def render_init(*_: object) -> None:
    if not bpy.app.background:
        sync.rendering(True)


@persistent
def render_complete(*_: object) -> None:
    _render_ended()


@persistent
def render_cancel(*_: object) -> None:
    _render_ended()


def _render_ended() -> None:
    if not bpy.app.background:
        sync.rendering(False)
        bpy.app.timers.register(sync.restored, first_interval=0.0)  # in the main thread, when the render has let go


@persistent
def load_post(*_: object) -> None:
    sync.forget()
    sync.restored()


@persistent
def save_pre(*_: object) -> None:
    leftovers.drop()
    saving.begin()


@persistent
def save_post(*_: object) -> None:
    saving.end()


@persistent
def save_post_fail(*_: object) -> None:
    saving.end()


HANDLERS = (
    depsgraph_update_post,
    frame_change_post,
    undo_pre,
    undo_post,
    redo_pre,
    redo_post,
    render_init,
    render_complete,
    render_cancel,
    load_post,
    save_pre,
    save_post,
    save_post_fail,
)


def register() -> None:
    for handler in HANDLERS:
        getattr(bpy.app.handlers, handler.__name__).append(handler)
    # The bpy module of 4.2 and 4.5 hangs or crashes at exit where a handler is still installed.
    atexit.register(_remove)


def unregister() -> None:
    atexit.unregister(_remove)
    _remove()
    if isinstance(bpy.data, bpy.types.BlendData):  # not while Blender starts
        saving.begin()
    sync.forget()


def _remove() -> None:
    for handler in HANDLERS:
        installed = getattr(bpy.app.handlers, handler.__name__)
        if handler in installed:
            installed.remove(handler)
