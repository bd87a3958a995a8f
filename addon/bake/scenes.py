# SPDX-License-Identifier: GPL-3.0-or-later
"""To Alembic and USD by Blender's own exporters, and back by its importers: the skins alone, as the viewport has them.

An export is one call that Blender does not return from before its end: it can be cancelled before it begins, not later.
It tells its progress to the mouse pointer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import compat
from . import files
from .drafts import draft
from .live import BakeError, Steps, playing, refuse_paused, refuse_unready, skins_of, times

ALEMBIC = (".abc",)
USD = (".usdc", ".usd", ".usda")


@dataclass(frozen=True)
class SceneFile:
    """What was baked: the file and, where asked for, objects that play it."""

    file: Path
    collection: bpy.types.Collection | None

    @property
    def summary(self) -> str:
        """One sentence for the artist."""
        playing = f"; '{self.collection.name}' plays it" if self.collection else ""
        return f"Baked '{self.file}'{playing}"


def alembic_steps(
    cage: bpy.types.Object, path: str, frame_start: int, frame_end: int, *, samples: int, subdivide: bool, result: bool
) -> Steps[SceneFile]:
    """See `to_alembic`."""
    _refuse_missing(bpy.app.build_options.alembic, "Alembic")
    times(frame_start, frame_end, samples=samples)

    def write(file: Path) -> None:
        compat.call(
            bpy.ops.wm.alembic_export,
            filepath=str(file),
            check_existing=False,
            start=frame_start,
            end=frame_end,
            xsamples=samples,
            gsamples=samples,
            selected=True,
            visible_objects_only=False,
            face_sets=True,
            apply_subdiv=subdivide,
            export_hair=False,
            export_particles=False,
            evaluation_mode="VIEWPORT",
            as_background_job=False,
        )

    def read(file: Path) -> None:
        compat.call(bpy.ops.wm.alembic_import, filepath=str(file), set_frame_range=False, as_background_job=False)

    return (yield from _steps(cage, path, ALEMBIC, (frame_start, frame_end), write, read if result else None))


def usd_steps(
    cage: bpy.types.Object, path: str, frame_start: int, frame_end: int, *, subdivide: bool, result: bool
) -> Steps[SceneFile]:
    """See `to_usd`."""
    _refuse_missing(bpy.app.build_options.usd, "USD")
    times(frame_start, frame_end)

    def write(file: Path) -> None:
        with _scene_range(frame_start, frame_end):
            compat.call(
                bpy.ops.wm.usd_export,
                filepath=str(file),
                check_existing=False,
                selected_objects_only=True,
                visible_objects_only=False,
                export_animation=True,
                export_hair=False,
                export_subdivision="TESSELLATE" if subdivide else "BEST_MATCH",
                export_armatures=False,
                export_shapekeys=False,  # they would stand for the points
                export_textures=False,
                export_textures_mode="KEEP",  # nothing but the file is written
                convert_world_material=False,
                evaluation_mode="VIEWPORT",
            )

    def read(file: Path) -> None:
        compat.call(
            bpy.ops.wm.usd_import,
            filepath=str(file),
            set_frame_range=False,
            mtl_name_collision_mode="REFERENCE_EXISTING",
            import_textures_mode="IMPORT_NONE",
            create_world_material=False,
        )

    return (yield from _steps(cage, path, USD, (frame_start, frame_end), write, read if result else None))


def _refuse_missing(built_in: bool, name: str) -> None:
    if not built_in:
        raise BakeError(f"This Blender was built without {name}; use another build, or bake to a Mesh Cache")


def _steps(
    cage: bpy.types.Object,
    path: str,
    suffixes: tuple[str, ...],
    frames: tuple[int, int],
    write: Callable[[Path], None],
    read: Callable[[Path], None] | None,
) -> Steps[SceneFile]:
    refuse_unready(cage)
    target = files.target(path, cage.name, suffixes)
    yield 0.0
    skins = [skin.obj for skin in skins_of(cage)]
    with files.written([target]) as (file,), playing(cage, frames[0]), _selected(skins):
        with _watched(cage, frames) as troubles:
            _call(write, file, f"'{target.name}' can't be written")
        if troubles:
            raise troubles[0]
        if file.stat().st_size == 0:
            raise BakeError(f"'{target.name}' can't be written: Blender's exporter made nothing")
        yield 1.0
    return SceneFile(target, None if read is None else _read(cage, target, read))


def _call(act: Callable[[Path], None], file: Path, trouble: str) -> None:
    try:
        act(file)
    except RuntimeError as error:  # what an operator of Blender reports
        raise BakeError(f"{trouble}: {str(error).removeprefix('Error: ').strip()}") from error


def _read(cage: bpy.types.Object, target: Path, read: Callable[[Path], None]) -> bpy.types.Collection:
    """Import the file into a collection of its own."""
    view_layer = bpy.context.view_layer
    before = set(bpy.data.user_map())
    with draft() as made, _selected([]):
        collection = made.finish(f"{cage.name} {target.suffix.removeprefix('.').upper()}")
        active = view_layer.active_layer_collection
        view_layer.active_layer_collection = view_layer.layer_collection.children[collection.name]
        try:
            _call(read, target, f"'{target.name}' was written, but can't be read again")
        finally:
            view_layer.active_layer_collection = active
            for datablock in set(bpy.data.user_map()) - before - {collection}:
                made.add(datablock)
        return collection


@contextmanager
def _selected(objects: list[bpy.types.Object]) -> Iterator[None]:
    """These objects selected, the first one active; the selection is as before after."""
    layer = bpy.context.view_layer.objects
    active, selected = layer.active, [obj for obj in layer if obj.select_get()]
    _select(objects, objects[0] if objects else None)
    try:
        yield
    finally:
        _select(selected, active)


def _select(objects: list[bpy.types.Object], active: bpy.types.Object | None) -> None:
    layer = bpy.context.view_layer.objects
    for obj in layer:
        obj.select_set(obj in objects)
    layer.active = active


@contextmanager
def _scene_range(start: int, end: int) -> Iterator[None]:
    """The scene's frame range, which is what the USD exporter goes by."""
    scene = bpy.context.scene
    before = scene.frame_start, scene.frame_end
    scene.frame_start, scene.frame_end = start, end
    try:
        yield
    finally:
        scene.frame_start, scene.frame_end = before


@contextmanager
def _watched(cage: bpy.types.Object, frames: tuple[int, int]) -> Iterator[list[BakeError]]:
    """Yields what keeps the rig from being live at frames that Blender goes through, and tells how far it is."""
    troubles: list[BakeError] = []

    def watch(scene: bpy.types.Scene, *_: object) -> None:
        try:
            refuse_paused(cage, scene.frame_current_final)
        except BakeError as error:
            troubles.append(error)
        share = (scene.frame_current - frames[0]) / max(frames[1] - frames[0], 1)
        bpy.context.window_manager.progress_update(100.0 * min(max(share, 0.0), 1.0))

    bpy.app.handlers.frame_change_post.append(watch)
    try:
        yield troubles
    finally:
        bpy.app.handlers.frame_change_post.remove(watch)
