"""The wheel of this platform: without a compiler and with an empty cache it compiles nothing, and computes the same.

``LIBRARY_SCENES='*'`` compares all bundled scenes with compiled pieces, in place of three.
"""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from fnmatch import fnmatch
from importlib.util import find_spec
from pathlib import Path

import pytest
from support.processes import TIMEOUT, claimed_domain

from bilayer_core.scene.bundled import bundled_scenes

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux" or platform.machine() != "x86_64", reason="a wheel of Linux on x86-64"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="a linker makes the library"),
    pytest.mark.skipif("NUMBA_BOUNDSCHECK" in os.environ, reason="the library does not check bounds"),
]
SCENES = os.environ.get("LIBRARY_SCENES", "gripping crawling_dual_leg knot").split()
LISTENER = """
import atexit, runpy, sys
from numba.core import event

class Listener(event.Listener):
    count = 0
    def on_start(self, event):
        self.count += 1
    def on_end(self, event):
        pass

listener = Listener()
for kind in ("numba:compile", "numba:run_pass"):
    event.register(kind, listener)
atexit.register(lambda: print("compile events:", listener.count, file=sys.stderr))
"""
RUN_MODULE = (
    LISTENER + "module, *sys.argv[1:] = sys.argv[1:]\nrunpy.run_module(module, run_name='__main__', alter_sys=True)"
)
STATES = """
import hashlib, json, sys
from bilayer_core import Simulator, load_scene
from bilayer_core.jit import library

found = {"library": library.is_in_use()}
for name in sys.argv[1:]:
    simulator = Simulator(load_scene(name))
    for _ in range(20):
        simulator.step()
    found[name] = hashlib.blake2b(simulator.save_state().tobytes()).hexdigest()
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory):
    """What `make wheel` makes, of a copy of the sources."""
    if find_spec("auditwheel") is None:
        pytest.skip("auditwheel is missing: pip install '.[wheel]'")
    place = tmp_path_factory.mktemp("wheel")
    left_out = shutil.ignore_patterns(".*", "__pycache__", "build", "dist", "runs", "*.egg-info")
    shutil.copytree(root, place / "tree", ignore=left_out)
    tree = place / "tree"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tree), os.environ.get("PYTHONPATH", "")])}
    environment["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])

    def run(*arguments, **more):
        command = [sys.executable, "-m", *map(str, arguments)]
        done = subprocess.run(command, cwd=tree, env=environment | more, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr

    run("bilayer_core.jit.build_library", place / "engine")
    made = ["pip", "wheel", "--no-deps", "--wheel-dir", place / "made", "."]
    run(*made, BILAYER_LIBRARY=str(place / "engine"))
    (plain,) = (place / "made").glob("*.whl")
    run("auditwheel", "repair", "--wheel-dir", place / "dist", plain)
    (audited,) = (place / "dist").glob("*.whl")
    return audited


@pytest.fixture(scope="module")
def site(wheel, tmp_path_factory):
    """Where the wheel is installed."""
    place = tmp_path_factory.mktemp("site")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--no-deps", "--target", place, wheel]
    subprocess.run(install, check=True, capture_output=True)
    return place


@pytest.fixture
def run(site, tmp_path):
    """Run Python with the wheel, no compiler and an empty cache, which stays empty."""
    cache = tmp_path / "cache"

    def of(*arguments, cwd=tmp_path, empty=True, **more):
        environment = {name: os.environ[name] for name in os.environ.keys() - {"BILAYER_JIT_AHEAD", "PATH"}}
        environment |= {"PYTHONPATH": str(site), "NUMBA_CACHE_DIR": str(cache), "PATH": str(tmp_path)} | more
        command = [sys.executable, "-P", *map(str, arguments)]
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=TIMEOUT)
        assert done.returncode == 0, done.stdout + done.stderr
        assert not empty or not cache.exists()
        return done

    return of


def _events(done):
    return int(re.search(r"^compile events: (\d+)$", done.stderr, re.M)[1])


def test_the_wheel_is_for_this_platform_and_every_python(wheel):
    assert re.fullmatch(r"bilayer_sim_ros-[\d.]+-py3-none-(manylinux_\d+_\d+_x86_64\.?)+\.whl", wheel.name), wheel.name
    with zipfile.ZipFile(wheel) as packed:
        names = packed.namelist()
        assert {"bilayer_core/jit/engine.so", "bilayer_core/jit/engine.json"} <= set(names)
        (description,) = (name for name in names if name.endswith(".dist-info/WHEEL"))
        assert "Root-Is-Purelib: false" in packed.read(description).decode()
        facts = json.loads(packed.read("bilayer_core/jit/engine.json"))
    assert facts["target"] == "x86-64-v3" and {"numba", "llvmlite", "python"} == facts["versions"].keys()


RUN_COMMANDS = """
from bilayer_core.cli import main
from bilayer_core import Simulator, load_scene

for words in {commands}:
    assert main(words.split()) == 0, words
Simulator(load_scene("bending")).solve_static()
assert listener.count == 0
import numba
numba.njit(lambda x: x + 1)(1)  # the listener counts what is compiled
"""
COMMANDS = (
    "run crawling_inchworm --duration 20ms --quiet",
    "run gripping --duration 20ms --quiet --log run.mcap",
    "render run.mcap --png picture.png",
    "check gripping",
)


def test_commands_and_statics_compile_nothing(run):
    assert _events(run("-c", LISTENER + RUN_COMMANDS.format(commands=COMMANDS))) > 0


@pytest.mark.skipif(find_spec("rclpy") is None, reason="without ROS 2")
def test_the_node_compiles_nothing(run):
    parameters = {"scene": "bending", "real_time_factor": "0.0", "duration": "0.1", "log": "node.mcap"}
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    with claimed_domain() as domain:
        node = run("-c", RUN_MODULE, "bilayer_sim_ros.sim_node", "--ros-args", *words, ROS_DOMAIN_ID=str(domain))
    assert _events(node) == 0


def test_the_library_computes_what_compiled_pieces_do_bit_for_bit(run, root):
    names = [name for name in bundled_scenes() if any(fnmatch(name, pattern) for pattern in SCENES)]
    assert names
    from_library = json.loads(run("-c", STATES, *names).stdout)
    environment = os.environ | {"PYTHONPATH": str(root)}
    command = [sys.executable, "-P", "-c", STATES, *names]
    compiled = json.loads(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    assert from_library.pop("library") and not compiled.pop("library")
    assert from_library == compiled


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ({"BILAYER_JIT_TARGET": "native"}, "it is for x86-64-v3, and code for .* is wanted"),
        ({"NUMBA_OPT": "2"}, "NUMBA_OPT is set"),
    ],
)
def test_where_other_code_is_wanted_one_line_says_so(run, setting, reason):
    told = run("-c", "import bilayer_core.engine", empty=False, **setting).stderr
    assert re.fullmatch(f"kernels are compiled, since the library that was installed does not fit: {reason}\n", told)


def test_an_edit_of_a_source_compiles_pieces_and_names_the_file(run, site, tmp_path):
    copy = tmp_path / "site"
    shutil.copytree(site, copy)
    edited = copy / "bilayer_core" / "forces" / "drag.py"
    edited.write_text(edited.read_text(encoding="utf-8") + "\n# edited\n", encoding="utf-8")
    told = run("-c", "import bilayer_core.engine", empty=False, PYTHONPATH=str(copy)).stderr
    assert told.count("\n") == 1 and f"{edited} is not as it was when the library was compiled" in told
