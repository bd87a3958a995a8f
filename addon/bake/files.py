# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are there as a whole or not at all: written beside their place, and moved into it at the end."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import bpy

from .live import BakeError


def target(path: str, name: str, suffixes: tuple[str, ...]) -> Path:
    """The file a bake is to write: `path`, relative to the .blend where it starts with `//`.

    Empty, or a folder: `name` and the first of `suffixes` in it (the folder of the .blend). Raises `BakeError`.
    """
    if (not path or path.startswith("//")) and not bpy.data.is_saved:
        raise BakeError("Save the .blend first, or give a full path: there is no folder that '//' could mean")
    text = bpy.path.abspath(path or "//")
    found = Path(text)
    if found.is_dir() or text.endswith(("/", "\\")):
        found /= bpy.path.clean_name(name) + suffixes[0]
    elif found.suffix.lower() not in suffixes:
        found = found.with_name(found.name + suffixes[0])
    if not found.parent.is_dir():
        raise BakeError(f"There is no folder '{found.parent}'; make it, or choose another")
    if found.is_dir():
        raise BakeError(f"'{found}' is a folder; choose another name")
    return found


@contextmanager
def written(paths: list[Path]) -> Iterator[list[Path]]:
    """Yields files to write instead of `paths`, whose place they take at the end, all of them or none.

    A file system's errors become `BakeError`; after any error, nothing is left and what was there before is there.
    """
    drafts = [path.with_name(f"{path.stem}.{uuid.uuid4().hex[:8]}.partial{path.suffix}") for path in paths]
    try:
        for draft in drafts:
            draft.touch(exist_ok=False)  # whether the folder can be written to is known before the work
        yield drafts
        _publish(drafts, paths)
    except OSError as error:
        raise BakeError(f"'{paths[0].parent}' can't be written to: {error.strerror or error}") from error
    finally:
        for draft in drafts:
            with suppress(OSError):
                draft.unlink(missing_ok=True)


def _publish(drafts: list[Path], paths: list[Path]) -> None:
    """Move every draft to its place; where one can't be, put back those that were."""
    done: list[tuple[Path, Path | None]] = []
    try:
        for draft, path in zip(drafts, paths, strict=True):
            before = draft.with_suffix(".before") if path.exists() else None
            if before is not None:
                path.replace(before)
            done.append((path, before))
            draft.replace(path)
    except OSError:
        for path, before in reversed(done):
            if before is None:
                path.unlink(missing_ok=True)
            else:
                before.replace(path)
        raise
    for _, before in done:
        if before is not None:
            before.unlink()
