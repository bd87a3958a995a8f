# SPDX-License-Identifier: GPL-3.0-or-later
"""The window while long work runs: how far it is, beside the mouse cursor and in the status bar, and a way out.

Operators that take long are modal, driven by a timer. Nothing but views can be changed meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

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


class Work(Protocol):
    """What the core does in a thread for an operator."""

    name: str  # of what it is done to
    job: Any  # has `wait(seconds)`, `stage` and `cancel()`


class Waits:
    """An operator whose work takes long: modal where a person calls it, at once everywhere else."""

    doing = ""  # one word of the status bar
    cancelled = ""  # what is said after Esc
    refusals: tuple[type[Exception], ...] = ()
    _work: Any = None
    _wait: Wait | None = None

    def begin(self, context: bpy.types.Context) -> Work:
        """Read, and let the core begin. Raises one of `refusals`."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, *, later: bool) -> None:
        """Wait for the core, write, and report; others may have worked where it is `later`. Raises as `begin`."""
        raise NotImplementedError

    def share(self) -> float:
        """How much is done, 0 to 1."""
        raise NotImplementedError

    def refuse(self, error: Exception, *, by_hand: bool) -> set[str]:
        """Say why not. `by_hand`: a person has just called it, and may be asked."""
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self.begin_in_window(context)

    def begin_in_window(self, context: bpy.types.Context) -> set[str]:
        """Begin, and go on beside the window where it takes long."""
        try:
            self._work = self.begin(context)
        except self.refusals as error:
            return self.refuse(error, by_hand=True)
        if self._work.job.wait(PATIENCE):
            return self._finish(context, later=False, by_hand=True)
        self._wait = Wait(context, f"{self.doing} '{self._work.name}'", self._work.job.cancel)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self._work = self.begin(context)
        except self.refusals as error:
            return self.refuse(error, by_hand=False)
        with at_cursor(context) as show:
            while not self._work.job.wait(0.1):
                show(self.share())
        return self._finish(context, later=False, by_hand=False)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._work.job
        if wants_out(event):
            self.cancel(context)
            self.report({"INFO"}, self.cancelled)
            return {"CANCELLED"}
        if event.type == "TIMER" and job.wait(0.0):
            self._wait.end()
            return self._finish(context, later=True, by_hand=True)
        if event.type == "TIMER":
            self._wait.tell(self.share(), job.stage)
        return {"PASS_THROUGH"} if only_looks(event) else {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Stop. Blender calls it too when it closes or loads a file."""
        if self._wait is not None:
            self._wait.give_up()

    def _finish(self, context: bpy.types.Context, *, later: bool, by_hand: bool) -> set[str]:
        try:
            self.finish(context, later=later)
        except self.refusals as error:
            return self.refuse(error, by_hand=by_hand)
        return {"FINISHED"}


class Binds(Waits):
    """An operator that binds."""

    doing = "Binding"
    cancelled = "Bind cancelled; nothing was changed"
    refusals = (lifecycle.BindError,)

    def finish(self, context: bpy.types.Context, *, later: bool) -> None:
        cage, note = self._work.finish(context, later=later)
        self.report({"INFO"}, lifecycle.summary(cage))
        if note:
            self.report({"WARNING"}, note)

    def share(self) -> float:
        return self._work.job.progress
