"""What an installation contains, tried in a directory of its own."""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow
NOT_SOURCES = shutil.ignore_patterns(".*", "__pycache__", "build", "runs", "*.egg-info")


EXECUTABLES = ["sim_node", "replay_node", "ramp_controller", "gait_controller", "goal_controller"]


@pytest.mark.verify
def test_ros2_finds_executables_and_launch_files_after_an_editable_installation(root, tmp_path):
    shutil.copytree(root, tmp_path / "sources", ignore=NOT_SOURCES)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--ignore-installed"]
    subprocess.run([*pip, "--prefix", tmp_path / "prefix", "--editable", tmp_path / "sources"], check=True)
    # `ros2 run` and `ros2 launch` look for the package in the index of each prefix, and then beside it.
    (index,) = tmp_path.glob("prefix/**/share/ament_index/resource_index/packages/bilayer_sim_ros")
    prefix = index.parents[4]
    executables = {path.name for path in (prefix / "lib/bilayer_sim_ros").iterdir() if os.access(path, os.X_OK)}
    assert executables == set(EXECUTABLES) and (prefix / "bin/bilayer").exists()
    launch_files = {path.name for path in (prefix / "share/bilayer_sim_ros").rglob("*.launch.py")}
    assert launch_files == {"simulation.launch.py", "replay.launch.py"}


@pytest.mark.verify
@pytest.mark.parametrize("kind", ["install", "develop"])
def test_colcon_puts_the_command_on_the_path_and_executables_where_ros2_run_looks(root, tmp_path, kind):
    """colcon calls setup.py itself, and makes links to data files where it is asked for links."""
    shutil.copytree(root, tmp_path / "sources", ignore=NOT_SOURCES)
    prefix, sources = tmp_path / "prefix", tmp_path / "sources"
    setup = [sys.executable, "-W", "ignore", "setup.py", "--quiet"]
    if kind == "install":
        command = ["install", "--prefix", prefix, "--single-version-externally-managed", "--record", "files.log"]
        subprocess.run([*setup, *command], cwd=sources, check=True)
        (packages,) = prefix.glob("lib/python3*/site-packages")
    else:
        packages = prefix / "packages"
        packages.mkdir(parents=True)
        command = ["develop", "--install-dir", packages, "--script-dir", prefix / "lib/bilayer_sim_ros", "--no-deps"]
        path = os.environ | {"PYTHONPATH": str(packages)}
        subprocess.run([*setup, *command], cwd=sources, check=True, env=path)
        (prefix / "bin").mkdir()
        (prefix / "bin/bilayer").symlink_to(sources / "resource/bilayer")
    names = {path.name for path in (prefix / "lib/bilayer_sim_ros").iterdir()}
    assert names == {"bilayer", *EXECUTABLES}
    environment = os.environ | {"PYTHONPATH": f"{packages}{os.pathsep}{sources}", "AMENT_PREFIX_PATH": str(prefix)}
    path = f"{prefix / 'bin'}{os.pathsep}{os.environ['PATH']}"  # as colcon does for a package with a bin
    shown = subprocess.run(
        ["bilayer", "scenes"], env=environment | {"PATH": path}, cwd=tmp_path, capture_output=True, text=True
    )
    assert shown.returncode == 0 and "gripping" in shown.stdout, shown.stderr


SHOW_HELP = """
import contextlib, runpy, sys
sys.argv = [None, "--help"]
for sys.argv[0] in {paths}:
    with contextlib.suppress(SystemExit):
        runpy.run_path(sys.argv[0], run_name="__main__")
"""
WITHOUT_ROS = "import sys; sys.modules['rclpy'] = None\nfrom bilayer_sim_ros.sim_node import main\nsys.exit(main())"


def test_an_installation_has_commands_scenes_licences_and_what_ros_looks_for(root, tmp_path):
    """Installed once, without its dependencies, which are those of the environment, and used away from the checkout."""
    shutil.copytree(root, tmp_path / "sources", ignore=NOT_SOURCES)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--ignore-installed", "--no-compile"]
    subprocess.run([*pip, "--prefix", tmp_path / "prefix", tmp_path / "sources"], check=True)
    prefix = tmp_path / "prefix"
    (packages,) = prefix.glob("lib/python3*/site-packages")

    def run(*command):
        environment = os.environ | {"PYTHONPATH": str(packages)}
        return subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    assert (prefix / "share/ament_index/resource_index/packages/bilayer_sim_ros").is_file()
    configuration = ("config/sim_node.yaml", "config/scenes/gripping.yaml", "config/templates/strip.yaml")
    configuration += ("config/sweeps/walker_gait.yaml", "config/sweeps/walker_gait.py")
    for name in ("package.xml", *configuration, "launch/simulation.launch.py", "launch/replay.launch.py"):
        assert (prefix / "share/bilayer_sim_ros" / name).is_file()

    (information,) = packages.glob("bilayer_sim_ros-*.dist-info")
    assert {"LICENSE", "NOTICE"} <= {path.name for path in information.rglob("*")}

    listing = run(prefix / "bin" / "bilayer", "scenes")
    assert listing.returncode == 0 and "gripping" in listing.stdout, listing.stderr
    assert str(prefix) in run(sys.executable, "-c", "import bilayer_core; print(bilayer_core.__file__)").stdout

    for name in EXECUTABLES:  # they run those of the same name in bin
        assert os.access(prefix / "lib/bilayer_sim_ros" / name, os.X_OK)
    shown = run(prefix / "lib/bilayer_sim_ros/gait_controller", "--help")
    assert shown.returncode == 0 and "usage: gait_controller" in shown.stdout, shown.stderr
    shown = run(sys.executable, "-c", SHOW_HELP.format(paths=[str(prefix / "bin" / name) for name in EXECUTABLES]))
    assert re.findall(r"^usage: (\w+)", shown.stdout, re.M) == EXECUTABLES, shown.stderr

    node = run(sys.executable, "-c", WITHOUT_ROS)
    assert node.returncode == 2 and "Traceback" not in node.stderr
    assert "pip install 'bilayer_sim_ros[ros]'" in node.stderr


def test_every_ros_wheel_of_this_environment_is_pinned(root):
    pinned = set(re.findall(r"(ros-[a-z0-9-]+)(?:\[\w+\])?==", (root / "setup.py").read_text()))
    names = {distribution.metadata["Name"].lower() for distribution in importlib.metadata.distributions()}
    assert {name for name in names if name.startswith("ros-")} <= pinned
