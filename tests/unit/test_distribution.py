"""The source distribution and what it says of itself: files, version, licences, citation."""

import email
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import pytest
import yaml

import bilayer_core

LEFT_OUT = {".ci/run", ".gitignore", ".readthedocs.yaml"}
"""Files that only a clone needs."""
MADE = re.compile(r"PKG-INFO|setup\.cfg|bilayer_sim_ros\.egg-info/.*")
"""Files that setuptools adds."""


@pytest.fixture(scope="module")
def tracked(root):
    if not (root / ".git").exists():
        pytest.skip("no checkout of git")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, check=True, capture_output=True, text=True)
    return set(listed.stdout.split("\0")[:-1])


@pytest.fixture(scope="module")
def distribution(root, tracked, tmp_path_factory):
    """The unpacked source distribution, made of a copy of the tracked files."""
    directory = tmp_path_factory.mktemp("distribution")
    for name in tracked:
        (directory / "sources" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(root / name, directory / "sources" / name)
    command = [sys.executable, "setup.py", "--quiet", "sdist", "--formats=tar", "--dist-dir", directory]
    subprocess.run(command, cwd=directory / "sources", check=True)
    (archive,) = directory.glob("*.tar")
    shutil.unpack_archive(archive, directory)
    return directory / archive.stem


@pytest.fixture(scope="module")
def metadata(distribution):
    return email.message_from_string((distribution / "PKG-INFO").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def version(root):
    return ElementTree.parse(root / "package.xml").getroot().findtext("version")


def test_it_holds_every_tracked_file_but_those_for_clones(tracked, distribution):
    packed = {path.relative_to(distribution).as_posix() for path in distribution.rglob("*") if path.is_file()}
    assert {name for name in packed if not MADE.fullmatch(name)} == tracked - LEFT_OUT


def test_it_is_described_and_has_its_licences(metadata, version):
    assert metadata["Version"] == version and metadata["License"] == "Apache-2.0"
    assert {"Summary", "Keywords", "Maintainer", "Maintainer-email", "Requires-Python"} <= {*metadata.keys()}
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert {"LICENSE", "NOTICE"} <= set(metadata.get_all("License-File"))
    classifiers = metadata.get_all("Classifier")
    assert "Typing :: Typed" in classifiers and not any("License" in classifier for classifier in classifiers)


def test_the_notice_has_the_licences_of_what_compiled_kernels_contain(root):
    notice = (root / "NOTICE").read_text(encoding="utf-8")
    assert "numba (BSD-2-Clause)" in notice and "Redistributions in binary form must reproduce" in notice
    assert "LLVM (Apache-2.0 WITH LLVM-exception)" in notice and "embedded into an Object form" in notice


def test_every_file_that_names_the_version_names_that_of_package_xml(root, version):
    citation = yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))
    released = re.search(r"^## (\S+)$", (root / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)[1]
    assert citation["version"] == released == bilayer_core.__version__ == version


def test_a_link_to_setup_py_finds_the_version_as_well(root, version, tmp_path):
    """colcon's symlink install runs one in a directory of its own."""
    (tmp_path / "setup.py").symlink_to(root / "setup.py")
    command = [sys.executable, "-W", "ignore", "setup.py", "--version"]
    told = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert told.stdout.strip() == version


def test_the_citation_has_the_keys_of_its_format_and_the_paper(root):
    citation = yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0" and citation["license"] == "Apache-2.0"
    assert citation["message"] and citation["title"] and citation["authors"]
    (paper,) = citation["references"]
    assert paper["type"] == "article" and paper["title"] and paper["journal"] == "Advanced Intelligent Systems"
    assert paper["doi"] == "10.1002/aisy.202500141"
    names = [author["family-names"] for author in paper["authors"]]
    assert names == ["Li", "Tong", "Hao", "Zhu", "Wu", "Liu", "Huang"]
