# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files of words and numbers. Whatever is wrong is told with the file, the line and what was expected there."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]
Ints = NDArray[np.int64]
Row = tuple[int, list[str]]  # line number, words


class FileError(ValueError):
    """A file can't be used; the message is a sentence that names it. Nothing was changed."""


class TextFile:
    """The lines of a file that say something: no empty ones, no comments (`#`)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines = _read(path).splitlines()
        split = ((number, line.split()) for number, line in enumerate(self.lines, start=1))
        self.rows: list[Row] = [(number, words) for number, words in split if words and words[0][0] != "#"]

    def marked(self, mark: str) -> list[Row]:
        """The rows whose first word is `mark`, without it."""
        return [(number, words[1:]) for number, words in self.rows if words[0] == mark]

    def table(self, rows: Sequence[Row], form: str, *, width: int, whole: int) -> tuple[Ints, Doubles]:
        """Rows of `width` numbers, the first `whole` of them whole: those, and the others.

        Raises `FileError` at the first row that is none; `form` is how a line should read.
        """
        wrong = next((number for number, words in rows if len(words) != width), None)
        if wrong is not None:
            raise self.fault(wrong, f"'{form}'")
        try:
            flat = np.fromiter(map(float, itertools.chain.from_iterable(words for _, words in rows)), float)
        except ValueError:
            raise self.fault(next(number for number, words in rows if not _are_numbers(words)), f"'{form}'") from None
        values = flat.reshape(-1, width)
        self.require(rows, np.isfinite(values).all(axis=1), f"'{form}' with finite numbers")
        first = values[:, :whole]
        self.require(rows, (first == np.floor(first)).all(axis=1), f"'{form}' with whole numbers first")
        return first.astype(np.int64), values[:, whole:]

    def require(self, rows: Sequence[Row], good: NDArray[np.bool_], expected: str) -> None:
        """Raise `FileError` at the first row that is not `good`."""
        if not good.all():
            raise self.fault(rows[int(np.flatnonzero(~good)[0])][0], expected)

    def fault(self, line: int, expected: str) -> FileError:
        """What to raise where `line` is not what was expected."""
        found = self.lines[line - 1].strip()
        found = found if len(found) <= 60 else found[:57] + "…"
        return FileError(f"{self.path.name}, line {line}: expected {expected}, found '{found}'")

    def lacking(self, expected: str) -> FileError:
        """What to raise where the file as a whole lacks something."""
        return FileError(f"{self.path.name}: expected {expected}, found none")


def _are_numbers(words: list[str]) -> bool:
    try:
        list(map(float, words))
    except ValueError:
        return False
    return True


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        raise FileError(f"There is no file '{path}'") from None
    except OSError as error:
        raise FileError(f"'{path}' can't be read: {error.strerror or error}") from None
