"""Generated cages beside those of nested-cages, in one run: the second table that `make bench` prints.

The peer (Sacht, Vouga, Jacobson: Nested Cages, 2015) decimates the skin to as many triangles and inflates that; it has
no skeleton. It lives in a virtual environment of its own; where it can't be installed, its columns stay empty. Only
ratios within one run count: these machines are shared.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cage_rig_core as core
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "native"), str(ROOT)]
from characters import character

from blend_fixtures.arm import arm

SHARED = Path(os.environ.get("CAGE_RIG_SHARED") or ROOT.parent / "shared") / "data" / "characters"
NAMES = ("human_2k_53b", "human_24k_52b", "proc_octopus_20k_66b", "proc_airplane")
PEER_LIMIT = float(os.environ.get("PEER_SECONDS", "300"))
PEER = """
import sys, time
import numpy as np, nested_cages
given = np.load(sys.argv[1])
skin, faces = np.asfortranarray(given["skin"]), np.asfortranarray(given["faces"].astype(np.int32))
start = time.perf_counter()
cage = nested_cages.nested_cages(skin, faces, num_faces=[int(given["count"])], quad_order=1)[0]
np.savez(sys.argv[2], vertices=np.array(cage[0]), faces=np.array(cage[1]), seconds=time.perf_counter() - start)
"""


def peer_python() -> Path | None:
    """The peer's interpreter; None, and a sentence, where it can't be installed."""
    folder = ROOT / ".venvs" / "nested-cages"
    python = folder / "bin" / "python"
    if not python.exists():
        print("installing the peer nested-cages ...", flush=True)
        made = subprocess.run([sys.executable, "-m", "venv", str(folder)], check=False, capture_output=True)
        install = [str(python), "-m", "pip", "install", "--quiet", "nested-cages", "numpy"]
        if made.returncode or subprocess.run(install, check=False, capture_output=True).returncode:
            print("The peer nested-cages can't be installed here; its columns stay empty.")
            return None
    return python


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def peer(python: Path, skin: np.ndarray, faces: np.ndarray, count: int) -> str:
    """Seconds and volume ratio of the peer's cage with as many triangles, or why there is none."""
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder, "given.npz"), Path(folder, "found.npz")
        np.savez(given, skin=skin, faces=faces, count=count)
        try:
            command = [str(python), "-c", PEER, str(given), str(found)]
            subprocess.run(command, check=False, capture_output=True, timeout=PEER_LIMIT)
        except subprocess.TimeoutExpired:
            return f"none within {PEER_LIMIT:.0f} s"
        if not found.exists():
            return "fails"
        cage = np.load(found)
        ratio = volume(cage["vertices"], cage["faces"]) / volume(skin, faces)
        return f"{float(cage['seconds']):8.1f} {ratio:6.2f}"


def inputs() -> dict[str, tuple[np.ndarray, ...]]:
    shape = arm()
    part = shape.skins[0]
    quads = np.asarray(part.faces)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    ends = np.array([point for bone in shape.bones for point in (bone.head, bone.tail)])
    pairs = [(k, k + 1) for k in range(len(ends) - 1)]
    found = {"arm of the fixtures": (np.asarray(part.vertices), faces, ends, np.array(pairs))}
    for name in NAMES:
        path = SHARED / f"{name}.glb"
        if path.is_file():
            found[name] = character(path)
        else:
            print(f"{path} is not there; left out")
    return found


def main() -> None:
    python = peer_python()
    head = f"{'skin':24} {'triangles':>9} {'vertices':>8} {'ours s':>8} {'volume':>6} {'distance':>8} {'preview s':>9}"
    print(f"{head}   peer s, volume")
    for name, (skin, faces, nodes, edges) in inputs().items():
        start = time.perf_counter()
        core.cage_sections(skin, faces, nodes, edges)
        preview = time.perf_counter() - start
        start = time.perf_counter()
        try:
            vertices, triangles, report = core.generate_cage(skin, faces, nodes, edges, options={"triangles": True})
        except core.CagingError as refused:
            print(f"{name:24} {len(faces):9} {refused}")
            continue
        seconds = time.perf_counter() - start
        other = peer(python, skin, faces, len(triangles)) if python else "-"
        row = f"{name:24} {len(faces):9} {len(vertices):8} {seconds:8.1f} {report['volume_ratio']:6.2f}"
        print(f"{row} {report['mean_distance']:8.4f} {preview:9.2f}   {other}", flush=True)


if __name__ == "__main__":
    main()
