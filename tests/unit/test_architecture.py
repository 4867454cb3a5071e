"""Which part of the package may import which; see docs/design.md."""

import ast
import subprocess
import sys
from itertools import combinations
from pathlib import Path

from support.sources import nodes_of

ROOT = Path(__file__).resolve().parents[2]

# Each part, and the parts that it may import beside itself.
BASE = {"names", "printable", "errors", "extras", "processes", "jit"}
GEOMETRY = BASE | {"kinematics", "contact"}
MECHANICS = GEOMETRY | {"scene", "model", "forces"}
ENGINE = MECHANICS | {"integrators", "engine"}
LOG = BASE | {"kinematics", "observed", "log"}
NUMERICS = ENGINE | {"observed", "log", "simulation"}
ALLOWED = {
    "names": set(),
    "printable": set(),
    "errors": {"printable"},
    "extras": {"errors"},
    "processes": set(),
    "jit": {"errors", "processes"},
    "scene": BASE | {"kinematics"},
    "kinematics": BASE,
    "contact": BASE | {"kinematics"},
    "model": GEOMETRY | {"scene"},
    "forces": GEOMETRY | {"scene", "model"},
    "integrators": MECHANICS,
    "engine": MECHANICS | {"integrators"},
    "observed": set(),
    "log": LOG,
    "simulation": ENGINE | {"observed", "log"},
    "runs": NUMERICS,
    "view": NUMERICS | {"runs"},
    "testing": NUMERICS,
    "studies": NUMERICS | {"view"},
    "verification": NUMERICS | {"studies", "testing"},
    "cli": NUMERICS | {"runs", "view", "studies", "verification"},
}
# The package's own face, and its command line as `python -m bilayer_core`.
FACES = {"__init__": NUMERICS | {"studies"}, "__main__": {"cli"}}
TOP = "bilayer_core"


def modules():
    return sorted((ROOT / TOP).rglob("*.py"))


def part_of(path: Path) -> str:
    return path.relative_to(ROOT / TOP).parts[0].removesuffix(".py")


def imported_names(path: Path):
    """Full names of all modules that a file imports anywhere, relative imports resolved."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, (base, node.module)))
            yield from ([f"{module}.{alias.name}" for alias in node.names] if module == TOP else [module])


def test_imports_of_the_core_point_one_way():
    for path in modules():
        part = part_of(path)
        allowed = ALLOWED.get(part, FACES.get(part))
        assert allowed is not None, f"{part} has no place in the order of parts"
        imported = {name.split(".")[1] for name in imported_names(path) if name.startswith(f"{TOP}.")}
        assert imported & ALLOWED.keys() <= allowed | {part}, path


def test_the_core_knows_neither_its_ros_adapter_nor_ros():
    for path in modules():
        tops = {name.split(".")[0] for name in imported_names(path)}
        unknown = {top for top in tops if top in {"bilayer_sim_ros", "rclpy"} or top.endswith(("_msgs", "_srvs"))}
        assert not unknown, path


def _modules_with_names(node, path):
    """Modules of the package that an import statement means."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
    module = ".".join(filter(None, (base, node.module)))
    return [module, *(f"{module}.{alias.name}" for alias in node.names)]


def imports_of_modules():
    """Every module of both packages, and those that it imports anywhere: late, or for the type checker alone, too."""
    everything = [*modules(), *sorted((ROOT / "bilayer_sim_ros").rglob("*.py"))]
    paths = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in everything}
    files = {name.removesuffix(".__init__"): path for path, name in paths.items()}
    return {
        name: {
            target
            for node in nodes_of(path)
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for target in _modules_with_names(node, path)
            if target in files and target != name and not files[target].name == "__init__.py"
        }
        for name, path in files.items()
        if path.name != "__init__.py"
    }


def test_no_modules_import_each_other_in_a_circle():
    left = imports_of_modules()
    while free := [name for name, targets in left.items() if not targets & left.keys()]:
        for name in free:
            del left[name]
    while unused := left.keys() - set().union(*left.values()):
        for name in unused:
            del left[name]
    assert sorted(left) == []


def test_no_module_has_the_name_of_one_beside_it_or_next_door():
    """The folders next door are those in the same folder, the one around it, and those inside."""
    found = {}
    for path in (*modules(), *sorted((ROOT / "bilayer_sim_ros").rglob("*.py"))):
        if not path.stem.startswith("__") and "." not in path.stem and path.parent != ROOT / TOP / "cli":
            found.setdefault(path.stem, []).append(path)
    near = [
        (str(one.relative_to(ROOT)), str(other.relative_to(ROOT)))
        for paths in found.values()
        for one, other in combinations(paths, 2)
        if one.parent.parent == other.parent.parent
        or one.parent.parent == other.parent
        or other.parent.parent == one.parent
    ]
    assert near == []


PUBLIC_NUMBA = {"numba", "numba.extending", "numba.core.types", "numba.core.cgutils", "numba.types"}
OFFERED = {"numba.core": {"cgutils", "types"}}
"""What numba's documentation of extensions imports from its inside."""
COMPILER = "bilayer_core/jit/compiler/"
EXCEPTION = f"{COMPILER}undocumented.py"


def test_only_the_compiler_uses_numba_and_only_one_short_file_what_that_does_not_document():
    for path in modules():
        name = path.relative_to(ROOT).as_posix()
        assert name.startswith(COMPILER) or not {of for of in imported_names(path) if of.split(".")[0] == "numba"}, name
        if name == EXCEPTION:
            assert len(path.read_text().splitlines()) <= 100
            continue
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "numba":
                names = {alias.name for alias in node.names}
                assert node.module in PUBLIC_NUMBA or names <= OFFERED.get(node.module, set()), f"{name}: {node.module}"
            if isinstance(node, ast.Import):
                used = {alias.name for alias in node.names if alias.name.split(".")[0] == "numba"}
                assert used <= PUBLIC_NUMBA, name


def test_every_file_with_kernels_is_part_of_the_fingerprint_of_the_cache():
    from bilayer_core.jit.cache import FOLDERS

    for path in modules():
        decorators = {
            getattr(getattr(of, "func", of), "id", "")
            for node in nodes_of(path)
            if isinstance(node, (ast.FunctionDef, ast.ClassDef))
            for of in node.decorator_list
        }
        if decorators & {"kernel", "exact_kernel", "entry", "piece", "record"}:
            assert part_of(path) in FOLDERS, path


def test_importing_the_core_imports_neither_ros_nor_viewer_nor_log_library():
    unwanted = {"rclpy", "rerun", "mcap", "matplotlib", "bilayer_sim_ros"}
    program = f"import sys, bilayer_core; print(*sorted({unwanted!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
