# SPDX-License-Identifier: GPL-3.0-or-later
"""The window while long work runs: how far it is, beside the mouse cursor and in the status bar, and a way out.

Operators that take long are modal, driven by a timer. Nothing but views can be changed meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

import bpy

from .. import lifecycle

PATIENCE = 0.3  # seconds in which work is done as if at once
LOOKING = {"MOUSEMOVE", "MIDDLEMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "MOUSESMARTZOOM", "NDOF_MOTION"}
LOOKING |= {"WHEELUPMOUSE", "WHEELDOWNMOUSE", "WHEELINMOUSE", "WHEELOUTMOUSE"}
LOOKING |= {"TIMER", "WINDOW_DEACTIVATE", *(f"NUMPAD_{digit}" for digit in range(10)), "NUMPAD_PERIOD"}


class Open(Protocol):
    """What a window shows, until it is given up."""

    def give_up(self) -> None:
        """Leave nothing behind."""


_open: list[Open] = []  # ended when the add-on goes


class Wait:
    """What the window shows from now on until `end`. `give_up` takes the work back; the add-on may go at any time."""

    def __init__(
        self, context: bpy.types.Context, what: str, give_up: Callable[[], None], *, interval: float = 0.05
    ) -> None:
        self._what, self._give_up, self._window = what, give_up, context.window
        manager = context.window_manager
        self._timer = manager.event_timer_add(interval, window=context.window)
        manager.progress_begin(0.0, 100.0)
        _open.append(self)
        self.tell(0.0)

    def tell(self, share: float, stage: str = "", *, way_out: bool = True) -> None:
        """Show how far the work is, and what it does."""
        text = f"{self._what}: {stage}" if stage else self._what

        def draw(header: bpy.types.Header, _context: bpy.types.Context) -> None:
            header.layout.label(text=text)
            bar = header.layout.row()
            bar.ui_units_x = 8.0
            bar.progress(factor=share, text=f"{share:.0%}")
            if way_out:
                header.layout.label(text="", icon="EVENT_ESC")
                header.layout.label(text="Cancel")

        bpy.context.window_manager.progress_update(100.0 * share)
        show_status(self._window, draw)

    def end(self) -> None:
        """Give the window back."""
        if self not in _open:
            return
        _open.remove(self)
        manager = bpy.context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        show_status(self._window, None)

    def give_up(self) -> None:
        """Take the work back and give the window back."""
        self.end()
        self._give_up()


@contextmanager
def at_cursor(context: bpy.types.Context) -> Iterator[Callable[[float], object]]:
    """For work that holds the window, as what the panel Adjust Last Operation repeats does: the mouse cursor counts.

    Gives what is told the share that is done. Esc is not heard meanwhile.
    """
    manager = context.window_manager
    manager.progress_begin(0.0, 100.0)
    try:
        yield lambda share: manager.progress_update(100.0 * share)
    finally:
        manager.progress_end()


def show_status(window: bpy.types.Window, draw: Callable[[bpy.types.Header, bpy.types.Context], None] | None) -> None:
    """Let the status bar of a window show something, or Blender's own again. The window may be closed already."""
    if any(other == window for other in bpy.context.window_manager.windows):
        with bpy.context.temp_override(window=window):
            window.workspace.status_text_set(draw)


def begin(work: Open) -> None:
    """It is given up when the add-on goes, unless it ends before."""
    _open.append(work)


def end(work: Open) -> None:
    """It has ended."""
    if work in _open:
        _open.remove(work)


def end_all() -> None:
    """The add-on goes: Blender forgets modal operators without a word to them."""
    for work in list(_open):
        work.give_up()


def wants_out(event: bpy.types.Event) -> bool:
    """Whether the artist cancels."""
    return event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS"


def only_looks(event: bpy.types.Event) -> bool:
    """Whether an event can move views at most, so that it need not wait."""
    return event.type in LOOKING and not event.alt and not (event.ctrl and event.type.startswith("WHEEL"))


class Binds:
    """An operator that binds: modal where a person calls it and it takes long, at once everywhere else."""

    _work: lifecycle.Work | None = None
    _wait: Wait | None = None

    def begin(self, context: bpy.types.Context) -> lifecycle.Work:
        """Read, and let the core begin. Raises `lifecycle.BindError`."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self._work = self.begin(context)
        except lifecycle.BindError as error:
            return self._refuse(error)
        if self._work.job.wait(PATIENCE):
            return self._finish(context, later=False)
        self._wait = Wait(context, f"Binding '{self._work.name}'", self._work.job.cancel)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self._work = self.begin(context)
        except lifecycle.BindError as error:
            return self._refuse(error)
        return self._finish(context, later=False)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._work.job
        if wants_out(event):
            self.cancel(context)
            self.report({"INFO"}, "Bind cancelled; nothing was changed")
            return {"CANCELLED"}
        if event.type == "TIMER" and job.wait(0.0):
            self._wait.end()
            return self._finish(context, later=True)
        if event.type == "TIMER":
            self._wait.tell(job.progress, job.stage)
        return {"PASS_THROUGH"} if only_looks(event) else {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Stop. Blender calls it too when it closes or loads a file."""
        if self._wait is not None:
            self._wait.give_up()

    def _finish(self, context: bpy.types.Context, *, later: bool) -> set[str]:
        try:
            cage, note = self._work.finish(context, later=later)
        except lifecycle.BindError as error:
            return self._refuse(error)
        self.report({"INFO"}, lifecycle.summary(cage))
        if note:
            self.report({"WARNING"}, note)
        return {"FINISHED"}

    def _refuse(self, error: lifecycle.BindError) -> set[str]:
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}
