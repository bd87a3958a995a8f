"""Rigs that another version has bound, in this file and in a library: brought up to date, or refused as a whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import Rig, bend, fat_key, native, select, shown, unwatched, update
from test_damaged import artists, reopened, snapshot
from test_linked import as_rig, library, library_of, link, override, rigs

CURRENT = 2
NAMES = ("Bar", "BarRig", "BarCage")
Write = Callable[[Rig], None]


def first_build(rig: Rig) -> None:
    """What the first builds wrote: three inputs, a constraint for a driver, no memory, snapshots without a name."""
    skin, settings = rig.skin, rig.settings
    inputs = {"Attribute": "String", "Rest Cage": "Object", "Posed Cage": "Object"}
    ours = skin.modifiers["Cage Rig"]
    whole, old = ours.node_group, bpy.data.node_groups.new("Cage Rig", "GeometryNodeTree")
    old["cage_rig"] = True
    old.is_modifier = True
    for way in ("OUTPUT", "INPUT"):
        old.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    for name, kind in inputs.items():
        old.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{kind}")
    given, named = old.nodes.new("NodeGroupInput"), old.nodes.new("GeometryNodeInputNamedAttribute")
    place, out = old.nodes.new("GeometryNodeSetPosition"), old.nodes.new("NodeGroupOutput")
    named.data_type = "FLOAT_VECTOR"
    for source, target in (
        (given.outputs["Geometry"], place.inputs["Geometry"]),
        (given.outputs["Attribute"], named.inputs["Name"]),
        (next(found for found in named.outputs if found.enabled), place.inputs["Position"]),
        (place.outputs["Geometry"], out.inputs["Geometry"]),
    ):
        old.links.new(source, target)
    import bl_ext.user_default.cage_rig.adapters.modifier as modifier

    ours.node_group = old
    ours.show_in_editmode = True
    modifier.set_inputs(ours, {"Attribute": "cage_rig.posed", "Rest Cage": rig.cage, "Posed Cage": settings.posed_cage})
    bpy.data.node_groups.remove(whole)
    posed = settings.posed_cage
    for name in ("cage_rig.rest", "cage_rig.posed"):
        posed.data.attributes.remove(posed.data.attributes[name])
    posed.driver_remove("delta_location", 0)
    follow = posed.constraints.new("ARMATURE")
    follow.influence = 0.0
    for mesh in (settings.snapshot, snapshot(rig)):
        del mesh["cage_rig_bind"]
    settings.version = 1


@pytest.mark.parametrize("version", [0, 1])
def test_a_rig_of_the_first_builds_is_live_and_brought_up_to_date(bar: Rig, tmp_path: Path, version: int) -> None:
    bend(bar, 1.0)
    fat_key(bar, value=0.6)
    before, seen = artists(bar), shown(bar.skin).copy()

    def damage(rig: Rig) -> None:
        first_build(rig)
        rig.settings.version = version

    rig = reopened(bar, tmp_path / "old.blend", damage)
    assert rig.settings.state == "LIVE" and rig.settings.version == CURRENT, rig.settings.message
    assert artists(rig) == before and np.abs(shown(rig.skin) - seen).max() < 1e-6
    group = rig.skin.modifiers["Cage Rig"].node_group
    assert list(bpy.data.node_groups) == [group] and "Use Feed" in [item.name for item in group.interface.items_tree]
    assert not rig.posed.constraints and len(rig.posed.animation_data.drivers) == 1
    assert {"cage_rig.rest", "cage_rig.posed"} <= set(rig.posed.data.attributes.keys())
    assert snapshot(rig)["cage_rig_bind"] == rig.settings.bind_id
    bend(rig, 0.3)
    rig.armature.hide_set(True)
    update()
    assert np.abs(shown(rig.skin) - seen).max() > 0.1
    wanted = shown(rig.skin).copy()
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert np.abs(shown(bpy.data.objects["Bar"]) - wanted).max() < 1e-6
    assert bpy.data.objects["BarCage"].cage_rig.state == "LIVE"


def build_a_newer_one(rig: Rig) -> None:
    """What a version to come may write: a form of which this one knows nothing, with other inputs of the modifier."""
    interface = rig.skin.modifiers["Cage Rig"].node_group.interface
    interface.remove(next(item for item in interface.items_tree if item.name == "Keep Input"))
    interface.new_socket("Novelty", in_out="INPUT", socket_type="NodeSocketFloat")
    for name in ("cage_rig.rest", "cage_rig.posed"):
        rig.posed.data.attributes.remove(rig.posed.data.attributes[name])
    rig.settings.version = CURRENT + 1


def form() -> dict[str, object]:
    """All that bringing a rig up to date, or making it of this file, would change."""
    found: dict[str, object] = {}
    for kind in ("objects", "meshes", "node_groups", "actions", "armatures"):
        found[kind] = sorted((item.name, item.library is None) for item in getattr(bpy.data, kind))
    for obj in bpy.data.objects:
        entry: dict[str, object] = {"version": obj.cage_rig.version, "hidden": obj.hide_viewport}
        entry["constraints"] = [constraint.name for constraint in obj.constraints]
        entry["drivers"] = len(obj.animation_data.drivers) if obj.animation_data is not None else 0
        entry["posed cage"] = getattr(obj.cage_rig.posed_cage, "name", None)
        groups = [modifier.node_group for modifier in obj.modifiers if modifier.type == "NODES"]
        entry["inputs"] = [(group.name, [item.name for item in group.interface.items_tree]) for group in groups]
        if obj.type == "MESH":
            entry["attributes"] = sorted(obj.data.attributes.keys())
            entry["mark"] = [skin.snapshot.get("cage_rig_bind") for skin in obj.cage_rig.skins]
        found[f"{obj.name} {obj.library is None}"] = entry
    return found


def assert_refused(cage: bpy.types.Object, before: dict[str, object], *words: str) -> None:
    """The rig is paused with a sentence that says these, its skin is Blender's own, and its form is what it was."""
    for _ in range(2):
        update()
        bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)
        assert cage.cage_rig.state == "PAUSED" and cage.cage_rig.fix == ""
        assert all(word in cage.cage_rig.message for word in (f"'{cage.name}'", *words)), cage.cage_rig.message
    assert form() == before
    skin = cage.cage_rig.skins[0].object
    assert not skin.modifiers["Cage Rig"].show_viewport and skin.modifiers["Armature"].show_viewport


def in_a_library(rig: Rig, folder: Path, wrote: Write) -> str:
    """The path of a library whose rig another version has bound; an empty file is open."""
    with unwatched():
        wrote(rig)
        path = library(rig, folder)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


def instance(path: str) -> bpy.types.Object:
    """The cage of a character that is linked and not overridden, in the scene."""
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", link(path)
    bpy.context.scene.collection.objects.link(empty)
    return next(obj for obj in bpy.data.objects if obj.cage_rig.state != "NONE")


def overridden(path: str) -> bpy.types.Object:
    return override(path).cage


def test_a_newer_rig_opens_paused_and_is_left_as_it_is(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    fat_key(bar, value=0.6)
    plain, made = native(bar.skin), artists(bar)
    with unwatched():
        build_a_newer_one(bar)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "newer.blend"))
        bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
        before = form()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    cage = bpy.data.objects["BarCage"]
    assert_refused(cage, before, "newer Cage Rig", "update the extension")
    assert np.abs(shown(as_rig(cage).skin) - plain).max() < 1e-6 and artists(as_rig(cage)) == made
    select([cage], cage)
    for operator in (bpy.ops.cage_rig.rebind, bpy.ops.cage_rig.unbind):
        with pytest.raises(RuntimeError, match="'BarCage' was bound with a newer Cage Rig"):
            operator()
    assert_refused(cage, before, "newer Cage Rig", "update the extension")


@pytest.mark.parametrize("take", [instance, overridden])
@pytest.mark.parametrize(
    ("wrote", "words"),
    [
        (first_build, ("older Cage Rig", "library.blend", "open and save that file", "reload it here")),
        (build_a_newer_one, ("newer Cage Rig", "update the extension")),
    ],
)
def test_a_linked_rig_of_another_version_is_refused_whole(
    bar: Rig, tmp_path: Path, wrote: Write, words: tuple[str, ...], take: Callable[[str], bpy.types.Object]
) -> None:
    path = in_a_library(bar, tmp_path, wrote)
    with unwatched():
        cage = take(path)
        before = form()
    assert_refused(cage, before, *words)
    shot = str(tmp_path / "shot.blend")
    name, is_linked = cage.name, cage.library is not None
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    with unwatched():
        bpy.ops.wm.open_mainfile(filepath=shot)
        before = form()
    bpy.ops.wm.open_mainfile(filepath=shot)
    (cage,) = (obj for obj in bpy.data.objects if obj.name == name and (obj.library is not None) == is_linked)
    assert_refused(cage, before, *words)


def test_an_overridden_rig_is_live_once_its_library_is_brought_up_to_date(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    fat_key(bar)
    seen = shown(bar.skin).copy()
    path = in_a_library(bar, tmp_path, first_build)
    cage = overridden(path)
    assert cage.cage_rig.state == "PAUSED"
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=path)  # as the message says
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=shot)
    (name,) = rigs()
    rig = as_rig(bpy.data.objects[name])
    assert rig.settings.state == "LIVE" and rig.settings.version == CURRENT, rig.settings.message
    assert np.abs(shown(rig.skin) - seen).max() < 1e-5
    bend(rig, 0.2)
    assert np.abs(shown(rig.skin) - seen).max() > 0.1


def test_a_cage_that_an_older_version_bound_here_to_a_linked_character_is_brought_up_to_date(
    bar: Rig, tmp_path: Path
) -> None:
    """The modifier is on a skin of the library and of this file: nothing has to be done elsewhere."""
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    path = library_of([bar.skin, bar.armature, bar.cage], tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    link(path).override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)
    skin, bones, linked = (
        next(obj for obj in bpy.data.objects if obj.name == name and not obj.library) for name in NAMES
    )
    cage = bpy.data.objects.new("ShotCage", linked.data.copy())
    bpy.context.scene.collection.objects.link(cage)
    select([skin, bones, cage], cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    bend(Rig([skin], bones, cage), 1.0)
    seen = shown(skin).copy()
    shot = str(tmp_path / "shot.blend")
    with unwatched():
        first_build(Rig([skin], bones, cage))
        bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    rig = as_rig(bpy.data.objects["ShotCage"])
    assert rig.settings.state == "LIVE" and rig.settings.version == CURRENT, rig.settings.message
    bend(rig, 1.0)
    assert np.abs(shown(rig.skin) - seen).max() < 1e-5
