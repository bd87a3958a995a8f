# SPDX-License-Identifier: GPL-3.0-or-later
"""New objects of a bake: in a collection of their own when they are done, gone without a trace when they are not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..adapters import dependence, modifier, stack
from .live import Skin


class Draft:
    """What a bake has made so far, in no scene yet."""

    def __init__(self) -> None:
        self.made: list[bpy.types.ID] = []
        self.objects: list[bpy.types.Object] = []

    def add(self, datablock: bpy.types.ID) -> None:
        """Take a new datablock along: it goes when the bake is not finished."""
        self.made.append(datablock)

    def copy(self, source: bpy.types.Object, name: str) -> bpy.types.Object:
        """A copy of an object and its data, of this file, that has nothing to do with any rig."""
        obj = source.copy()
        self.add(obj)
        if obj.override_library is not None:
            obj.make_local(clear_liboverride=True)
        obj.data = source.data.copy()
        self.add(obj.data)
        obj.name = obj.data.name = name
        obj.property_unset("cage_rig")
        dependence.settle(obj, [])
        obj.hide_viewport = obj.hide_select = False
        self.objects.append(obj)
        return obj

    def copy_skin(self, skin: Skin, name: str) -> tuple[bpy.types.Object, int]:
        """A copy of a skin without our modifiers and those that they stand in for or take into account.

        Returns it with the place in its modifiers where the one was that places the vertices. Its shape keys are still
        there.
        """
        source, suspended = skin.obj, stack.suspended_names(skin.obj)
        leader = list(source.modifiers).index(modifier.find(source, skin.cage))
        ours = {mod.name for mod in modifier.ours(source)}
        obj = self.copy(source, name)
        place = 0
        for index, mod in enumerate(list(obj.modifiers)):
            taken = index < leader and mod.type not in stack.HARMLESS
            if taken or mod.name in ours | suspended:
                obj.modifiers.remove(mod)
            elif index < leader:
                place += 1
        for attribute in [a.name for a in obj.data.attributes if a.name.startswith("cage_rig.")]:
            obj.data.attributes.remove(obj.data.attributes[attribute])
        if obj.parent_type == "ARMATURE":
            obj.parent_type = "OBJECT"  # else the parent would deform it
        return obj, place

    def finish(self, name: str) -> bpy.types.Collection:
        """Put the objects into a new collection of the scene."""
        collection = bpy.data.collections.new(name)
        self.add(collection)
        for obj in self.objects:
            collection.objects.link(obj)
        bpy.context.scene.collection.children.link(collection)
        for obj in self.objects:
            obj.select_set(False)  # as their sources may be
        return collection


@contextmanager
def draft() -> Iterator[Draft]:
    """Yields a `Draft`; whatever it holds is removed again if the work ends by an exception or is closed."""
    made = Draft()
    try:
        yield made
    except BaseException:
        bpy.data.batch_remove(made.made)
        raise
