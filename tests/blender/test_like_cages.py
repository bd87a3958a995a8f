"""A cage like another one: the same faces around another level of detail, so that what is made for one fits both."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import bmesh
import bpy
import caged
import numpy as np
import pytest
from generating import state
from scene import select, update

from blend_fixtures import uncaged
from blend_fixtures.build import build_character
from blend_fixtures.doll import doll
from blend_fixtures.small import capsule

HUMANS = ("human_2k_53b", "human_24k_52b", "human_200k_53b")


@pytest.fixture
def caging(installed: None) -> ModuleType:
    import bl_ext.user_default.cage_rig.caging as caging

    return caging


def faces(cage: bpy.types.Object) -> list[tuple[int, ...]]:
    return [tuple(face.vertices) for face in cage.data.polygons]


def two_humans(template: str, other: str) -> tuple[uncaged.Uncaged, uncaged.Uncaged]:
    characters = uncaged.beside()
    if not set(HUMANS) <= set(characters):
        pytest.skip(f"the humans are not in {uncaged.FOLDER}")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=False)
    first = characters[template]()
    before = set(bpy.data.objects)
    characters[other]()
    new = [obj for obj in bpy.data.objects if obj not in before]
    skins = [obj for obj in new if any(mod.type == "ARMATURE" for mod in obj.modifiers)]
    return first, (skins, next(obj for obj in new if obj.type == "ARMATURE"))


def built(**how: object) -> uncaged.Uncaged:
    """A doll without a cage."""
    rig = build_character(doll(**how))
    mesh = rig.cage.data
    bpy.data.objects.remove(rig.cage)
    bpy.data.meshes.remove(mesh)
    return rig.skins, rig.armature


@pytest.fixture
def coarse() -> uncaged.Uncaged:
    return built()


@pytest.fixture
def fine() -> uncaged.Uncaged:
    """More than twice as many vertices, and bones in another order."""
    return built(cell=0.042, legs_first=True)


@pytest.fixture
def like(caging: ModuleType, coarse: uncaged.Uncaged) -> bpy.types.Object:
    return caging.generate_cage(bpy.context, *coarse)


def is_good(cage: bpy.types.Object, made: uncaged.Uncaged) -> None:
    found = caged.measure(cage, *made)
    assert not caged.faults(found, symmetric=True), found


def test_the_fine_doll_gets_the_faces_of_the_coarse_one(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged
) -> None:
    own = caging.generate_cage(bpy.context, *fine)
    assert faces(own) != faces(like), "or there is nothing to show"
    told: list[str] = []
    cage = caging.generate_cage(bpy.context, *fine, like=like, tell=told.append)
    assert faces(cage) == faces(like)
    assert f", with the faces of '{like.name}'" in told[0]
    assert sections(cage) == sections(like)
    assert [group.name for group in cage.vertex_groups] == [group.name for group in like.vertex_groups]
    is_good(cage, fine)


def sections(cage: bpy.types.Object) -> list[int]:
    return [item.value for item in cage.data.attributes["cage_rig_section"].data]


def test_the_button_makes_it_and_the_cage_remembers_it(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged
) -> None:
    caged.choose(*fine)
    assert bpy.ops.cage_rig.generate_cage(like=like.name) == {"FINISHED"}
    cage = bpy.context.object
    assert faces(cage) == faces(like)
    assert caging.like_of(cage) == like
    shape = points(cage)
    assert bpy.ops.cage_rig.generate_cage(clearance=0.004) == {"FINISHED"}, "it is selected, and made anew"
    assert bpy.context.object == cage
    assert faces(cage) == faces(like) and not np.array_equal(points(cage), shape)
    is_good(cage, fine)
    wanted, like.name = faces(like), "Renamed"
    assert caging.like_of(cage) == like, "it has the same faces"
    bpy.data.objects.remove(like)
    assert caging.like_of(cage) == cage
    for clearance in (0.002, 0.003):
        assert bpy.ops.cage_rig.generate_cage(clearance=clearance) == {"FINISHED"}
        assert faces(bpy.context.object) == wanted, "it still has them, without the other one"
    assert bpy.ops.cage_rig.generate_cage(like="", clearance=0.002) == {"FINISHED"}
    assert faces(bpy.context.object) != wanted and caging.like_of(bpy.context.object) is None, "its own again"


def test_an_appended_cage_leaves_the_other_character_behind(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged, tmp_path: Path
) -> None:
    cage = caging.generate_cage(bpy.context, *fine, like=like)
    name, wanted, count = cage.name, faces(cage), len(bpy.data.objects)
    nodes = caging.nodes_of(cage)
    path = str(tmp_path / "two.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.append(directory=f"{path}/Object/", filename=name)
    assert 0 < len(bpy.data.objects) == count // 2
    cage = bpy.data.objects[name]
    kept = cage.cage_rig_generated
    moved = [node._replace(position=node.position + 0.05) if "leg" in node.bone else node for node in nodes]
    skins = [item.object for item in kept.skins]
    assert caging.generate_cage(bpy.context, skins, kept.armature, nodes=moved, cage=cage) == cage
    assert faces(cage) == wanted


def test_a_cage_that_could_have_the_faces_of_another_one_says_so(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged
) -> None:
    told: list[str] = []
    cage = caging.generate_cage(bpy.context, *fine, tell=told.append)
    assert told[0].endswith(f". To give it the faces of '{like.name}', choose that cage in Like")
    scene = bpy.context.scene
    assert caging.suggested(scene, cage) == [like] and set(caging.cages(scene)) == {cage, like}
    alike = caging.generate_cage(bpy.context, *fine, like=like, tell=told.append)
    assert "choose that cage" not in told[1] and like not in caging.suggested(scene, alike)
    bar = build_character(capsule())
    bpy.data.objects.remove(bar.cage)
    caging.generate_cage(bpy.context, bar.skins, bar.armature, tell=told.append)
    assert "choose that cage" not in told[2], "of other bones"
    assert caging.suggested(scene, fine[0][0]) == []


def points(cage: bpy.types.Object) -> np.ndarray:
    found = np.empty(3 * len(cage.data.vertices), np.float32)
    cage.data.vertices.foreach_get("co", found)
    return found.reshape(-1, 3)


def test_nodes_to_be_edited_begin_where_the_other_cage_has_its_sections(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged
) -> None:
    skins, armature = fine
    opened = caging.open_character(bpy.context, armature, skins, caging.Options(), like)
    editing = caging.edit(opened, caging.Options(), None)
    assert len(editing.sections) == len(set(sections(like))) > len(editing.places) > 3
    cage = caging.generate_cage(bpy.context, *fine, like=like)
    assert caging.nodes_of(cage) == [node._replace(position=pytest.approx(node.position)) for node in editing.nodes]


def test_after_an_edit_of_its_nodes_it_still_is_like_the_other(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged
) -> None:
    cage = caging.generate_cage(bpy.context, *fine, like=like)
    nodes, before, named = caging.nodes_of(cage), points(cage), sections(cage)
    moved = [
        node._replace(position=node.position + 0.08) if node.bone.startswith("upper_leg") else node for node in nodes
    ]
    assert moved != nodes
    told: list[str] = []
    assert caging.generate_cage(bpy.context, *fine, nodes=moved, cage=cage, tell=told.append) == cage
    assert faces(cage) == faces(like) and sections(cage) == named
    assert "vertices are where they were" in told[0]
    kept = (np.abs(points(cage) - before).max(axis=1) == 0.0).mean()
    assert 0.3 < kept < 1.0
    is_good(cage, fine)
    like_groups = {group.name for group in like.vertex_groups}
    assert like_groups == {group.name for group in cage.vertex_groups}


def test_a_shape_key_and_its_action_serve_both_cages(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged, coarse: uncaged.Uncaged
) -> None:
    cage = caging.generate_cage(bpy.context, *fine, like=like)
    rigs = []
    for own, made in ((like, coarse), (cage, fine)):
        select([*made[0], made[1], own], own)
        assert bpy.ops.cage_rig.bind() == {"FINISHED"}
        update()
        assert own.cage_rig.state == "LIVE", own.cage_rig.message
        rigs.append((own, made[0][0]))
    rest = [evaluated(skin) for _, skin in rigs]
    # the doll's head is blown up on one cage, and the offsets are copied to the other, vertex by vertex
    head = like.vertex_groups["head"].index
    of_head = [any(group.group == head for group in vertex.groups) for vertex in like.data.vertices]
    assert any(of_head) and not all(of_head)
    shapes = [points(own).astype(float) for own, _ in rigs]
    offsets = np.where(np.array(of_head)[:, None], 0.5 * (shapes[0] - shapes[0][of_head].mean(axis=0)), 0.0)
    for (own, _), shape in zip(rigs, shapes, strict=True):
        own.shape_key_add(name="Basis")
        key = own.shape_key_add(name="Big Head")
        key.data.foreach_set("co", (shape + offsets).ravel().astype(np.float32))
    keys = like.data.shape_keys
    block = keys.key_blocks["Big Head"]
    for frame, value in ((1, 0.0), (10, 1.0)):
        block.value = value
        block.keyframe_insert("value", frame=frame)
    play_on(cage.data.shape_keys, keys)
    found = []
    for frame in (1, 10):
        bpy.context.scene.frame_set(frame)
        update()
        found.append([evaluated(skin) for _, skin in rigs])
    for k, (own, skin) in enumerate(rigs):
        assert own.cage_rig.state == "LIVE", own.cage_rig.message
        assert np.abs(found[0][k] - rest[k]).max() < 1e-5
        grown = np.linalg.norm(found[1][k] - rest[k], axis=1)
        assert grown[rest[k][:, 2] > 1.15].min() > 0.03, f"the head of '{skin.name}' grows"
        assert grown[rest[k][:, 2] < -0.4].max() < 0.003, f"the feet of '{skin.name}' stay"
    sizes = [np.ptp(points_[where[:, 2] > 0.95], axis=0) for points_, where in zip(found[1], rest, strict=True)]
    assert np.abs(sizes[0] - sizes[1]).max() < 0.1 * sizes[0].max(), "and both grow alike"


def play_on(target: bpy.types.Key, source: bpy.types.Key) -> None:
    """The same action."""
    animation = target.animation_data_create()
    animation.action = source.animation_data.action
    if hasattr(animation, "action_slot"):
        animation.action_slot = source.animation_data.action_slot


def evaluated(skin: bpy.types.Object) -> np.ndarray:
    mesh = skin.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    found = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", found)
    return found.reshape(-1, 3).astype(float)


def test_the_other_cage_may_stand_beside_the_character(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged, coarse: uncaged.Uncaged
) -> None:
    for obj in (like, coarse[1]):
        obj.location.x += 4.0
        obj.rotation_euler.z += 1.0
    update()
    cage = caging.generate_cage(bpy.context, *fine, like=like)
    assert faces(cage) == faces(like)
    is_good(cage, fine)


def test_what_can_t_be_is_refused_and_nothing_changes(
    caging: ModuleType, like: bpy.types.Object, coarse: uncaged.Uncaged
) -> None:
    rig = build_character(capsule())
    bar, other = (rig.skins, rig.armature), rig.cage
    before = state()

    def refused(made: uncaged.Uncaged, model: bpy.types.Object, **how: object) -> str:
        with pytest.raises(caging.GenerateError) as error:
            caging.generate_cage(bpy.context, *made, like=model, **how)
        assert state() == before
        return str(error.value)

    limbs = refused(bar, like)
    assert limbs.startswith(f"'Capsule' can't get a cage like '{like.name}' at its bone '")
    assert "nothing here is like the part of the other cage" in limbs and limbs.endswith("or clear Like")
    assert refused(coarse, other) == f"'{other.name}' is no cage that Generate Cage made; choose one for Like, or none"
    assert "is no cage" in refused(coarse, coarse[1])
    text = refused(coarse, like, options=caging.Options(corners=6))
    assert text == f"'{like.name}' has 4 corners in a cross section, not 6; set Corners to 4"
    assert "can't be like itself" in refused(coarse, like, cage=like)
    nodes = [caging.OnBone("lower_leg.L", 0.3)]
    text = refused(coarse, like, nodes=nodes)
    assert "cross sections from number" in text and "turn Keep My Nodes off" in text
    caged.choose(*coarse)
    before = state()
    with pytest.raises(RuntimeError, match="There is no object 'nobody' for Like"):
        bpy.ops.cage_rig.generate_cage(like="nobody")
    assert state() == before


def test_a_cage_with_other_vertices_is_refused(
    caging: ModuleType, like: bpy.types.Object, fine: uncaged.Uncaged
) -> None:
    edit = bmesh.new()
    edit.from_mesh(like.data)
    edit.verts.new((0.0, 0.0, 9.0))
    edit.to_mesh(like.data)
    edit.free()
    with pytest.raises(caging.GenerateError, match="has other vertices than Generate Cage gave it"):
        caging.generate_cage(bpy.context, *fine, like=like)


@pytest.mark.parametrize("placement", ["AUTOMATIC", "JOINTS"])
@pytest.mark.parametrize(("template", "other"), [(0, 1), (1, 0), (1, 2)])
def test_levels_of_detail_of_one_character_have_the_same_faces(
    caging: ModuleType, template: int, other: int, placement: str
) -> None:
    (skins, armature), (other_skins, other_armature) = two_humans(HUMANS[template], HUMANS[other])
    told: list[str] = []
    options = caging.Options(placement=placement)

    like = caging.generate_cage(bpy.context, skins, armature, options, tell=told.append)
    cage = caging.generate_cage(bpy.context, other_skins, other_armature, options, like=like, tell=told.append)
    assert faces(cage) == faces(like)
    found = caged.measure(cage, other_skins, other_armature)
    assert not caged.faults(found, symmetric=True), found
