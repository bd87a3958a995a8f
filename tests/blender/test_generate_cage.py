"""Cages generated from a character and its bones: without a window, as scripts and the operator's buttons do."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree
from scene import Points, rest, select, update

from blend_fixtures.build import RigObjects, build_arm, build_character
from blend_fixtures.small import capsule, part_of

SECTION = "cage_rig_section"


@pytest.fixture
def caging(installed: None) -> ModuleType:
    import bl_ext.user_default.cage_rig.caging as caging

    return caging


def uncaged(rig: RigObjects) -> RigObjects:
    mesh = rig.cage.data
    bpy.data.objects.remove(rig.cage)
    bpy.data.meshes.remove(mesh)
    return RigObjects(rig.skins, rig.armature, None)


@pytest.fixture
def character() -> RigObjects:
    """A round bar without a cage, everything selected that Generate Cage needs."""
    found = uncaged(build_character(capsule()))
    select([*found.skins, found.armature], found.armature)
    return found


def press(**options: object) -> bpy.types.Object:
    options = options if "own_nodes" in options or is_caged() else {"placement": "JOINTS"} | options
    assert bpy.ops.cage_rig.generate_cage(**options) == {"FINISHED"}
    return bpy.context.object


def is_caged() -> bool:
    return any(obj.cage_rig_generated.skins for obj in bpy.context.selected_objects)


def refused(**options: object) -> str:
    with pytest.raises(RuntimeError) as error:
        bpy.ops.cage_rig.generate_cage(**options)
    return str(error.value)


def state() -> dict[str, object]:
    """All that a refusal must leave as it is."""
    kinds = ("objects", "meshes", "armatures", "collections", "node_groups", "images", "actions")
    meshes = {
        mesh.name: (rest_of(mesh).tobytes(), len(mesh.polygons), sorted(mesh.attributes.keys()))
        for mesh in bpy.data.meshes
    }
    objects = {
        obj.name: (tuple(map(tuple, obj.matrix_world)), obj.select_get(), obj.cage_rig_generated.own_nodes)
        for obj in bpy.data.objects
    }
    poses = {armature.name: armature.pose_position for armature in bpy.data.armatures}
    return {"counts": [len(getattr(bpy.data, kind)) for kind in kinds], **meshes, **objects, **poses}


def rest_of(mesh: bpy.types.Mesh) -> Points:
    points = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    return points


def sections(cage: bpy.types.Object) -> np.ndarray:
    found = np.empty(len(cage.data.vertices), np.int32)
    cage.data.attributes[SECTION].data.foreach_get("value", found)
    return found


def bones(cage: bpy.types.Object) -> list[str]:
    """The bone that each vertex belongs to."""
    names = [group.name for group in cage.vertex_groups]
    groups = [[(names[g.group], g.weight) for g in vertex.groups] for vertex in cage.data.vertices]
    assert all(len(found) == 1 and found[0][1] == 1.0 for found in groups)
    return [found[0][0] for found in groups]


def in_world(obj: bpy.types.Object) -> Points:
    matrix = np.array(obj.matrix_world)
    return rest(obj) @ matrix[:3, :3].T + matrix[:3, 3]


def encloses(cage: bpy.types.Object, skin: bpy.types.Object) -> bool:
    """Whether every vertex of a skin is inside: rays out of it cross the cage an odd number of times."""
    work = bmesh.new()
    work.from_mesh(cage.data)
    bmesh.ops.triangulate(work, faces=work.faces)
    work.transform(cage.matrix_world)
    tree = BVHTree.FromBMesh(work)
    work.free()

    way = Vector((0.31, 0.77, 0.56)).normalized()

    def crossings(start: Vector) -> int:
        count, found = 0, tree.ray_cast(start, way)
        while found[0] is not None:
            count += 1
            found = tree.ray_cast(found[0] + 1e-6 * way, way)
        return count

    return all(crossings(Vector(point)) % 2 for point in in_world(skin)[::5].tolist())


def at_joints(caging: ModuleType) -> object:
    return caging.Options(placement="JOINTS")


def bend(armature: bpy.types.Object, angle: float = 1.57) -> None:
    bone = armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler = (0.0, 0.0, angle)
    update()


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


def test_quads_or_triangles(character: RigObjects) -> None:
    quads = press()
    assert any(len(face.vertices) == 4 for face in quads.data.polygons)
    select([*character.skins, character.armature], character.armature)
    triangles = press(triangles=True)
    assert triangles != quads
    assert {len(face.vertices) for face in triangles.data.polygons} == {3}
    assert len(triangles.data.polygons) == 2 * len(triangles.data.vertices) - 4


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


# Refusals


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


def test_an_arm_with_fingers_is_caged(caging: ModuleType) -> None:
    found = uncaged(build_arm())
    cage = caging.generate_cage(bpy.context, found.skins, found.armature, at_joints(caging))
    assert all(encloses(cage, skin) for skin in found.skins)
    select([*found.skins, found.armature, cage], cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
