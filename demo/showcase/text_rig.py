"""A rig of text files, the format of [CTL*20]'s prototype: X.obj, X_cage.obj, X.skt, X.skw, X_skelAnim.txt,
X_cageAnim.txt.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from blend_fixtures.build import RigObjects, add_armature, add_cage, add_shape_key, add_skin
from blend_fixtures.parts import Array, Bone, Cage, Skin

_RATE = 24.0


def load_text_rig(path: Path) -> tuple[RigObjects, int, str]:
    """The rig with both animations keyed; a frame that shows its pose, and the shape key of its strongest cage edit."""
    stem = next(iter(sorted(path.glob("*.skt")))) if path.is_dir() else path
    base = str(stem.with_suffix(""))
    vertices, faces = _read_obj(Path(base + ".obj"))
    bones, joints = _read_skeleton(stem)
    skin = Skin(
        stem.stem, vertices, np.array(faces), _read_weights(Path(base + ".skw"), len(vertices), len(bones)), ("Clay",)
    )
    armature = add_armature(stem.stem + "Rig", bones)
    upright = Matrix.Rotation(0.5 * np.pi, 4, "X")
    armature.matrix_world = upright
    skin_object = add_skin(skin, [bone.name for bone in bones], armature)
    cage = add_cage(stem.stem + "Cage", Cage(*_read_obj(Path(base + "_cage.obj"))))
    cage.matrix_world = upright
    times = _key_skeleton(armature, joints, Path(base + "_skelAnim.txt"))
    edit = _key_cage(cage, Path(base + "_cageAnim.txt"))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, _frame(times[-1])
    bpy.context.view_layer.update()
    return RigObjects([skin_object], armature, cage), _frame(times[len(times) // 2]), edit


def _frame(seconds: float) -> int:
    return 1 + round(seconds * _RATE)


def _rows(path: Path, mark: str) -> list[list[str]]:
    """The words after `mark` of each line that starts with it; without a mark, of every line."""
    lines = [line.split() for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return [words[1:] for words in lines if words[0] == mark] if mark else lines


def _read_obj(path: Path) -> tuple[Array, list[list[int]]]:
    """Vertices (#V by 3) and faces of an .obj, as they are written."""
    vertices = np.array([[float(x) for x in row[:3]] for row in _rows(path, "v")])
    return vertices, [[int(word.split("/")[0]) - 1 for word in row] for row in _rows(path, "f")]


def _read_skeleton(path: Path) -> tuple[list[Bone], Array]:
    """Bones and joints (#J by 3); a bone ends at the mean of its children, a last one goes on as its parent did."""
    rows = sorted(_rows(path, "j"), key=lambda row: int(row[0]))
    joints = np.array([[float(x) for x in row[3:6]] for row in rows])
    parents = [int(row[2]) for row in rows]
    bones = []
    for j, row in enumerate(rows):
        children = [k for k, parent in enumerate(parents) if parent == j]
        onward = joints[j] - joints[parents[j]] if parents[j] >= 0 else np.array([0.0, 0.0, 1.0])
        tail = joints[children].mean(axis=0) if children else joints[j] + 0.6 * onward
        if np.linalg.norm(tail - joints[j]) < 1e-3:
            tail = joints[j] + np.array([0.0, 0.0, 1.0])
        parent = rows[parents[j]][1] if parents[j] >= 0 else None
        bones.append(Bone(row[1], tuple(joints[j].tolist()), tuple(tail.tolist()), parent))
    return bones, joints


def _read_weights(path: Path, vertices: int, bones: int) -> Array:
    """Dense weights (#V by #J) as written; rows sum to nearly 1."""
    weights = np.zeros((vertices, bones))
    table = np.array([[float(word) for word in row] for row in _rows(path, "")])
    weights[table[:, 1].astype(int), table[:, 0].astype(int)] = table[:, 2]
    return weights


def _key_skeleton(armature: bpy.types.Object, joints: Array, path: Path) -> list[float]:
    """Key the global joint frames of the file as bone channels; returns the key times in seconds."""
    times = [float(row[0]) for row in _rows(path, "k")]
    rows = _rows(path, "s")
    names = [bone.name for bone in armature.data.bones]
    for key, seconds in enumerate(times):
        frames = [[float(x) for x in row[1:]] for row in rows if int(row[0]) == key]
        moved: dict[str, Matrix] = {}
        for name, joint, (rx, ry, rz, *position) in zip(names, joints, frames, strict=True):
            turn = Euler(np.radians((rx, ry, rz)), "XYZ").to_matrix().to_4x4()
            moved[name] = Matrix.Translation(position) @ turn @ Matrix.Translation(-Vector(joint))
        for bone in armature.pose.bones:
            _key_bone(bone, moved, _frame(seconds))
    return times


def _key_bone(bone: bpy.types.PoseBone, moved: dict[str, Matrix], frame: int) -> None:
    """Key location and rotation so that the bone moves by `moved` (rest to pose, armature space)."""
    rest = bone.bone.matrix_local
    before = moved[bone.parent.name] if bone.parent else Matrix()
    bone.location, bone.rotation_quaternion, _ = (
        rest.inverted() @ before.inverted() @ moved[bone.name] @ rest
    ).decompose()
    bone.keyframe_insert("location", frame=frame)
    bone.keyframe_insert("rotation_quaternion", frame=frame)


def _key_cage(cage: bpy.types.Object, path: Path) -> str:
    """One shape key per cage key, fading into the next; returns the name of the strongest."""
    times = [float(row[0]) for row in _rows(path, "k")]
    rows = _rows(path, "c")
    rest = np.array([vertex.co for vertex in cage.data.vertices])
    strongest, size = "", 0.0
    for key in range(len(times)):
        offsets = np.array([[float(x) for x in row[1:]] for row in rows if int(row[0]) == key])
        reach = float(np.abs(offsets).max())
        if reach == 0.0:
            continue
        block = add_shape_key(cage, f"Cage {key}", rest + offsets)
        if reach > size:
            strongest, size = block.name, reach
        for other in {max(key - 1, 0), key, min(key + 1, len(times) - 1)}:
            block.value = 1.0 if other == key else 0.0
            block.keyframe_insert("value", frame=_frame(times[other]))
    return strongest
