"""The table and the picture of what the benches have left in build/bench: docs/bench.md and docs/bench.png."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from rows import ROOT, Row, kept, table

BENCHES = {
    "blender": "Whole frames and binds in Blender",
    "core": "The core, from Python",
    "frames": "Kernels",
    "binding": "Binds and edits of the posed cage",
    "skinning": "Centers of rotation",
}
HEAD = """# Figures

Measured by `make bench` on {machine} ({cores} cores). Every row takes turns with what it stands beside, in one process
on the same meshes, and its time is the least of many rounds; every scenario checks its answer. *Bandwidth* is the part
of the speed at which memory can be read, measured beside it; *cached*: ours was faster, from a cache.

![Times faster than what would be used instead](bench.png)
"""


def machine() -> str:
    """The processor's name."""
    info = Path("/proc/cpuinfo")
    names = [line for line in info.read_text().splitlines() if "model name" in line] if info.exists() else []
    return names[0].split(":")[1].strip() if names else platform.processor() or platform.machine()


def page(found: dict[str, list[Row]]) -> str:
    parts = [HEAD.format(machine=machine(), cores=os.cpu_count())]
    for name, title in BENCHES.items():
        if found[name]:
            reasons = dict.fromkeys((row.scenario.split(":")[0], row.why) for row in found[name])
            whys = "\n".join(f"- *{scenario}*: {why}." for scenario, why in reasons)
            parts.append(f"## {title}\n\n{table(found[name])}\n\nWhy they are there:\n\n{whys}\n")
    return "\n".join(parts)


def picture(rows: list[Row], path: Path) -> None:
    """Bars of how many times faster than the peer, on a logarithmic scale."""
    import matplotlib

    matplotlib.use("svg" if path.suffix == ".svg" else "agg")
    from matplotlib import pyplot

    compared = [row for row in rows if row.peer is not None][::-1]
    figure, axes = pyplot.subplots(figsize=(9, 1 + 0.27 * len(compared)), layout="constrained")
    ratios = [row.peer / row.ours for row in compared]
    colors = ["#2b6cb0" if ratio >= 1 else "#c05621" for ratio in ratios]
    bars = axes.barh([row.scenario for row in compared], ratios, color=colors)
    labels = [f" {row.peer / row.ours:.1f} × {row.beside.split(',')[0]}" for row in compared]
    axes.bar_label(bars, labels, size=7)
    axes.axvline(1.0, color="#333", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xlim(min([0.5, *ratios]) * 0.9, max(ratios) * 12)
    axes.tick_params(axis="y", labelsize=7)
    axes.set_xlabel("times faster (one process, the same meshes)")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110, bbox_inches="tight")


def main() -> None:
    found = {name: kept(name) for name in BENCHES}
    (ROOT / "docs" / "bench.md").write_text(page(found))
    picture([row for rows in found.values() for row in rows], ROOT / "docs" / "bench.png")
    print("docs/bench.md and docs/bench.png are written")


if __name__ == "__main__":
    main()
