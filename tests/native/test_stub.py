"""The typed stub says what the module has."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import cage_rig_core as core
import pytest

STUB = Path(__file__).resolve().parents[2] / "rust_core" / "cage_rig_py" / "cage_rig_core.pyi"
ALLOWLIST = Path(__file__).with_name("stub_allowlist.txt")


def parameters(function):
    """Names in order, and which have defaults, of a function in the stub."""
    arguments = function.args
    positional = [a.arg for a in arguments.posonlyargs + arguments.args if a.arg not in ("self", "cls")]
    keyword = [a.arg for a in arguments.kwonlyargs]
    return positional, keyword


def signature(function):
    found = [p for p in inspect.signature(function).parameters.values() if p.name not in ("self", "cls")]
    keyword = [p.name for p in found if p.kind is p.KEYWORD_ONLY]
    return [p.name for p in found if p.kind is not p.KEYWORD_ONLY], keyword


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_names_and_signatures_agree():
    stub = ast.parse(STUB.read_text())
    functions = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
    classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}
    typed = {name for name, node in classes.items() if any(ast.unparse(base) == "TypedDict" for base in node.bases)}
    in_module = public(dir(core)) - {"cage_rig_core"}
    assert in_module == set(functions) | (set(classes) - typed)
    for name, node in functions.items():
        assert signature(getattr(core, name)) == parameters(node), name
    for name in ("CoupledRig", "Playback", "BindJob", "MethodJob", "CagingJob", "CageGenerator"):
        members = {node.name: node for node in classes[name].body if isinstance(node, ast.FunctionDef)}
        check_class(getattr(core, name), members)


def check_class(found, members):
    assert public(dir(found)) == public(members)
    if "__new__" in members:
        assert signature(found) == parameters(members["__new__"])
    for name in public(members):
        attribute = inspect.getattr_static(found, name)
        if members[name].decorator_list:
            assert inspect.isgetsetdescriptor(attribute), name
        else:
            assert signature(attribute) == parameters(members[name]), name


def test_mypy_finds_the_stub_true():
    pytest.importorskip("mypy.stubtest", reason="mypy is not installed")
    run = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "cage_rig_core", "--allowlist", ALLOWLIST, "--ignore-disjoint-bases"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
