"""Generate a cage by hand: look at the sections, add, drag and remove nodes on bones, undo, Esc, Enter, then bind."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
from mathutils import Vector

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import RigObjects, build_biped

LOOK = 0.8


def counts() -> list[int]:
    kinds = ("objects", "meshes", "armatures", "collections", "node_groups", "images")
    return [len(getattr(bpy.data, kind)) for kind in kinds]


def shown() -> object:
    return sys.modules["bl_ext.user_default.cage_rig"].caging.current.shown()


def press_button() -> None:
    """What a click on the panel's button does."""
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.generate_cage("INVOKE_DEFAULT")


def choose(rig: RigObjects) -> None:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in (*rig.skins, rig.armature))
    bpy.context.view_layer.objects.active = rig.armature


def on_bone(rig: RigObjects, name: str, share: float) -> tuple[int, int]:
    bone = rig.armature.data.bones[name]
    return driver.on_screen(rig.armature.matrix_world @ bone.head_local.lerp(bone.tail_local, share))


def at_node(index: int) -> tuple[int, int]:
    editing = shown().editing
    return driver.on_screen(shown().to_world @ Vector(editing.course.point(editing.places[index])))


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_biped()
    bpy.data.objects.remove(rig.cage)
    bpy.context.scene.frame_set(8)
    yield LOOK
    driver.look_from_front(rig.skins)
    choose(rig)
    yield LOOK
    driver.show_tab()
    bpy.ops.ed.undo_push(message="Before")
    yield LOOK
    driver.screenshot("0_before")
    yield from look_and_leave(rig)
    yield from edit_nodes(rig)
    yield from cancel_work(rig)
    yield from refuse(rig)
    yield from generate(rig)
    yield from adjust()
    yield from take_back()
    yield from bend(rig)


def look_and_leave(rig: RigObjects) -> Iterator[float | None]:
    before = counts()
    press_button()
    yield 2.0
    driver.screenshot("1_sections")
    driver.check("sections are shown", shown() is not None and len(shown().editing.sections) > 20)
    driver.check("at rest", rig.armature.data.pose_position == "REST")
    driver.key("ESC")
    yield LOOK
    driver.check("Esc leaves", shown() is None and counts() == before, counts())
    driver.check("and the pose is back", rig.armature.data.pose_position == "POSE")


def edit_nodes(rig: RigObjects) -> Iterator[float | None]:
    press_button()
    yield 2.0
    editing = shown().editing
    count = len(editing.places)
    place = on_bone(rig, "thigh.L", 0.55)
    driver.move(place)
    yield LOOK
    driver.screenshot("2_offered")
    driver.check("a click is offered on a bone", editing.offered is not None)
    driver.click(place)
    yield LOOK
    driver.screenshot("3_added")
    driver.check("a click adds a node and its image", len(editing.places) == count + 2, len(editing.places))
    driver.check(
        "the node is on the bone",
        any(node.bone == "thigh.L" and abs(node.position - 0.55) < 0.1 for node in editing.nodes),
        editing.nodes,
    )
    index = count
    start = at_node(index)
    driver.move(start)
    yield LOOK
    driver.check("a node is meant where the mouse is", editing.hovered is not None)
    window = driver.window()
    window.event_simulate(type="LEFTMOUSE", value="PRESS", x=start[0], y=start[1])
    yield LOOK
    end = on_bone(rig, "thigh.L", 0.75)
    for step in range(1, 6):
        driver.move((start[0] + (end[0] - start[0]) * step // 5, start[1] + (end[1] - start[1]) * step // 5))
        yield 0.3
    driver.screenshot("4_dragged")
    window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=end[0], y=end[1])
    yield LOOK
    moved = editing.course.named(editing.places[index])
    driver.check("a drag moves it along the skeleton", abs(moved.position - 0.75) < 0.12, moved)
    image = editing.course.named(editing.places[index + 1])
    driver.check("and its image", image.bone == "thigh.R" and abs(image.position - moved.position) < 0.02, image)
    x, y = at_node(index)
    driver.move((x, y))
    yield LOOK
    driver.key("X", at=(x, y))
    yield LOOK
    driver.check("X removes it", len(editing.places) == count, len(editing.places))
    driver.key("Z", ctrl=True, at=(x, y))
    yield LOOK
    driver.check("Ctrl Z brings it back", len(editing.places) == count + 2, len(editing.places))
    window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y, ctrl=True)
    yield LOOK
    window.event_simulate(type="LEFTMOUSE", value="PRESS", x=x, y=y, ctrl=True)
    window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=x, y=y, ctrl=True)
    yield LOOK
    driver.check("Ctrl click removes it", len(editing.places) == count, len(editing.places))
    driver.key("J", at=(x, y))
    yield 2.0
    driver.screenshot("5_joints")
    driver.check("J places nodes at the joints", len(editing.places) > count, len(editing.places))
    driver.key("Z", ctrl=True, at=(x, y))
    yield LOOK
    driver.click(on_bone(rig, "thigh.L", 0.55))
    yield LOOK


def cancel_work(rig: RigObjects) -> Iterator[float | None]:
    before, sections = counts(), len(shown().editing.sections)
    driver.key("RET")
    yield 1.0
    driver.screenshot("6_working")
    driver.check("the core is at work", shown() is not None and bool(shown().working), shown() and shown().working)
    driver.key("ESC")
    for _ in range(40):
        yield 0.2
        if not shown().working:
            break
    driver.check("Esc goes back to the nodes", shown() is not None and len(shown().editing.sections) == sections)
    driver.check("nothing was made", counts() == before)


def refuse(rig: RigObjects) -> Iterator[float | None]:
    """What the core refuses goes back to the nodes, with the place in red."""
    generator = sys.modules["bl_ext.user_default.cage_rig"].generator
    node, place = 7, shown().editing.course.point(shown().editing.places[2])
    words = "the cage can't grow around the skin near control node 7 at (0.1, 0.0, 0.7): a bending node is needed there"
    result = generator.Job.result

    def refused(job: object) -> None:
        raise generator.Refusal(words, node, place)

    generator.Job.result = refused
    driver.key("RET")
    for _ in range(300):
        yield 0.2
        if not shown().working:
            break
    generator.Job.result = result
    yield LOOK
    driver.screenshot("7_refused")
    editing = shown().editing
    driver.check("the refusal names the bone", editing.message.startswith("At bone '") and words in editing.message)
    driver.check("and its place is shown", editing.fault is not None)
    bone = rig.armature.data.bones.active
    driver.check("the bone is the active one", bone is not None and f"'{bone.name}'" in editing.message, bone)


def adjust() -> Iterator[float | None]:
    """The panel that adjusts the last operation: triangles instead of quads, with the nodes that were edited."""
    area, _ = driver.view()
    panel = next(region for region in area.regions if region.type == "HUD")
    driver.click((panel.x + 20, panel.y + panel.height // 2))
    yield 1.5
    driver.screenshot("9_adjust")
    cage = bpy.context.object
    vertices = len(cage.data.vertices)
    panel = next(region for region in driver.view()[0].regions if region.type == "HUD")
    height = panel.height
    driver.check("the panel opens", height > 150, height)
    operator = bpy.context.window_manager.operators[-1]
    driver.check("it has the nodes", operator.own_nodes and len(operator.nodes) == len(cage.cage_rig_generated.nodes))
    rows = 10  # of the panel: its title, the nodes and the options
    step = height / (rows + 0.3)
    driver.click((panel.x + int(0.5 * panel.width), panel.y + height - int(4.6 * step)))
    for _ in range(300):
        yield 0.2
        cage = bpy.context.object
        if {len(face.vertices) for face in cage.data.polygons} == {3}:
            break
    yield LOOK
    driver.screenshot("9_adjusted")
    driver.check("an option makes the cage again", {len(face.vertices) for face in cage.data.polygons} == {3})
    driver.check("with the same nodes", len(cage.data.vertices) == vertices, len(cage.data.vertices))


def generate(rig: RigObjects) -> Iterator[float | None]:
    nodes = shown().editing.nodes
    press_button()  # it says Generate now
    yield LOOK
    driver.check("the button starts it too", shown() is not None and bool(shown().working))
    for _ in range(300):
        yield 0.2
        if shown() is None:
            break
    yield LOOK
    driver.screenshot("8_generated")
    cage = bpy.context.object
    kept = cage.cage_rig_generated
    driver.check("a cage is there", cage.type == "MESH" and len(cage.data.vertices) > 80, cage.name)
    driver.check("the nodes are kept", kept.own_nodes and len(kept.nodes) == len(nodes), len(kept.nodes))


def take_back() -> Iterator[float | None]:
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.ed.undo()
    yield LOOK
    driver.check(
        "one undo takes it away", not any("Cage" in obj.name for obj in bpy.data.objects), list(bpy.data.objects)
    )
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.ed.redo()
    yield LOOK


def bend(rig: RigObjects) -> Iterator[float | None]:
    cage = next(obj for obj in bpy.data.objects if obj.cage_rig_generated.armature)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = cage
    bpy.ops.cage_rig.bind()
    yield LOOK
    driver.check("it binds", cage.cage_rig.state == "LIVE", cage.cage_rig.message)
    driver.screenshot("9_bound")


driver.perform(acts())
