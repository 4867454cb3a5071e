"""What package.xml says is what is imported; what rosdep does not know comes with pip."""

import ast
import re
import sys
from xml.etree import ElementTree

import pytest

OPTIONAL = {"rosbag2_interfaces", "simulation_interfaces"}
"""ROS packages that are used where they are installed."""
OWN = {"bilayer_core", "bilayer_sim_ros"}
COMMANDS = {"ros2launch"}
"""ROS packages that are not imported, but run."""
OF_PIP = {"lz4", "mcap", "numba", "pebble", "pint"}
"""Python packages without a key of rosdep, or with too old a version."""
KEYS = {"python3-yaml": "pyyaml"}
"""Keys of rosdep whose package has another name."""


@pytest.fixture(scope="module")
def declared(root):
    """Names in package.xml by the kind of dependency."""
    kinds = ("depend", "exec_depend", "test_depend")
    package = ElementTree.parse(root / "package.xml").getroot()
    return {kind: {element.text for element in package.iter(kind)} for kind in kinds}


@pytest.fixture(scope="module")
def requirements(root):
    """Python packages that pip installs with this one."""
    required = re.search(r"install_requires=\[(.*?)\]", (root / "setup.py").read_text(), re.DOTALL)[1]
    return set(re.findall(r'^\s*"([a-z0-9]+)', required, re.MULTILINE))


def imported(folder):
    """Top-level names of all that the sources of a package import that is not of Python itself."""
    names = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - OWN


def test_the_ros_packages_that_are_imported_are_those_of_package_xml(root, declared, requirements):
    of_python = {"yaml" if name == "pyyaml" else name for name in requirements}
    topics = (root / "bilayer_core" / "log" / "messages" / "topics.py").read_text()
    published = set(re.findall(r"(\w+)/msg/\w", topics))  # these are imported by name
    needed = (imported(root / "bilayer_sim_ros") | published) - of_python - OPTIONAL
    named = {name for name in declared["depend"] | declared["exec_depend"] if not name.startswith("python3-")}
    assert needed == named - COMMANDS


def test_the_python_packages_of_package_xml_are_those_of_pip(declared, requirements):
    keys = {name for name in declared["exec_depend"] if name.startswith("python3-")}
    assert {KEYS.get(key, key.removeprefix("python3-")) for key in keys} == requirements - OF_PIP


def test_the_test_packages_of_package_xml_are_of_the_extra_test(root, declared):
    extra = re.search(r'"test": \[(.*?)\]', (root / "setup.py").read_text(), re.DOTALL)[1]
    known = set(re.findall(r'"([a-z0-9-]+)>=', extra)) | {"pil"}
    assert {key.removeprefix("python3-") for key in declared["test_depend"]} <= known
