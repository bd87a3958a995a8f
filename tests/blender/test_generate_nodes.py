"""Bending nodes of a generated cage: where they are, what keeps them, and how they are edited."""

from __future__ import annotations

from types import ModuleType

import bpy
import numpy as np
import pytest
from generating import (
    bones,
    press,
    sections,
)
from mathutils import Matrix
from scene import rest, select

from blend_fixtures.build import RigObjects


def test_given_nodes_are_where_they_were_asked_for(character: RigObjects, caging: ModuleType) -> None:
    nodes = [caging.OnBone("lower", 0.4), caging.OnBone("upper", 0.3)]
    told: list[str] = []
    options = caging.Options(symmetry=False)
    cage = caging.generate_cage(
        bpy.context, character.skins, character.armature, options, nodes=nodes, tell=told.append
    )
    assert len(cage.data.vertices) == 16
    assert bones(cage).count("lower") == bones(cage).count("upper") == 8
    middles = [rest(cage)[sections(cage) == k, 0].mean() for k in range(4)]
    assert sorted(middles) == middles or sorted(middles, reverse=True) == middles
    found = caging.open_character(bpy.context, character.armature, character.skins, options)
    at = [section.point[0] for section in caging.edit(found, options, nodes).sections if section.bending]
    assert sorted(at) == pytest.approx([-0.48, 0.24], abs=1e-3)
    assert "16 vertices in 4 cross sections" in told[0]


def test_nodes_persist_and_the_cage_is_updated_in_place(character: RigObjects, caging: ModuleType) -> None:
    nodes = [caging.OnBone("lower", 0.4), caging.OnBone("upper", 0.3)]
    cage = caging.generate_cage(bpy.context, character.skins, character.armature, nodes=nodes)
    mesh, before = cage.data, rest(cage)
    assert [(n.bone, pytest.approx(n.position, abs=1e-3)) for n in caging.nodes_of(cage)] == nodes
    cage.matrix_world = Matrix.Translation((3.0, 0.0, 0.0))
    select([cage], cage)  # skins and armature are known
    again = press()
    assert again == cage and cage.data == mesh
    assert np.abs(rest(cage) - before).max() < 1e-4
    assert tuple(cage.location) == (0.0, 0.0, 0.0)
    select([cage], cage)
    press(own_nodes=False, placement="JOINTS", triangles=True)
    assert caging.nodes_of(cage) is None
    assert cage.cage_rig_generated.placement == "JOINTS" and cage.cage_rig_generated.triangles
    assert len(bpy.data.meshes) == 1 + len(character.skins)


def test_nodes_are_saved_with_the_file(character: RigObjects, caging: ModuleType, tmp_path: object) -> None:
    cage = caging.generate_cage(
        bpy.context,
        character.skins,
        character.armature,
        caging.Options(corners=5),
        nodes=[caging.OnBone("lower", 0.5), caging.OnBone("upper", 0.5)],
    )
    name, count = cage.name, len(cage.data.vertices)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "cage.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "cage.blend"))
    cage = bpy.data.objects[name]
    assert caging.options_of(cage).corners == 5
    assert [node.bone for node in caging.nodes_of(cage)] == ["lower", "upper"]
    select([cage], cage)
    assert len(press().data.vertices) == count == 20


def test_sections_of_nodes_that_stay_are_kept(character: RigObjects, caging: ModuleType) -> None:
    found = caging.open_character(bpy.context, character.armature, character.skins, caging.Options())
    editing = caging.edit(found, caging.Options(), [caging.OnBone("lower", 0.5), caging.OnBone("upper", 0.5)])
    before = {section.point.tobytes(): section.corners for section in editing.sections}
    assert editing.add(found.course.find(caging.OnBone("upper", 0.1)))
    kept = [section for section in editing.sections if section.point.tobytes() in before]
    assert len(kept) >= len(before) - 1 and len(editing.sections) >= len(before) + 1
    assert all(np.array_equal(section.corners, before[section.point.tobytes()]) for section in kept)
    again = caging.open_character(bpy.context, character.armature, character.skins, caging.Options())
    assert again.generator is found.generator, "opened again, the same character has the sections it knows"


def test_nodes_are_edited_and_undone(character: RigObjects, caging: ModuleType) -> None:
    options = caging.Options()
    found = caging.open_character(bpy.context, character.armature, character.skins, options)
    editing = caging.edit(found, options, [caging.OnBone("lower", 0.5), caging.OnBone("upper", 0.5)])
    assert editing.add(found.course.find(caging.OnBone("lower", 0.25)))
    editing.drop()
    count = len(editing.places)
    assert count == 4, "the bar is symmetric: what is added has an image"
    editing.remove(0)
    assert len(editing.places) < count
    editing.undo()
    assert len(editing.places) == count
    editing.undo()
    assert len(editing.places) == 2
    editing.redo()
    assert len(editing.places) == count


def test_bones_that_a_cage_leaves_out_are_named(character: RigObjects, caging: ModuleType) -> None:
    found = caging.open_character(bpy.context, character.armature, character.skins, caging.Options())
    assert found.course.left_out([]) == []
    assert found.course.left_out([found.scene.graph.ends["upper"][1]]) == ["upper"]


def test_undo_knows_how_nodes_were_placed(character: RigObjects, caging: ModuleType) -> None:
    at_joints, by_itself = caging.Options(placement="JOINTS"), caging.Options()
    found = caging.open_character(bpy.context, character.armature, character.skins, at_joints)
    editing = caging.edit(found, at_joints, None)
    assert len(editing.places) == 1 and editing.nodes is None
    other = caging.open_character(bpy.context, character.armature, character.skins, by_itself)
    editing.replace(caging.source(other, by_itself))
    assert editing.placement == "AUTOMATIC" and len(editing.places) == 0
    editing.undo()
    assert editing.placement == "JOINTS" and len(editing.places) == 1 and editing.nodes is None


def test_the_redo_panel_makes_it_again_with_the_same_nodes(character: RigObjects, caging: ModuleType) -> None:
    nodes = [{"name": "lower", "position": 0.5}, {"name": "upper", "position": 0.5}]
    cage = press(own_nodes=True, nodes=nodes)
    assert [node.bone for node in caging.nodes_of(cage)] == ["lower", "upper"]
    assert len(cage.data.vertices) == 16
    select([*character.skins, character.armature], character.armature)
    again = press(own_nodes=True, nodes=nodes, corners=5)
    assert len(again.data.vertices) == 20


def test_a_click_means_what_is_seen_there(character: RigObjects, caging: ModuleType) -> None:
    options = caging.Options()
    found = caging.open_character(bpy.context, character.armature, character.skins, options)
    editing = caging.edit(found, options, [caging.OnBone("lower", 0.5), caging.OnBone("upper", 0.5)])
    flat = np.diag([400.0, 400.0, 1.0, 1.0])  # along z: a metre is 400 pixels
    node = found.course.point(editing.places[0])
    editing.point_at(flat, (400.0 * node[0] + 4.0, 400.0 * node[1]))
    assert editing.hovered == 0 and editing.offered is None
    editing.point_at(flat, (-200.0, 6.0))
    named = found.course.named(editing.offered)
    assert editing.hovered is None and named.bone == "lower" and named.position == pytest.approx(0.375, abs=0.02)
    editing.point_at(flat, (-200.0, 90.0))
    assert editing.hovered is None and editing.offered is None
