"""Every character gets a cage that is one: around the skin, crossing nothing, of the size that its sections say.

The fixtures always; the shared characters where they are, the large ones where CAGE_RIG_LARGE_CHARACTERS is set.
"""

from __future__ import annotations

import os
from dataclasses import replace
from types import ModuleType

import bpy
import caged
import pytest

from blend_fixtures import rigs, uncaged

QUICK = ("human_2k_53b", "fox_576_24b", "proc_airplane", "spot_unrigged", "blub_unrigged")
LARGE_ASKED = "CAGE_RIG_LARGE_CHARACTERS"
SHAPES = [make.__name__ for make in caged.FIXTURES]
PLACEMENTS = pytest.mark.parametrize("placement", ["AUTOMATIC", "JOINTS"])


@pytest.fixture
def caging(installed: None) -> ModuleType:
    import bl_ext.user_default.cage_rig.caging as caging

    return caging


def shared() -> list[object]:
    found = uncaged.beside()
    if not found:
        return [pytest.param("", marks=pytest.mark.skip(reason=f"no characters in {uncaged.FOLDER}"))]
    slow = pytest.mark.skipif(LARGE_ASKED not in os.environ, reason=f"large; set {LARGE_ASKED} to run it")
    return [pytest.param(name, marks=() if name in QUICK else slow) for name in found]


def check(caging: ModuleType, made: caged.Made, placement: str) -> None:
    """Generate as the button does: where the skins are refused and can be repaired, their hull."""
    skins, armature = made
    options = caging.Options(placement=placement)
    try:
        cage = caging.generate_cage(bpy.context, skins, armature, options)
    except caging.GenerateError as refused:
        assert refused.repairable, refused
        cage = caging.generate_cage(bpy.context, skins, armature, replace(options, hull=True))
    found = caged.measure(cage, skins, armature)
    assert not caged.faults(found, symmetric=caged.is_symmetric(skins, armature)), found


@PLACEMENTS
@pytest.mark.parametrize("name", SHAPES)
def test_a_fixture_is_caged(caging: ModuleType, name: str, placement: str) -> None:
    check(caging, caged.every_fixture()[name](), placement)


@pytest.mark.parametrize("name", rigs.RIGS)
def test_a_kind_of_rig_is_caged(caging: ModuleType, name: str) -> None:
    check(caging, caged.rigged(name)(), "JOINTS")


@PLACEMENTS
@pytest.mark.parametrize("name", shared())
def test_a_shared_character_is_caged(caging: ModuleType, name: str, placement: str) -> None:
    check(caging, uncaged.beside()[name](), placement)


TESSELLATIONS = ("human_2k_53b", "human_24k_52b", "human_200k_53b")


def test_tessellations_of_one_character_get_the_same_sections(caging: ModuleType) -> None:
    """Limb by limb, though the finest mesh has a hundred times as many triangles as the coarsest."""
    characters = uncaged.beside()
    if not set(TESSELLATIONS) <= set(characters):
        pytest.skip(f"the humans are not in {uncaged.FOLDER}")
    found = []
    for name in TESSELLATIONS:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=False)
        skins, armature = characters[name]()
        opened = caging.open_character(bpy.context, armature, skins, caging.Options())
        sections = caging.edit(opened, caging.Options(), None).sections
        limbs = [[s.bending for s in sections if s.arc == arc] for arc in {s.arc for s in sections}]
        found.append(sorted(limbs))
    assert found[0] == found[1] == found[2]
    assert sum(map(len, found[0])) == 39
