"""Overlays without a window: what they would draw is checked as numbers, and nothing is drawn."""

from __future__ import annotations

from types import ModuleType

import bmesh
import bpy
import numpy as np
import pytest
from scene import (
    Rig,
    bend,
    enter_edit_mode,
    fat_key,
    leave_edit_mode,
    partly_caged,
    rest,
    select,
    set_mesh,
    shown,
    update,
)

HANDLERS = ("depsgraph_update_post", "frame_change_post", "undo_post", "redo_post", "load_pre")


@pytest.fixture
def overlays(bar: Rig) -> ModuleType:
    import bl_ext.user_default.cage_rig.ui.overlays as overlays

    return overlays


@pytest.fixture
def kept(overlays: ModuleType) -> object:
    return overlays.Overlays()


def subject(overlays: ModuleType) -> object:
    return overlays.subject.find(bpy.context)


def chosen(overlays: ModuleType, kept: object) -> object:
    return kept.choice.read(bpy.context, subject(overlays))


class Seen:
    """The context, as a 3D View that hides nothing has it."""

    space_data = None
    view_layer = property(lambda _: bpy.context.view_layer)


def heat(overlays: ModuleType, kept: object, opacity: float = 1.0) -> list:
    return kept.heat.on(subject(overlays), chosen(overlays, kept), opacity)


def choose_bone(rig: Rig, name: str) -> None:
    select([rig.armature], rig.armature)
    bpy.ops.object.mode_set(mode="POSE")
    rig.armature.data.bones.active = rig.armature.data.bones[name]


def choose_vertices(cage: bpy.types.Object, vertices: list[int]) -> None:
    enter_edit_mode(cage)
    edit = bmesh.from_edit_mesh(cage.data)
    for vertex in edit.verts:
        vertex.select = vertex.index in vertices
    bpy.context.tool_settings.mesh_select_mode = (True, False, False)
    edit.select_flush_mode()
    bmesh.update_edit_mesh(cage.data)
    update()


def session(rig: Rig) -> object:
    import bl_ext.user_default.cage_rig.sync as sync

    return sync.session_of(rig.cage)


def test_settings_are_off_and_of_the_workspace() -> None:
    settings = bpy.context.workspace.cage_rig_overlays
    switches = ("weights", "joint_weights", "joints", "anchors", "fade")
    assert not any(getattr(settings, name) for name in switches)
    for prop in settings.bl_rna.properties:
        assert prop.identifier in ("rna_type", "name") or prop.description


def test_settings_are_not_undone(bar: Rig) -> None:
    bpy.ops.ed.undo_push(message="before")
    bpy.context.workspace.cage_rig_overlays.joints = True
    bar.cage.location.x = 1.0
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()
    assert bpy.context.workspace.cage_rig_overlays.joints


def test_unregister_leaves_no_handler(overlays: ModuleType) -> None:
    def ours() -> list:
        return [
            handler
            for name in HANDLERS
            for handler in getattr(bpy.app.handlers, name)
            if "overlays" in handler.__module__
        ]

    assert len(ours()) == len(HANDLERS) and len(overlays._running.handles) == 2
    overlays.cursor.follow(overlays.draw_cursor)
    overlays._running.kept()
    bpy.app.timers.register(overlays._switch_off, first_interval=1e6)
    overlays.unregister()
    assert not ours() and not overlays._running.handles and overlays._running.overlays is None
    assert not overlays.cursor.is_followed() and not bpy.app.timers.is_registered(overlays._switch_off)
    overlays.register()
    assert len(ours()) == len(HANDLERS) and len(overlays._running.handles) == 2


def test_nothing_is_drawn_and_nothing_fails_without_a_window(overlays: ModuleType) -> None:
    bpy.context.workspace.cage_rig_overlays.weights = True
    overlays.draw_view()
    overlays.draw_pixels()
    overlays.draw_cursor((0, 0))
    assert overlays._running.failures == {} and not overlays.cursor.is_followed()


def test_a_failure_switches_the_overlay_off_and_says_so(overlays: ModuleType) -> None:
    settings = bpy.context.workspace.cage_rig_overlays
    settings.joints = settings.anchors = True
    overlays._running.failures["joints"] = "An overlay was switched off: it met an error"
    overlays._switch_off()
    assert not settings.joints and settings.anchors and "switched off" in settings.message
    settings.joints = True
    assert settings.message == ""


def test_ramp_grows_evenly_in_lightness(overlays: ModuleType) -> None:
    table = overlays.colours.TABLE[:, :3]
    linear = np.where(table <= 0.04045, table / 12.92, ((table + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    middle = len(table) // 2
    assert (np.diff(luminance[middle:]) > 0).all() and (np.diff(luminance[: middle + 1]) < 0).all()
    lightness = np.cbrt(luminance)
    for side in (lightness[middle:], lightness[middle::-1]):
        steps = np.diff(side)
        assert 0.8 * steps.mean() < steps.min() and steps.max() < 1.2 * steps.mean()
    alpha = overlays.colours.TABLE[:, 3]
    assert alpha[middle] == 0.0 and alpha[0] == alpha[-1] == 1.0


def test_colours_are_signed_and_clamped(overlays: ModuleType) -> None:
    of_weights, table = overlays.colours.of_weights, overlays.colours.TABLE
    found = of_weights(np.float32([-2, -1, 0, 1, 2]), 1.0, 0.5)
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[3], found[4])
    assert np.allclose(found[1, :3], table[0, :3]) and np.allclose(found[3, :3], table[-1, :3])
    assert found[3, 3] == 0.5 and found[2, 3] == 0.0
    assert not of_weights(np.zeros(3, np.float32), 0.0)[:, 3].any()


@pytest.mark.parametrize("which", ["rest", "posed"])
def test_heat_of_a_cage_vertex_is_its_column(overlays: ModuleType, kept: object, bar: Rig, which: str) -> None:
    coords = session(bar).rig.cage_coords
    choose_vertices(bar.cage if which == "rest" else bar.posed, [5])
    (found,) = heat(overlays, kept)
    assert chosen(overlays, kept).vertices == (5,)
    assert np.allclose(found.weights, coords[:, 5], atol=1e-7)
    low, high = kept.heat.range(subject(overlays), chosen(overlays, kept))
    assert np.isclose(high, coords[:, 5].max()) and np.isclose(low, min(0.0, coords[:, 5].min()), atol=1e-7)
    leave_edit_mode()


def test_heat_of_several_cage_vertices_is_their_sum(overlays: ModuleType, kept: object, bar: Rig) -> None:
    coords = session(bar).rig.cage_coords
    choose_vertices(bar.cage, [1, 6, 9])
    (found,) = heat(overlays, kept)
    assert np.allclose(found.weights, coords[:, [1, 6, 9]].sum(1), atol=1e-6)
    assert "3 cage vertices" in chosen(overlays, kept).label
    leave_edit_mode()


def test_heat_follows_the_selection(overlays: ModuleType, kept: object, bar: Rig) -> None:
    coords = session(bar).rig.cage_coords
    choose_vertices(bar.cage, [1])
    heat(overlays, kept)
    bpy.ops.mesh.select_all(action="SELECT")
    update()
    (found,) = heat(overlays, kept)
    assert np.allclose(found.weights, coords.sum(1), atol=1e-5)
    bpy.ops.mesh.select_all(action="DESELECT")
    update()
    assert chosen(overlays, kept) is None
    leave_edit_mode()


def test_heat_of_a_masked_skin_is_what_the_cage_does_there(overlays: ModuleType, kept: object, bar: Rig) -> None:
    group = bar.skin.vertex_groups.new(name="Mask")
    group.add(range(len(bar.skin.data.vertices)), 0.25, "REPLACE")
    bar.settings.skins[0].mask = "Mask"
    update()
    update()
    choose_vertices(bar.cage, [5])
    (found,) = heat(overlays, kept)
    assert np.allclose(found.weights, 0.25 * session(bar).rig.cage_coords[:, 5], atol=1e-6)
    leave_edit_mode()


def test_heat_ends_where_a_partial_cage_ends(overlays: ModuleType, kept: object) -> None:
    rig = partly_caged()
    choose_vertices(rig.cage, range(len(rig.cage.data.vertices)))
    (found,) = heat(overlays, kept)
    leave_edit_mode()
    before = shown(rig.skin).copy()
    set_mesh(rig.cage, rest(rig.cage) + np.float32([0, 0, 0.5]))
    moved = (shown(rig.skin) - before)[:, 2]
    assert found.weights.min() == 0.0 and found.weights.max() > 0.999
    assert np.allclose(found.weights, moved / 0.5, atol=1e-5)


@pytest.mark.parametrize("part", ["armature", "refit"])
def test_heat_of_the_active_bone_is_its_skin_weights(overlays: ModuleType, kept: object, bar: Rig, part: str) -> None:
    obj = getattr(bar, part)
    select([obj], obj)
    bpy.ops.object.mode_set(mode="POSE")
    obj.data.bones.active = obj.data.bones["upper"]
    group = bar.skin.vertex_groups["upper"].index
    painted = np.zeros(len(bar.skin.data.vertices))
    total = np.zeros_like(painted)
    for vertex in bar.skin.data.vertices:
        for entry in vertex.groups:
            total[vertex.index] += entry.weight
            painted[vertex.index] += entry.weight * (entry.group == group)
    (found,) = heat(overlays, kept)
    assert np.allclose(found.weights, painted / total, atol=1e-6)
    assert chosen(overlays, kept).label == "upper"


def test_heat_is_on_the_skin_as_it_is_seen(overlays: ModuleType, kept: object, bar: Rig) -> None:
    fat_key(bar)
    bend(bar, 0.8)
    choose_bone(bar, "upper")
    (found,) = heat(overlays, kept)
    assert np.array_equal(found.surface.points, shown(bar.skin))
    bend(bar, 0.3)
    (moved,) = heat(overlays, kept)
    assert np.array_equal(moved.surface.points, shown(bar.skin))
    assert np.abs(moved.surface.points - found.surface.points).max() > 0.01
    assert moved.state != found.state


def test_triangles_are_those_of_the_skin(overlays: ModuleType, kept: object, bar: Rig) -> None:
    choose_bone(bar, "upper")
    (found,) = heat(overlays, kept)
    mesh = bar.skin.data
    assert len(found.triangles) == sum(len(face.vertices) - 2 for face in mesh.polygons)
    faces = [set(face.vertices) for face in mesh.polygons]
    assert all(any(set(triangle) <= face for face in faces) for triangle in found.triangles[::29].tolist())
    assert len(found.colours) == len(found.surface.points) == len(mesh.vertices)


def test_heat_under_a_subdivision_is_on_its_own_vertices(overlays: ModuleType, kept: object, bar: Rig) -> None:
    flat = bar.skin.modifiers
    choose_bone(bar, "upper")
    plain = heat(overlays, kept)[0].surface.offset
    flat.new("Subdivision", "SUBSURF").levels = 1
    update()
    (found,) = heat(overlays, kept)
    count = len(bar.skin.data.vertices)
    assert len(shown(bar.skin)) > count and len(found.surface.points) == count
    assert np.array_equal(found.surface.points, shown(bar.skin)[:count])
    assert found.surface.offset > plain


def test_heat_under_an_unknown_modifier_is_on_the_posed_skin(overlays: ModuleType, kept: object, bar: Rig) -> None:
    choose_bone(bar, "upper")
    bend(bar, 0.5)
    before = shown(bar.skin)
    bar.skin.modifiers.new("Decimate", "DECIMATE").ratio = 0.5
    update()
    (found,) = heat(overlays, kept)
    matrix = np.array(bar.skin.matrix_world.inverted() @ found.surface.to_world)
    points = found.surface.points @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(points - before).max() < 1e-5 * bar.size


def test_hidden_skins_have_no_heat(overlays: ModuleType, kept: object, bar: Rig) -> None:
    choose_bone(bar, "upper")
    bar.skin.hide_set(True)
    assert heat(overlays, kept) == []


def test_an_idle_redraw_makes_nothing(overlays: ModuleType, kept: object, bar: Rig) -> None:
    work = overlays.heat.Kept.get.__globals__["work"]

    def draw() -> None:
        found = subject(overlays)
        picked = kept.choice.read(bpy.context, found)
        kept.heat.on(found, picked, 0.8)
        kept.heat.range(found, picked)
        kept.joints.strokes(found)
        kept.anchors.on(found)
        if picked.joint >= 0:
            kept.joint_weights.strokes(found, picked)
        list(kept.cages.hidden(found))

    bar.cage.hide_set(True)
    bar.posed.hide_set(True)
    choose_bone(bar, "upper")
    draw()
    before = work.copy()
    assert {"points", "weights", "triangles", "colours", "joints", "cages", "joint_weights"} <= set(before)
    draw()
    assert work == before
    bend(bar, 0.5)
    draw()
    done = work - before
    assert done["points"] == 1 and not {"weights", "colours", "triangles", "edges", "anchors"} & set(done)
    leave_edit_mode()
    bar.posed.hide_set(False)
    choose_vertices(bar.posed, [3])
    draw()
    before = work.copy()
    draw()
    assert work == before
    leave_edit_mode()


def test_refit_joints_and_the_animations_own(overlays: ModuleType, kept: object, bar: Rig) -> None:
    bend(bar, 0.7)
    select([bar.cage], bar.cage)
    plain = kept.joints.strokes(subject(overlays))
    colours = overlays.colours
    assert not (plain.colour == np.float32(colours.APART)).all(1).any()
    fat_key(bar)
    select([bar.cage], bar.cage)
    strokes = kept.joints.strokes(subject(overlays))
    refit = np.array([bone.matrix.translation for bone in bar.refit.pose.bones])
    own = np.array([bone.matrix.translation for bone in bar.armature.pose.bones])
    dots = (strokes.start == strokes.end).all(1)
    at = dots & (strokes.colour == np.float32(colours.REFIT)).all(1)
    assert np.allclose(strokes.start[at], refit, atol=1e-5)
    apart = (strokes.colour == np.float32(colours.APART)).all(1)
    moved = np.linalg.norm(refit - own, axis=1) > 1e-3
    assert moved.any() and apart.sum() == moved.sum()
    assert np.allclose(strokes.start[apart], own[moved], atol=1e-5)
    assert np.allclose(strokes.end[apart], refit[moved], atol=1e-5)


def test_bones_that_move_no_skin_are_skipped(overlays: ModuleType) -> None:
    above = overlays.figures._weighted_parents
    parents = np.int32([-1, 0, 1, 2, 3, 3])
    weighted = np.array([True, False, False, True, True, False])
    assert above(parents, weighted).tolist() == [-1, 0, 0, 0, 3, 3]
    assert above(parents, np.zeros(6, bool)).tolist() == [-1] * 6


def test_anchors_are_on_the_skin(overlays: ModuleType, kept: object, bar: Rig) -> None:
    bend(bar, 0.7)
    select([bar.cage], bar.cage)
    ((surface, strokes),) = kept.anchors.on(subject(overlays))
    anchors = np.sort(session(bar).rig.anchors)
    assert surface.obj == bar.skin and len(strokes.start) == len(anchors)
    assert np.array_equal(strokes.start, shown(bar.skin)[anchors])


def test_joint_weights_are_dots_on_the_posed_cage(overlays: ModuleType, kept: object, bar: Rig) -> None:
    choose_bone(bar, "upper")
    bend(bar, 0.7)
    found, picked = subject(overlays), chosen(overlays, kept)
    weights = session(bar).rig.joint_coords[picked.joint]
    assert np.allclose(kept.joint_weights.weights(found, picked), weights)
    strokes = kept.joint_weights.strokes(found, picked)
    dots = (strokes.start == strokes.end).all(1)
    assert np.allclose(strokes.start[~dots], bar.refit.pose.bones["upper"].matrix.translation, atol=1e-5)
    assert np.allclose(strokes.end[~dots], strokes.start[dots])
    points = np.array([vertex.co for vertex in bar.posed.data.vertices], np.float32)
    largest = int(np.argmax(np.abs(weights)))
    assert np.allclose(strokes.start[-1], points[largest], atol=1e-6)
    widths = strokes.width[dots]
    assert (np.diff(widths) >= 0).all() and widths[-1] > 2 * widths[0]


def test_only_hidden_cages_are_drawn(overlays: ModuleType, kept: object, bar: Rig) -> None:
    choose_bone(bar, "upper")

    def drawn() -> set[str]:
        return {obj.name for obj, _, _ in kept.cages.hidden(subject(overlays))}

    assert drawn() == set()
    bar.cage.hide_set(True)
    assert drawn() == {bar.cage.name}
    bar.posed.hide_viewport = True
    assert drawn() == {bar.cage.name, bar.posed.name}
    bar.skin.hide_set(True)
    assert drawn() == set()


def test_drawn_cages_follow(overlays: ModuleType, kept: object, bar: Rig) -> None:
    bar.cage.hide_set(True)
    bar.posed.hide_set(True)
    choose_bone(bar, "upper")
    fat_key(bar)
    bend(bar, 0.6)
    found = {obj.name: strokes for obj, strokes, _ in kept.cages.hidden(subject(overlays))}
    bar.posed.hide_set(False)  # its mesh is that of this pose when it is shown
    update()
    for obj in (bar.cage, bar.posed):
        strokes = found[obj.name]
        dots = (strokes.start == strokes.end).all(1)
        assert np.allclose(strokes.start[dots], shown(obj), atol=1e-5)
        edges = {tuple(edge.vertices) for edge in obj.data.edges}
        assert int((~dots).sum()) == len(edges)


def test_hidden_cages_are_where_the_rig_is(overlays: ModuleType, kept: object, bar: Rig) -> None:
    bar.posed.hide_viewport = True
    choose_bone(bar, "upper")
    leave_edit_mode()
    bar.armature.location = (3.0, 0.0, 1.0)
    update()
    found = subject(overlays)
    ((obj, _, _),) = kept.cages.hidden(found)
    assert np.allclose(found.placed(obj).translation, (3.0, 0.0, 1.0), atol=1e-6)


def test_the_legend_says_what_is_missing(overlays: ModuleType, kept: object, bar: Rig) -> None:
    settings = bpy.context.workspace.cage_rig_overlays
    settings.weights = settings.joint_weights = settings.fade = True

    def entries() -> list:
        return kept.entries(Seen(), settings, subject(overlays))

    select([bar.armature], bar.armature)
    assert [entry.split(":")[0] for entry in entries()] == ["Fading Cages", "Weights", "Joint Weights"]
    bar.cage.hide_set(True)
    choose_bone(bar, "upper")
    joint, skin = entries()
    assert "upper" in joint.label and "upper" in skin.label
    assert np.isclose(skin.high, session(bar).skin_weights(1).max()) and skin.low == 0.0


def test_numbers_of_the_legend_are_short(overlays: ModuleType) -> None:
    entry, number = overlays.legend.entry, overlays.legend.number
    assert entry("", -1e-5, 0.5).low == 0.0 and entry("", -0.1, 0.5).low == -0.1
    assert [number(value) for value in (0.0, 1.0, 0.388, 0.0012, -0.05)] == ["0", "1.00", "0.39", "0.0012", "-0.05"]
    shades = overlays.legend.shades(entry("", -0.5, 1.0))
    assert shades[0, 0] > shades[0, 2] and shades[-1, 1] > 0.8


def test_a_paused_rig_has_no_overlays(overlays: ModuleType, bar: Rig) -> None:
    select([bar.cage], bar.cage)
    assert subject(overlays) is not None
    bpy.data.objects.remove(bar.skin)
    update()
    bpy.context.scene.frame_set(2)
    assert bar.settings.state == "LIVE" or subject(overlays) is None


def test_a_skin_in_edit_mode_has_no_anchors(overlays: ModuleType, kept: object, bar: Rig) -> None:
    enter_edit_mode(bar.skin)
    assert kept.anchors.on(subject(overlays)) == []
    leave_edit_mode()


def test_a_changed_cage_changes_what_is_drawn(overlays: ModuleType, kept: object, bar: Rig) -> None:
    bar.cage.hide_set(True)
    select([bar.armature], bar.armature)
    ((_, before, _),) = kept.cages.hidden(subject(overlays))
    set_mesh(bar.cage, 1.1 * np.array([vertex.co for vertex in bar.cage.data.vertices], np.float32))
    ((_, after, _),) = kept.cages.hidden(subject(overlays))
    assert np.allclose(after.start, 1.1 * before.start, atol=1e-5)


def test_a_loaded_file_starts_anew(overlays: ModuleType, bar: Rig, tmp_path: object) -> None:
    overlays.cursor.follow(overlays.draw_cursor)
    path = str(tmp_path / "rig.blend")
    bpy.context.workspace.cage_rig_overlays.anchors = True
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not overlays.cursor.is_followed()
    assert bpy.context.workspace.cage_rig_overlays.anchors
    kept = overlays.Overlays()
    select([bpy.data.objects["Armature"]] if "Armature" in bpy.data.objects else [], None)
    cage = next(obj for obj in bpy.data.objects if obj.cage_rig.state == "LIVE")
    select([cage], cage)
    assert len(kept.anchors.on(subject(overlays))) == 1
