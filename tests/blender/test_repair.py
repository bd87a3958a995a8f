"""The button of a paused rig: what the message says is done by one press."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from scene import Rig, bend, fat_key, fresh, select, shown, update


def remove_modifier(rig: Rig) -> None:
    rig.skin.modifiers.remove(rig.skin.modifiers["Cage Rig"])


def mirror_before(rig: Rig) -> None:
    rig.skin.modifiers.new("Solid", "SOLIDIFY")
    rig.skin.modifiers.move(len(rig.skin.modifiers) - 1, 0)


def bend_a_bone(rig: Rig) -> None:
    rig.armature.data.bones["upper"].bbone_segments = 4


def lose_the_mask(rig: Rig) -> None:
    rig.settings.skins[0].mask = "Gone"


def stand_on_nothing(rig: Rig) -> None:
    rig.settings.input = rig.armature


def delete_posed_cage(rig: Rig) -> None:
    bpy.data.objects.remove(rig.posed)


def rename_and_move_a_bone(rig: Rig) -> None:
    select([rig.armature], rig.armature)
    bpy.ops.object.mode_set(mode="EDIT")
    rig.armature.data.edit_bones.remove(rig.armature.data.edit_bones["upper"])
    bpy.ops.object.mode_set(mode="OBJECT")


FAULTS: dict[str, tuple[Callable[[Rig], None], str]] = {
    "modifier removed": (remove_modifier, "Rebind"),
    "modifier before ours": (mirror_before, "Move It After Cage Rig"),
    "B-bone": (bend_a_bone, "Set Segments to 1"),
    "mask gone": (lose_the_mask, "Clear the Mask"),
    "input is no rig": (stand_on_nothing, "Clear the Input"),
    "posed cage deleted": (delete_posed_cage, "Rebind"),
    "bone deleted": (rename_and_move_a_bone, "Rebind"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_one_press_repairs(bar: Rig, name: str) -> None:
    from bl_ext.user_default.cage_rig import repair

    fault, says = FAULTS[name]
    fat_key(bar)
    bend(bar, 0.6)
    fault(bar)
    bar.cage.update_tag()
    update()
    assert bar.settings.state == "PAUSED" and bar.settings.message
    assert repair.label(bar.settings.fix) == says
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.fix_problem() == {"FINISHED"}
    update()
    update()
    assert bar.settings.state == "LIVE" and bar.settings.fix == "", bar.settings.message
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() < 1e-5


def test_a_live_rig_has_nothing_to_fix(bar: Rig) -> None:
    select([bar.cage], bar.cage)
    with pytest.raises(RuntimeError, match="nothing that a button can fix"):
        bpy.ops.cage_rig.fix_problem()


def test_what_stands_on_a_paused_rig_selects_it(bar: Rig) -> None:
    from test_confined import bind_small

    hand = bind_small(bar)
    remove = bar.skin.modifiers["Cage Rig"]
    bar.skin.modifiers.remove(remove)
    bar.cage.update_tag()
    update()
    update()
    assert hand.settings.fix == f"select:{bar.cage.name}"
    select([hand.cage], hand.cage)
    assert bpy.ops.cage_rig.fix_problem() == {"FINISHED"}
    assert bpy.context.view_layer.objects.active == bar.cage
    assert bpy.ops.cage_rig.fix_problem() == {"FINISHED"}
    update()
    update()
    assert bar.settings.state == hand.settings.state == "LIVE", hand.settings.message
