"""Compile the engine ahead of time: ``python -m bilayer_core.jit.build_library FOLDER``, as `make wheel` does.

FOLDER takes the library and its text (`library`), which setup.py puts into a wheel. It takes a linker, here that of the
C compiler `cc`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from llvmlite import binding

from bilayer_core.jit.called import FIND, slot_of, symbol_of
from bilayer_core.jit.compile_all import ENGINE, compile_all, own_pieces
from bilayer_core.jit.library import FACTS, LIBRARY, facts
from bilayer_core.jit.target import BASELINE, machine, target


def slots_of(names: list[str]) -> bytes:
    """Return the object with the slots of pieces, each with the address of its piece."""
    lines = [f"define hidden i64 @{FIND}(i64 %slot) {{ ret i64 0 }}"]
    for name in names:
        lines += [
            f"declare hidden i64 @{symbol_of(name)}()",
            f"@{slot_of(name)} = protected global i64 ptrtoint (ptr @{symbol_of(name)} to i64)",
        ]
    module = binding.parse_assembly("\n".join(lines))
    module.triple = binding.get_process_triple()
    return machine().emit_object(module)


def build(folder: Path) -> Path:
    """Compile the library and its text into a folder; return the library's path."""
    folder.mkdir(parents=True, exist_ok=True)
    import_module(ENGINE)
    compile_all()
    pieces = own_pieces()
    library = folder / LIBRARY.name
    with tempfile.TemporaryDirectory() as place:
        objects = {piece.name: piece.make_object() for piece in pieces} | {
            "slots": slots_of([of.name for of in pieces])
        }
        for name, content in objects.items():
            Path(place, f"{name}.o").write_bytes(content)
        files = [f"{name}.o" for name in objects]
        command = ["cc", "-shared", "-s", "-Wl,-z,now", "-Wl,-soname," + LIBRARY.name, "-o", str(library.resolve())]
        subprocess.run([*command, *files, "-lm"], cwd=place, check=True)
    (folder / FACTS.name).write_text(json.dumps(facts(), indent=1), encoding="utf-8")
    return library


def main() -> None:
    """Build it where the command line says."""
    if target()[0] != BASELINE:
        raise SystemExit(f"the library is for {BASELINE}, and this process compiles for {target()[0]}")
    library = build(Path(sys.argv[1]))
    print(f"{library}: {library.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
