"""The manual names every message that the add-on can show, and every picture that it shows is there."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGE = DOCS / "problems.md"
NOT_SHOWN = {"description", "name", "bl_label", "help", "HELP"}  # shown where they belong: tooltips, labels, --help
MENUS = {"_import_menu", "_export_menu"}
MESSAGES = sorted(path for path in (ROOT / "addon").rglob("*.py") if path.name != "translations.py")


def sentences(path: Path) -> Iterator[str]:
    """Strings of three words or more, with … for what is put into them. Docstrings, tooltips and tables are none."""
    hidden: set[ast.AST] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        hide = node in hidden or (isinstance(node, ast.FunctionDef) and node.name in MENUS)
        hide |= isinstance(node, ast.keyword) and node.arg in NOT_SHOWN
        hide |= isinstance(node, ast.Assign | ast.AnnAssign) and _is_table_or_label(node)
        hide |= isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)  # a docstring
        text = _text(node)
        if hide or text is not None:  # what is in a string is no other one
            hidden |= set(ast.iter_child_nodes(node))
        if text is not None and not hide and _is_sentence(text):
            yield _plain(text)


def _is_sentence(text: str) -> bool:
    return " " in text and "\n" not in text and len(re.findall(r"[A-Za-z']{2,}", text)) >= 3


def _is_table_or_label(node: ast.Assign | ast.AnnAssign) -> bool:
    """Items of a menu (a list in capitals), or a class's label."""
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    name = target.id if isinstance(target, ast.Name) else ""
    return name in NOT_SHOWN or (name.isupper() and isinstance(node.value, ast.List))


def _text(node: ast.AST) -> str | None:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return re.sub(r"\{[\w.]*\}", "…", node.value)  # of `str.format`
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
    return None


def _plain(text: str) -> str:
    return " ".join(text.split())


def core_sentences() -> list[str]:
    """What the core refuses, by its error enums."""
    text = (ROOT / "rust_core/cage_rig/src/error.rs").read_text()
    return [
        _plain(re.sub(r"\{[^}]*\}", "…", found)) for found in re.findall(r'#\[error\("(.*?)"(?:, [^"]*?)?\)\]', text)
    ]


@pytest.fixture(scope="module")
def page() -> str:
    return _plain(PAGE.read_text().replace("\\", ""))


@pytest.mark.parametrize("path", MESSAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_the_manual_names_every_message_of_the_add_on(path: Path, page: str) -> None:
    missing = [text for text in sentences(path) if text not in page]
    assert not missing, f"put these into {PAGE.relative_to(ROOT)} with what to do"


def test_messages_are_found() -> None:
    found = {text for path in MESSAGES for text in sentences(path)}
    assert len(found) > 120
    assert "Only in Object Mode" in found
    assert "'…' has no faces, so it can't be a skin" in found


def test_the_manual_names_every_refusal_of_the_core(page: str) -> None:
    assert len(core_sentences()) > 40
    missing = [text for text in core_sentences() if text not in page]
    assert not missing, f"put these into {PAGE.relative_to(ROOT)} with what to do"


def test_pictures_of_the_manual_are_there_and_small() -> None:
    for path in DOCS.glob("*.md"):
        for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", path.read_text()):
            assert (DOCS / name).is_file(), f"{path.name} shows {name}"
    for picture in (DOCS / "pictures").iterdir():
        assert picture.stat().st_size <= 200_000, picture.name
        assert any(picture.name in page.read_text() for page in DOCS.glob("*.md")), f"no page shows {picture.name}"
