"""Counts instructions of the core's work under valgrind's callgrind and compares them with recorded numbers.

Times on a shared machine differ by half; counts by next to nothing, so that a regression shows anywhere. One thread,
and the instructions that valgrind knows (AVX2). `--record` writes the numbers anew, where a change is meant.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECORDED = Path(__file__).parent / "counts.json"
TOLERANCE = 0.05  # compilers differ a little from one version to the next
FEW, MANY = 2, 202  # binds before them differ a little from run to run


def program() -> str:
    """The built bench."""
    command = ["cargo", "bench", "--quiet", "-p", "cage_rig", "--bench", "count", "--no-run", "--message-format=json"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    built = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return next(found["executable"] for found in built if found.get("executable"))


def instructions(executable: str, scenario: str, repeats: int) -> int:
    """All instructions of one run."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind.out"
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", executable, scenario, str(repeats)]
        done = subprocess.run(
            command, env={**os.environ, "RAYON_NUM_THREADS": "1"}, capture_output=True, text=True, check=False
        )
    found = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
    if done.returncode or not found:
        sys.exit(f"count: '{scenario}' failed under valgrind:\n{done.stderr[-2000:]}")
    return int(found[1])


def main() -> None:
    if not shutil.which("valgrind"):
        sys.exit("count: valgrind is not installed; install it (Linux) to count instructions")
    executable = program()
    names = subprocess.run([executable], capture_output=True, text=True, check=True).stdout.split()
    counted = {
        name: (instructions(executable, name, MANY) - instructions(executable, name, FEW)) // (MANY - FEW)
        for name in names
    }
    if "--record" in sys.argv:
        RECORDED.write_text(json.dumps({"machine": platform.machine(), "instructions": counted}, indent=1) + "\n")
    recorded = json.loads(RECORDED.read_text())
    if recorded["machine"] != platform.machine():
        sys.exit(f"count: recorded on {recorded['machine']}; numbers of {platform.machine()} say nothing beside them")
    worse = []
    for name, number in counted.items():
        before = recorded["instructions"].get(name)
        change = number / before - 1.0 if before else float("inf")
        print(f"{name:12} {number:12,} instructions, {change:+.1%} of what is recorded")
        if change > TOLERANCE:
            worse.append(name)
    if worse:
        sys.exit(f"count: more work than recorded: {', '.join(worse)}; find out why, or record with --record")


if __name__ == "__main__":
    main()
