"""Cages generated from a character and its bones: without a window, as scripts and the operator's buttons do."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import bmesh
import bpy
import numpy as np
from generating import (
    at_joints,
    bend,
    bones,
    encloses,
    in_world,
    press,
    sections,
    uncaged,
)
from mathutils import Matrix
from scene import Points, rest, select, update

from blend_fixtures.build import RigObjects, build_arm, build_character
from blend_fixtures.doll import doll
from blend_fixtures.small import capsule, part_of


def test_a_button_makes_a_cage_that_binds(character: RigObjects) -> None:
    bend(character.armature)
    cage = press()
    assert cage.display_type == "WIRE" and cage.hide_render
    assert cage.users_collection == character.skins[0].users_collection
    assert all(encloses(cage, skin) for skin in character.skins)
    assert {*bpy.context.selected_objects} == {cage, *character.skins, character.armature}
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    assert cage.cage_rig.state == "LIVE", cage.cage_rig.message
    assert cage.cage_rig.armature == character.armature
    import bl_ext.user_default.cage_rig.sync as sync

    assert sync.report(cage)["vertices_outside"] == 0


def test_vertices_remember_their_section_and_bone(character: RigObjects) -> None:
    cage = press()
    owners, names = sections(cage), bones(cage)
    assert np.bincount(owners).tolist() == [4] * (owners.max() + 1)
    x = rest(cage)[:, 0]
    for section in range(owners.max() + 1):
        own = owners == section
        assert np.ptp(x[own]) < 0.3
        assert {names[k] for k in np.flatnonzero(own)} == {"lower" if x[own].mean() < -0.1 else "upper"} or abs(
            x[own].mean()
        ) < 0.15


def test_quads_or_triangles(caging: ModuleType) -> None:
    character = build_character(doll())
    select([*character.skins, character.armature], character.armature)
    quads = press()
    assert sum(len(face.vertices) == 4 for face in quads.data.polygons) >= 10
    select([*character.skins, character.armature], character.armature)
    triangles = press(triangles=True)
    assert triangles != quads
    assert {len(face.vertices) for face in triangles.data.polygons} == {3}
    assert len(triangles.data.polygons) == 2 * len(triangles.data.vertices) - 4


def test_several_skins_get_one_cage(caging: ModuleType) -> None:
    whole = capsule()
    skin = whole.skins[0]
    right = skin.vertices[skin.faces].mean(axis=1)[:, 0] > 0.0
    halves = [part_of(skin, "Left", ~right), part_of(skin, "Right", right)]
    found = uncaged(build_character(replace(whole, skins=halves)))
    options = replace(at_joints(caging), hull=True)
    cage = caging.generate_cage(bpy.context, found.skins, found.armature, options)
    assert cage.name == f"{found.armature.name} Cage"
    assert all(encloses(cage, skin) for skin in found.skins)


def test_closed_parts_are_caged_by_their_common_hull(character: RigObjects, caging: ModuleType) -> None:
    skin = character.skins[0]
    work = bmesh.new()
    work.from_mesh(skin.data)
    bmesh.ops.create_icosphere(work, subdivisions=3, radius=0.3, matrix=Matrix.Translation((0.3, 0.0, 0.0)))
    work.to_mesh(skin.data)
    work.free()
    for vertex in skin.data.vertices:
        skin.vertex_groups["upper"].add([vertex.index], 0.5, "ADD")
    told: list[str] = []
    cage = caging.generate_cage(bpy.context, [skin], character.armature, at_joints(caging), tell=told.append)
    assert encloses(cage, skin)
    assert "The skins are 2 closed parts; their common hull was caged" in told[0]


def test_unapplied_transforms_do_not_matter(character: RigObjects) -> None:
    plain = press()
    places = in_world(plain)
    bpy.data.objects.remove(plain)
    turn = Matrix.Translation((1.0, -2.0, 0.5)) @ Matrix.Rotation(0.7, 4, "X") @ Matrix.Scale(3.0, 4)
    character.armature.matrix_world = turn
    update()
    select([*character.skins, character.armature], character.armature)
    cage = press()
    matrix = np.array(turn)
    assert np.abs(in_world(cage) - (places @ matrix[:3, :3].T + matrix[:3, 3])).max() < 1e-3
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}


def test_a_sheared_armature_gets_a_cage_in_its_place(character: RigObjects) -> None:
    holder = bpy.data.objects.new("Holder", None)
    bpy.context.scene.collection.objects.link(holder)
    holder.scale = (1.0, 3.0, 0.5)
    character.armature.parent = holder
    character.armature.rotation_euler = (0.4, 0.7, 0.3)
    update()
    cage = press()
    assert all(encloses(cage, skin) for skin in character.skins)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}


def test_shape_keys_of_a_skin_stay_out_of_it(character: RigObjects) -> None:
    skin = character.skins[0]
    before = rest(press())
    skin.shape_key_add(name="Basis")
    key = skin.shape_key_add(name="Wide", from_mix=False)
    key.points.foreach_set("co", (rest(skin) * 2.0).ravel())
    key.value = 1.0
    select([*character.skins, character.armature], character.armature)
    assert np.abs(rest(press()) - before).max() < 1e-5


def test_one_undo_step(character: RigObjects) -> None:
    names = {skin.name for skin in character.skins} | {character.armature.name}
    bpy.ops.ed.undo_push(message="Before")
    press()
    bpy.ops.ed.undo_push(message="Generate Cage")  # what a window does after an operator
    bpy.ops.ed.undo()
    assert {obj.name for obj in bpy.data.objects} == names
    bpy.ops.ed.redo()
    made = [obj for obj in bpy.data.objects if obj.name not in names]
    assert len(made) == 1 and made[0].cage_rig_generated.armature is not None


def test_unbind_keeps_how_the_cage_was_generated(character: RigObjects, caging: ModuleType) -> None:
    cage = caging.generate_cage(
        bpy.context,
        character.skins,
        character.armature,
        nodes=[caging.OnBone("lower", 0.5), caging.OnBone("upper", 0.5)],
    )
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    assert bpy.ops.cage_rig.unbind() == {"FINISHED"}
    assert [node.bone for node in caging.nodes_of(cage)] == ["lower", "upper"]


def test_made_up_tails_of_joints_are_not_believed(caging: ModuleType) -> None:
    heads = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 2], [1, 0, 2], [0, 0, 3], [0, 0, 4]])
    parents = np.array([-1, 0, 1, 2, 2, 4], np.int32)
    names = list("abcdef")

    def ways(tails: Points) -> dict[str, Points]:
        graph = caging.character.bone_graph(names, parents, heads, tails, list(range(6)))
        assert len(graph.edges) == len(graph.nodes) - 1, "a tree"
        return {name: graph.nodes[tail] - graph.nodes[head] for name, (head, tail) in graph.ends.items()}

    sideways = ways(heads + np.array([0, 5, 0]))
    assert np.array_equal(sideways["c"], [0, 0, 1]), "to the child that leads on straightest"
    assert np.allclose(sideways["f"], [0, 0, 0.6]), "the last one straight ahead"
    assert np.allclose(sideways["d"], [0.6, 0, 0])
    joined = ways(np.array([[0, 0, 1], [0, 0, 2], [0, 0, 2.5], [1, 0, 2.5], [0, 0, 4], [0, 0, 5]]))
    assert np.allclose(joined["c"], [0, 0, 0.5]), "tails that bones begin at stay"


def test_an_arm_with_fingers_is_caged(caging: ModuleType) -> None:
    found = uncaged(build_arm())
    cage = caging.generate_cage(bpy.context, found.skins, found.armature, at_joints(caging))
    assert all(encloses(cage, skin) for skin in found.skins)
    select([*found.skins, found.armature, cage], cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
