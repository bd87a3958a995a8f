"""What all benches have in common: named scenarios, times in turns, and rows that the report collects.

Only ratios within one run count: these machines are shared. A row's time is the least of many rounds in which what is
compared takes turns, so that both see the same machine; every scenario checks its own answer once.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOUND = ROOT / "build" / "bench"


@dataclass(frozen=True)
class Row:
    """One line of the table; times in milliseconds, `peer` None where nothing else does the job."""

    scenario: str
    why: str
    ours: float
    peer: float | None = None
    beside: str = ""
    limit: float | None = None  # part of the measured memory bandwidth that was reached


def least(
    *acts: Callable[[], object], rounds: int = 15, turn: int = 1, before: Callable[[], object] = lambda: None
) -> list[float]:
    """The least time of each act in milliseconds, taking turns of so many, after one turn to warm up. What is `before`
    every act is not timed.
    """
    best = [float("inf")] * len(acts)
    for number in range(rounds + 1):
        for k, act in enumerate(acts):
            for _ in range(turn):
                before()
                start = time.perf_counter()
                act()
                if number:
                    best[k] = min(best[k], time.perf_counter() - start)
    return [1e3 * seconds for seconds in best]


def keep(name: str, rows: list[Row]) -> None:
    """Leave the rows of one bench for the report, and print them."""
    FOUND.mkdir(parents=True, exist_ok=True)
    (FOUND / f"{name}.json").write_text(json.dumps([asdict(row) for row in rows], indent=1))
    print(table(rows), flush=True)


def kept(name: str) -> list[Row]:
    """The rows that a bench has left; none where it did not run."""
    path = FOUND / f"{name}.json"
    return [Row(**entry) for entry in json.loads(path.read_text())] if path.exists() else []


def table(rows: list[Row]) -> str:
    """The rows in Markdown."""
    lines = ["| scenario | ours, ms | instead, ms | times faster | bandwidth | beside |"]
    lines.append("| --- | ---: | ---: | ---: | ---: | --- |")
    for row in rows:
        peer = "–" if row.peer is None else _number(row.peer)
        ratio = "–" if row.peer is None else f"{row.peer / row.ours:.1f}"
        lines.append(
            f"| {row.scenario} | {_number(row.ours)} | {peer} | {ratio} | {_share(row.limit)} | {row.beside or '–'} |"
        )
    return "\n".join(lines)


def _share(limit: float | None) -> str:
    """The part of the bandwidth that was reached; more than all of it says that a cache was read, and no memory."""
    if limit is None:
        return "–"
    return "cached" if limit > 1.0 else f"{100 * limit:.0f} %"


def _number(milliseconds: float) -> str:
    return f"{milliseconds:,.0f}" if milliseconds >= 100 else f"{milliseconds:.3g}"
