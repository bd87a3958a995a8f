# SPDX-License-Identifier: GPL-3.0-or-later
"""What the 3D Views show of rigs beside Blender's own drawing; switched by `workspace.cage_rig_overlays`.

Nothing is written to the file. An overlay that meets an error is switched off and says so in the panel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ...caging import current
from . import cursor, events, legend, shaders, subject
from .cages import Cages
from .figures import Anchors, Joints, JointWeights
from .heat import HeatMap
from .sections import Sections, draw_words
from .surfaces import Surfaces

NAMES = ("weights", "fade", "anchors", "joints", "joint_weights")  # in the order of their drawing


class Overlays:
    """All overlays and what they keep between drawings. Can be thrown away at any moment."""

    def __init__(self) -> None:
        surfaces, ink = Surfaces(), shaders.Ink()
        self.choice = subject.Choice()
        self.heat = HeatMap(surfaces)
        self.cages = Cages(ink)
        self.anchors = Anchors(surfaces, ink)
        self.joints = Joints(ink)
        self.joint_weights = JointWeights(ink)
        self.sections = Sections(ink)

    def draw(self, name: str, context: bpy.types.Context, settings: Any, found: subject.Subject) -> None:
        """Draw one overlay in the scene."""
        space, chosen = context.space_data, self.choice.read(context, found)
        match name:
            case "weights" if chosen is not None:
                self.heat.draw(self.heat.on(found, chosen, settings.weights_opacity, space))
            case "fade":
                self.cages.draw_faint(found, space, settings.fade_minimum)
            case "anchors":
                self.anchors.draw(found, space)
            case "joints":
                self.joints.draw(found, in_front=settings.joints_in_front)
            case "joint_weights" if chosen is not None and chosen.joint >= 0:
                self.joint_weights.draw(found, chosen)

    def entries(self, context: bpy.types.Context, settings: Any, found: subject.Subject) -> list[legend.Entry | str]:
        """What the legend explains, from below: weights that are shown, and why nothing is."""
        chosen = self.choice.read(context, found)
        entries: list[legend.Entry | str] = []
        if settings.fade and next(self.cages.hidden(found, context.space_data), None) is None:
            entries.append("Fading Cages: hide the cages first")
        if chosen is None and settings.weights:
            entries.append("Weights: select cage vertices or a bone")
        if settings.joint_weights and (chosen is None or chosen.joint < 0):
            entries.append("Joint Weights: choose a bone in Pose Mode")
        if chosen is not None and settings.joint_weights and chosen.joint >= 0:
            weights = self.joint_weights.weights(found, chosen)
            low, high = float(weights.min()), float(weights.max())
            entries.append(legend.entry(f"{chosen.label}: joint", min(0.0, low), max(0.0, high)))
        if chosen is not None and settings.weights:
            entries.append(legend.entry(f"{chosen.label}: skin", *self.heat.range(found, chosen)))
        return entries


class _Running:
    """The handles of what is registered, what is kept, and what has failed."""

    def __init__(self) -> None:
        self.handles: list[Any] = []
        self.overlays: Overlays | None = None
        self.failures: dict[str, str] = {}

    def kept(self) -> Overlays:
        if self.overlays is None:
            self.overlays = Overlays()
        return self.overlays


_running = _Running()


def draw_view() -> None:
    """In the scene, after Blender's own drawing of it."""
    _guarded(NAMES, _draw_view)
    _draw_editing(lambda shown: _running.kept().sections.draw(shown))


def _draw_view() -> None:
    _look_after()
    context = bpy.context
    settings, found = _shown(context)
    for name in NAMES:
        if found is not None and getattr(settings, name):
            _guarded((name,), lambda name=name: _running.kept().draw(name, context, settings, found))


def draw_pixels() -> None:
    """Over the picture: the legend."""
    _guarded(("weights", "joint_weights", "fade"), _draw_pixels)
    _draw_editing(lambda shown: draw_words(bpy.context, shown))


def _draw_pixels() -> None:
    context = bpy.context
    settings, found = _shown(context)
    if found is not None:
        legend.draw(context, _running.kept().entries(context, settings, found))


def draw_cursor(place: tuple[int, int]) -> None:
    """At the mouse cursor, over the finished picture of the view that it is in."""
    _guarded(("fade",), lambda: _draw_cursor(place))


def _draw_cursor(place: tuple[int, int]) -> None:
    context = bpy.context
    settings, found = _shown(context)
    if found is not None and settings.fade and context.region_data is not None:
        radius = settings.fade_radius * context.preferences.system.ui_scale
        _running.kept().cages.draw_near(found, context, place, radius)


def _shown(context: bpy.types.Context) -> tuple[Any, subject.Subject | None]:
    """The settings, and the rig that this view shows overlays of; None where it shows none."""
    space, workspace = context.space_data, context.workspace
    if workspace is None or space is None or space.type != "VIEW_3D" or not space.overlay.show_overlays:
        return None, None
    settings = workspace.cage_rig_overlays
    return settings, subject.find(context) if any(getattr(settings, name) for name in NAMES) else None


def _look_after() -> None:
    """Follow the cursor only while a window wants it; keep nothing while none wants any overlay."""
    wanted = [window.workspace.cage_rig_overlays for window in bpy.context.window_manager.windows]
    if any(settings.fade for settings in wanted):
        cursor.follow(draw_cursor)
    else:
        cursor.leave()
    if not any(getattr(settings, name) for settings in wanted for name in NAMES) and current.shown() is None:
        _running.overlays = None


def _guarded(names: tuple[str, ...], draw: Callable[[], None]) -> None:
    """Draw, and have these overlays switched off where that fails: nothing can be written while Blender draws."""
    if bpy.app.background:  # nothing to draw on
        return
    try:
        with shaders.tidy():
            draw()
    except Exception as error:
        text = f"An overlay was switched off: it met an error ({type(error).__name__}: {error}); please report it"
        _running.failures.update(dict.fromkeys(names, text))
        if not bpy.app.timers.is_registered(_switch_off):
            bpy.app.timers.register(_switch_off, first_interval=0.0)


def _draw_editing(draw: Callable[[current.Shown], None]) -> None:
    """What is shown of bending nodes, while they are edited; the editing ends where that fails."""
    shown = current.shown()
    if shown is None or bpy.app.background:
        return
    try:
        with shaders.tidy():
            draw(shown)
    except Exception as error:
        shown.failure = f"The nodes could not be shown ({type(error).__name__}: {error}); please report it"


def _switch_off() -> None:
    for workspace in bpy.data.workspaces:
        settings = workspace.cage_rig_overlays
        for name, text in _running.failures.items():
            if getattr(settings, name):
                setattr(settings, name, False)
                settings.message = text
    _running.failures.clear()
    _running.overlays = None


def register() -> None:
    events.register()
    add = bpy.types.SpaceView3D.draw_handler_add
    _running.handles = [add(draw_view, (), "WINDOW", "POST_VIEW"), add(draw_pixels, (), "WINDOW", "POST_PIXEL")]


def unregister() -> None:
    while _running.handles:
        bpy.types.SpaceView3D.draw_handler_remove(_running.handles.pop(), "WINDOW")
    cursor.leave()
    if bpy.app.timers.is_registered(_switch_off):
        bpy.app.timers.unregister(_switch_off)
    _running.overlays = None
    events.unregister()
