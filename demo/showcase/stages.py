"""Says what the demo does and how long each stage took."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stages:
    """A running account of the stages. Times are wall-clock seconds."""

    def __init__(self) -> None:
        self._start = time.perf_counter()

    @contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Time a stage; what is appended to the yielded list is printed behind it."""
        notes: list[str] = []
        start = time.perf_counter()
        yield notes
        note = f"  {'; '.join(notes)}" if notes else ""
        print(f"{name:<26}{time.perf_counter() - start:7.2f} s{note}", flush=True)

    def total(self) -> None:
        print(f"{'total':<26}{time.perf_counter() - self._start:7.2f} s", flush=True)
