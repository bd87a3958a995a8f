"""Modifiers on the skin beside ours: before it they change the rest skin, after it they work on the posed one."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scene import Rig, bend, bind, build_bar, fat_key, fresh, native, rest, select, shown, update


def lattice_before(rig: Rig) -> bpy.types.Object:
    """A lattice modifier before ours (and before the armature's), squeezed."""
    lattice = bpy.data.objects.new("Lattice", bpy.data.lattices.new("Lattice"))
    lattice.scale = (3, 1, 1)
    bpy.context.scene.collection.objects.link(lattice)
    rig.skin.modifiers.new("Squeeze", "LATTICE").object = lattice
    rig.skin.modifiers.move(len(rig.skin.modifiers) - 1, 0)
    squeeze(lattice, 0.2)
    update()
    return lattice


def squeeze(lattice: bpy.types.Object, amount: float) -> None:
    for point in lattice.data.points:
        point.co_deform.z = point.co.z + amount * (1 if point.co.x > 0 else -0.5)
    lattice.data.update_tag()
    update()


def close(rig: Rig, *, tolerance: float = 1e-5) -> bool:
    return bool(np.abs(shown(rig.skin) - native(rig.skin)).max() < tolerance * rig.size)


def test_a_lattice_before_ours_is_honoured(bar: Rig) -> None:
    lattice = lattice_before(bar)
    update()
    assert bar.settings.state == "LIVE", bar.settings.message
    bend(bar, 1.0)
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() > 0.1
    assert close(bar)
    squeeze(lattice, -0.1)
    assert close(bar), "live while the lattice is edited"
    fat_key(bar)
    fattened = shown(bar.skin).copy()
    assert np.isfinite(fattened).all() and not close(bar)
    assert np.abs(fresh(bar)[0] - fattened).max() < 1e-5


def test_blender_evaluates_no_node_that_nothing_asks_for(bar: Rig) -> None:
    """Every node of a group takes time in every frame, also where it does nothing."""
    bend(bar, 1.0)
    fat_key(bar)
    before, inputs = shown(bar.skin).copy(), given(bar)
    few = ["GeometryNodeInputNamedAttribute", "GeometryNodeStoreNamedAttribute", "NodeGroupInput", "NodeGroupOutput"]
    assert nodes(bar) == few
    lattice_before(bar)
    update()
    bend(bar, 1.0)
    assert bar.settings.state == "LIVE", bar.settings.message
    assert len(nodes(bar)) > len(few) and given(bar) == {**inputs, "Keep Input": True}
    assert np.abs(shown(bar.skin) - before).max() > 0.01
    bar.skin.modifiers.remove(bar.skin.modifiers["Squeeze"])
    update()
    bend(bar, 1.0)
    assert nodes(bar) == few and given(bar) == inputs
    assert np.abs(shown(bar.skin) - before).max() < 1e-6


def nodes(rig: Rig) -> list[str]:
    return sorted(node.bl_idname for node in rig.skin.modifiers["Cage Rig"].node_group.nodes)


def given(rig: Rig) -> dict[str, object]:
    """What the modifier's inputs are set to."""
    from bl_ext.user_default.cage_rig.adapters import modifier, node_group

    return {name: modifier.read(rig.skin.modifiers["Cage Rig"], name) or None for name in node_group.SOCKETS}


def test_a_lattice_before_ours_at_bind() -> None:
    objects = build_bar()
    lattice_before(Rig(objects.skins, objects.armature, objects.cage))
    rig = bind(objects)
    update()
    bend(rig, 1.0)
    assert rig.settings.state == "LIVE", rig.settings.message
    assert close(rig)


def test_a_keyed_deformation_before_ours_plays(bar: Rig) -> None:
    modifier = bar.skin.modifiers.new("Twist", "SIMPLE_DEFORM")
    bar.skin.modifiers.move(len(bar.skin.modifiers) - 1, 0)
    modifier.deform_axis = "X"
    for frame, angle in ((1, 0.0), (11, 1.5)):
        modifier.angle = angle
        modifier.keyframe_insert("angle", frame=frame)
    bend(bar, 0.8)
    scene = bpy.context.scene
    for frame in (1, 6, 11, 3):
        scene.frame_set(frame)
        live = shown(bar.skin).copy()
        assert np.abs(live - native(bar.skin)).max() < 1e-5 * bar.size, f"frame {frame}"


@pytest.mark.parametrize("kind", ["SUBSURF", "SOLIDIFY", "TRIANGULATE"])
def test_growing_modifiers_after_ours_go_with_deforming_ones_before(bar: Rig, kind: str) -> None:
    lattice_before(bar)
    bar.skin.modifiers.new("After", kind)
    update()
    bend(bar, 1.0)
    assert bar.settings.state == "LIVE", bar.settings.message
    assert close(bar)


def test_reordering_modifiers_after_deforming_ones_pause_with_a_reason(bar: Rig) -> None:
    lattice_before(bar)
    decimate = bar.skin.modifiers.new("Fewer", "DECIMATE")
    decimate.ratio = 0.3
    update()
    bend(bar, 1.0)
    assert bar.settings.state == "PAUSED" and "reorder" in bar.settings.message
    bar.skin.modifiers.remove(decimate)
    update()
    bend(bar, 0.5)
    assert bar.settings.state == "LIVE", bar.settings.message
    bend(bar, 0.6)
    assert close(bar)


def test_decimate_alone_after_ours_works(bar: Rig) -> None:
    bar.skin.modifiers.new("Fewer", "DECIMATE").ratio = 0.3
    update()
    bend(bar, 1.0)
    assert bar.settings.state == "LIVE", bar.settings.message
    assert len(shown(bar.skin)) < len(rest(bar.skin))


def test_a_modifier_that_adds_vertices_moved_before_ours_pauses_by_name(bar: Rig) -> None:
    modifier = bar.skin.modifiers.new("Double", "MIRROR")
    update()
    assert bar.settings.state == "LIVE"
    bar.skin.modifiers.move(len(bar.skin.modifiers) - 1, 0)
    update()
    assert bar.settings.state == "PAUSED" and modifier.name in bar.settings.message
    bar.skin.modifiers.move(0, len(bar.skin.modifiers) - 1)
    update()
    assert bar.settings.state == "LIVE"


def test_unbind_leaves_other_modifiers_where_they_were(bar: Rig) -> None:
    lattice_before(bar)
    bar.skin.modifiers.new("After", "SUBSURF")
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    assert [m.name for m in bar.skin.modifiers] == ["Squeeze", "Armature", "After"]
