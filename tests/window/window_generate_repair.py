"""Skins that can't be caged as they are: the dialog that offers their repaired hull, and its two answers."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bmesh
import bpy
from mathutils import Matrix

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.small import capsule

LOOK = 0.8


def shown() -> object:
    return sys.modules["bl_ext.user_default.cage_rig"].caging.current.shown()


def character() -> RigObjects:
    """A round bar with two bones, everything selected that Generate Cage needs."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.data.orphans_purge(do_recursive=True)
    rig = build_character(capsule())
    bpy.data.objects.remove(rig.cage)
    bpy.context.view_layer.update()
    driver.look_from_front(rig.skins)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.armature
    return rig


def reshape(skin: bpy.types.Object, act: object) -> None:
    work = bmesh.new()
    work.from_mesh(skin.data)
    act(work)
    work.to_mesh(skin.data)
    work.free()


def open_end(work: bmesh.types.BMesh) -> None:
    """A hole in the side."""
    gone = [face for face in work.faces if face.calc_center_median().z > 0.2 and abs(face.calc_center_median().x) < 0.1]
    bmesh.ops.delete(work, geom=gone, context="FACES")


def press_button() -> None:
    area, region = driver.view()
    driver.move(driver.centre())
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.generate_cage("INVOKE_DEFAULT")


def working() -> Iterator[float]:
    for _ in range(300):
        yield 0.2
        if shown() is None:
            return


def offered(name: str, fault: object) -> Iterator[float]:
    """The dialog, left with Esc and then answered with Enter; the nodes; the cage."""
    rig = character()
    reshape(rig.skins[0], fault)
    yield LOOK  # tabs are there once they are drawn
    driver.show_tab()
    yield LOOK
    count = len(bpy.data.objects), len(bpy.data.meshes)
    press_button()
    yield 1.5
    driver.screenshot(f"{name}_1_dialog")
    driver.check(f"{name}: nothing is edited before the answer", shown() is None)
    picked = [vertex for vertex in rig.skins[0].data.vertices if vertex.select]
    driver.check(f"{name}: the place is selected", 0 < len(picked) < len(rig.skins[0].data.vertices), len(picked))
    driver.key("ESC")
    yield LOOK
    driver.screenshot(f"{name}_2_left")
    driver.check(f"{name}: Esc leaves everything as it was", (len(bpy.data.objects), len(bpy.data.meshes)) == count)
    press_button()
    yield 1.5
    driver.key("RET")
    yield 3.0
    driver.screenshot(f"{name}_3_sections")
    driver.check(
        f"{name}: yes goes on to the nodes of the hull", shown() is not None and bool(shown().editing.sections)
    )
    driver.check(f"{name}: the hull is not in the file", (len(bpy.data.objects), len(bpy.data.meshes)) == count)
    if shown() is None:
        return
    driver.key("RET")
    yield from working()
    yield LOOK
    driver.screenshot(f"{name}_4_cage")
    cage = bpy.context.object
    driver.check(f"{name}: a cage of the hull is made", cage.cage_rig_generated.hull, cage.name)
    bpy.ops.cage_rig.bind()
    driver.check(f"{name}: it binds", cage.cage_rig.state == "LIVE", cage.cage_rig.message)


def crossing_start() -> Iterator[float]:
    """Nodes that a cage can't start from: the work ends at the nodes, with the sentence and the place."""
    rig = character()
    rig.armature.data.bones.active = None
    skin = rig.skins[0]
    skin.data.transform(Matrix.Diagonal((1.0, 1.6, 1.6, 1.0)))
    press_button()
    yield 2.0
    bone = rig.armature.data.bones["lower"]
    middle = bone.head_local.lerp(bone.tail_local, 0.5)
    for step in range(6):
        place = driver.on_screen(middle.lerp(bone.tail_local, 0.12 * step))
        driver.move(place)
        yield 0.3
        driver.click(place)
        yield 0.6
    driver.screenshot("start_1_nodes")
    driver.check("start: nodes are there", shown() is not None and len(shown().editing.places) >= 2)
    driver.key("RET")
    for _ in range(300):
        yield 0.2
        if shown() is None or not shown().working:
            break
    yield LOOK
    driver.screenshot("start_2_answer")
    made = shown() is None and bpy.context.object.cage_rig_generated.own_nodes
    said = shown() is not None and bool(shown().editing.message)
    driver.check("start: a cage or a sentence", made or said, shown() and shown().editing.message)
    if shown() is not None:
        driver.key("ESC")
        yield LOOK


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    yield LOOK
    yield from offered("hole", open_end)
    yield from crossing_start()


driver.perform(acts())
