# SPDX-License-Identifier: GPL-3.0-or-later
"""What Generate Cage and Fit Cage have in common: options, and the question that a skin with holes raises."""

from __future__ import annotations

import textwrap

import bpy
from bpy.props import BoolProperty, FloatProperty

from .. import caging


class AroundSkins:
    """An operator that puts a cage around skins."""

    clearance: FloatProperty(
        name="Clearance",
        description="The least gap between skin and cage, as a share of the character's size",
        default=3e-4,
        min=1e-4,
        max=0.05,
        precision=4,
        step=0.05,
    )
    tightness: FloatProperty(
        name="Tightness", description="How strongly the cage is pressed to the skin", default=1.0, min=0.0, max=5.0
    )
    hull: BoolProperty(
        name="Cage Repaired Hull",
        description="Enclose a voxel-remeshed copy of the skins: for meshes with holes or crossing parts",
    )

    question = ""  # what a dialog asks

    def ask(self, context: bpy.types.Context, error: Exception) -> set[str]:
        """Offer to cage the repaired hull, where that helps. Yes is answered with `execute`."""
        if not getattr(error, "repairable", False) or self.hull:
            return self.say_no(error)
        error.show()
        self.question = str(error)
        manager = context.window_manager
        return manager.invoke_props_dialog(
            self, width=420, title="Cage Repaired Hull?", confirm_text="Cage Repaired Hull"
        )

    def draw_question(self) -> None:
        """What the dialog shows."""
        for line in textwrap.wrap(self.question, 68):
            self.layout.label(text=line)

    def tell(self, text: str) -> None:
        """What was done."""
        self.report({"INFO"}, text)

    def say_no(self, error: Exception) -> set[str]:
        """Why nothing was done; the place is selected."""
        if isinstance(error, caging.GenerateError):
            error.show()
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}
