"""Play in the viewport while an animation renders, with and without Lock Interface: no crash, the right frames."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.bar import bar
from blend_fixtures.build import build_character

FRAMES = range(2, 8)


def acts() -> Iterator[float | None]:
    driver.key("ESC")
    yield 0.5
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_character(bar())
    yield 0.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    yield 0.5
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.bind("EXEC_DEFAULT")
    animate(rig)
    set_up_camera()
    yield 0.5
    truth = still_pictures()
    for locked in (True, False):
        yield from render_while_playing(rig, truth, locked=locked)


def animate(rig: object) -> None:
    bone = rig.armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (10, 1.5)):
        bone.rotation_euler = (0.0, 0.0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    key = rig.cage.data.shape_keys.key_blocks[1]
    for frame, value in ((1, 0.0), (10, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def set_up_camera() -> None:
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 4.0, (0.0, 0.0, 5.0)
    scene.collection.objects.link(camera)
    scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", 8
    scene.render.resolution_x = scene.render.resolution_y = 128
    scene.render.film_transparent = True
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]


def picture(path: str) -> np.ndarray:
    image = bpy.data.images.load(path)
    pixels = np.array(image.pixels[:], np.float32).reshape(128, 128, 4)[:, :, 3]
    bpy.data.images.remove(image)
    return pixels


def still_pictures() -> dict[int, np.ndarray]:
    """Every frame rendered alone, nothing else going on."""
    scene = bpy.context.scene
    found = {}
    for frame in FRAMES:
        scene.frame_set(frame)
        scene.render.filepath = str(driver.OUT / f"still_{frame:04}.png")
        bpy.ops.render.render("EXEC_DEFAULT", write_still=True)
        found[frame] = picture(scene.render.filepath)
    return found


def render_while_playing(rig: object, truth: dict[int, np.ndarray], *, locked: bool) -> Iterator[float | None]:
    scene = bpy.context.scene
    scene.render.use_lock_interface = locked
    name = "locked" if locked else "open"
    scene.render.filepath = str(driver.OUT / f"{name}_")
    bpy.context.preferences.view.render_display_type = "NONE"
    with bpy.context.temp_override(window=driver.window()):
        bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
    yield 0.3
    if not locked:
        driver.key("SPACE")  # plays in the viewport meanwhile
    waited = 0.0
    while bpy.app.is_job_running("RENDER") and waited < 120.0:
        waited += 0.3
        yield 0.3
    if not locked:
        driver.screenshot("played")
        driver.key("SPACE")
    yield 0.5
    driver.check(f"{name}: the render ends", waited < 120.0)
    files = [Path(driver.OUT / f"{name}_{frame:04}.png") for frame in FRAMES]
    driver.check(f"{name}: every frame is there", all(file.exists() for file in files))
    if all(file.exists() for file in files):
        worst = max(np.abs(picture(str(file)) - truth[frame]).sum() for frame, file in zip(FRAMES, files, strict=True))
        driver.check(f"{name}: every frame is right", worst < 1.0, worst)
    driver.check(f"{name}: still live", rig.cage.cage_rig.state == "LIVE", rig.cage.cage_rig.message)
    yield 0.5


driver.perform(acts())
