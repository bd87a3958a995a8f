"""Rough cages made to fit: without a window, as scripts and the operator's buttons do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bmesh
import bpy
import caged
import exact
import numpy as np
import pytest
from generating import bend, press, state, uncaged
from mathutils import Matrix
from rough import box, decimated
from scene import enter_edit_mode, leave_edit_mode, rest, select, set_mesh, shown, update

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.doll import doll


def around(character: RigObjects) -> bpy.types.Object:
    """A box that the bar sticks out of, selected with all that is needed."""
    made = box((-0.9, -0.2, -0.2), (0.9, 0.2, 0.2))
    select([*character.skins, character.armature, made], made)
    return made


def fit(**options: object) -> bpy.types.Object:
    assert bpy.ops.cage_rig.fit_cage(**options) == {"FINISHED"}
    return bpy.context.object


def refused(**options: object) -> str:
    """Nothing but the selection of vertices has changed."""
    before = state()
    with pytest.raises(RuntimeError) as error:
        bpy.ops.cage_rig.fit_cage(**options)
    assert state() == before
    return str(error.value)


def measure(cage: bpy.types.Object, character: RigObjects) -> dict[str, float]:
    """How often cage and skin cross themselves or one another, and the skin's vertices outside, in rig space."""
    space = character.armature or character.skins[0]
    skin, faces = caged.skin_of(character.skins, character.armature)
    points, triangles = caged.inside_of(np.array(space.matrix_world), cage)
    winding = exact.winding(skin[:: len(skin) // 500 + 1], points, triangles)
    return {
        "meeting": len(exact.meeting(points, triangles, skin, faces)),
        "self": len(exact.self_meeting(points, triangles)),
        "outside": int((np.abs(np.abs(winding) - 1) > 1e-6).sum()),
    }


GOOD = {"meeting": 0, "self": 0, "outside": 0}


def all_but_places(obj: bpy.types.Object) -> dict[str, object]:
    mesh = obj.data
    uv = [tuple(item.uv) for layer in mesh.uv_layers for item in layer.data]
    return {
        "faces": [tuple(face.vertices) for face in mesh.polygons],
        "materials": [face.material_index for face in mesh.polygons],
        "uv": uv,
        "groups": [[(group.group, group.weight) for group in vertex.groups] for vertex in mesh.vertices],
        "attributes": sorted(mesh.attributes.keys()),
        "marks": [item.value for item in mesh.attributes["mark"].data] if "mark" in mesh.attributes else None,
        "matrix": [tuple(row) for row in obj.matrix_world],
        "parts": (mesh.name, [modifier.name for modifier in obj.modifiers], obj.parent),
    }


def test_a_decimated_copy_is_fitted_and_binds(character: RigObjects) -> None:
    skin = character.skins[0]
    cage = decimated(skin, 80)
    cage.data.uv_layers.new()
    cage.data.attributes.new("mark", "INT", "POINT").data.foreach_set("value", range(len(cage.data.vertices)))
    select([skin, character.armature, cage], cage)
    assert measure(cage, character)["meeting"], "or there is nothing to do"
    before, untouched, start = all_but_places(cage), state(), rest(cage)
    assert fit() == cage
    assert measure(cage, character) == GOOD
    assert not np.array_equal(rest(cage), start)
    assert all_but_places(cage) == before
    after = state()
    changed = {name for name in after if after[name] != untouched[name]}
    assert changed == {cage.data.name}
    assert {*bpy.context.selected_objects} == {cage, skin, character.armature}
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    assert cage.cage_rig.state == "LIVE", cage.cage_rig.message
    import bl_ext.user_default.cage_rig.sync as sync

    assert sync.report(cage)["vertices_outside"] == 0
    posed = cage.cage_rig.posed_cage
    still = shown(posed)
    character.armature.data.pose_position = "POSE"
    bend(character.armature)
    assert np.abs(shown(posed) - still).max() > 0.3


def test_the_mesh_without_weights_is_the_cage(character: RigObjects) -> None:
    cage = around(character)
    bpy.context.view_layer.objects.active = character.skins[0]
    assert measure(cage, character)["outside"]
    assert fit() == cage
    assert measure(cage, character) == GOOD
    assert {len(face.vertices) for face in cage.data.polygons} == {4}
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}, "it is what encloses the others now"
    assert cage.cage_rig.state == "LIVE", cage.cage_rig.message


def test_options_are_those_of_generate_cage(character: RigObjects) -> None:
    fitting, generating = (
        getattr(bpy.ops.cage_rig, name).get_rna_type().properties for name in ("fit_cage", "generate_cage")
    )
    for name in ("clearance", "tightness", "symmetry", "hull"):
        assert fitting[name].default == generating[name].default and fitting[name].name == generating[name].name
    cage = around(character)
    start = rest(cage)
    close = rest(fit())
    set_mesh(cage, start)
    assert np.ptp(rest(fit(clearance=0.02)), axis=0)[1] > np.ptp(close, axis=0)[1] + 0.02
    set_mesh(cage, start)
    assert np.abs(rest(fit(tightness=0.0)) - close).max() > 1e-3


def test_one_undo_step(character: RigObjects) -> None:
    cage = around(character)
    start, name = rest(cage), cage.name
    bpy.ops.ed.undo_push(message="Before")
    fitted = rest(fit())
    bpy.ops.ed.undo_push(message="Fit Cage")  # what a window does after an operator
    bpy.ops.ed.undo()
    assert np.array_equal(rest(bpy.data.objects[name]), start)
    bpy.ops.ed.redo()
    assert np.array_equal(rest(bpy.data.objects[name]), fitted)


def test_unapplied_transforms_do_not_matter(character: RigObjects) -> None:
    cage, armature = around(character), character.armature
    start = rest(cage)
    fit()
    wanted = caged.inside_of(np.array(armature.matrix_world), cage)[0]
    turn = Matrix.Translation((1.0, -2.0, 0.5)) @ Matrix.Rotation(0.7, 4, "X") @ Matrix.Scale(3.0, 4)
    own = Matrix.Translation((0.1, 0.2, -0.3)) @ Matrix.Rotation(1.1, 4, "Y") @ Matrix.Diagonal((2.0, 0.7, -1.5, 1.0))
    set_mesh(cage, start)
    cage.data.transform(own.inverted())
    cage.parent, cage.matrix_basis = armature, own
    armature.matrix_world = turn
    update()
    bend(armature)
    before = [tuple(row) for row in cage.matrix_basis]
    fit()
    assert measure(cage, character) == GOOD
    assert np.abs(caged.inside_of(np.array(armature.matrix_world), cage)[0] - wanted).max() < 0.03
    assert [tuple(row) for row in cage.matrix_basis] == before


def test_a_cage_that_hangs_on_a_bone_is_fitted_at_rest(character: RigObjects) -> None:
    cage, armature = around(character), character.armature
    place = cage.matrix_world.copy()
    cage.parent, cage.parent_type, cage.parent_bone = armature, "BONE", "upper"
    update()
    cage.matrix_world = place
    update()
    armature.data.pose_position = "POSE"
    bend(armature)
    fit()
    assert armature.data.pose_position == "POSE"
    assert measure(cage, character) == GOOD, "which looks at rest"


def test_a_skin_without_bones_has_a_skeleton_of_its_own(character: RigObjects) -> None:
    skin = character.skins[0]
    skin.modifiers.clear()
    skin.vertex_groups.clear()
    skin.parent = None
    skin.location = (0.0, 0.0, 2.0)
    cage = around(character)
    cage.location = (0.0, 0.0, 2.0)
    update()
    select([skin, cage], cage)
    fit()
    assert measure(cage, RigObjects([skin], None, None)) == GOOD
    assert {*bpy.context.selected_objects} == {cage, skin}


def test_a_generated_cage_goes_on_as_one(caging: ModuleType) -> None:
    found = uncaged(build_character(doll()))
    select([*found.skins, found.armature], found.armature)
    cage = press(clearance=0.002)
    nodes, kept = caging.nodes_of(cage), all_but_places(cage)
    options = caging.options_of(cage)
    middle = rest(cage).mean(axis=0)
    set_mesh(cage, middle + (rest(cage) - middle) * np.random.default_rng(3).uniform(0.93, 1.05, (len(rest(cage)), 1)))
    assert measure(cage, found)["meeting"]
    select([cage], cage)
    assert fit() == cage
    assert measure(cage, found) == GOOD
    assert bpy.context.window_manager is not None and caging.options_of(cage) == options
    assert caging.nodes_of(cage) == nodes and all_but_places(cage) == kept
    assert {*bpy.context.selected_objects} == {cage, *found.skins, found.armature}
    fitted = rest(cage)
    course = caging.open_character(bpy.context, found.armature, found.skins, options).course
    editing = caging.edit(caging.open_character(bpy.context, found.armature, found.skins, options), options, nodes)
    own = [course.named(place) for place in editing.places]
    moved = [node._replace(position=node.position + 0.1) if node.bone == "upper_leg.L" else node for node in own]
    told: list[str] = []
    caging.generate_cage(bpy.context, found.skins, found.armature, nodes=moved, cage=cage, tell=told.append)
    assert "vertices are where they were" in told[0]
    same = (np.abs(rest(cage)[: len(fitted)] - fitted[: len(rest(cage))]).max(axis=1) == 0.0).mean()
    assert same > 0.3


def test_several_skins_are_enclosed_by_their_common_hull(character: RigObjects, caging: ModuleType) -> None:
    first, cage = character.skins[0], around(character)
    select([first], first)
    bpy.ops.object.duplicate()
    second = bpy.context.object
    second.scale, second.location = (0.5, 1.3, 1.3), (0.0, 0.0, 0.0)
    update()
    both = RigObjects([first, second], character.armature, None)
    told: list[str] = []
    caging.fit_cage(bpy.context, cage, both.skins, both.armature, tell=told.append)
    assert told[0].endswith(". The skins are 2 closed parts; their common hull was caged")
    assert measure(cage, both) == GOOD


def test_limbs_that_it_leaves_out_are_named(caging: ModuleType) -> None:
    found = uncaged(build_character(doll()))
    cage = box((-0.3, -0.25, -0.95), (0.3, 0.25, 1.1), 4)
    told: list[str] = []
    caging.fit_cage(bpy.context, cage, found.skins, found.armature, tell=told.append)
    assert told[0].startswith("'Rough' was fitted: 152 vertices, 150 faces, 1.")
    assert told[0].endswith(
        ". It had no faces around these bones and was stretched over them: 'lower_arm.L', 'lower_arm.R'"
    )
    assert measure(cage, found) == GOOD


def test_scripts_watch_and_cancel(character: RigObjects, caging: ModuleType) -> None:
    cage = around(character)
    before = state()
    with pytest.raises(caging.Cancelled):
        caging.fit_cage(bpy.context, cage, character.skins, character.armature, watch=lambda job: job.cancel())
    assert state() == before


def test_what_was_changed_meanwhile_is_not_written_over(character: RigObjects, caging: ModuleType) -> None:
    cage = around(character)
    begun = [caging.Fitting(bpy.context, cage, character.skins, character.armature, caging.Options()) for _ in range(3)]
    assert begun[0].finish(bpy.context, later=True) == cage
    moved = rest(cage)
    with pytest.raises(caging.GenerateError, match="were changed while it was fitted"):
        begun[1].finish(bpy.context, later=True)
    assert np.array_equal(rest(cage), moved)
    bpy.data.objects.remove(cage)
    with pytest.raises(caging.GenerateError, match="'Rough', its armature or its skins were changed"):
        begun[2].finish(bpy.context, later=True)


def chosen(obj: bpy.types.Object) -> np.ndarray:
    return np.array([vertex.select for vertex in obj.data.vertices])


def reshape(obj: bpy.types.Object, act: Callable[[bmesh.types.BMesh], object]) -> None:
    work = bmesh.new()
    work.from_mesh(obj.data)
    work.verts.ensure_lookup_table()
    work.faces.ensure_lookup_table()
    act(work)
    work.to_mesh(obj.data)
    work.free()


def test_an_open_cage_is_refused_with_its_hole(character: RigObjects) -> None:
    cage = around(character)
    hole = [vertex.index for vertex in cage.data.vertices if vertex.co.x > 0.89]
    reshape(
        cage, lambda work: bmesh.ops.delete(work, geom=[f for f in work.faces if f.normal.x > 0.9], context="FACES")
    )
    message = refused()
    assert "'Rough' can't be fitted: the cage is open: edge" in message
    assert chosen(cage).any() and rest(cage)[chosen(cage)][:, 0].min() > 0.89 and chosen(cage).sum() < len(hole)


def test_a_fin_and_a_flipped_face_are_refused(character: RigObjects) -> None:
    cage = around(character)
    start = cage.data.copy()

    def fin(work: bmesh.types.BMesh) -> None:
        edge = next(iter(work.edges))
        work.faces.new((*edge.verts, work.verts.new((0.0, 0.0, 2.0))))

    reshape(cage, fin)
    assert "'Rough' can't be fitted: the cage is not manifold" in refused() or "open" in refused()
    assert chosen(cage)[-1]
    cage.data = start
    start.polygons[7].flip()
    assert "'Rough' can't be fitted: cage face 7 is flipped" in refused()
    assert set(np.flatnonzero(chosen(cage))) == set(start.polygons[7].vertices)


def test_a_cage_that_crosses_itself_is_refused_with_the_place(character: RigObjects) -> None:
    cage = around(character)
    points = rest(cage)
    points[:, 0] = np.where(points[:, 0] > 0.8, -0.5, points[:, 0])
    set_mesh(cage, points)
    message = refused()
    assert "'Rough' crosses itself at vertex" in message and "pull its faces apart there" in message
    assert chosen(cage).sum() == 1


def test_a_cage_somewhere_else_is_refused_at_a_bone(character: RigObjects) -> None:
    cage = around(character)
    cage.location.y = 5.0
    update()
    character.armature.data.bones.active = None
    message = refused()
    assert f"At bone '{character.armature.data.bones.active.name}' of '{character.armature.name}': " in message
    assert "'Rough' leaves out the middle of the skin" in message and "bring its faces around it" in message
    assert 0 < chosen(cage).sum() < len(rest(cage))


def test_damaged_numbers_are_refused(character: RigObjects) -> None:
    cage = around(character)
    points = rest(cage)
    points[3, 1] = np.nan
    set_mesh(cage, points)
    with pytest.raises(RuntimeError, match=r"'Rough' can't be fitted: .*finite"):
        bpy.ops.cage_rig.fit_cage()
    points[3] = points[2]
    set_mesh(cage, points)
    assert "'Rough' can't be fitted: cage vertices 2 and 3 are at the same place" in refused()
    assert np.flatnonzero(chosen(cage)).tolist() == [2, 3]


def test_an_open_skin_is_refused_or_repaired(character: RigObjects) -> None:
    skin, cage = character.skins[0], around(character)
    reshape(
        skin,
        lambda work: bmesh.ops.delete(work, geom=[v for v in work.verts if v.co.x > 0.9], context="VERTS"),
    )
    message = refused()
    assert f"'{skin.name}' can't be caged: the skin is open at edge" in message
    assert "Cage Repaired Hull" in message and chosen(skin).any()
    assert fit(hull=True) == cage
    assert measure(cage, character) == GOOD


def test_faces_of_many_corners_are_refused(character: RigObjects) -> None:
    cage = around(character)
    reshape(cage, lambda work: bmesh.ops.dissolve_edges(work, edges=[next(e for e in work.edges if e.is_contiguous)]))
    large = [face for face in cage.data.polygons if len(face.vertices) > 4]
    assert large
    assert "'Rough' has faces of more than four corners" in refused()
    assert set(np.flatnonzero(chosen(cage))) == set(large[0].vertices)


def bound(cage: bpy.types.Object) -> None:
    fit()
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    select([*cage.cage_rig.armature.children, cage.cage_rig.armature, cage], cage)


def keyed(cage: bpy.types.Object) -> None:
    cage.shape_key_add(name="Basis")
    cage.shape_key_add(name="Fat")


def mirrored(cage: bpy.types.Object) -> None:
    cage.modifiers.new("Mirror", "MIRROR")


def shared(cage: bpy.types.Object) -> None:
    bpy.data.objects.new("Other", cage.data)


def fine(cage: bpy.types.Object) -> None:
    reshape(cage, lambda work: bmesh.ops.subdivide_edges(work, edges=work.edges, cuts=8, use_grid_fill=True))


def flat(cage: bpy.types.Object) -> None:
    cage.scale.z = 0.0
    update()


@pytest.mark.parametrize(
    ("act", "wanted"),
    [
        (bound, "'Rough' is bound; Unbind it, fit it, and bind it again"),
        (keyed, "'Rough' has shape keys, which hold the places of its vertices; remove them first"),
        (mirrored, "Modifier 'Mirror' of 'Rough' gives it another shape; apply it or hide it, then fit"),
        (shared, "The mesh of 'Rough' is shared with another object; make it single-user first"),
        (fine, "'Rough' has more vertices than the skins that it is to enclose; make the rough cage the active object"),
        (flat, "'Rough' is scaled to nothing along an axis; give it a scale"),
    ],
)
def test_cages_that_can_t_be_moved_are_refused(
    character: RigObjects, act: Callable[[bpy.types.Object], None], wanted: str
) -> None:
    act(around(character))
    assert wanted in refused()


def test_modifiers_that_keep_the_shape_are_none_of_its_business(character: RigObjects) -> None:
    cage = around(character)
    cage.modifiers.new("Hidden", "SUBSURF").show_viewport = False
    cage.modifiers.new("Normals", "WEIGHTED_NORMAL")
    assert fit() == cage
    assert [modifier.name for modifier in cage.modifiers] == ["Hidden", "Normals"]


def test_a_linked_cage_is_refused(character: RigObjects, caging: ModuleType, tmp_path: Path) -> None:
    cage = around(character)
    path = str(tmp_path / "cage.blend")
    bpy.data.libraries.write(path, {cage})
    bpy.data.objects.remove(cage)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Rough"]
    linked = wanted.objects[0]
    bpy.context.scene.collection.objects.link(linked)
    select([*character.skins, character.armature, linked], character.armature)
    assert "'Rough' is linked from another file; fit it in its own file" in refused()
    override = linked.override_create(remap_local_usages=True)
    select([*character.skins, character.armature, override], character.armature)
    assert "'Rough' is linked from another file; fit it in its own file" in refused()


def test_selections_that_say_too_little(character: RigObjects) -> None:
    cage, skin, armature = around(character), character.skins[0], character.armature
    asked = "Select the skin meshes and a rough cage around them, and make the cage the active object"
    for objects, active in (
        ([armature], armature),
        ([skin, armature], armature),
        ([cage, armature], cage),
        ([], None),
    ):
        select(objects, active)
        assert asked in refused()
    second = box((-1.0, -0.5, -0.5), (1.0, 0.5, 0.5))
    select([skin, armature, cage, second], armature)
    assert asked in refused(), "either may be meant"
    other = armature.copy()
    bpy.context.scene.collection.objects.link(other)
    select([skin, armature, other, cage], cage)
    assert "Select one armature with the skins; 2 are meant" in refused()
    select([skin, armature], armature)
    generated = press()
    select([skin, armature, cage, generated], cage)
    assert f"'Rough' and '{generated.name}' are cages; select one of them" in refused()


def test_in_edit_mode_it_waits(character: RigObjects) -> None:
    cage = around(character)
    enter_edit_mode(cage)
    assert not bpy.ops.cage_rig.fit_cage.poll()
    leave_edit_mode()
    select([*character.skins, character.armature, cage], cage)
    assert bpy.ops.cage_rig.fit_cage.poll()
