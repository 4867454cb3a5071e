"""Docstrings say what a thing is or does, from the first word on."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for name in ("bilayer_core", "bilayer_sim_ros") for path in (ROOT / name).rglob("*.py"))
REFUSED = {"What", "Whether", "Of", "As", "Until", "That", "Who"}
"""Words that begin half a sentence, whose other half the reader must find."""
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def test_no_docstring_begins_with_half_a_sentence():
    wrong = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            text = ast.get_docstring(node) if isinstance(node, DOCUMENTED) else None
            if text and text.split()[0] in REFUSED:
                wrong.append(f"{path.relative_to(ROOT)}: {text.splitlines()[0]}")
    assert len(SOURCES) > 400 and wrong == []
