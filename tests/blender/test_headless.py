"""The command line, called as Blender calls it: with arguments, answering by exit code, lines and JSON."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from scene import Rig, bound_bar, rest, set_mesh, update
from test_sync import key_the_bar

Main = Callable[..., tuple[int, dict]]


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def walk(bar: Rig, tmp_path: Path) -> Path:
    """A saved file: the bar with a keyed pose and a keyed cage over frames 1 to 12."""
    key_the_bar(bar)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 12
    return save(tmp_path / "walk.blend")


def change_cage(path: Path, to: Path) -> Path:
    """The same file with one vertex of the rest cage moved."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    rig = bpy.data.objects["BarCage"]
    if rig.data.shape_keys:
        for block in rig.data.shape_keys.key_blocks:
            block.data[7].co.z += 0.2
    rig.data.vertices[7].co.z += 0.2
    rig.data.update()
    update()
    return save(to)


def test_check_of_a_live_rig_says_what_it_is(main: Main, walk: Path, capfd: pytest.CaptureFixture[str]) -> None:
    code, answer = main("check", walk)
    (rig,) = answer["files"][0]["rigs"]
    assert code == 0 and answer["ok"] and rig["state"] == "LIVE" and rig["beyond"] == []
    assert rig["skins"] == {"Bar": len(bpy.data.objects["Bar"].data.vertices)}
    assert set(rig["residuals"]) == set(answer["limits"])
    assert all(0.0 <= value <= answer["limits"][name] for name, value in rig["residuals"].items())
    assert rig["report"]["anchor_max_ratio"] >= 1.0 and rig["bind_seconds"] > 0.0 and rig["frame_ms"] > 0.0
    assert "BarCage: live; " in capfd.readouterr().out


def test_check_sees_what_is_shown_wrongly(main: Main, walk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import bl_ext.user_default.cage_rig.session as session

    right, live = session.Session.posed_skin, []

    def wrong(self: object, index: int) -> np.ndarray:
        live.append(self)  # the running session is asked first
        points = right(self, index)
        return points + np.float32(0.001) if self is live[0] else points

    monkeypatch.setattr(session.Session, "posed_skin", wrong)
    code, answer = main("check", walk)
    assert code == 1 and answer["files"][0]["rigs"][0]["beyond"] == ["shown_error"]


def test_check_of_a_paused_rig_says_why_and_when(main: Main, bar: Rig, tmp_path: Path) -> None:
    bpy.data.objects.remove(bar.posed)
    code, answer = main("check", save(tmp_path / "broken.blend"), "--frames", "3-5")
    (rig,) = answer["files"][0]["rigs"]
    assert code == 1 and not answer["ok"]
    assert (rig["state"], rig["paused_at"]) == ("PAUSED", 3) and "posed cage of 'BarCage' was deleted" in rig["message"]


def test_check_of_several_files(main: Main, walk: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(walk))
    bpy.data.objects.remove(bpy.data.objects["BarRig"])
    broken = save(tmp_path / "broken.blend")
    code, answer = main("check", walk, broken)
    assert code == 1 and [[rig["ok"] for rig in file["rigs"]] for file in answer["files"]] == [[True], [False]]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["check", "{dir}/none.blend"], "there is no file"),
        (["check", "{dir}/text.blend"], "can't be opened"),
        (["check", "{dir}/empty.blend"], "there is no rig in"),
        (["check", "{walk}", "--rig", "Body"], "there is no cage 'Body' of a rig"),
        (["check", "{walk}", "--frames", "one"], "'one' is no range of frames; write it as 1-48"),
        (["check", "{walk}", "--frames", "9-3"], "there is no frame from 9 to 3"),
        (["bake", "{walk}", "--to", "pc2", "--out", "{dir}/text.blend"], "can't be made a folder"),
        (["bake", "{walk}", "--to", "fbx", "--out", "{dir}"], "invalid choice: 'fbx'"),
        (["compare", "{walk}", "{dir}/none.npz"], "there is no file"),
        (["compare", "{walk}", "{dir}/text.blend"], "is no record of Cage Rig"),
        (["compare", "{walk}", "{dir}/none.npz", "--tolerance", "-1"], "a tolerance is 0 or more"),
        (["merge", "{dir}/text.blend", "--out", "{dir}/all"], "is no point cache (PC2)"),
        (["merge", "{dir}/none.pc2", "--out", "{dir}/all"], "No such file"),
        (["merge", "{dir}", "--out", "{dir}/all"], "there is no point cache (.pc2) in"),
        (["dance", "{walk}"], "invalid choice: 'dance'"),
        (["check"], "required: FILE"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(
    main: Main, walk: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], sentence: str
) -> None:
    (tmp_path / "text.blend").write_text("no file of Blender")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    save(tmp_path / "empty.blend")
    before = sorted(tmp_path.rglob("*"))
    code, answer = main(*(text.format(dir=tmp_path, walk=walk) for text in arguments))
    assert code == 2 and answer == {} and sentence in capfd.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


def test_frames_may_be_negative(headless: ModuleType) -> None:
    assert headless.run.frames("-10--1") == (-10, -1) and headless.run.frames("-3-4") == (-3, 4)
    assert headless.run.frames("7") == (7, 7)


@pytest.mark.parametrize(("target", "suffix"), [("abc", "abc"), ("usd", "usdc"), ("pc2", "pc2")])
def test_bake_writes_one_file_a_rig(main: Main, walk: Path, tmp_path: Path, target: str, suffix: str) -> None:
    code, answer = main("bake", walk, "--to", target, "--frames", "2-6", "--out", tmp_path / "made")
    assert code == 0 and answer["baked"][0]["frames"] == [2, 6]
    assert answer["baked"][0]["files"] == [str(tmp_path / "made" / f"BarCage.{suffix}")]
    assert (tmp_path / "made" / f"BarCage.{suffix}").stat().st_size > 1000


@pytest.mark.parametrize("target", ["shapekeys", "native"])
def test_bake_of_objects_is_a_file_with_nothing_else(main: Main, bar: Rig, tmp_path: Path, target: str) -> None:
    walk = save(tmp_path / "walk.blend")
    code, answer = main("bake", walk, "--to", target, "--frames", "1-3", "--out", tmp_path)
    assert code == 0
    with bpy.data.libraries.load(answer["baked"][0]["files"][0]) as (inside, loaded):
        loaded.collections = inside.collections
    (collection,) = loaded.collections
    meshes = [obj for obj in collection.all_objects if obj.type == "MESH"]
    assert len(meshes) == 1 and "BarCage" not in inside.objects
    if target == "shapekeys":
        assert len(meshes[0].data.shape_keys.key_blocks) == 4


def test_chunks_merged_equal_one_bake_bit_for_bit(main: Main, walk: Path, tmp_path: Path) -> None:
    def baked(frames: str) -> Path:
        code, answer = main("bake", walk, "--to", "pc2", "--frames", frames, "--out", tmp_path / frames)
        assert code == 0
        return Path(answer["baked"][0]["files"][0])

    whole, parts = baked("1-12"), [baked("9-12"), baked("1-4"), baked("4-8")]  # in any order, one frame twice
    (tmp_path / "1-4" / "BarCage.0123abcd.partial.pc2").write_bytes(b"a killed bake has left this")
    code, answer = main("merge", *(part.parent for part in parts), "--out", tmp_path / "merged")
    (merged,) = answer["merged"]
    assert code == 0 and (merged["start"], merged["samples"], merged["parts"]) == (1.0, 12, 3)
    assert (tmp_path / "merged" / "BarCage.pc2").read_bytes() == whole.read_bytes()
    parts[0].write_bytes(parts[0].read_bytes()[:-5])
    assert main("merge", *parts, "--out", tmp_path / "again")[0] == 2 and not (tmp_path / "again").exists()


def test_merging_names_what_is_missing(
    main: Main, walk: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for frames in ("1-3", "6-7"):
        assert main("bake", walk, "--to", "pc2", "--frames", frames, "--out", tmp_path / frames)[0] == 0
    code, _ = main("merge", tmp_path / "6-7", tmp_path / "1-3", "--out", tmp_path / "all")
    assert code == 2 and "the frames from 4 to 6 are in no file" in capfd.readouterr().err
    assert not (tmp_path / "all").exists()


def test_compare_finds_nothing_where_nothing_changed(main: Main, walk: Path, tmp_path: Path) -> None:
    code, answer = main("compare", walk, tmp_path / "gold.npz", "--record")
    assert code == 0 and answer["frames"] == list(range(1, 13))
    code, answer = main("compare", walk, tmp_path / "gold.npz", "--tolerance", "0")
    assert code == 0 and [track["what"] for track in answer["tracks"]] == ["skin", "joints", "posed cage"]
    assert all(track["largest"] == 0.0 and not track["differs"] for track in answer["tracks"])


def test_compare_names_first_frame_and_vertex_and_draws_them(main: Main, walk: Path, tmp_path: Path) -> None:
    assert main("compare", walk, tmp_path / "gold.npz", "--record", "--frames", "3-8")[0] == 0
    changed = change_cage(walk, tmp_path / "changed.blend")
    code, answer = main("compare", changed, tmp_path / "gold.npz", "--picture", tmp_path / "seen")
    skin, _, cage = answer["tracks"]
    assert code == 1 and skin["differs"] and cage["differs"] and skin["first_frame"] == 3
    golden = np.load(tmp_path / "gold.npz")
    bpy.ops.wm.open_mainfile(filepath=str(changed))
    bpy.context.scene.frame_set(3)
    evaluated = bpy.data.objects["Bar"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    shown = np.array([vertex.co for vertex in evaluated.vertices])
    assert np.linalg.norm(shown - golden["track_0"][0], axis=1).argmax() == skin["vertex"]
    image = bpy.data.images.load(skin["picture"])
    pixels = np.array(image.pixels[:]).reshape(-1, 4)
    red = (pixels[:, 0] > 0.4) & (pixels[:, 1] < 0.15)
    grey = np.ptp(pixels[:, :3], axis=1) < 0.03
    assert image.size[0] == 800 and red.sum() > 500 and grey.sum() > 500
    assert main("compare", changed, tmp_path / "gold.npz", "--tolerance", "1")[0] == 0


def test_compare_sees_one_frame_of_one_key(main: Main, walk: Path, tmp_path: Path) -> None:
    assert main("compare", walk, tmp_path / "gold.npz", "--record")[0] == 0
    bpy.ops.wm.open_mainfile(filepath=str(walk))
    armature = bpy.data.objects["BarRig"]
    bone = armature.pose.bones[0]
    for frame, angle in ((6, 0.0), (7, 0.1), (8, 0.0)):
        bone.location.y = angle
        bone.keyframe_insert("location", frame=frame)
    changed = save(tmp_path / "changed.blend")
    code, answer = main("compare", changed, tmp_path / "gold.npz")
    assert code == 1 and {track["first_frame"] for track in answer["tracks"]} == {7}
    assert main("compare", changed, tmp_path / "gold.npz", "--frames", "1-6")[0] == 0
    assert main("compare", changed, tmp_path / "gold.npz", "--frames", "5-13")[0] == 2


def test_compare_tells_other_meshes_from_other_shapes(main: Main, walk: Path, tmp_path: Path) -> None:
    assert main("compare", walk, tmp_path / "gold.npz", "--record", "--frames", "1")[0] == 0
    other = np.load(tmp_path / "gold.npz")
    arrays = {name: other[name] for name in other.files}
    arrays["track_0"] = arrays["track_0"][:, :-1]
    np.savez(tmp_path / "gold.npz", **arrays)
    code, answer = main("compare", walk, tmp_path / "gold.npz")
    assert code == 1 and answer["tracks"][0]["fault"].startswith("it has ")


def test_json_on_the_standard_output_is_all_there_is(
    headless: ModuleType, walk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert headless.main(["check", str(walk), "--json", "-"]) == 0
    caught = capfd.readouterr()
    assert json.loads(caught.out[caught.out.index("{") :])["ok"] and "BarCage: live" not in caught.out
    assert "walk.blend: playing 100%" in caught.err


def test_it_runs_as_a_module_where_it_is_installed(walk: Path, tmp_path: Path) -> None:
    repository = next(r for r in bpy.context.preferences.extensions.repos if r.module == "user_default")
    done = subprocess.run(
        [sys.executable, "-m", "cage_rig", "check", str(walk), "--json", str(tmp_path / "a.json")],
        cwd=repository.directory,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "a.json").read_text())["ok"]


def test_unregistering_takes_the_command_away(headless: ModuleType) -> None:
    assert len(headless._commands) == 1
    headless.unregister()
    assert headless._commands == []
    headless.register()


def test_a_second_rig_has_files_of_its_own(main: Main, tmp_path: Path) -> None:
    first = bound_bar()
    first.cage.name = "First"
    second = bound_bar()
    set_mesh(second.cage, rest(second.cage) * np.float32([1, 1.5, 1.5]))
    both = save(tmp_path / "both.blend")
    code, answer = main("bake", both, "--to", "pc2", "--frames", "1-2", "--out", tmp_path / "made")
    assert code == 0 and len({file for rig in answer["baked"] for file in rig["files"]}) == 2
    assert main("bake", both, "--to", "pc2", "--frames", "1-2", "--out", tmp_path / "one", "--rig", "First")[0] == 0
    assert [file.name for file in (tmp_path / "one").iterdir()] == ["First.pc2"]
