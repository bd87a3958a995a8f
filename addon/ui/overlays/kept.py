# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn is kept until what it was made from has changed: a redraw of an unchanged scene makes nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

T = TypeVar("T")

work: Counter[str] = Counter()  # how often each kind of thing was made


class Kept(Generic[T]):
    """One thing and the key that it was made for. `kind` is the name under which `work` counts its making."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.key: Hashable = None
        self._value: T | None = None

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The thing for this key (not None), made where the key is another than the last one's."""
        if self._value is None or key != self.key:
            self.key, self._value = None, None
            self._value = make()
            self.key = key
            work[self.kind] += 1
        return self._value
