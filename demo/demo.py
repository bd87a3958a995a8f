"""Runs the main job of Cage Rig on a character and shows it: a .blend with the rig live, a picture, a baked Alembic;
a picture of the skinning methods on an arm; cage keys beside a punch and a walk, as a picture, a film and a .blend.

python tools/with_extension.py demo/demo.py --out DIR [--quick] [--rig FILE] [--cage FILE]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from showcase import acting, coupling, figures, film, keys, keys_picture, load_rig, methods, methods_picture, picture
from showcase.bars import bar_figures, bound_bar
from showcase.stages import Stages

from blend_fixtures.build import RigObjects, build_biped
from blend_fixtures.punch import STRIKE

BAR_PLACE = (2.8, 0.0, 0.28)
VIEW = np.radians(-32.0)


def main() -> None:
    args = _arguments()
    if not coupling.is_available():
        sys.exit("demo: the Cage Rig extension is not enabled; run 'make demo'")
    folder = args.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    stages = Stages()
    acting.set_frames()
    loaded = _character(stages, args)
    rig, frame = loaded.rig, loaded.frame
    bar = None if args.rig else _bar(stages)
    states = _act(stages, loaded)
    bars = _bend(stages, bar)
    skins = [*rig.skins, *(bar.skins if bar else [])]
    with stages.stage("bake Alembic") as notes:
        acting.export_alembic(folder / "demo.abc", skins)
        notes.append(f"{(folder / 'demo.abc').stat().st_size / 1e6:.1f} MB")
    with stages.stage("save .blend"):
        bpy.context.scene.frame_set(frame)
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "demo.blend"), compress=True)
    with stages.stage("picture"):
        picture.draw_picture(folder / "demo.png", states, bars, quick=args.quick, yaw=VIEW)
    written = ["demo.png", "demo.blend", "demo.abc"]
    if not args.rig:
        _methods(stages, folder / "methods.png", quick=args.quick)
        written[1:1] = ["methods.png", "keys.png", "keys.blend", _keys(stages, folder, quick=args.quick)]
    stages.total()
    print("see", ", ".join(str(folder / name) for name in written))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for what is written")
    parser.add_argument("--quick", action="store_true", help="smaller, coarser pictures")
    parser.add_argument("--rig", type=Path, help="a rigged .glb, .gltf, .fbx or .blend, or a rig of text files (.skt)")
    parser.add_argument("--cage", type=Path, help="a cage as .obj, .ply or .glb; without it a coarse hull is made")
    return parser.parse_args()


def _character(stages: Stages, args: argparse.Namespace) -> load_rig.Loaded:
    """The character in the scene."""
    name = "build the character" if args.rig is None else f"load {args.rig.name}"
    with stages.stage(name) as notes:
        try:
            loaded = load_rig.load_rig(args.rig, args.cage) if args.rig else load_rig.Loaded(build_biped(), frame=1)
        except ValueError as error:
            sys.exit(f"demo: {error}")
        notes.append(_summary(loaded.rig))
        notes.extend([loaded.note] if loaded.note else [])
    return loaded


def _bar(stages: Stages) -> RigObjects:
    with stages.stage("build and bind the bar"):
        return bound_bar(BAR_PLACE)


def _act(stages: Stages, loaded: load_rig.Loaded) -> list[figures.Figure]:
    """Bind, pose, edit the rest cage, key it and play; returns the states for the picture."""
    rig, scene = loaded.rig, bpy.context.scene
    with stages.stage("bind"):
        acting.ensure_fat_key(rig)
        coupling.bind(rig)
    with stages.stage("pose and edit the cage") as notes:
        states = _states(rig, frame=loaded.frame, key=loaded.edit_key, notes=notes)
    with stages.stage("key the cage and play") as notes:
        first, last = scene.frame_start, scene.frame_end
        if not loaded.cage_is_animated:
            acting.animate_key(rig, loaded.edit_key, {first: 0.0, (first + last) // 2: 1.0, last: 0.0})
        seconds = acting.play(first, last)
        coupling.require_live(rig)
        vertices = sum(len(skin.data.vertices) for skin in rig.skins)
        notes.append(f"{last - first + 1} frames of {vertices} vertices at {1.0 / seconds:.0f} a second")
    return states


def _states(rig: RigObjects, *, frame: int, key: str, notes: list[str]) -> list[figures.Figure]:
    """The four states of the picture: rest, posed, posed and edited, refit bones."""
    bpy.context.scene.frame_set(frame)
    acting.clear_keys(rig)
    acting.show_rest(rig, True)
    states = [figures.freeze("Rest", rig.skins, cage=rig.cage)]
    acting.show_rest(rig, False)
    states.append(figures.freeze("Posed by the bones", rig.skins, cage=coupling.posed_cage(rig)))
    before = np.concatenate([acting.evaluated_points(skin) for skin in rig.skins])
    acting.set_key(rig, key, 1.0)
    after = np.concatenate([acting.evaluated_points(skin) for skin in rig.skins])
    title = "…and fattened with the cage" if key == acting.FAT else "…and edited with the cage"
    states.append(figures.freeze(title, rig.skins, cage=coupling.posed_cage(rig)))
    notes.append(f"the cage moved the skin by up to {np.linalg.norm(after - before, axis=1).max():.3g}")
    states.append(_refit_state(rig))
    acting.clear_keys(rig)
    return states


def _refit_state(rig: RigObjects) -> figures.Figure:
    """The character with its refit bones: in other proportions, if the cage has a key for that."""
    title = "The bones follow the cage"
    if acting.SHORT in rig.cage.data.shape_keys.key_blocks:
        acting.clear_keys(rig)
        acting.set_key(rig, acting.SHORT, 1.0)
        title = "Reshaped: the bones follow"
    return figures.freeze(title, rig.skins, armature=coupling.refit_armature(rig))


def _bend(stages: Stages, bar: RigObjects | None) -> list[figures.Figure]:
    if bar is None:
        return []
    with stages.stage("bend the bar"):
        return bar_figures(bar)


def _methods(stages: Stages, path: Path, *, quick: bool) -> None:
    """The arm under each skinning method, as a picture of its own."""
    with stages.stage("build and bind the arm"):
        rig = methods.bound_arm()
    rows = []
    for identifier, name in coupling.methods(rig):
        with stages.stage(f"arm, {name}") as notes:
            rows.append(methods.method_row(rig, identifier, name))
            notes.extend(rows[-1].elbow.facts())
    with stages.stage("picture of the methods"):
        methods_picture.draw_methods(path, rows, quick=quick)


def _keys(stages: Stages, folder: Path, *, quick: bool) -> str:
    """Cage keys beside a punch and a walk, in a file of their own; returns the film's name."""
    with stages.stage("key punch and walk") as notes:
        bpy.ops.wm.read_homefile(use_empty=True)
        stage = film.build_stage()
        left, right = film.places(stage)
        acts = [keys.punch_act(left), keys.walk_act(right)]
        strips = [keys.strip(act) for act in acts]
        film.dress(stage, acts)
        notes.extend(f"{act.name.lower()}: cage keys at {', '.join(f'{k:g}' for k in act.cage_keys())}" for act in acts)
    with stages.stage("picture of the keys"):
        keys_picture.draw_keys(folder / "keys.png", strips, quick=quick)
    with stages.stage("film of the keys") as notes:
        shot = film.shoot(stage, folder, quick=quick)
        notes.append(shot.name)
    film.save(folder / "keys.blend", frame=STRIKE)
    return str(shot.relative_to(folder))


def _summary(rig: RigObjects) -> str:
    vertices = sum(len(skin.data.vertices) for skin in rig.skins)
    return (
        f"{len(rig.skins)} meshes, {vertices} vertices, {len(rig.armature.data.bones)} bones, "
        f"cage of {len(rig.cage.data.vertices)}"
    )


if __name__ == "__main__":
    main()
