# SPDX-License-Identifier: GPL-3.0-or-later
"""The mouse and keys of Generate Cage, from the first look at the sections to the cage of the core's job."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import bpy
import numpy as np

from .. import caging
from ..caging import current
from ..generator import Cancelled, Job, Refusal
from . import waiting

RUNNING, THROUGH = {"RUNNING_MODAL"}, {"PASS_THROUGH"}
MORE_LOOKING = {"HOME", "ACCENT_GRAVE", "NUMPAD_PLUS", "NUMPAD_MINUS", "WHEELINMOUSE", "WHEELOUTMOUSE"}
GIZMOS = 110  # pixels of the interface's unit, in the upper right corner of a view
TICK = 0.05  # seconds
KEYS = (
    (("MOUSE_LMB",), "Add or Drag Node"),
    (("EVENT_CTRL", "MOUSE_LMB"), "or"),
    (("EVENT_X",), "Remove"),
    (("EVENT_A",), "Place Automatically"),
    (("EVENT_J",), "Place at Joints"),
    (("EVENT_S",), "Symmetry"),
    (("EVENT_CTRL", "EVENT_Z"), "Undo"),
    (("EVENT_RETURN",), "Generate"),
    (("EVENT_ESC",), "Cancel"),
)


class Run:
    """One editing of nodes in a window. `handle` takes every event; `end` leaves all as it was."""

    def __init__(
        self,
        context: bpy.types.Context,
        cage: bpy.types.Object | None,
        armature: bpy.types.Object | None,
        skins: list[bpy.types.Object],
        options: caging.Options,
        nodes: list[caging.OnBone] | None,
        like: bpy.types.Object | None = None,
    ) -> None:
        self.cage, self.options, self.job, self._like = cage, options, None, like
        self.job: Job | None
        self.character = caging.open_character(context, armature, skins, options, like)
        self.editing = caging.edit(self.character, options, nodes)
        # Blender's own highlights would hide ours
        self._selected = [obj for obj in context.view_layer.objects if obj.select_get()]
        _select(self._selected, False)
        self._posed = armature.data.pose_position if armature else ""
        if armature:
            armature.data.pose_position = "REST"  # sections are of the rest pose
        context.view_layer.update()
        self._shown = current.begin(self.editing, self.character.space.matrix_world.copy())
        self._seen: object = None
        self._wait: waiting.Wait | None = None
        self._window = context.window
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        waiting.show_status(context.window, _draw_keys)
        waiting.begin(self)
        _redraw(context)

    def give_up(self) -> None:
        """Put everything back; a job on its way is cancelled."""
        if self.job is not None and not self.job.done:
            self.job.cancel()
        if self._wait is not None:
            self._wait.end()
        context = bpy.context
        waiting.end(self)
        current.end()
        with suppress(ReferenceError):  # the artist may have deleted something
            if self._posed:
                self.character.armature.data.pose_position = self._posed
            _select(self._selected, True)
        context.window_manager.event_timer_remove(self._timer)
        waiting.show_status(self._window, None)
        context.view_layer.update()
        _redraw(context)

    def handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """One event: FINISHED when the job has a cage, CANCELLED when the artist wants none."""
        if self._shown.failure:
            raise caging.GenerateError(self._shown.failure)
        if not self._is_whole():
            raise caging.GenerateError("The character was deleted or undone while its nodes were edited")
        wish, self._shown.wish = self._shown.wish, ""
        answer = self._answer_work(event, wish) if self.job else self._answer_edit(context, event, wish)
        state = (self.editing.revision, self._shown.working)
        if state != self._seen:
            self._seen = state
            _redraw(context)
        return answer

    def _is_whole(self) -> bool:
        try:
            return all(obj.data is not None for obj in (self.character.space, *self.character.skins))
        except ReferenceError:
            return False

    def _answer_work(self, event: bpy.types.Event, wish: str) -> set[str]:
        """While the core is at work."""
        if wish == "CANCEL" or waiting.wants_out(event):
            self.job.cancel()
        if event.type != "TIMER":
            return THROUGH if _navigates(event) else RUNNING
        if not self.job.done:
            self._shown.working = f"Generating: {self.job.stage}, {self.job.share:.0%}"
            self._wait.tell(self.job.share, self.job.stage)
            return RUNNING
        try:
            self.job.result()
            return {"FINISHED"}
        except Cancelled:
            self.editing.refuse("", None)
        except Refusal as refusal:
            error = caging.explain(refusal, self.character)
            error.show()
            self.editing.refuse(str(error), error.place)
        self._wait.end()
        self.job, self._wait, self._shown.working = None, None, ""
        waiting.show_status(self._window, _draw_keys)
        return RUNNING

    def _answer_edit(self, context: bpy.types.Context, event: bpy.types.Event, wish: str) -> set[str]:
        pressed = event.value == "PRESS"
        if wish == "CANCEL" or (waiting.wants_out(event) and not self.editing.is_dragging):
            return {"CANCELLED"}
        if wish == "GENERATE" or (event.type in {"RET", "NUMPAD_ENTER"} and pressed):
            self._generate(context)
            return RUNNING
        if event.type != "MOUSEMOVE" and _navigates(event):
            return THROUGH
        view = _view_at(context, event)
        if self.editing.is_dragging:
            return self._drag(event, view)
        if view is None:
            self.editing.hovered = self.editing.offered = None
            return THROUGH if "MOUSE" in event.type else RUNNING
        self._point(context, event, view)
        if event.type == "MOUSEMOVE":
            return THROUGH
        return self._press(context, event, view) if pressed else RUNNING

    def _press(self, context: bpy.types.Context, event: bpy.types.Event, view: tuple) -> set[str]:
        editing = self.editing
        match event.type:
            case "LEFTMOUSE" if editing.hovered is not None:
                if event.ctrl:
                    editing.remove(editing.hovered)
                else:
                    editing.grab(editing.hovered)
            case "LEFTMOUSE" if editing.offered is not None and not event.ctrl:
                editing.add(editing.offered)
            case "LEFTMOUSE" if _at_gizmos(context, event, view):
                return THROUGH
            case "X" | "DEL" | "BACK_SPACE" if editing.hovered is not None:
                editing.remove(editing.hovered)
            case "Z" if event.ctrl or event.oskey:
                (editing.redo if event.shift else editing.undo)()
            case "Z":
                return THROUGH  # shading
            case "A":
                self._place(context, "AUTOMATIC")
            case "J":
                self._place(context, "JOINTS")
            case "S":
                self.options = replace(self.options, symmetry=not self.options.symmetry)
                editing.symmetry = self.options.symmetry
                editing.refuse(f"Symmetry: {'on' if editing.symmetry else 'off'}", None)
        return RUNNING

    def _drag(self, event: bpy.types.Event, view: tuple | None) -> set[str]:
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self.editing.drop()
        elif waiting.wants_out(event):
            self.editing.drop()
            self.editing.undo()
        elif event.type == "MOUSEMOVE" and view is not None:
            project, mouse = self._look(event, view)
            self.editing.drag(self.editing.course.on_screen(project, mouse)[1])
        return RUNNING

    def _point(self, context: bpy.types.Context, event: bpy.types.Event, view: tuple) -> None:
        project, mouse = self._look(event, view)
        self.editing.point_at(project, mouse, unit=context.preferences.system.ui_scale)

    def _look(self, event: bpy.types.Event, view: tuple) -> tuple[np.ndarray, tuple[float, float]]:
        """What brings rig space to the pixels of a view, and where the mouse is among them."""
        region, space = view
        half = np.array([region.width, region.height]) / 2.0
        screen = np.diag([half[0], half[1], 1.0, 1.0])
        screen[:2, 3] = half
        project = screen @ np.array(space.region_3d.perspective_matrix @ self._shown.to_world)
        return project, (event.mouse_x - region.x, event.mouse_y - region.y)

    def _place(self, context: bpy.types.Context, placement: str) -> None:
        """Place nodes anew."""
        options = replace(self.options, placement=placement)
        try:
            self.character = self._opened(context, options)
            self.editing.replace(caging.source(self.character, options))
        except (caging.GenerateError, Refusal) as error:
            self.editing.refuse(str(error), error.place)

    def _opened(self, context: bpy.types.Context, options: caging.Options) -> caging.Character:
        """The same character, with other options."""
        found = self.character
        return caging.open_character(context, found.armature, found.skins, options, self._like)

    def _generate(self, context: bpy.types.Context) -> None:
        self.editing.refuse("", None)
        self.editing.hovered = self.editing.offered = None
        # symmetry and placement may have been switched on the way
        self.options = replace(self.options, placement=self.editing.placement)
        self.character = self._opened(context, self.options)
        self.job = caging.start(self.character, self.options, self.editing, self.cage)
        self._shown.working = "Generating"
        self._wait = waiting.Wait(context, "Generating the cage", self.job.cancel)


def _draw_keys(header: bpy.types.Header, _context: bpy.types.Context) -> None:
    row = header.layout.row(align=True)
    for icons, text in KEYS:
        for icon in icons[:-1]:
            row.label(text="", icon=icon)
        row.label(text=text, icon=icons[-1])
        row.separator(factor=2.0)


def _select(objects: list[bpy.types.Object], chosen: bool) -> None:
    for obj in objects:
        obj.select_set(chosen)


def _navigates(event: bpy.types.Event) -> bool:
    """Whether an event can move views at most."""
    by_hand = event.type == "LEFTMOUSE" and event.alt
    return by_hand or waiting.only_looks(event) or event.type in MORE_LOOKING or event.type.startswith("NDOF")


def _view_at(context: bpy.types.Context, event: bpy.types.Event) -> tuple | None:
    """The 3D View under the mouse, (region, space), where nothing lies over it."""
    x, y = event.mouse_x, event.mouse_y
    for area in context.window.screen.areas:
        if area.type != "VIEW_3D" or not _inside(area, x, y):
            continue
        over = [region for region in area.regions if region.type not in {"WINDOW", "XR"} and _inside(region, x, y)]
        if not over:
            region = next(region for region in area.regions if region.type == "WINDOW" and _inside(region, x, y))
            return region, area.spaces.active
    return None


def _inside(box: bpy.types.Area | bpy.types.Region, x: int, y: int) -> bool:
    return box.width > 1 and box.x <= x < box.x + box.width and box.y <= y < box.y + box.height


def _at_gizmos(context: bpy.types.Context, event: bpy.types.Event, view: tuple) -> bool:
    region, reach = view[0], GIZMOS * context.preferences.system.ui_scale
    right, top = region.x + region.width - event.mouse_x, region.y + region.height - event.mouse_y
    return right < 4.0 * reach and top < 3.0 * reach


def _redraw(context: bpy.types.Context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
