# SPDX-License-Identifier: GPL-3.0-or-later
"""A live rig, played frame by frame for a bake: what it shows, with everything of the scene put back after."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import TypeVar

import bpy
import numpy as np

from .. import health, layers, registry, skins, sync
from ..adapters import positions
from ..session import Session

R = TypeVar("R")
# A bake on its way: yields its progress, 0 to 1, and returns what it made. Closing it takes back what it has begun.
Steps = Generator[float, None, R]
SAMPLES = 100  # the most that a Mesh Cache modifier can play


class BakeError(Exception):
    """The bake can't be made; the message is a sentence for the artist. Nothing is left of what was begun."""


def run(steps: Steps[R], tell: Callable[[float], None] | None = None) -> R:
    """Take a bake to its end, telling its progress; returns what it made."""
    with closing(steps):
        while True:
            try:
                share = next(steps)
            except StopIteration as end:
                return end.value
            if tell is not None:
                tell(share)


def times(start: int, end: int, *, samples: int = 1, step: int = 1) -> list[float]:
    """Frames from `start` to `end`, both included: `samples` a frame, or every `step`th one (and the last)."""
    if end < start:
        raise BakeError(f"There is no frame from {start} to {end}; let the range end where it starts, or after")
    if not 1 <= samples <= SAMPLES or step < 1:
        raise BakeError(f"A bake takes 1 to {SAMPLES} samples a frame, and steps of at least one frame")
    count = (end - start) * samples
    found = [start + k / samples for k in range(0, count + 1, step)]
    return found if found[-1] == end else [*found, float(end)]


def refuse_unready(cage: bpy.types.Object) -> None:
    """Raise `BakeError` where the rig does not run, or Blender is in another mode than Object Mode."""
    if cage.cage_rig.state == "NONE":
        raise BakeError(f"'{cage.name}' is not the cage of a rig; bind it first")
    for rig in rigs(cage):
        if rig.cage_rig.state != "LIVE":
            raise BakeError(f"'{rig.name}' is paused: {rig.cage_rig.message}")
    if bpy.context.mode != "OBJECT":
        raise BakeError("Bake in Object Mode")


@dataclass(frozen=True)
class Skin:
    """A skin of the character, and the rig that places its vertices: the one on top, where several do something."""

    obj: bpy.types.Object
    cage: bpy.types.Object
    index: int  # among that rig's skins

    @property
    def session(self) -> Session:
        """Of that rig."""
        return sync.session_of(self.cage)


def rigs(cage: bpy.types.Object) -> list[bpy.types.Object]:
    """The rigs of the character: the one at the bottom first, then those that stand on it."""
    bottom = [cage, *layers.below(cage)][-1]
    return layers.bottom_up([other for other in registry.rigs() if bottom in (other, *layers.below(other))])


def skins_of(cage: bpy.types.Object) -> list[Skin]:
    """The character's skins that were not deleted."""
    found: dict[int, Skin] = {}
    for rig in rigs(cage):
        for index, obj in health.live_skins(rig):
            if obj.session_uid not in found or obj.cage_rig.owner == rig:
                found[obj.session_uid] = Skin(obj, rig, index)
    return list(found.values())


def refuse_paused(cage: bpy.types.Object, time: float) -> None:
    """Raise `BakeError` where a rig of the character does not run at this time."""
    for rig in rigs(cage):
        if rig.cage_rig.state != "LIVE":
            raise BakeError(f"'{rig.name}' is paused at frame {time:g}: {rig.cage_rig.message}")


@contextmanager
def playing(cage: bpy.types.Object, first: float) -> Iterator[Callable[[float], bpy.types.Depsgraph]]:
    """Yields what goes to a time (in frames) and returns the depsgraph there, where the rig is sure to be live.

    Its skins are shown meanwhile; they, and the frame, are as before after. `first` is the time that comes first.
    """
    scene = bpy.context.scene
    frame, subframe = scene.frame_current, scene.frame_subframe

    def go(time: float) -> bpy.types.Depsgraph:
        whole = math.floor(time)
        scene.frame_set(whole, subframe=time - whole)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        refuse_paused(cage, time)
        for obj in participants:
            if not obj.evaluated_get(depsgraph).is_evaluated:
                raise BakeError(f"'{obj.name}' is hidden at frame {time:g}, so that Blender does not evaluate it")
        return depsgraph

    objects = [skin.obj for skin in skins_of(cage)]
    participants = [*objects, *rigs(cage), cage.cage_rig.armature]
    with shown(objects):
        sync.baking(True)
        try:
            go(first)  # what modifiers before ours do can be read from the second time on
            yield go
        finally:
            sync.baking(False)
            scene.frame_set(frame, subframe=subframe)


@contextmanager
def shown(objects: list[bpy.types.Object]) -> Iterator[None]:
    """Objects visible and selectable in the view layer, whatever hid them; put back after."""
    with ExitStack() as stack:
        for obj in objects:
            _show(obj, stack)
        yield


def _show(obj: bpy.types.Object, stack: ExitStack) -> None:
    root = bpy.context.scene.collection
    if obj.hide_viewport or obj.hide_select:
        stack.callback(_set, obj, hide_viewport=obj.hide_viewport, hide_select=obj.hide_select)
        _set(obj, hide_viewport=False, hide_select=False)
    if not obj.visible_get() and obj not in root.objects.values():
        root.objects.link(obj)  # its collections may be hidden or excluded
        stack.callback(root.objects.unlink, obj)
    if obj.hide_get():
        obj.hide_set(False)
        stack.callback(obj.hide_set, True)


def _set(obj: bpy.types.Object, **values: bool) -> None:
    for name, value in values.items():
        setattr(obj, name, value)


def posed_skins(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> list[positions.Points]:
    """What our modifier gives each of `skins_of` now, `#M by 3` in the skin's own space.

    From the sessions that feed them, so that modifiers after ours, and how it is fed, do not matter.
    """
    found = []
    for skin in skins_of(cage):
        to_rig, _ = skins.to_rig(skin.cage, skin.index, depsgraph)
        found.append(positions.apply_matrix(np.linalg.inv(to_rig), skin.session.posed_skin(skin.index)))
    return found
