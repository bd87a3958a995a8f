"""Rig data that is damaged in a file: it opens paused, says what and what to do, loses nothing, and Rebind mends it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import Rig, bend, fat_key, native, rest, select, shown, unwatched, update

Damage = Callable[[Rig], None]


def reopened(rig: Rig, path: Path, damage: Damage) -> Rig:
    """The rig after it was damaged while nobody looked, saved, and opened again."""
    with unwatched():
        damage(rig)
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    objects = bpy.data.objects
    return Rig([objects["Bar"]], objects["BarRig"], objects["BarCage"])


def artists(rig: Rig) -> dict[str, object]:
    """What the artist made: whatever is damaged beside it, it must stay."""
    keys = rig.cage.data.shape_keys
    shapes = {block.name: [tuple(point.co) for point in block.points] for block in keys.key_blocks}
    groups = [[(group.group, group.weight) for group in vertex.groups] for vertex in rig.skin.data.vertices]
    bones = [(bone.name, tuple(bone.head_local), tuple(bone.tail_local)) for bone in rig.armature.data.bones]
    return {"skin": rest(rig.skin).tobytes(), "groups": groups, "shapes": shapes, "bones": bones}


def snapshot(rig: Rig) -> bpy.types.Mesh:
    return rig.settings.skins[0].snapshot


def values(mesh: bpy.types.Mesh, name: str, dtype: type) -> np.ndarray:
    found = np.empty(len(mesh.vertices), dtype)
    mesh.attributes[name].data.foreach_get("value", found)
    return found


def lose(name: str) -> Damage:
    return lambda rig: snapshot(rig).attributes.remove(snapshot(rig).attributes[name])


def lose_weights(rig: Rig) -> None:
    for name in [found.name for found in snapshot(rig).attributes if found.name.startswith(("joint_", "weight_"))]:
        lose(name)(rig)


def retype(kind: str, domain: str) -> Damage:
    def damage(rig: Rig) -> None:
        lose("joint_0")(rig)
        snapshot(rig).attributes.new("joint_0", kind, domain)

    return damage


def fill(name: str, value: float) -> Damage:
    def damage(rig: Rig) -> None:
        found = values(snapshot(rig), name, np.int32 if name.startswith("joint") else np.float32)
        found[5] = value
        snapshot(rig).attributes[name].data.foreach_set("value", found)

    return damage


def _nan_in_the_skin(rig: Rig) -> None:
    snapshot(rig).vertices[3].co.x = float("nan")


def _nan_in_the_cage(rig: Rig) -> None:
    rig.settings.snapshot.vertices[3].co.x = float("nan")


def _short_skin(rig: Rig) -> None:
    snapshot(rig).clear_geometry()
    snapshot(rig).from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])


def _short_cage(rig: Rig) -> None:
    rig.settings.snapshot.clear_geometry()


def _other_bind(rig: Rig) -> None:
    rig.settings.bind_id = "0" * 32


def _other_snapshot(rig: Rig) -> None:
    other = snapshot(rig).copy()
    other["cage_rig_bind"] = "1" * 32
    rig.settings.skins[0].snapshot = other


def _no_snapshot(rig: Rig) -> None:
    rig.settings.skins[0].snapshot = None


def _no_cage_snapshot(rig: Rig) -> None:
    rig.settings.snapshot = None


def _fewer_joints(rig: Rig) -> None:
    rig.settings.joints.remove(1)


def _no_joints(rig: Rig) -> None:
    rig.settings.joints.clear()


def _joint_cycle(rig: Rig) -> None:
    rig.settings.joints[0].parent = 1


def _far_parent(rig: Rig) -> None:
    rig.settings.joints[1].parent = 77


def _nan_joint(rig: Rig) -> None:
    rig.settings.joints[1].head = (0.0, float("nan"), 0.0)


def _no_place(rig: Rig) -> None:
    rig.settings.cage_to_rig = np.zeros((4, 4))


def _nan_place(rig: Rig) -> None:
    rig.settings.skins[0].skin_to_rig = np.full((4, 4), np.nan)


def _no_node_group(rig: Rig) -> None:
    bpy.data.node_groups.remove(rig.skin.modifiers["Cage Rig"].node_group)


def _posed_cage_is_an_empty(rig: Rig) -> None:
    empty = bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.cage_rig.part, empty.cage_rig.owner = "POSED_CAGE", rig.cage
    rig.settings.posed_cage = empty


def _half_of_the_coordinates(rig: Rig) -> None:
    kept(rig)
    rig.settings.skins[0].snapshot.attributes.remove(snapshot(rig).attributes["cage_coords.16"])


def _nan_in_the_coordinates(rig: Rig) -> None:
    kept(rig)
    block = np.full(16 * len(snapshot(rig).vertices), np.nan, np.float32)
    snapshot(rig).attributes["cage_coords.0"].data.foreach_set("value", block)


def kept(rig: Rig) -> None:
    """Let the file keep the rig's own coordinates, as if they had been loaded."""
    import bl_ext.user_default.cage_rig.exchange as exchange

    found = exchange.coordinates_of(rig.cage)
    exchange.use_coordinates(rig.cage, cage_coords=found.cage_coords, source="a test")


DAMAGES = {
    "weights lost": (lose_weights, "has lost its weights"),
    "first joints lost": (lose("joint_0"), "has lost its attribute 'joint_0'"),
    "first weights lost": (lose("weight_0"), "has lost its attribute 'weight_0'"),
    "joints as floats": (retype("FLOAT", "POINT"), "'joint_0' of 'Bar Bind' is of another kind"),
    "joints of faces": (retype("INT", "FACE"), "'joint_0' of 'Bar Bind' is of another kind"),
    "a joint that is not there": (fill("joint_0", 99), "vertex 5 has a weight for joint 99"),
    "a weight of NaN": (fill("weight_0", np.nan), "the weight of vertex 5 for joint"),
    "a negative weight": (fill("weight_0", -1.0), "the weight of vertex 5 for joint"),
    "NaN in the skin": (_nan_in_the_skin, "3"),
    "NaN in the cage": (_nan_in_the_cage, "3"),
    "a short skin": (_short_skin, "it had 3 when it was bound"),
    "a short cage": (_short_cage, "has other vertices or faces than when it was bound"),
    "another bind": (_other_bind, "is of another bind"),
    "another snapshot": (_other_snapshot, "is of another bind"),
    "no snapshot": (_no_snapshot, "What was bound of 'Bar' is lost"),
    "no snapshot of the cage": (_no_cage_snapshot, "What was bound of 'BarCage' is lost"),
    "fewer joints": (_fewer_joints, "joints"),
    "no joints": (_no_joints, "joint"),
    "a cycle of joints": (_joint_cycle, "is its own ancestor"),
    "a parent that is not there": (_far_parent, "has parent 77"),
    "a joint of NaN": (_nan_joint, "joints has a value that is not finite"),
    "no place of the cage": (_no_place, "the place of 'cage' is lost"),
    "NaN in the place of a skin": (_nan_place, "the place of 'Bar Bind' is lost"),
    "no node group": (_no_node_group, "The Cage Rig modifier of 'Bar' was removed"),
    "an empty as the posed cage": (_posed_cage_is_an_empty, "The posed cage of 'BarCage' was deleted"),
    "half of loaded coordinates": (_half_of_the_coordinates, "has lost its attribute 'cage_coords.16'"),
    "NaN in loaded coordinates": (_nan_in_the_coordinates, "not finite"),
}


@pytest.mark.parametrize(("damage", "reason"), DAMAGES.values(), ids=DAMAGES)
def test_what_is_damaged_opens_paused_and_rebind_mends_it(
    bar: Rig, tmp_path: Path, damage: Damage, reason: str
) -> None:
    bend(bar, 1.0)
    fat_key(bar, value=0.6)
    before, seen = artists(bar), shown(bar.skin).copy()
    rig = reopened(bar, tmp_path / "damaged.blend", damage)
    assert rig.settings.state == "PAUSED" and reason in rig.settings.message, rig.settings.message
    assert "Rebind" in rig.settings.message and rig.settings.fix == "rebind", rig.settings.message
    assert "please report" not in rig.settings.message
    assert artists(rig) == before
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-6 if "Cage Rig" in rig.skin.modifiers else True
    select([rig.cage], rig.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    update()
    assert rig.settings.state == "LIVE", rig.settings.message
    assert artists(rig) == before
    assert np.abs(shown(rig.skin) - seen).max() < 1e-4 * rig.size


def test_nan_in_the_rest_cage_pauses_by_name_and_goes_when_it_is_mended(bar: Rig, tmp_path: Path) -> None:
    def damage(rig: Rig) -> None:
        rig.cage.data.vertices[4].co.y = float("nan")

    place = bar.cage.data.vertices[4].co.y
    rig = reopened(bar, tmp_path / "damaged.blend", damage)
    assert rig.settings.state == "PAUSED" and "not finite or beyond 1e12 in row 4" in rig.settings.message
    rig.cage.data.vertices[4].co.y = place
    rig.cage.data.update()
    update()
    assert rig.settings.state == "LIVE", rig.settings.message


def test_a_node_group_without_its_inputs_is_made_whole(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    before = shown(bar.skin).copy()

    def damage(rig: Rig) -> None:
        interface = rig.skin.modifiers["Cage Rig"].node_group.interface
        for item in list(interface.items_tree):
            if item.name in ("Keep Input", "Feed"):
                interface.remove(item)

    rig = reopened(bar, tmp_path / "damaged.blend", damage)
    assert rig.settings.state == "LIVE", rig.settings.message
    assert np.abs(shown(rig.skin) - before).max() < 1e-6 and len(bpy.data.node_groups) == 1
