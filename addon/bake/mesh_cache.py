# SPDX-License-Identifier: GPL-3.0-or-later
"""To PC2 point caches, one a skin, which Blender's Mesh Cache modifier and other programs play."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import bpy

from . import files, pc2
from .drafts import Draft, draft
from .live import Skin, Steps, playing, posed_skins, refuse_unready, skins_of, times

SUFFIXES = (".pc2",)


@dataclass(frozen=True)
class MeshCaches:
    """What was baked: a file a skin and, where asked for, objects that play them."""

    files: list[Path]
    collection: bpy.types.Collection | None

    @property
    def summary(self) -> str:
        """One sentence for the artist."""
        playing = f"; '{self.collection.name}' plays them" if self.collection else ""
        names = ", ".join(f"'{file.name}'" for file in self.files[:3]) + (" and others" if len(self.files) > 3 else "")
        return f"Baked {names} in '{self.files[0].parent}'{playing}"


def steps(
    cage: bpy.types.Object, path: str, frame_start: int, frame_end: int, *, samples: int, result: bool
) -> Steps[MeshCaches]:
    """See `to_mesh_cache`."""
    refuse_unready(cage)
    at = times(frame_start, frame_end, samples=samples)
    skins = skins_of(cage)
    paths = _paths(cage, path, skins)
    with draft() as made, files.written(paths) as drafts, ExitStack() as stack:
        opened = [stack.enter_context(file.open("wb")) for file in drafts]
        for file, skin in zip(opened, skins, strict=True):
            count = len(skin.obj.data.vertices)
            pc2.write_header(file, points=count, start=frame_start, rate=1.0 / samples, samples=len(at))
        with playing(cage, at[0]) as go:
            for index, time in enumerate(at):
                for file, points in zip(opened, posed_skins(cage, go(time)), strict=True):
                    pc2.write_sample(file, points)
                yield (index + 1) / len(at)
        stack.close()  # before the files are moved: Windows does not move open ones
        if not result:
            return MeshCaches(paths, None)
        for skin, file in zip(skins, paths, strict=True):
            _player(made, skin, file, frame_start, samples)
        return MeshCaches(paths, made.finish(f"{cage.name} Mesh Cache"))


def _paths(cage: bpy.types.Object, path: str, skins: list[Skin]) -> list[Path]:
    """The file of each skin: `path` itself where there is one skin, else with the skin's name added."""
    whole = files.target(path, cage.name, SUFFIXES)
    if len(skins) == 1:
        return [whole]
    found: list[Path] = []
    for skin in skins:
        name = f"{whole.stem}-{bpy.path.clean_name(skin.obj.name)}"
        taken = sum(other.stem.lower().startswith(name.lower()) for other in found)
        found.append(whole.with_name(f"{name}{f'-{taken + 1}' if taken else ''}{whole.suffix}"))
    return found


def _player(made: Draft, skin: Skin, file: Path, start: int, samples: int) -> None:
    """A copy of the skin that plays the file by a Mesh Cache modifier where ours is."""
    obj, place = made.copy_skin(skin, f"{skin.obj.name} Mesh Cache")
    obj.shape_key_clear()  # the points have them
    mod = obj.modifiers.new("Mesh Cache", "MESH_CACHE")
    mod.cache_format, mod.filepath = "PC2", _relative(file)
    mod.deform_mode, mod.interpolation, mod.play_mode, mod.time_mode = "OVERWRITE", "LINEAR", "SCENE", "FRAME"
    mod.forward_axis, mod.up_axis = "POS_Y", "POS_Z"  # as they are
    mod.frame_scale, mod.frame_start = samples, start * samples  # it plays sample scale · frame − start
    obj.modifiers.move(len(obj.modifiers) - 1, place)


def _relative(file: Path) -> str:
    if not bpy.data.is_saved:
        return str(file)
    try:
        return bpy.path.relpath(str(file))
    except ValueError:  # another drive
        return str(file)
