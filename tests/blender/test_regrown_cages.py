"""A generated cage whose bending nodes are edited: sections that the edit leaves alone stay as they are."""

from __future__ import annotations

from types import ModuleType

import bpy
import pytest
from mathutils import Vector
from scene import Points, rest, select

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.small import capsule

PLACES = (("lower", 0.2), ("lower", 0.7), ("upper", 0.2), ("upper", 0.7))


@pytest.fixture
def caging(installed: None) -> ModuleType:
    import bl_ext.user_default.cage_rig.caging as caging

    return caging


@pytest.fixture
def character() -> RigObjects:
    """A round bar without a cage."""
    found = build_character(capsule())
    bpy.data.meshes.remove(found.cage.data)
    select([*found.skins, found.armature], found.armature)
    return RigObjects(found.skins, found.armature, None)


@pytest.fixture
def cage(character: RigObjects, caging: ModuleType) -> bpy.types.Object:
    return caging.generate_cage(
        bpy.context, character.skins, character.armature, asymmetric(caging), nodes=on_bones(caging, PLACES)
    )


def asymmetric(caging: ModuleType, **more: object) -> object:
    return caging.Options(symmetry=False, **more)


def on_bones(caging: ModuleType, places: tuple[tuple[str, float], ...]) -> list[object]:
    return [caging.OnBone(*place) for place in places]


def again(
    character: RigObjects, caging: ModuleType, cage: bpy.types.Object, *, last: float = 0.85, **options: object
) -> str:
    """Generate it with the last node moved; what is told of it."""
    told: list[str] = []
    nodes = on_bones(caging, (*PLACES[:-1], ("upper", last)))
    options = asymmetric(caging, **options)
    skins, armature = character.skins, character.armature
    assert caging.generate_cage(bpy.context, skins, armature, options, nodes=nodes, cage=cage, tell=told.append) == cage
    return told[0]


def unmoved(cage: bpy.types.Object, before: Points) -> int:
    return int((rest(cage) == before).all(1).sum())


def test_sections_far_from_a_moved_node_stay(character: RigObjects, caging: ModuleType, cage: bpy.types.Object) -> None:
    before = rest(cage)
    told = again(character, caging, cage)
    assert "12 vertices are where they were" in told
    assert unmoved(cage, before) == 12 and (rest(cage)[:12] == before[:12]).all()
    assert caging.nodes_of(cage)[-1].position == pytest.approx(0.85, abs=1e-3)


def test_edits_follow_each_other(character: RigObjects, caging: ModuleType, cage: bpy.types.Object) -> None:
    first = rest(cage)
    for last in (0.85, 0.6, 0.75):
        again(character, caging, cage, last=last)
        assert (rest(cage)[:12] == first[:12]).all()


def test_what_the_artist_has_moved_stays(character: RigObjects, caging: ModuleType, cage: bpy.types.Object) -> None:
    center = rest(cage)[:4].mean(0)
    for vertex in cage.data.vertices[:4]:
        vertex.co += 0.3 * (vertex.co - Vector(center))
    before = rest(cage)
    again(character, caging, cage)
    assert (rest(cage)[:4] == before[:4]).all()


def test_a_file_that_is_opened_again_knows_its_cage(
    character: RigObjects, caging: ModuleType, cage: bpy.types.Object, tmp_path: object
) -> None:
    names = [obj.name for obj in (cage, character.armature, *character.skins)]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "cage.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "cage.blend"))
    cage, armature, *skins = (bpy.data.objects[name] for name in names)
    before = rest(cage)
    again(RigObjects(skins, armature, None), caging, cage)
    assert unmoved(cage, before) == 12


def test_a_cage_in_another_place_is_grown_anew(
    character: RigObjects, caging: ModuleType, cage: bpy.types.Object
) -> None:
    cage.location.x += 100.0
    bpy.context.view_layer.update()
    assert "where they were" not in again(character, caging, cage)
    assert tuple(cage.location) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("change", ["options", "skin", "vertices", "nothing"])
def test_more_than_nodes_changed_makes_it_anew(
    character: RigObjects, caging: ModuleType, cage: bpy.types.Object, change: str
) -> None:
    options: dict[str, object] = {}
    match change:
        case "options":
            options["clearance"] = 0.01
        case "skin":
            for vertex in character.skins[0].data.vertices:
                vertex.co *= 0.97
        case "vertices":
            select([cage], cage)
            bpy.ops.object.mode_set(mode="EDIT")
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.mesh.subdivide()
            bpy.ops.object.mode_set(mode="OBJECT")
        case "nothing":
            options["last"] = PLACES[-1][1]
    assert "where they were" not in again(character, caging, cage, **options)
    assert len(cage.data.vertices) == 24
