"""Bake from a button: the dialog, progress, Esc on the way, and files by the file browser."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import build_biped

FOLDER = Path(tempfile.mkdtemp(prefix="cage_rig_bake_"))


def bake(target: str, **options: object) -> None:
    """What a click on the panel's button does."""
    area, region = driver.view()
    bpy.context.view_layer.objects.active = bpy.data.objects["BipedCage"]
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.bake("INVOKE_DEFAULT", target=target, **options)


def counts() -> list[int]:
    kinds = [prop.identifier for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"]
    kinds = [kind for kind in kinds if kind not in ("screens", "workspaces", "window_managers", "brushes", "palettes")]
    return [len(getattr(bpy.data, kind)) for kind in kinds]


def rest_cage() -> list[float]:
    mesh = bpy.data.objects["BipedCage"].data
    return [x for block in mesh.shape_keys.key_blocks for point in block.points for x in point.co]


def confirm_files() -> Iterator[float | None]:
    """Press the file browser's button."""
    area = next(area for area in driver.window().screen.areas if area.type == "FILE_BROWSER")
    driver.screenshot("file_browser")
    yield 0.5
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.file.execute()
    yield None


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield 0.5
    driver.install()
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_biped()
    scene = bpy.context.scene
    scene.frame_end = 48
    scene.frame_set(5)
    yield 0.5
    driver.look_from_front([*rig.skins, rig.cage])
    yield 0.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    bpy.ops.cage_rig.bind()
    bpy.ops.ed.undo_push(message="Bound")
    yield 0.5
    count, before = len(rig.skins), rest_cage()
    yield from a_dialog_and_escape()
    yield from to_the_end(count)
    yield from a_native_rig()
    yield from files(count)
    cage = bpy.data.objects["BipedCage"]
    driver.check("the rig is as it was", rest_cage() == before and cage.cage_rig.state == "LIVE", cage.cage_rig.message)


def a_dialog_and_escape() -> Iterator[float | None]:
    scene, before = bpy.context.scene, counts()
    bake("SHAPE_KEYS")
    yield 0.7
    driver.screenshot("1_dialog")
    driver.key("RET")
    seen = set()
    for _ in range(12):
        yield 0.2
        seen.add(scene.frame_current)
    driver.screenshot("2_on_its_way")
    driver.check("a dialog's OK starts the bake", len(seen) > 3, sorted(seen))
    driver.check("it has begun something", counts() != before)
    driver.key("ESC")
    yield 0.7
    driver.check("Esc takes everything back", counts() == before, f"{before} {counts()}")
    driver.check("and the frame", scene.frame_current == 5, scene.frame_current)
    seen = scene.frame_current
    yield 0.5
    driver.check("and it stays", scene.frame_current == seen and counts() == before)


def to_the_end(skins: int) -> Iterator[float | None]:
    bake("SHAPE_KEYS", step=8)
    yield 0.7
    driver.key("RET")
    for _ in range(100):
        yield 0.2
        if "BipedCage Shape Keys" in bpy.data.collections:
            break
    yield 0.5
    driver.screenshot("3_shape_keys")
    found = bpy.data.collections.get("BipedCage Shape Keys")
    driver.check("a bake comes to its end", found is not None and len(found.objects) == skins)
    driver.check("the frame is back", bpy.context.scene.frame_current == 5, bpy.context.scene.frame_current)
    yield None
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.ed.undo()
    yield 0.5
    driver.check("one undo takes it away", "BipedCage Shape Keys" not in bpy.data.collections)


def a_native_rig() -> Iterator[float | None]:
    before = counts()
    bake("NATIVE_RIG")
    yield 0.7
    driver.key("RET")
    for _ in range(300):  # until it plays both, and then away
        yield 0.1
        if "BipedCage Native" in bpy.data.collections:
            break
    yield 0.3
    driver.screenshot("4_native_on_its_way")
    driver.check("both are seen while they are compared", "BipedCage Native" in bpy.data.collections)
    driver.key("ESC")
    yield 0.7
    driver.check("Esc takes the native rig back", counts() == before, f"{before} {counts()}")


def files(skins: int) -> Iterator[float | None]:
    cache = FOLDER / "walk.pc2"
    bake("MESH_CACHE", filepath=str(cache))
    yield 1.0
    yield from confirm_files()
    yield 0.5
    halfway = sorted(file.name for file in FOLDER.iterdir())
    driver.key("ESC")
    yield 0.7
    driver.check(
        "files are written beside their place", all(".partial." in name for name in halfway) and halfway, halfway
    )
    driver.check("Esc leaves no file", not list(FOLDER.iterdir()), list(FOLDER.iterdir()))
    built = bpy.app.build_options
    for target, name, count in (
        ("MESH_CACHE", "walk.pc2", skins),
        ("ALEMBIC", "x.abc", int(built.alembic)),  # refused where Blender is built without it
        ("USD", "x.usdc", int(built.usd)),
    ):
        for file in FOLDER.iterdir():
            file.unlink()
        bake(target, filepath=str(FOLDER / name))
        yield 1.0
        yield from confirm_files()
        for _ in range(150):
            yield 0.2
            done = [file for file in FOLDER.iterdir() if ".partial." not in file.name]
            if len(done) == count and len(list(FOLDER.iterdir())) == count:
                break
        yield 0.5
        driver.screenshot(f"5_{target.lower()}")
        found = sorted(file.name for file in FOLDER.iterdir())
        driver.check(
            f"{target} by the file browser", len(found) == count and not any("partial" in n for n in found), found
        )
        driver.check("the frame is back", bpy.context.scene.frame_current == 5, bpy.context.scene.frame_current)


driver.perform(acts())
