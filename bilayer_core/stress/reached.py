"""What an edit of one source can change in compiled code: found from the sources alone, by names.

A piece holds the kernels that it calls, and the constants that these read. So a definition of a module is *reached* by
an edit if it was edited, or uses the name of one that is reached, whatever it uses it for.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

Name = tuple[str, str]
"""A module, by its path in the package, and a name in it."""


def reached(package: Path, folders: tuple[str, ...], edited: str, before: str) -> set[Name]:
    """Definitions of modules that an edit reaches.

    Parameters
    ----------
    package : Path
        With the edit in it.
    folders : tuple of str
        Of the package, which are looked through.
    edited : str
        The file, in the package.
    before : str
        Its source before.
    """
    trees = {
        path.relative_to(package).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for folder in folders
        for path in sorted((package / folder).rglob("*.py"))
    }
    if edited not in trees:
        return set()
    old, new = _definitions(ast.parse(before)), _definitions(trees[edited])
    names = [name for name in {*old, *new} if _dump(old.get(name)) != _dump(new.get(name))]
    users: dict[Name, set[Name]] = {}
    for path, tree in trees.items():
        imported = dict(_imports(path, tree, set(trees)))
        for name, nodes in _definitions(tree).items():
            for node in nodes:
                for used in ast.walk(node):
                    if isinstance(used, ast.Name):
                        users.setdefault(imported.get(used.id, (path, used.id)), set()).add((path, name))
    found, left = set(), [(edited, name) for name in names]
    while left:
        one = left.pop()
        if one not in found:
            found.add(one)
            left += users.get(one, set()) | users.get((one[0], "*"), set())
    return found


def _dump(nodes: list[ast.stmt] | None) -> list[str]:
    return [ast.dump(node) for node in nodes or []]


def _definitions(tree: ast.Module) -> dict[str, list[ast.stmt]]:
    """Statements of a module by what they define."""
    found: dict[str, list[ast.stmt]] = {}
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = [node.name]
        else:
            parts = [part for part in ast.walk(node) if isinstance(part, ast.Name)]
            names = [part.id for part in parts if isinstance(part.ctx, ast.Store)]
        for name in names:
            found.setdefault(name, []).append(node)
    return found


def _imports(path: str, tree: ast.Module, known: set[str]) -> Iterator[tuple[str, Name]]:
    """Names that a module takes from others of the package; of a whole module, ``*``."""
    for node in tree.body:
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        base = Path(path).parents[node.level - 1].joinpath(*(node.module or "").split("."))
        for alias in node.names:
            local = alias.asname or alias.name
            for source, name in ((base / f"{alias.name}.py", "*"), (base.with_suffix(".py"), alias.name)):
                if source.as_posix() in known:
                    yield local, (source.as_posix(), name)
            package = (base / "__init__.py").as_posix()
            if package in known:
                yield local, (package, alias.name)
