"""Coordinates out of a live rig and into it: used at once, kept with the .blend, and refused where they don't fit."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from scene import Rig, bend, bind, build_bar, fat_key, fresh, rest, select, set_mesh, shown, update
from test_linked import as_rig, library, override

from blend_fixtures.build import build_character
from blend_fixtures.small import two_roots, two_skins

Array = np.ndarray
ROOT = Path(__file__).parents[2]


@pytest.fixture
def exchange() -> ModuleType:
    from bl_ext.user_default.cage_rig import exchange

    return exchange


@pytest.fixture
def other(exchange: ModuleType, bar: Rig) -> Array:
    """Coordinates of the bar's skin that are not ours: as exact for linear functions, and far from mean value ones."""
    return other_coords(exchange.coordinates_of(bar.cage).cage_coords, exchange.rest_of(bar.cage).cage_points)


def other_coords(coords: Array, cage: Array) -> Array:
    linear = np.column_stack([cage, np.ones(len(cage))])
    blind = np.eye(len(cage)) - linear @ np.linalg.pinv(linear)  # what no linear function sees
    waves = np.sin(np.arange(coords.size, dtype=float)).reshape(coords.shape)
    return coords + 0.05 * waves @ blind


def active(rig: Rig) -> None:
    select([rig.cage], rig.cage)


def export(rig: Rig, path: Path) -> None:
    active(rig)
    assert bpy.ops.cage_rig.export_coordinates(filepath=str(path)) == {"FINISHED"}


def load(rig: Rig, path: Path) -> None:
    active(rig)
    assert bpy.ops.cage_rig.load_coordinates(filepath=str(path)) == {"FINISHED"}


def edited(rig: Rig) -> Array:
    """The skin, bent, under an edited cage: what coordinates decide."""
    if rig.cage.data.shape_keys is None:
        block = fat_key(rig)
        wave = np.sin(np.arange(3 * len(block.points), dtype=np.float32))
        block.points.foreach_set("co", rest(rig.cage).ravel() + 0.1 * wave)
        rig.cage.data.update_tag()
    bend(rig, 0.7)
    return shown(rig.skin).copy()


def expected(rig: Rig, coords: Array) -> Array:
    """The rest skin under the edited cage: M0 + Φ(C − C0)."""
    return rest(rig.skin) + coords @ (shown(rig.cage) - rest(rig.cage))


def assert_uses(rig: Rig, coords: Array) -> None:
    edited(rig)
    bend(rig, 0.0)
    assert rig.settings.state == "LIVE", rig.settings.message
    assert np.abs(shown(rig.skin) - expected(rig, coords)).max() < 2e-6 * rig.size


def test_an_export_holds_the_rig_and_what_it_uses(bar: Rig, exchange: ModuleType, tmp_path: Path) -> None:
    export(bar, tmp_path / "bar.npz")
    found = dict(np.load(tmp_path / "bar.npz"))
    assert str(found["format"]) == "cage_rig coordinates" and found["version"] == 1
    assert found["skin_names"].tolist() == ["Bar"] and found["skin_counts"].tolist() == [len(rest(bar.skin))]
    assert found["joint_names"].tolist() == ["lower", "upper"]
    np.testing.assert_array_equal(found["skin_points"], rest(bar.skin))
    np.testing.assert_array_equal(found["cage_points"], rest(bar.cage))
    np.testing.assert_array_equal(found["cage_sizes"], [len(face.vertices) for face in bar.cage.data.polygons])
    assert np.abs(found["cage_coords"] @ found["cage_points"] - found["skin_points"]).max() < 1e-12
    assert np.abs(found["joint_coords"] @ found["cage_points"] - found["joints"]).max() < 1e-10
    assert len(np.unique(found["anchors"])) == len(rest(bar.cage))
    assert "center_coords" not in found, "this method has none"
    assert all(found[name].dtype == np.float64 for name in ("cage_coords", "joint_coords", "skin_points"))
    bar.settings.method = "COR"
    update()
    export(bar, tmp_path / "bar.npz")
    assert np.load(tmp_path / "bar.npz")["center_coords"].shape == found["cage_coords"].shape


@pytest.mark.parametrize("name", ["bar.npz", "bar_cageWeights.txt"])
def test_what_is_exported_can_be_loaded(bar: Rig, exchange: ModuleType, tmp_path: Path, name: str) -> None:
    before, cage = edited(bar), rest(bar.posed)
    export(bar, tmp_path / name)
    load(bar, tmp_path / name)
    assert bar.settings.coordinates == name and bar.settings.state == "LIVE"
    assert np.abs(shown(bar.skin) - before).max() < 1e-6 * bar.size
    assert np.abs(rest(bar.posed) - cage).max() < 1e-6 * bar.size
    export(bar, tmp_path / "again.npz")
    load(bar, tmp_path / "again.npz")
    assert np.abs(shown(bar.skin) - before).max() < 1e-6 * bar.size


def test_loaded_coordinates_move_the_skin_at_once(bar: Rig, exchange: ModuleType, other: Array) -> None:
    ours = edited(bar)
    exchange.use_coordinates(bar.cage, cage_coords=other)
    assert np.abs(shown(bar.skin) - ours).max() > 1e-3 * bar.size
    assert bar.settings.coordinates == "a script"
    assert_uses(bar, other)
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() == 0.0


def test_the_rest_character_stays_where_it_is(bar: Rig, exchange: ModuleType, other: Array) -> None:
    """Given coordinates that miss by a part of the limit, skin and joints rest where they did."""
    joint_coords = exchange.coordinates_of(bar.cage).joint_coords + 3e-6
    joint_coords /= joint_coords.sum(axis=1, keepdims=True)
    exchange.use_coordinates(bar.cage, cage_coords=other, joint_coords=joint_coords)
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() == 0.0
    heads = np.array([bone.head for bone in bar.refit.pose.bones])
    assert np.abs(heads - exchange.rest_of(bar.cage).joints).max() < 2e-7 * bar.size


def test_posed_edits_come_back_through_loaded_coordinates(bar: Rig, exchange: ModuleType, other: Array) -> None:
    exchange.use_coordinates(bar.cage, cage_coords=other)
    bend(bar, 0.8)
    wanted = rest(bar.posed)
    wanted[5] += np.float32([0.05, -0.1, 0.05])
    set_mesh(bar.posed, wanted)
    assert bar.settings.message == "" and np.abs(rest(bar.posed) - wanted).max() < 1e-5 * bar.size


def test_given_anchors_hold_the_posed_cage(bar: Rig, exchange: ModuleType) -> None:
    computed = exchange.coordinates_of(bar.cage).anchors
    chosen = np.sort(computed)[::-1].copy()
    exchange.use_coordinates(bar.cage, anchors=chosen)
    assert exchange.coordinates_of(bar.cage).anchors.tolist() == chosen.tolist()
    fresh(bar)
    assert exchange.coordinates_of(bar.cage).anchors.tolist() == chosen.tolist()


def reopened(path: Path) -> Rig:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return as_rig(bpy.data.objects["BarCage"])


def test_they_are_kept_with_the_file_to_the_last_bit(
    bar: Rig, exchange: ModuleType, other: Array, tmp_path: Path
) -> None:
    given = exchange.coordinates_of(bar.cage)
    exchange.use_coordinates(
        bar.cage,
        cage_coords=other,
        joint_coords=given.joint_coords,
        center_coords=other[::-1],
        anchors=given.anchors[::-1],
        source="harmonic.npz",
    )
    before, cage = edited(bar), rest(bar.posed)
    used = exchange.coordinates_of(bar.cage)
    rig = reopened(tmp_path / "bar.blend")
    assert rig.settings.state == "LIVE" and rig.settings.coordinates == "harmonic.npz"
    assert np.array_equal(shown(rig.skin), before) and np.array_equal(rest(rig.posed), cage)
    for name, value in vars(exchange.coordinates_of(rig.cage)).items():
        assert np.array_equal(value, getattr(used, name)), name


def test_they_come_along_when_the_character_is_appended(
    bar: Rig, exchange: ModuleType, other: Array, tmp_path: Path
) -> None:
    exchange.use_coordinates(bar.cage, cage_coords=other)
    before = edited(bar)
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.append(directory=path + "/Collection/", filename="Character")
    update()
    rig = as_rig(bpy.data.objects["BarCage"])
    assert rig.settings.state == "LIVE" and np.abs(shown(rig.skin) - before).max() < 1e-6 * rig.size


def test_they_come_along_when_the_character_is_overridden(
    bar: Rig, exchange: ModuleType, other: Array, tmp_path: Path
) -> None:
    exchange.use_coordinates(bar.cage, cage_coords=other, source="harmonic.npz")
    before = edited(bar)
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = override(path)
    assert rig.settings.state == "LIVE" and rig.settings.coordinates == "harmonic.npz"
    assert np.abs(shown(rig.skin) - before).max() < 1e-6 * rig.size
    with pytest.raises(exchange.FileError, match=r"was bound in another file"):
        exchange.use_coordinates(rig.cage, cage_coords=other)


def test_undo_brings_the_others_back(bar: Rig, exchange: ModuleType, other: Array, tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", cage_coords=other)
    ours = edited(bar)
    bpy.ops.ed.undo_push(message="edited")
    load(bar, tmp_path / "other.npz")
    theirs = shown(bar.skin).copy()
    bpy.ops.ed.undo_push(message="loaded")
    bpy.ops.ed.undo()
    rig = as_rig(bpy.data.objects["BarCage"])
    assert rig.settings.coordinates == "" and np.abs(shown(rig.skin) - ours).max() < 1e-7
    bpy.ops.ed.redo()
    rig = as_rig(bpy.data.objects["BarCage"])
    assert rig.settings.coordinates == "other.npz" and np.abs(shown(rig.skin) - theirs).max() < 1e-7


def test_rebind_keeps_them_while_the_rest_is_theirs(
    bar: Rig, exchange: ModuleType, other: Array, capfd: pytest.CaptureFixture[str]
) -> None:
    exchange.use_coordinates(bar.cage, cage_coords=other, source="harmonic.npz")
    bar.skin.vertex_groups["upper"].add(range(40), 0.5, "REPLACE")
    active(bar)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.coordinates == "harmonic.npz"
    assert_uses(bar, other)
    bend(bar, 0.0)
    bar.cage.shape_key_clear()
    set_mesh(bar.skin, rest(bar.skin) * np.float32([1.0, 1.02, 1.0]))
    assert "Warning" not in capfd.readouterr().out
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.coordinates == "" and bar.settings.state == "LIVE"
    assert "Warning: The rest shape has changed, so the coordinates of 'harmonic.npz' were" in capfd.readouterr().out
    found = exchange.coordinates_of(bar.cage).cage_coords
    assert np.abs(found - other).max() > 0.01


def test_the_rig_goes_back_to_its_own(bar: Rig, exchange: ModuleType, other: Array) -> None:
    ours = edited(bar)
    active(bar)
    assert not bpy.ops.cage_rig.drop_coordinates.poll()
    exchange.use_coordinates(bar.cage, cage_coords=other)
    assert bpy.ops.cage_rig.drop_coordinates() == {"FINISHED"}
    assert bar.settings.coordinates == ""
    assert np.array_equal(shown(bar.skin), ours)
    assert not [a.name for a in bar.settings.skins[0].snapshot.attributes if a.name.startswith("cage_coords")]


def test_duplicates_have_coordinates_of_their_own(bar: Rig, exchange: ModuleType, other: Array) -> None:
    before = edited(bar)
    select([*bar.skins, bar.armature, bar.cage, bar.posed, bar.refit], bar.cage)
    bpy.ops.object.duplicate()
    update()
    twin = as_rig(bpy.context.view_layer.objects.active)
    exchange.use_coordinates(twin.cage, cage_coords=other)
    assert np.abs(shown(twin.skin) - before).max() > 1e-3 * bar.size
    assert np.array_equal(fresh(bar)[0], before), "the first is untouched"


@pytest.mark.parametrize("act", ["rebind", "unbind"])
def test_a_duplicate_may_be_bound_anew_beside_the_first(bar: Rig, act: str) -> None:
    before = edited(bar)
    select([*bar.skins, bar.armature, bar.cage, bar.posed, bar.refit], bar.cage)
    bpy.ops.object.duplicate()
    update()
    assert getattr(bpy.ops.cage_rig, act)() == {"FINISHED"}
    update()
    assert bar.settings.state == "LIVE", bar.settings.message
    assert np.array_equal(fresh(bar)[0], before)


def test_several_skins_may_be_in_another_order(exchange: ModuleType, tmp_path: Path) -> None:
    rig = bind(build_character(two_skins()))
    given = exchange.coordinates_of(rig.cage)
    cage = exchange.rest_of(rig.cage).cage_points
    exchange.use_coordinates(rig.cage, cage_coords=other_coords(given.cage_coords, cage), anchors=given.anchors)
    edited(rig)
    before = {skin.name: shown(skin).copy() for skin in rig.skins}
    anchors = exchange.coordinates_of(rig.cage).anchors
    export(rig, tmp_path / "two.npz")
    active(rig)
    bend(rig, 0.0)
    bpy.ops.cage_rig.unbind()
    from bl_ext.user_default.cage_rig import lifecycle

    lifecycle.bind(bpy.context, rig.cage, rig.armature, rig.skins[::-1])
    rig = as_rig(rig.cage)
    load(rig, tmp_path / "two.npz")
    bend(rig, 0.7)
    for skin in rig.skins:
        assert np.abs(shown(skin) - before[skin.name]).max() < 1e-6 * rig.size
    count = len(rest(rig.skins[1]))
    moved = np.where(anchors < count, anchors + len(rest(rig.skins[0])), anchors - count)
    assert exchange.coordinates_of(rig.cage).anchors.tolist() == moved.tolist()


def test_centers_of_a_cage_around_a_part_are_left_out(exchange: ModuleType) -> None:
    """They are coordinates and a place that no cage moves: rows that don't sum to 1."""
    objects = build_character(two_roots())
    set_mesh(objects.cage, rest(objects.cage) * np.float32([0.6, 1.0, 1.0]))
    rig = bind(objects)
    rig.settings.method = "COR"
    update()
    found = exchange.coordinates_of(rig.cage)
    assert found.names == ["skin coordinates", "joint coordinates", "anchors"]
    fat_key(rig)
    bend(rig, 0.7, "right")
    before = shown(rig.skin).copy()
    exchange.use_coordinates(rig.cage, **vars(found))
    assert np.abs(shown(rig.skin) - before).max() < 2e-6 * rig.size


BAD: dict[str, tuple[Callable[[Array], Array], str]] = {
    "few rows": (lambda coords: coords[:9], r"bad.npz: cage_coords is 9 by 28, expected \d+ by 28"),
    "a sum": (lambda coords: coords * 1.001, r"bad.npz: cage_coords of vertex \d+ of 'Bar' sum to 1.001"),
    "order": (lambda coords: coords[::-1], r"cage_coords put vertex \d+ of 'Bar' 0.98 of the character's size beside"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_coordinates_change_nothing(
    bar: Rig, exchange: ModuleType, other: Array, tmp_path: Path, case: str
) -> None:
    change, message = BAD[case]
    exchange.use_coordinates(bar.cage, cage_coords=other, source="good.npz")
    before = edited(bar)
    np.savez(tmp_path / "bad.npz", cage_coords=change(other))
    with pytest.raises(RuntimeError, match=message):
        load(bar, tmp_path / "bad.npz")
    assert bar.settings.coordinates == "good.npz" and bar.settings.state == "LIVE"
    assert np.array_equal(shown(bar.skin), before) and np.array_equal(fresh(bar)[0], before)


def test_an_export_that_can_t_be_leaves_no_file(bar: Rig, exchange: ModuleType, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"There is no folder"):
        export(bar, tmp_path / "none" / "bar.npz")
    with pytest.raises(RuntimeError, match=r"Save the .blend first"):
        active(bar)
        bpy.ops.cage_rig.export_coordinates()
    bar.skin.modifiers.remove(bar.skin.modifiers["Cage Rig"])
    update()
    with pytest.raises(RuntimeError, match=r"'BarCage' is not live: The Cage Rig modifier of 'Bar' was removed"):
        export(bar, tmp_path / "bar.npz")
    with pytest.raises(exchange.FileError, match=r"'Bar' is not the cage of a rig"):
        exchange.export_coordinates(bar.skin, str(tmp_path / "bar.npz"))
    assert list(tmp_path.iterdir()) == []


def test_text_is_three_files_of_the_chosen_name(bar: Rig, tmp_path: Path) -> None:
    export(bar, tmp_path / "X_cage_cageWeights.txt")
    names = ["X_cage.maxvol", "X_cage_cageWeights.txt", "X_cage_jointWeights.txt"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names


def test_coordinates_can_t_be_loaded_into_what_is_no_rig() -> None:
    objects = build_bar()
    select([objects.cage], objects.cage)
    for operator in (bpy.ops.cage_rig.load_coordinates, bpy.ops.cage_rig.export_coordinates):
        assert not operator.poll()


def test_float32_shows_what_float64_shows(exchange: ModuleType, tmp_path: Path) -> None:
    """On the published arm, posed and edited: skin, posed cage and joints under coordinates as a file keeps them."""
    folder = Path(os.environ.get("CAGE_RIG_SHARED") or ROOT.parent / "shared") / "data/arm"
    if not (folder / "arm.skt").is_file():
        pytest.skip("the reference rig is not here; set CAGE_RIG_SHARED to the folder that holds data/arm")
    bpy.ops.cage_rig.import_rig(filepath=str(folder), use_coordinates=False)
    rig = as_rig(bpy.context.object)
    export(rig, tmp_path / "arm.npz")
    for name in ("arm.npz", "arm_cageWeights.txt"):
        export(rig, tmp_path / name)

    def seen() -> list[Array]:
        found = []
        for frame in (37, 217):
            bpy.context.scene.frame_set(frame)
            heads = np.array([bone.head for bone in rig.refit.pose.bones])
            found += [shown(rig.skin).copy(), rest(rig.posed), heads]
        return found

    wanted = seen()
    for name in ("arm.npz", "arm_cageWeights.txt"):
        load(rig, tmp_path / name)
        worst = max(float(np.abs(one - other).max()) for one, other in zip(seen(), wanted, strict=True))
        assert worst < 5e-7 * rig.size
        active(rig)
        bpy.ops.cage_rig.drop_coordinates()
