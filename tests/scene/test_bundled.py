import sysconfig
from pathlib import Path

import pytest

import bilayer_core
from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.scene import bundled
from bilayer_core.scene.bundled import (
    bundled_directory,
    bundled_scenes,
    bundled_sweep,
    bundled_sweeps,
    bundled_templates,
    is_file_name,
)

SHARED = "share/bilayer_sim_ros/config/scenes"


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    """A package that is installed where no scenes are."""
    package = tmp_path / "site-packages" / "bilayer_core"
    monkeypatch.setattr(bilayer_core, "__file__", str(package / "__init__.py"))
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path / "data"))
    monkeypatch.setattr(bundled.sys, "prefix", str(tmp_path / "prefix"))
    monkeypatch.setattr(bilayer_core, "DISTRIBUTION", "a_distribution_that_is_not_installed")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    return tmp_path


def put_scene(directory: Path) -> Path:
    directory.mkdir(parents=True)
    (directory / "robot.yaml").write_text("title: A robot\n")
    return directory


def test_scenes_of_the_checkout_are_found_first(root):
    assert bundled_directory("scenes") == root / "config" / "scenes"


def test_templates_lie_beside_the_scenes(nowhere, monkeypatch):
    put_scene(nowhere / "install" / SHARED)
    directory = put_scene(nowhere / "install" / SHARED.replace("scenes", "templates"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(nowhere / "install"))
    assert bundled_templates() == {"robot": directory / "robot.yaml"}


def test_scenes_are_found_through_a_link_to_the_package(nowhere, monkeypatch):
    directory = put_scene(nowhere / "checkout" / "config" / "scenes")
    (nowhere / "checkout" / "bilayer_core").mkdir()
    (nowhere / "build").mkdir()
    (nowhere / "build" / "bilayer_core").symlink_to(nowhere / "checkout" / "bilayer_core")
    monkeypatch.setattr(bilayer_core, "__file__", str(nowhere / "build" / "bilayer_core" / "__init__.py"))
    assert bundled_directory("scenes") == directory


@pytest.mark.parametrize("prefix", ["data", "prefix", "site-packages"])
def test_scenes_of_a_wheel_are_found_below_the_prefix(nowhere, prefix):
    directory = put_scene(nowhere / prefix / SHARED)
    assert bundled_directory("scenes") == directory


def test_scenes_are_found_where_the_installer_recorded_them(nowhere, monkeypatch):
    directory = put_scene(nowhere / "user" / SHARED)
    info = nowhere / "user" / "lib" / "robots-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: robots\nVersion: 1.0\n")
    (info / "RECORD").write_text(f"robots.py,,\n../{SHARED}/robot.yaml,,\n")
    monkeypatch.syspath_prepend(str(info.parent))
    monkeypatch.setattr(bilayer_core, "DISTRIBUTION", "robots")
    assert bundled_directory("scenes") == directory


def test_scenes_of_a_colcon_install_are_found_in_its_prefix(nowhere, monkeypatch):
    directory = put_scene(nowhere / "install" / SHARED)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/opt/ros/none:{nowhere / 'install'}")
    assert bundled_directory("scenes") == directory
    assert bundled_scenes() == {"robot": directory / "robot.yaml"}


def test_without_scenes_the_error_lists_where_they_were_looked_for(nowhere, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(nowhere / "install"))
    with pytest.raises(SceneError) as refused:
        bundled_directory("scenes")
    for place in (nowhere / "site-packages" / "config/scenes", nowhere / "data" / SHARED, nowhere / "install" / SHARED):
        assert f"\n  {place}" in str(refused.value)


def test_an_unknown_scene_is_refused_with_the_nearest_name_and_all_names():
    with pytest.raises(SceneError) as refused:
        load_scene("griping")
    assert "did you mean gripping?" in str(refused.value)
    assert all(name in str(refused.value) for name in bundled_scenes())


def test_a_file_in_the_present_directory_is_preferred_to_a_bundled_scene(tmp_path, monkeypatch, root):
    text = (root / "config/scenes/cantilever.yaml").read_text()
    (tmp_path / "gripping").write_text(text)
    monkeypatch.chdir(tmp_path)
    assert load_scene("gripping").name == "cantilever"


@pytest.mark.parametrize("name", ["walker_gait.yaml", "walker_gait.yml", "here/walker_gait", Path("walker_gait")])
def test_a_suffix_a_folder_or_a_path_means_a_file(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert is_file_name(name)
    assert not is_file_name("walker_gait")


def test_a_file_beside_is_taken_before_a_bundled_one_of_its_name(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walker_gait").write_text("")
    assert is_file_name("walker_gait")


def test_an_unknown_sweep_is_refused_with_the_nearest_name_and_all_of_them():
    with pytest.raises(SceneError) as refusal:
        bundled_sweep("walker_gate")
    assert "neither a sweep file nor a bundled sweep, did you mean walker_gait?" in str(refusal.value)
    assert all(name in str(refusal.value) for name in bundled_sweeps())
