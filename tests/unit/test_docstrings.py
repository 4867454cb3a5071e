"""Docstrings say what a thing is or does, from the first word on; those that users read name parameters and results."""

import ast
import inspect
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass
from pathlib import Path

from numpydoc.validate import validate
from support.sources import nodes_of

import bilayer_core
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.observed.observer import Observer
from bilayer_core.runs.replay import branch
from bilayer_core.scene import scene_classes
from bilayer_core.studies.converge.study import converge
from bilayer_core.testing import run_scene

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for name in ("bilayer_core", "bilayer_sim_ros") for path in (ROOT / name).rglob("*.py"))
REFUSED = {"What", "Whether", "Of", "As", "Until", "That", "Who"}
"""Words that begin half a sentence, whose other half the reader must find."""
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
DOCUMENTED = (ast.Module, ast.ClassDef, *FUNCTIONS)
ATTRIBUTES = {"property", "cached_property", "setter", "computed_field"}
"""Decorators of functions that are read as attributes: a noun phrase describes these."""
VERBS = frozenset(
    """
    Add Advance Announce Answer Append Ask Assemble Assign Begin Block Bring Build Call Carry Change Check Choose Clear
    Close Compare Compile Compute Continue Convert Copy Count Decide Declare Delete Describe Do Draw Eliminate End
    Estimate Evaluate Exchange Execute Explain Factorise Fail Find Finish Follow Forget Format Freeze Give Go Ignore
    Index Install Judge Keep Leave Let List Load Lock Log Look Make Mark Measure Move Multiply Note Notice Offer Open
    Overwrite Pad Parse Play Predict Prepare Print Publish Put Raise Read Record Reduce Refuse Relax Remember Remove
    Repeat Replace Report Rest Restore Resume Return Round Run Say Scale Search Select Send Serve Set Show Silence
    Simulate Spread Start Stop Subtract Sum Supply Take Tell Try Turn Update Validate Wait Warn Write Yield
    """.split()
)
"""First words of docstrings of functions; another verb is added here."""
CALLED = [getattr(bilayer_core, name) for name in set(bilayer_core.__all__) - {"__version__", *scene_classes.__all__}]
CALLED += [run_scene, McapRecorder, branch, converge]
"""Functions and classes that programs of users call; the tables of keys document the classes of scenes."""
CODES = {"PR01", "PR02", "PR03", "RT01", "YD01"}
"""Codes of numpydoc: parameters are documented, under their names and in order; so are returned and yielded values."""


def test_no_docstring_begins_with_half_a_sentence():
    wrong = []
    for path in SOURCES:
        for node in nodes_of(path):
            text = ast.get_docstring(node) if isinstance(node, DOCUMENTED) else None
            if text and text.split()[0] in REFUSED:
                wrong.append(f"{path.relative_to(ROOT)}: {text.splitlines()[0]}")
    assert len(SOURCES) > 400 and wrong == []


def test_docstrings_of_functions_begin_with_an_imperative():
    wrong = []
    for path in SOURCES:
        for node in nodes_of(path):
            text = ast.get_docstring(node) if isinstance(node, FUNCTIONS) and not _is_attribute(node) else None
            if text and not _is_imperative(text):
                wrong.append(f"{path.relative_to(ROOT)}: {text.splitlines()[0]}")
    assert wrong == []


def test_noun_phrases_and_half_sentences_are_no_imperatives():
    phrases = [
        "Length of an edge [m].",
        "Likewise for rails.",
        "m2 = t × m1",
        "Its value.",
        "All runs.",
        "Returns it.",
        "",
    ]
    nouns = ["Record of a run.", "Load [N] of the tip.", "Run: the first of all."]
    assert [text for text in [*phrases, *nouns] if _is_imperative(text)] == []
    assert _is_imperative("Record a run.") and _is_imperative("Load the tip by a force [N].")


def test_public_names_document_their_parameters_and_results():
    names = _public_names()
    faults = {name: [fault for fault in validate(name)["errors"] if fault[0] in CODES] for name in names}
    assert {f"{Observer.__module__}.Observer.observe", f"{run_scene.__module__}.RobotRun.assert_energy"} <= names
    assert {name: found for name, found in faults.items() if found} == {}


def _is_imperative(text: str) -> bool:
    """Whether a text begins with a verb; what "of" or a unit follows is a noun."""
    first, second, *_ = [*text.split(), "", ""]
    return first.rstrip(",") in VERBS and second != "of" and not second.startswith("[")


def _is_attribute(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    names = {ast.unparse(decorator).partition("(")[0].split(".")[-1] for decorator in function.decorator_list}
    return bool(names & ATTRIBUTES)


def _public_names() -> set[str]:
    """Return the import paths of `CALLED`, and of the methods of all classes whose objects these return."""
    names, seen, left = {_path_of(called) for called in CALLED}, set(), [*CALLED, Observer]
    while left:
        found = left.pop()
        if found in seen:
            continue
        seen.add(found)
        if not inspect.isclass(found):
            names.add(_path_of(found))
            left += _classes_in(found.__annotations__.get("return", ""), found)
            continue
        left += _methods_of(found)
        if is_dataclass(found):
            left += [of_field for field in found.__annotations__.values() for of_field in _classes_in(field, found)]
    return names


def _path_of(named: type | Callable) -> str:
    return f"{named.__module__}.{named.__qualname__}"


def _classes_in(annotation: object, owner: type | Callable) -> Iterator[type]:
    """Yield the classes of the package that an annotation in the module of `owner` names."""
    for word in re.findall(r"\w+", str(annotation)):
        found = vars(sys.modules[owner.__module__]).get(word)
        if inspect.isclass(found) and found.__module__.startswith("bilayer_core"):
            yield found


def _methods_of(owner: type) -> Iterator[Callable]:
    """Yield the public methods and properties of a class, of its bases in the package as well."""
    for base in owner.__mro__:
        for name, member in list(vars(base).items()) if base.__module__.startswith("bilayer_core") else ():
            for wrapped in ("__func__", "fget", "func"):  # of class methods, properties and cached ones
                member = getattr(member, wrapped, member)
            if inspect.isfunction(member) and (name == "__getitem__" or not name.startswith("_")):
                yield member
