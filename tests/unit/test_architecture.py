"""Which part of the package may import which; see docs/design.md."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Each part, and the parts that it may import beside itself.
BASE = {"errors", "jit"}
GEOMETRY = BASE | {"kinematics", "contact"}
MECHANICS = GEOMETRY | {"scene", "model", "forces"}
ENGINE = MECHANICS | {"integrators", "engine"}
NUMERICS = ENGINE | {"simulation"}
ALLOWED = {
    "errors": set(),
    "jit": {"errors"},
    "scene": BASE,
    "kinematics": BASE,
    "contact": BASE | {"kinematics"},
    "model": GEOMETRY | {"scene"},
    "forces": GEOMETRY | {"scene", "model"},
    "integrators": MECHANICS,
    "engine": MECHANICS | {"integrators"},
    "simulation": ENGINE,
    "record": NUMERICS,
    "view": NUMERICS | {"record"},
    "converge": NUMERICS,
    "beam2d": {"errors", "scene", "model"},
    "validate": NUMERICS | {"beam2d"},
    "bench": NUMERICS | {"converge", "validate"},
    "cli": NUMERICS | {"record", "view", "converge", "validate", "bench"},
}
# The package's own face, and its command line as `python -m bilayer_core`.
FACES = {"__init__": NUMERICS, "__main__": {"cli"}}
TOP = "bilayer_core"


def modules():
    return sorted((ROOT / TOP).rglob("*.py"))


def part_of(path: Path) -> str:
    return path.relative_to(ROOT / TOP).parts[0].removesuffix(".py")


def imported_names(path: Path):
    """Full names of all modules that a file imports anywhere, relative imports resolved."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, (base, node.module)))
            yield from ([f"{module}.{alias.name}" for alias in node.names] if module == TOP else [module])


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_of_the_core_point_one_way(path):
    part = part_of(path)
    allowed = ALLOWED.get(part, FACES.get(part))
    assert allowed is not None, f"{part} has no place in the order of parts"
    imported = {name.split(".")[1] for name in imported_names(path) if name.startswith(f"{TOP}.")}
    assert imported & ALLOWED.keys() <= allowed | {part}


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(ROOT)))
def test_the_core_knows_neither_its_ros_adapter_nor_ros(path):
    tops = {name.split(".")[0] for name in imported_names(path)}
    assert not {top for top in tops if top in {"bilayer_sim_ros", "rclpy"} or top.endswith(("_msgs", "_srvs"))}


def test_importing_the_core_imports_neither_ros_nor_viewer_nor_log_library():
    unwanted = {"rclpy", "rerun", "mcap", "matplotlib", "bilayer_sim_ros"}
    program = f"import sys, bilayer_core; print(*sorted({unwanted!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
