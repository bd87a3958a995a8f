"""Runs the core's own benches, which print rows for the table: `row`, scenario, why, ours, peer, beside, limit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from rows import ROOT, Row, keep


def rows_of(output: str) -> list[Row]:
    """The rows in a bench's output; a dash stands for nothing."""
    found = []
    for line in output.splitlines():
        if line.startswith("row\t"):
            scenario, why, ours, peer, beside, limit = line.split("\t")[1:]
            numbers = [None if text == "-" else float(text) for text in (peer, limit)]
            found.append(Row(scenario, why, float(ours), numbers[0], "" if beside == "-" else beside, numbers[1]))
    return found


def main() -> None:
    for bench in ("frames", "binding", "skinning"):
        command = ["cargo", "bench", "--quiet", "-p", "cage_rig", "--bench", bench]
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
        print("\n".join(line for line in done.stdout.splitlines() if not line.startswith("row\t")))
        keep(bench, rows_of(done.stdout))


if __name__ == "__main__":
    main()
