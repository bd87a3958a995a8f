"""Ours and nested-cages given the same rough cage, in one run: the table of docs/generate_fit_bench.md.

    python tests/bench/bench_fitting.py                   every skin
    python tests/bench/bench_fitting.py human_24k_52b     some

Rough cages are the peer's own, beside its example; the skin decimated by quadric errors; and the cross sections of a
generated cage, joined by its faces, where ours is the cage that grew from them. The peer comes as it is and pressed
tightest; how long it may take, and how both are measured, is as in bench_caging.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import cage_rig_core as core
import numpy as np
from bench_caging import CASES, ENERGIES, EXAMPLE, PEER, ROOT, Case, Skin, measured, mesh, numbers, peer, peer_python
from bench_caging import skin_of as skin_of_case

TABLE = ROOT / "docs" / "generate_fit_bench.md"
COUNT = 1000  # triangles that a skin is decimated to
Rough = dict[str, np.ndarray]


def roughs(case: Case, given: Skin, python: Path, folder: Path) -> dict[str, Rough]:
    """Rough cages of a skin, by what they are."""
    found: dict[str, Rough] = {}
    if case.name == "gargo":
        for path in sorted(Path(EXAMPLE or "").parent.glob("gargo_*.off")):
            vertices, triangles = mesh(path)
            found[f"the peer's {path.stem}"] = {"vertices": vertices, "triangles": triangles}
        return found
    np.savez(folder / "given.npz", skin=given[0], faces=given[1], count=COUNT)
    made = folder / "rough.npz"
    subprocess.run([str(python), str(PEER), "decimate", str(folder / "given.npz"), str(made)], check=True)
    with np.load(made) as file:
        found["decimated"] = {name: file[name] for name in file.files}
    return found


def fitted(given: Skin, rough: Rough) -> dict[str, Any]:
    """Our cage from a rough one."""
    start = time.perf_counter()
    try:
        vertices, triangles, _ = core.fit_cage(*given, rough["vertices"], rough["triangles"])
    except core.CagingError as refused:
        return {"refused": str(refused)}
    return {"seconds": time.perf_counter() - start, "cage": (vertices, triangles)}


def grown(given: Skin) -> tuple[Rough, dict[str, Any]]:
    """Cross sections as a rough cage, and the cage that grew from them."""
    start = time.perf_counter()
    vertices, triangles, report = core.generate_cage(*given, options={"triangles": True})
    made = {"seconds": time.perf_counter() - start, "cage": (vertices, triangles)}
    corners = np.concatenate([section["corners"] for section in report["sections"]])
    return {"vertices": corners, "triangles": triangles}, made


def row(name: str, what: str, given: Skin, rough: Rough, mine: dict[str, Any], python: Path, folder: Path) -> str:
    """One line of the table."""
    count = len(rough["triangles"])
    cage = mine.pop("cage", None)
    if cage is not None:
        mine |= measured(python, given, *cage, folder)
    others = [numbers(peer(python, given, count, energy, folder, rough)) for energy in ENERGIES]
    return f"| {name} | {what} | {count:,} | {numbers(mine)} | {' | '.join(others)} |"


def main() -> None:
    python = peer_python()
    if python is None:
        return
    names = ["skin", "rough cage", "triangles", "ours s", "volume", "distance", "peer s", "volume", "distance"]
    names += ["pressed s", "volume", "distance"]
    lines = ["| " + " | ".join(names) + " |", "| --- | --- " + "| ---: " * (len(names) - 2) + "|"]
    for case in CASES:
        given = skin_of_case(case) if len(sys.argv) < 2 or case.name in sys.argv[1:] else None
        if given is None:
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for what, rough in roughs(case, given, python, folder).items():
                lines.append(row(case.name, what, given, rough, fitted(given, rough), python, folder))
                print(lines[-1], flush=True)
            if case.name != "gargo":
                sections, mine = grown(given)
                lines.append(row(case.name, "cross sections", given, sections, mine, python, folder))
                print(lines[-1], flush=True)
    TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
