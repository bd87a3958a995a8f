"""Characters that get no cage, or one with a note: what is said, selected and left as it was."""

from __future__ import annotations

from types import ModuleType

import bmesh
import bpy
import numpy as np
from generating import (
    at_joints,
    encloses,
    press,
    refused,
    state,
)
from mathutils import Matrix, Vector
from scene import rest, select

from blend_fixtures.build import RigObjects


def opened(skin: bpy.types.Object) -> None:
    """Without its right end."""
    work = bmesh.new()
    work.from_mesh(skin.data)
    bmesh.ops.delete(work, geom=[v for v in work.verts if v.co.x > 0.9], context="VERTS")
    work.to_mesh(skin.data)
    work.free()


def test_an_open_skin_is_refused_with_its_holes_selected(character: RigObjects) -> None:
    skin = character.skins[0]
    opened(skin)
    before = state()
    message = refused()
    assert f"'{skin.name}' can't be caged: the skin is open at edge" in message
    assert "Cage Repaired Hull" in message
    assert state() == before
    chosen = np.array([vertex.select for vertex in skin.data.vertices])
    assert chosen.any() and rest(skin)[chosen][:, 0].min() > 0.8
    select([skin, character.armature], skin)
    cage = press(hull=True)
    assert encloses(cage, skin)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}


def test_a_fin_is_refused_with_its_place(character: RigObjects) -> None:
    skin = character.skins[0]
    work = bmesh.new()
    work.from_mesh(skin.data)
    work.edges.ensure_lookup_table()
    edge = max(work.edges, key=lambda edge: sum(v.co.z for v in edge.verts) - abs(edge.verts[0].co.x))
    tip = work.verts.new((edge.verts[0].co + edge.verts[1].co) / 2 + Vector((0.0, 0.0, 0.2)))
    work.faces.new((*edge.verts, tip))
    work.to_mesh(skin.data)
    work.free()
    skin.vertex_groups["upper"].add([len(skin.data.vertices) - 1], 1.0, "REPLACE")
    before = state()
    assert f"'{skin.name}' can't be caged" in refused()
    assert state() == before
    assert skin.data.vertices[-1].select


def test_an_inside_out_skin_is_turned_and_reported(character: RigObjects, caging: ModuleType) -> None:
    skin = character.skins[0]
    skin.data.flip_normals()
    told: list[str] = []
    cage = caging.generate_cage(bpy.context, character.skins, character.armature, at_joints(caging), tell=told.append)
    assert f"'{skin.name}' is inside out" in told[0]
    assert encloses(cage, skin)


def test_bones_outside_are_refused(character: RigObjects) -> None:
    skin = character.skins[0]
    skin.data.transform(Matrix.Translation((0.0, 30.0, 0.0)))
    before = state()
    message = refused()
    assert f"The bones of '{character.armature.name}' and '{skin.name}' don't fit" in message
    assert state() == before


def test_a_fault_at_a_bone_names_and_selects_it(character: RigObjects, caging: ModuleType) -> None:
    import bl_ext.user_default.cage_rig.generator as generator

    found = caging.open_character(bpy.context, character.armature, character.skins, caging.Options())
    node = int(found.scene.graph.ends["upper"][1])
    error = caging.explain(generator.Refusal("a bending node is needed there", node, np.zeros(3)), found)
    assert str(error) == f"At bone 'upper' of '{character.armature.name}': a bending node is needed there"
    error.show()
    assert character.armature.data.bones.active.name == "upper"


def test_a_bound_cage_is_refused(character: RigObjects) -> None:
    cage = press()
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    select([cage], cage)
    before = state()
    assert f"'{cage.name}' is bound; Unbind it" in refused()
    assert state() == before


def test_a_cage_with_shape_keys_is_refused(character: RigObjects) -> None:
    cage = press()
    cage.shape_key_add(name="Basis")
    cage.shape_key_add(name="Fat")
    select([cage], cage)
    assert f"'{cage.name}' has shape keys" in refused()


def test_selections_that_say_too_little(character: RigObjects) -> None:
    select([character.armature], character.armature)
    assert "Select the skin meshes that the cage is to enclose" in refused()
    skin = character.skins[0]
    skin.modifiers.clear()
    select([skin], skin)
    assert press().cage_rig_generated.armature is None, "without an armature it gets a skeleton of its own"
    other = character.armature.copy()
    bpy.context.scene.collection.objects.link(other)
    select([skin, character.armature, other], skin)
    assert "Select one armature with the skins; 2 are meant" in refused()


def test_what_bind_refuses_of_a_skin_is_refused_too(character: RigObjects) -> None:
    skin = character.skins[0]
    skin.vertex_groups.clear()
    before = state()
    assert f"'{skin.name}' has no weights" in refused()
    assert state() == before
