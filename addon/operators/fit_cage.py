# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit Cage: move the vertices of a rough cage so that it encloses the selected skins."""

from __future__ import annotations

from dataclasses import replace

import bpy
from bpy.props import BoolProperty

from .. import caging, lifecycle, selection
from .around_skins import AroundSkins
from .waiting import Waits

OPTIONS = ("clearance", "tightness", "symmetry", "hull")


class CAGE_RIG_OT_fit_cage(AroundSkins, Waits, bpy.types.Operator):
    """Draw a rough cage, made by hand or decimated from the skin, around the selected skins. Only its vertices move.
    The cage is the mesh without weights, or the active one"""

    bl_idname = "cage_rig.fit_cage"
    bl_label = "Fit Cage"
    bl_options = {"REGISTER", "UNDO"}

    symmetry: BoolProperty(
        name="Symmetry", description="Give a symmetric character a symmetric cage, where its faces are", default=True
    )

    doing = "Fitting"
    cancelled = "Fit cancelled; the cage is as it was"
    refusals = (caging.GenerateError, lifecycle.BindError)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Fit cages in Object Mode")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.question:  # it was answered with yes
            self.question, self.hull = "", True
            return self.begin_in_window(context)
        return super().execute(context)

    def begin(self, context: bpy.types.Context) -> caging.Fitting:
        cage, armature, skins = selection.to_fit(context)
        before = caging.options_of(cage)
        for name in OPTIONS:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(before, name))
        options = replace(before, **{name: getattr(self, name) for name in OPTIONS})
        return caging.Fitting(context, cage, skins, armature, options)

    def finish(self, context: bpy.types.Context, *, later: bool) -> None:
        self._work.finish(context, later=later, tell=self.tell)

    def share(self) -> float:
        return self._work.job.share

    def refuse(self, error: Exception, *, by_hand: bool) -> set[str]:
        return self.ask(bpy.context, error) if by_hand else self.say_no(error)

    def draw(self, _context: bpy.types.Context) -> None:
        if self.question:
            self.draw_question()
            return
        self.layout.use_property_split = True
        for name in OPTIONS:
            self.layout.prop(self, name)
