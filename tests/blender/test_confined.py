"""Cages that act on a part: partial cages, masks by vertex groups, and several cages on one character."""

from __future__ import annotations

import itertools
from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import (
    Points,
    Rig,
    bend,
    build_bar,
    drag,
    edited,
    enter_edit_mode,
    fat_key,
    fresh,
    leave_edit_mode,
    native,
    partly_caged,
    rest,
    select,
    set_mesh,
    shown,
    small_cage,
    update,
)
from test_sync import assert_rendered, key_the_bar


def bind_small(rig: Rig, name: str = "HandCage") -> Rig:
    """A second, smaller cage on the same skin."""
    cage = small_cage(name)
    select([rig.skin, rig.armature, cage], cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    return Rig([rig.skin], rig.armature, cage)


def fatten(rig: Rig, factor: float) -> None:
    set_mesh(rig.cage, rest(rig.cage) * np.float32([1, factor, factor]))


def weigh(skin: bpy.types.Object, name: str, weights: Points) -> bpy.types.VertexGroup:
    group = skin.vertex_groups.get(name) or skin.vertex_groups.new(name=name)
    for vertex, weight in enumerate(weights.tolist()):
        group.add([vertex], weight, "REPLACE")
    skin.data.update_tag()
    return group


def ramp(rig: Rig) -> Points:
    return np.clip(rest(rig.skin)[:, 0] + 0.5, 0.0, 1.0)


# Partial cages


def test_a_partial_cage_moves_its_part_and_leaves_the_rest(capfd: pytest.CaptureFixture[str]) -> None:
    rig = partly_caged()
    assert "skin vertices are outside the cage" in capfd.readouterr().out
    assert rig.settings.state == "LIVE", rig.settings.message
    bend(rig, 1.1)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-5 * rig.size, "at rest cage as Blender"
    plain = shown(rig.skin).copy()
    fatten(rig, 1.5)
    moved = np.linalg.norm(shown(rig.skin) - plain, axis=1)
    place = rest(rig.skin)[:, 0]
    assert moved[place > 0.5].max() > 0.08 and moved[place < -0.2].max() < 1e-6
    # without a step between: neighbouring rings are 2/72 apart
    steps = [moved[np.abs(place - x) < 0.02].max() for x in np.arange(-0.2, 0.5, 2 / 72)]
    assert max(abs(a - b) for a, b in itertools.pairwise(steps)) < 0.03


def test_the_posed_cage_of_a_partial_cage_is_dragged_exactly() -> None:
    rig = partly_caged()
    bend(rig, 1.3)
    posed = rest(rig.posed)
    skin = shown(rig.skin)[rest(rig.skin)[:, 0] > 0.4]
    assert np.linalg.norm(posed[:, None] - skin[None], axis=2).min(axis=1).max() < 0.4, "it is at its part"
    enter_edit_mode(rig.posed)
    drag(rig.posed, 5, (0.1, 0.1, 0.2))
    wanted = edited(rig.posed).copy()
    leave_edit_mode()
    assert np.abs(rest(rig.posed) - wanted).max() < 1e-6
    assert np.abs(shown(rig.skin) - fresh(rig)[0]).max() < 1e-6


def test_a_cage_beside_the_skin_is_refused_by_name() -> None:
    objects = build_bar()
    objects.cage.location.y = 50.0
    update()
    select(objects.all, objects.cage)
    with pytest.raises(RuntimeError, match="'BarCage' can't be bound: the cage encloses no vertex of the skin"):
        bpy.ops.cage_rig.bind()
    assert objects.cage.cage_rig.state == "NONE"


# Masks


def test_a_mask_confines_the_cage(bar: Rig) -> None:
    fat_key(bar)
    whole = shown(bar.skin).copy()
    mask = ramp(bar)
    weigh(bar.skin, "Where", mask)
    bar.settings.skins[0].mask = "Where"
    update()
    update()
    assert bar.settings.state == "LIVE", bar.settings.message
    wanted = rest(bar.skin) + (whole - rest(bar.skin)) * mask[:, None]
    assert np.abs(shown(bar.skin) - wanted).max() < 1e-5
    bend(bar, 0.9)
    posed = shown(bar.skin).copy()
    assert np.abs(fresh(bar)[0] - posed).max() < 1e-5
    bar.settings.skins[0].mask = ""
    update()
    bend(bar, 0.0)
    assert np.abs(shown(bar.skin) - whole).max() < 1e-6


def test_a_mask_of_nothing_is_the_character_without_the_cage(bar: Rig) -> None:
    fat_key(bar)
    bend(bar, 1.2)
    weigh(bar.skin, "Nowhere", 0.0 * ramp(bar))
    bar.settings.skins[0].mask = "Nowhere"
    update()
    update()
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_painting_the_mask_is_live(bar: Rig) -> None:
    fat_key(bar)
    weigh(bar.skin, "Where", ramp(bar))
    bar.settings.skins[0].mask = "Where"
    update()
    update()
    before = shown(bar.skin).copy()
    weigh(bar.skin, "Where", 1.0 - ramp(bar))
    update()
    update()
    assert np.abs(shown(bar.skin) - before).max() > 0.05
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() < 1e-6


def test_a_keyed_mask_plays_renders_and_reloads(bar: Rig, tmp_path: Path) -> None:
    key_the_bar(bar)
    weigh(bar.skin, "Where", ramp(bar))
    mix = bar.skin.modifiers.new("Fade", "VERTEX_WEIGHT_MIX")
    bar.skin.modifiers.move(len(bar.skin.modifiers) - 1, 0)
    mix.vertex_group_a, mix.mix_set, mix.mix_mode, mix.default_weight_b = "Where", "ALL", "MUL", 1.0
    for frame, value in ((1, 0.0), (12, 1.0)):
        mix.default_weight_b = value
        mix.keyframe_insert("default_weight_b", frame=frame)
    bar.settings.skins[0].mask = "Where"
    update()
    scene = bpy.context.scene
    shapes = {}
    for frame in (4, 5, 6, 9):
        scene.frame_set(frame)
        shapes[frame] = shown(bar.skin).copy()
    for frame in (9, 5, 6, 4):
        scene.frame_set(frame)
        assert np.array_equal(shown(bar.skin), shapes[frame]), f"frame {frame} depends on what came before"
    mask = ramp(bar)
    mask *= mix.default_weight_b
    mix.show_viewport = mix.show_render = False
    weigh(bar.skin, "Where", mask)
    update()
    update()
    assert np.abs(shown(bar.skin) - shapes[4]).max() < 1e-4, "the same mask, painted"
    weigh(bar.skin, "Where", ramp(bar))
    mix.show_viewport = mix.show_render = True
    update()
    path = str(tmp_path / "masked.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    cage = next(obj for obj in bpy.data.objects if obj.cage_rig.state != "NONE")
    rig = Rig([cage.cage_rig.skins[0].object], cage.cage_rig.armature, cage)
    for frame in (5, 9, 4):
        scene = bpy.context.scene
        scene.frame_set(frame)
        assert np.abs(shown(rig.skin) - shapes[frame]).max() < 1e-5, rig.settings.message
    assert_rendered(rig, shapes, tmp_path)


def test_a_mask_that_is_gone_pauses_the_rig_by_name(bar: Rig) -> None:
    fat_key(bar)
    weigh(bar.skin, "Where", ramp(bar))
    bar.settings.skins[0].mask = "Where"
    update()
    bar.skin.vertex_groups.remove(bar.skin.vertex_groups["Where"])
    bar.skin.data.update_tag()
    update()
    assert bar.settings.state == "PAUSED" and "'Where'" in bar.settings.message
    bar.settings.skins[0].mask = ""
    update()
    assert bar.settings.state == "LIVE", bar.settings.message


# Several cages on one character


def test_a_second_cage_stands_on_the_first(bar: Rig) -> None:
    fat_key(bar)
    bend(bar, 0.8)
    first = shown(bar.skin).copy()
    hand = bind_small(bar)
    assert hand.settings.input == bar.cage
    assert bar.settings.state == hand.settings.state == "LIVE", hand.settings.message
    assert np.abs(shown(bar.skin) - first).max() < 1e-5 * bar.size, "a cage at rest adds nothing"
    heads = [np.array(rig.refit.pose.bones["upper"].head) for rig in (bar, hand)]
    assert np.abs(heads[0] - heads[1]).max() < 1e-5 * bar.size, "its refit bones are those of the first"
    fatten(hand, 1.4)
    both = shown(bar.skin).copy()
    place = rest(bar.skin)[:, 0]
    added = np.linalg.norm(both - first, axis=1)
    assert added[place > 0.5].max() > 0.05 and added[place < -0.2].max() < 1e-5
    assert np.abs(fresh(hand)[0] - both).max() < 1e-5
    # An edit of the lower cage goes through.
    bar.cage.data.shape_keys.key_blocks["Fat"].value = 0.0
    update()
    assert np.abs(shown(bar.skin) - both).max() > 0.1
    assert np.abs(shown(bar.skin) - fresh(hand)[0]).max() < 1e-5


def test_both_posed_cages_are_dragged_exactly(bar: Rig) -> None:
    hand = bind_small(bar)
    bend(bar, 1.0)
    for rig, vertex in ((bar, 9), (hand, 6), (bar, 13), (hand, 2)):
        enter_edit_mode(rig.posed)
        drag(rig.posed, vertex, (0.1, 0.15, 0.1))
        wanted = edited(rig.posed).copy()
        leave_edit_mode()
        assert rig.settings.state == "LIVE" and rig.settings.message == "", rig.settings.message
        assert np.abs(rest(rig.posed) - wanted).max() < 1e-5
        assert np.abs(shown(bar.skin) - fresh(rig)[0]).max() < 1e-5


def test_layered_cages_play_hidden_render_and_reload(bar: Rig, tmp_path: Path) -> None:
    key_the_bar(bar)
    hand = bind_small(bar)
    fatten(hand, 1.3)
    scene = bpy.context.scene
    shapes = {}
    for frame in (4, 5, 6, 17):
        scene.frame_set(frame)
        shapes[frame] = shown(bar.skin).copy()
    for obj in (bar.cage, bar.posed, bar.armature, hand.cage, hand.posed, hand.refit, bar.refit):
        obj.hide_viewport = obj.hide_render = True
    for frame in (17, 5, 6, 4):
        scene.frame_set(frame)
        assert np.abs(shown(bar.skin) - shapes[frame]).max() < 1e-6, frame
    path = str(tmp_path / "layers.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    cage = bpy.data.objects["HandCage"]
    rig = Rig([cage.cage_rig.skins[0].object], cage.cage_rig.armature, cage)
    for frame in (5, 17, 4, 6):
        bpy.context.scene.frame_set(frame)
        assert np.abs(shown(rig.skin) - shapes[frame]).max() < 1e-5, rig.settings.message
    assert_rendered(rig, shapes, tmp_path)


def test_a_skin_waits_for_posed_cages_only_where_it_has_several(bar: Rig) -> None:
    """What is an input of a modifier is evaluated before it. Several modifiers say by it of which rig each is."""
    assert posed_inputs(bar.skin) == [None]
    hand = bind_small(bar)
    assert set(posed_inputs(bar.skin)) == {bar.posed, hand.posed}
    fatten(hand, 1.3)
    assert np.abs(shown(bar.skin) - fresh(hand)[0]).max() < 1e-5
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    update()
    assert posed_inputs(hand.skin) == [None]
    assert hand.settings.state == "LIVE", hand.settings.message
    fatten(hand, 0.8)
    assert np.abs(shown(hand.skin) - fresh(hand)[0]).max() < 1e-5


def test_a_lower_rig_comes_back_when_its_posed_cage_was_deleted(bar: Rig) -> None:
    hand = bind_small(bar)
    fatten(hand, 1.3)
    before = shown(bar.skin).copy()
    bpy.data.objects.remove(bar.posed)
    update()
    assert bar.settings.state == "PAUSED"
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    update()
    assert (bar.settings.state, hand.settings.state) == ("LIVE", "LIVE"), bar.settings.message + hand.settings.message
    assert set(posed_inputs(bar.skin)) == {bar.posed, hand.posed} and bar.skin.cage_rig.owner == hand.cage
    assert np.abs(shown(bar.skin) - before).max() < 1e-5


def test_a_modifier_that_was_duplicated_changes_nothing(bar: Rig) -> None:
    fat_key(bar)
    bend(bar, 1.0)
    before = shown(bar.skin).copy()
    with bpy.context.temp_override(object=bar.skin, active_object=bar.skin):
        assert bpy.ops.object.modifier_copy(modifier="Cage Rig") == {"FINISHED"}
    update()
    assert bar.settings.state == "LIVE", bar.settings.message
    assert np.abs(shown(bar.skin) - before).max() < 1e-6
    hand = bind_small(bar)
    fatten(hand, 1.3)
    assert np.abs(shown(bar.skin) - fresh(hand)[0]).max() < 1e-5
    for rig in (hand, bar):
        select([rig.cage], rig.cage)
        bpy.ops.cage_rig.unbind()
    assert [m.name for m in bar.skin.modifiers] == ["Armature"] and not bpy.data.node_groups


def posed_inputs(skin: bpy.types.Object) -> list[bpy.types.Object | None]:
    from bl_ext.user_default.cage_rig.adapters import modifier

    return [modifier.read(found, "Posed Cage") for found in modifier.ours(skin)]


def test_three_levels_act_in_order_and_come_off_in_any_order(bar: Rig) -> None:
    hand, tip = bind_small(bar), bind_small(bar, "TipCage")
    assert tip.settings.input == hand.cage and hand.settings.input == bar.cage
    fat_key(bar)
    bend(bar, 0.6)
    one = shown(bar.skin).copy()
    fatten(hand, 1.3)
    two = shown(bar.skin).copy()
    fatten(tip, 0.8)
    assert np.abs(shown(bar.skin) - two).max() > 0.01
    select([hand.cage], hand.cage)
    bpy.ops.cage_rig.unbind()
    update()
    assert tip.settings.input == bar.cage and tip.settings.state == "LIVE", tip.settings.message
    assert np.abs(shown(bar.skin) - fresh(tip)[0]).max() < 1e-5
    select([tip.cage], tip.cage)
    bpy.ops.cage_rig.unbind()
    update()
    assert bar.settings.state == "LIVE" and bar.skin.cage_rig.owner == bar.cage
    assert np.abs(shown(bar.skin) - one).max() < 1e-5
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    assert not [m for m in bar.skin.modifiers if m.type == "NODES"] and bar.skin.modifiers["Armature"].show_viewport
    assert not [group for group in bpy.data.node_groups if group.get("cage_rig")]
    assert not [attribute for attribute in bar.skin.data.attributes if attribute.name.startswith("cage_rig")]


def test_the_lowest_comes_off_first(bar: Rig) -> None:
    hand = bind_small(bar)
    fatten(hand, 1.3)
    bend(bar, 0.6)
    before = shown(bar.skin).copy()
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    update()
    assert hand.settings.input is None and hand.settings.state == "LIVE", hand.settings.message
    assert np.abs(shown(bar.skin) - before).max() < 1e-5


def test_the_order_can_be_changed_but_never_to_a_cycle(bar: Rig) -> None:
    hand = bind_small(bar)
    fat_key(bar)
    fatten(hand, 1.3)
    bar.settings.input = hand.cage  # a script can; the interface does not offer it
    update()
    update()
    assert "PAUSED" in (bar.settings.state, hand.settings.state)
    assert "cycle" in bar.settings.message + hand.settings.message
    hand.settings.input = None
    update()
    update()
    assert bar.settings.state == hand.settings.state == "LIVE", bar.settings.message + hand.settings.message
    assert bar.skin.cage_rig.owner == bar.cage
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() < 1e-5


def test_two_cages_that_name_no_order_are_not_both_live(bar: Rig) -> None:
    hand = bind_small(bar)
    hand.settings.input = None
    update()
    states = {bar.settings.state, hand.settings.state}
    assert states == {"LIVE", "PAUSED"}
    assert "too" in bar.settings.message + hand.settings.message
    hand.settings.input = bar.cage
    update()
    update()
    assert hand.settings.state == bar.settings.state == "LIVE", hand.settings.message


def test_a_paused_lower_cage_pauses_what_stands_on_it(bar: Rig) -> None:
    hand = bind_small(bar)
    bend(bar, 0.5)
    bar.settings.posed_cage.data.clear_geometry()
    update()
    assert bar.settings.state == "PAUSED"
    update()
    assert hand.settings.state == "PAUSED" and f"'{bar.cage.name}'" in hand.settings.message
    assert np.abs(shown(bar.skin) - native_points(bar)).max() < 1e-5
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.rebind()
    update()
    update()
    assert bar.settings.state == hand.settings.state == "LIVE", hand.settings.message


def native_points(rig: Rig) -> Points:
    """A paused rig shows Blender's own skinning: that of a copy without ours."""
    twin = rig.skin.copy()
    twin.data = rig.skin.data.copy()
    for modifier in [m for m in twin.modifiers if m.type == "NODES"]:
        twin.modifiers.remove(modifier)
    bpy.context.scene.collection.objects.link(twin)
    twin.modifiers["Armature"].show_viewport = True
    update()
    points = shown(twin).copy()
    bpy.data.objects.remove(twin)
    return points


def test_refit_of_two_cages_is_applied_at_once(bar: Rig) -> None:
    hand = bind_small(bar)
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.4, 1.0, 1.0]))
    fatten(hand, 1.3)
    bend(bar, 0.7)
    before = shown(bar.skin).copy()
    select([bar.cage], bar.cage)
    with pytest.raises(RuntimeError, match=hand.cage.name):
        bpy.ops.cage_rig.apply_refit()
    select([hand.cage], hand.cage)
    assert bpy.ops.cage_rig.apply_refit() == {"FINISHED"}
    update()
    assert np.abs(shown(bar.skin) - before).max() < 1e-5
    assert np.abs(fresh(hand)[0] - before).max() < 1e-5


def test_undo_over_layers(bar: Rig) -> None:
    bpy.ops.ed.undo_push(message="start")
    hand = bind_small(bar)
    names = bar.cage.name, hand.cage.name, bar.skin.name
    bpy.ops.ed.undo_push(message="bound")
    fatten(hand, 1.4)
    fat = shown(bar.skin).copy()
    bpy.ops.ed.undo_push(message="fat")
    bpy.ops.ed.undo()
    skin = bpy.data.objects[names[2]]
    assert np.abs(shown(skin) - fat).max() > 0.05
    bpy.ops.ed.redo()
    skin = bpy.data.objects[names[2]]
    assert np.abs(shown(skin) - fat).max() < 1e-6
    assert all(bpy.data.objects[name].cage_rig.state == "LIVE" for name in names[:2])
