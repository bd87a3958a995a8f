"""Renders show the frames that the viewport shows: motion blur, and what goes on beside a render."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from baked import bake
from scene import Rig, bend, native, shown, update
from test_sync import key_the_bar

Picture = np.ndarray


def camera() -> None:
    scene = bpy.context.scene
    found = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    found.data.type, found.data.ortho_scale, found.location = "ORTHO", 3.0, (0.0, 0.0, 5.0)
    scene.collection.objects.link(found)
    scene.camera = found
    scene.render.resolution_x = scene.render.resolution_y = 96
    scene.render.film_transparent = True
    scene.render.engine, scene.cycles.samples, scene.cycles.seed = "CYCLES", 16, 0


def alpha(folder: Path, frame: int) -> Picture:
    scene = bpy.context.scene
    scene.frame_set(frame)
    scene.render.filepath = str(folder / "picture.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels[:], np.float32).reshape(96, 96, 4)[:, :, 3]
    bpy.data.images.remove(image)
    return pixels


@pytest.mark.parametrize("steps", [1, 3])
def test_motion_blur_is_that_of_a_cache_with_sub_frames(bar: Rig, tmp_path: Path, steps: int) -> None:
    key_the_bar(bar)
    camera()
    scene = bpy.context.scene
    sharp = alpha(tmp_path, 7)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    bar.skin.cycles.use_motion_blur = bar.skin.cycles.use_deform_motion = True
    bar.skin.cycles.motion_steps = steps
    live = alpha(tmp_path, 7)
    assert np.abs(live - sharp).sum() > 5.0, "it blurs"
    assert np.abs(alpha(tmp_path, 7) - live).sum() < 0.5, "and again the same"
    copies = bake().to_mesh_cache(bar.cage, str(tmp_path), frame_start=5, frame_end=9, samples=8)
    bar.skin.hide_render = True
    for obj in copies.collection.objects:
        obj.cycles.use_deform_motion, obj.cycles.motion_steps = True, steps
    cached = alpha(tmp_path, 7)
    assert np.abs(cached - live).sum() < 1.0
    scene.frame_set(7)
    assert scene.frame_subframe == 0.0


def test_workbench_renders_the_live_frames(bar: Rig, tmp_path: Path) -> None:
    key_the_bar(bar)
    camera()
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    live = [alpha(tmp_path, frame) for frame in (4, 6, 12)]
    assert min(np.abs(live[0] - live[1]).sum(), np.abs(live[1] - live[2]).sum()) > 5.0
    bake().to_mesh_cache(bar.cage, str(tmp_path), frame_start=4, frame_end=12)
    bar.skin.hide_render = True
    for frame, picture in zip((4, 6, 12), live, strict=True):
        assert np.abs(alpha(tmp_path, frame) - picture).sum() < 1.0, frame


def test_the_viewport_is_right_after_a_render(bar: Rig, tmp_path: Path) -> None:
    key_the_bar(bar)
    camera()
    scene = bpy.context.scene
    scene.frame_set(12)
    before = shown(bar.skin).copy()
    scene.frame_start, scene.frame_end = 3, 6
    scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    scene.frame_set(12)
    assert np.abs(shown(bar.skin) - before).max() < 1e-6


def test_what_a_render_is_at_is_read_again_when_it_has_ended(bar: Rig) -> None:
    """The end of a render waits for its turn; by then the next one may have begun, in a thread of its own."""
    import bl_ext.user_default.cage_rig.sync as sync

    before = shown(bar.skin).copy()
    sync.rendering(True)
    try:
        bend(bar, 1.0)
        sync.restored()
        assert np.abs(shown(bar.skin) - before).max() < 1e-6
    finally:
        sync.rendering(False)
    sync.restored()
    update()
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5
