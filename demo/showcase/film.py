"""The acts as a short film: every character live on one stage over its time line; keys.blend plays it too."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .keys import Act
from .placing import CAGE_BLUE, add_lines
from .studio import Quality, Studio, flat_material
from .timeline import BONE_GREY, DEPTH, Ruler, add_lane, add_stretch

WIDTH, HEIGHT, FLOOR = 8.0, 3.0, -0.65  # metres
FRAMES, RATE = 48, 24
PLACES = ((-3.00, 60.0), (-1.10, 60.0), (1.45, 50.0), (3.15, 50.0))  # from left to right, and turned by degrees
STEP, QUICK_STEP = 2, 12  # from one frame of the film to the next
FULL, QUICK = Quality(scale=0.8, samples=2, guided=True), Quality(scale=0.4, samples=2, guided=True)
CAPTIONS = ("bones alone", "with cage keys")


def build_stage() -> Studio:
    """A stage in a scene of its own, which becomes the file's only one."""
    studio = Studio("Cage Keys", width=WIDTH, height=HEIGHT)
    others = [scene for scene in bpy.data.scenes if scene != studio.scene]
    bpy.context.window.scene = studio.scene
    for scene in others:
        bpy.data.scenes.remove(scene)
    scene = studio.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, RATE
    return studio


def places(studio: Studio) -> tuple[list[Matrix], list[Matrix]]:
    """Where the two characters of each act stand."""
    found = [
        Matrix.Translation(studio.on_plane(x, FLOOR)) @ Matrix.Rotation(np.radians(yaw), 4, "Z") for x, yaw in PLACES
    ]
    return found[:2], found[2:]


def dress(studio: Studio, acts: Sequence[Act]) -> None:
    """The floor, captions, and under each act its keys with a line that runs with the frames."""
    studio.add_floor(height=studio.on_plane(0.0, FLOOR).z)
    for k, act in enumerate(acts):
        stands = PLACES[2 * k : 2 * k + 2]
        for (x, _), caption in zip(stands, CAPTIONS, strict=True):
            studio.add_label(caption, x=x, y=FLOOR - 0.25, size=0.18)
        left, right = stands[0][0] - 0.45, stands[1][0] + 0.55
        ruler = Ruler(left - (right - left) / FRAMES, (right - left) / FRAMES, (1, FRAMES))
        _add_sheet(studio, act, ruler)


def shoot(studio: Studio, folder: Path, *, quick: bool) -> Path:
    """Render a film into `folder`, or pictures if this Blender writes no films; returns which."""
    scene, settings = studio.scene, studio.scene.render.image_settings
    studio.set_up(QUICK if quick else FULL)
    studio.whiten_floor()
    path = folder / "keys.mp4"
    try:
        _choose_film(scene)
    except TypeError:
        settings.file_format = "PNG"
        path = folder / "keys" / "####.png"
    step = QUICK_STEP if quick else STEP
    scene.frame_step, scene.render.fps = step, RATE // step
    scene.render.filepath, scene.render.use_file_extension = str(path), False
    bpy.ops.render.render(animation=True, scene=scene.name)
    scene.frame_step, scene.render.fps = 1, RATE
    return path


def save(path: Path, *, frame: int) -> None:
    """Save the stage, at `frame` and ready to be played or rendered, and nothing else."""
    bpy.data.orphans_purge(do_recursive=True)
    bpy.context.scene.frame_set(frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)


def _choose_film(scene: bpy.types.Scene) -> None:
    """H.264 in an .mp4. Raises TypeError if this Blender was built without FFmpeg."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # Blender 5
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    video = scene.render.ffmpeg
    video.format, video.codec, video.constant_rate_factor = "MPEG4", "H264", "HIGH"


def _add_sheet(studio: Studio, act: Act, ruler: Ruler) -> None:
    bones, cage = FLOOR - 0.51, FLOOR - 0.70
    for name, keys, y, color in (
        ("bones", act.bone_keys(), bones, BONE_GREY),
        ("cage", act.cage_keys(), cage, CAGE_BLUE),
    ):
        studio.add_label(name, x=ruler.at(0) - 0.06, y=y, size=0.15, color=color, align="RIGHT")
        add_lane(studio, ruler, [frame for frame in keys if frame <= FRAMES], y=y, color=color, size=0.045)
    add_stretch(studio, ruler, act.cage_keys(), y=cage)
    reach = 0.5 * (bones - cage) + 0.09
    middle = studio.on_plane(0.0, 0.5 * (bones + cage), depth=DEPTH + 1.0)
    up = studio.on_plane(0.0, reach)
    corners = [middle + a * up + b * studio.on_plane(0.012, 0.0) for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    head = add_lines(
        studio, "Playhead", np.array(corners), [[0, 1, 2, 3]], surface=flat_material("Playhead", (0.85, 0.12, 0.03))
    )
    head.driver_add("location", 0).driver.expression = f"{ruler.x:.6f} + {ruler.pitch:.6f} * frame"
