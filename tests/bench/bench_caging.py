"""Generated cages beside those of nested-cages, in one run: the table of docs/generate_bench.md.

    python tests/bench/bench_caging.py                    every skin
    python tests/bench/bench_caging.py human_2k_53b       some; the table keeps what was measured of the others
    python tests/bench/bench_caging.py --only ours        or peer: the other's measures are kept

The peer (Sacht, Vouga, Jacobson: Nested Cages, 2015) decimates the skin to as many triangles as our cage has and
inflates that; it knows no skeleton. It lives in an environment of its own, which also measures both cages, by libigl;
where that can't be installed, its columns stay empty. It computes in one thread, and its processor seconds are told,
which a busy machine doesn't lengthen; after PEER_SECONDS of them it is given up. Ours are seconds of the clock.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cage_rig_core as core
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "native"), str(ROOT)]
from characters import character

from blend_fixtures.arm import arm

EXAMPLE = os.environ.get("NESTED_CAGES_EXAMPLE")  # the peer's own: gargo.off of its repository, without a skeleton
SHARED = Path(os.environ.get("CAGE_RIG_SHARED") or ROOT.parent / "shared") / "data" / "characters"
PEER = Path(__file__).with_name("nested_cages_peer.py")
PEER_SECONDS = int(os.environ.get("PEER_SECONDS", "240"))
OUT_OF_TIME = -24  # SIGXCPU
ENERGIES = ("None", "Volume")  # of the peer, as it comes and pressed tightest
KEPT = ROOT / "build" / "bench" / "caging.json"
TABLE = ROOT / "docs" / "generate_bench.md"
Skin = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Case:
    """A skin and what its cage may take at most, in seconds on two cores."""

    name: str
    limit: float


CASES = (
    Case("arm", 10),
    Case("human_2k_53b", 10),
    Case("human_24k_52b", 10),
    Case("human_200k_53b", 20),
    Case("proc_octopus_20k_66b", 15),
    Case("proc_humanoid_fingers_30k_63b", 15),
    Case("proc_airplane", 10),
    Case("gargo", 10),
)


def skin_of(case: Case) -> Skin | None:
    """Vertices, triangles, nodes and edges; None, and a sentence, where there is no such file."""
    if case.name == "arm":
        return bare_arm()
    if case.name == "gargo":
        if EXAMPLE:
            return example(Path(EXAMPLE))
        print("NESTED_CAGES_EXAMPLE names no file; the peer's example is left out")
        return None
    path = SHARED / f"{case.name}.glb"
    if not path.is_file():
        print(f"{path} is not there; left out")
        return None
    return character(path)


def mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles in OFF."""
    words = path.read_text().split()
    count, faces = int(words[1]), int(words[2])
    numbers = words[4:]
    points = np.array(numbers[: 3 * count], float).reshape(-1, 3)
    return points, np.array(numbers[3 * count : 3 * count + 4 * faces], int).reshape(-1, 4)[:, 1:]


def example(path: Path) -> Skin:
    """A mesh, with the skeleton that is found in it."""
    points, triangles = mesh(path)
    return points, triangles, *core.extract_skeleton(points, triangles)


def bare_arm() -> Skin:
    """The largest closed part of the fixture, without sleeve and hem: the peer takes one part alone."""
    shape = arm()
    part = shape.skins[0]
    label = np.arange(len(part.vertices))
    for _ in range(len(label)):
        least = label[part.faces].min(axis=1)
        before = label.copy()
        for k in range(4):
            np.minimum.at(label, part.faces[:, k], least)
        if np.array_equal(label, before):
            break
    quads = part.faces[label[part.faces[:, 0]] == np.bincount(label).argmax()]
    used, inverse = np.unique(quads, return_inverse=True)
    quads = inverse.reshape(-1, 4)
    nodes = [bone.head for bone in shape.bones] + [shape.bones[-1].tail]
    edges = [(k, k + 1) for k in range(len(shape.bones))]
    return (
        part.vertices[used],
        np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]),
        np.array(nodes),
        np.array(edges),
    )


def peer_python() -> Path | None:
    """The peer's interpreter; None, and a sentence, where it can't be installed."""
    folder = ROOT / ".venvs" / "nested-cages"
    python = folder / "bin" / "python"
    if not python.exists():
        print("installing the peer nested-cages ...", flush=True)
        made = subprocess.run([sys.executable, "-m", "venv", str(folder)], check=False, capture_output=True)
        install = [str(python), "-m", "pip", "install", "--quiet", "nested-cages", "libigl", "numpy"]
        if made.returncode or subprocess.run(install, check=False, capture_output=True).returncode:
            print("The peer nested-cages can't be installed here; its columns stay empty.")
            return None
    return python


def ours(case: Case, given: Skin) -> dict[str, Any]:
    """Our cage; how long the sections of its preview take alone, and the cage again when one node was moved."""
    start = time.perf_counter()
    core.cage_sections(*given)
    preview = time.perf_counter() - start
    start = time.perf_counter()
    try:
        generator = core.CageGenerator(*given, options={"triangles": True})
        vertices, triangles, report = generator.generate().result()
    except core.CagingError as refused:
        return {"refused": str(refused)}
    found = {"seconds": time.perf_counter() - start, "preview": preview, "limit": case.limit}
    bending = [section for section in report["sections"] if section["kind"] == "bending"]
    places = np.array([section["place"] for section in bending])
    middle = len(bending) // 2
    places[middle] += 0.3 * bending[middle]["radius"] * bending[middle]["direction"]
    start = time.perf_counter()
    _, _, edited = generator.generate(places, (None, vertices, triangles)).result()
    found |= {"edit": time.perf_counter() - start, "kept": edited["kept_vertices"]}
    found |= {"volume": report["volume_ratio"], "distance": report["mean_distance"]}
    return found | {"vertices": vertices, "triangles": triangles}


def peer(
    python: Path, given: Skin, count: int, energy: str, folder: Path, rough: dict[str, np.ndarray] | None = None
) -> dict[str, Any]:
    """The peer's cage of as many triangles, or from a rough one (`vertices`, `triangles`), measured; or why not."""
    found = folder / "found.npz"
    found.unlink(missing_ok=True)
    np.savez(folder / "given.npz", skin=given[0], faces=given[1], count=count, **(rough or {}))
    command = [str(python), str(PEER), "cage", str(folder / "given.npz"), str(found), energy, str(PEER_SECONDS)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode == OUT_OF_TIME:
        return {"refused": f"none in {PEER_SECONDS} s"}
    if not found.exists():
        why = (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1]
        return {"refused": "fails", "why": why}
    with np.load(found) as cage:
        made = {"seconds": float(min(cage["seconds"], cage["processor"]))}
        return made | measured(python, given, cage["vertices"], cage["triangles"], folder)


def measured(python: Path, given: Skin, vertices: np.ndarray, triangles: np.ndarray, folder: Path) -> dict[str, Any]:
    """Any cage, by libigl: the same way for both."""
    file = folder / "measure.npz"
    np.savez(file, skin=given[0], faces=given[1], vertices=vertices, triangles=triangles)
    answer = subprocess.run([str(python), str(PEER), "measure", str(file)], check=True, capture_output=True, text=True)
    return json.loads(answer.stdout)


def blender_preview(case: Case) -> dict[str, float]:
    """What passes in Blender between the button and the sections; nothing where there is no bpy or no file."""
    path, script = SHARED / f"{case.name}.glb", Path(__file__).with_name("preview_seconds.py")
    command = [sys.executable, str(ROOT / "tools" / "with_extension.py"), str(script), str(path)]
    if not path.is_file() or importlib.util.find_spec("bpy") is None:
        return {}
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return json.loads(lines[-1]) if lines else {}


def run_ours(case: Case, given: Skin) -> dict[str, Any]:
    found = ours(case, given)
    cage = {name: found.pop(name) for name in ("vertices", "triangles") if name in found}
    if cage:
        np.savez(KEPT.with_name(f"{case.name}.npz"), **cage)
        found |= {"#vertices": len(cage["vertices"]), "#triangles": len(cage["triangles"])}
    return found | {"faces": len(given[1]), "blender": blender_preview(case)}


def run_peer(case: Case, given: Skin, python: Path) -> dict[str, Any]:
    """The measures of both cages; ours is the one that was made last."""
    with tempfile.TemporaryDirectory() as name, np.load(KEPT.with_name(f"{case.name}.npz")) as cage:
        vertices, triangles, folder = cage["vertices"], cage["triangles"], Path(name)
        both = {"ours": measured(python, given, vertices, triangles, folder)}
        return both | {energy: peer(python, given, len(triangles), energy, folder) for energy in ENERGIES}


def numbers(found: dict[str, Any]) -> str:
    """Volume ratio, mean distance and what crosses, of one cage."""
    if "refused" in found:
        return f"{found['refused']} | | "
    wrong = sum(found.get(name, 0) for name in ("outside", "crossing", "folded"))
    faults = f" ({wrong} faults)" if wrong else ""
    return f"{found['seconds']:.1f} | {found['volume']:.2f} | {found['distance']:.4f}{faults}"


def write(results: dict[str, Any]) -> None:
    """The table as a part of the manual."""
    head = [
        "skin",
        "triangles",
        "cage",
        "preview",
        "in Blender",
        "node moved",
        "cage s",
        "edit s",
        "limit s",
        "volume",
        "distance",
    ]
    head += ["peer s", "volume", "distance", "pressed s", "volume", "distance"]
    lines = ["| " + " | ".join(head) + " |", "| --- " + "| ---: " * (len(head) - 1) + "|"]
    for case in CASES:
        if case.name not in results or "ours" not in results[case.name]:
            continue
        mine, others = results[case.name]["ours"], results[case.name].get("peer", {})
        mine = mine | others.get("ours", {})
        row = [case.name, f"{mine['faces']:,}"]
        if "refused" in mine:
            lines.append(f"| {' | '.join(row)} | {mine['refused']} |" + " |" * (len(head) - 3))
            continue
        inside = [f"{mine['blender'][key]:.2f}" if mine["blender"] else "" for key in ("preview", "moved")]
        seconds, *rest = numbers(mine).split(" | ")
        row += [f"{mine['#vertices']} / {mine['#triangles']}", f"{mine['preview']:.2f}", *inside, seconds]
        row += [f"{mine['edit']:.2f}" if "edit" in mine else "", f"{case.limit:.0f}", *rest]
        row += [numbers(others[energy]) if energy in others else " | | " for energy in ENERGIES]
        lines.append("| " + " | ".join(row) + " |")
    TABLE.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("names", nargs="*", help="of skins; all of them by default")
    asked.add_argument("--only", choices=["ours", "peer"])
    given = asked.parse_args()
    python = peer_python() if given.only != "ours" else None
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    results = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    for case in CASES:
        skin = skin_of(case) if not given.names or case.name in given.names else None
        if skin is None:
            continue
        found = results.setdefault(case.name, {})
        if given.only != "peer":
            found["ours"] = run_ours(case, skin)
        if python is not None and "refused" not in found.get("ours", {"refused": ""}):
            found["peer"] = run_peer(case, skin, python)
        KEPT.write_text(json.dumps(results, indent=1))
    write(results)


if __name__ == "__main__":
    main()
