"""Words of the panels in other languages: all of them, and none that the panels do not have.

The bpy module is built without languages; `window_language` shows that Blender uses them.
"""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import pytest

PANELS = Path(__file__).parent.parent.parent / "addon/ui/panels.py"


@pytest.fixture
def translations() -> ModuleType:
    import bl_ext.user_default.cage_rig.translations as translations

    return translations


def words_of_the_panels() -> tuple[set[str], set[str]]:
    """What the panels write: labels, and texts of buttons. Without f-strings, which name things of the file."""
    labels, buttons = set(), set()
    for node in ast.walk(ast.parse(PANELS.read_text())):
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "bl_label":
            labels.add(ast.literal_eval(node.value))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            kind = {"label": labels, "prop": labels, "operator": buttons}.get(node.func.attr)
            for keyword in node.keywords:
                if kind is not None and keyword.arg == "text" and isinstance(keyword.value, ast.Constant):
                    kind.add(keyword.value.value)
    return labels - {"", "Cage Rig"}, buttons - {""}


def test_every_word_of_the_panels_is_translated(translations: ModuleType) -> None:
    labels, buttons = words_of_the_panels()
    assert len(labels) > 6 and len(buttons) > 3
    assert labels <= set(translations.LABELS) and buttons <= set(translations.BUTTONS)
    for words in (*translations.LABELS.values(), *translations.BUTTONS.values()):
        assert len(words) == len(translations.LANGUAGES) and all(words)


def test_no_translation_is_of_words_that_are_gone(translations: ModuleType) -> None:
    addon = PANELS.parent.parent
    sources = "".join(path.read_text() for path in addon.rglob("*.py") if path.name != "translations.py")
    gone = [english for english in (*translations.LABELS, *translations.BUTTONS) if f'"{english}"' not in sources]
    assert gone == []
