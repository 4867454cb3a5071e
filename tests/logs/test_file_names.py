"""Names from logs of strangers as names of files: they stay where they belong, and nothing is replaced."""

import csv
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import synthetic_run

from bilayer_core.cli import main
from bilayer_core.errors import OutputError
from bilayer_core.log.file.file_names import file_names
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run import export as module
from bilayer_core.log.run.csv_cells import text_cell
from bilayer_core.log.run.export import CSV, NPZ, PARQUET, export
from bilayer_core.log.run.log_source import LogSource

HOSTILE = (
    "../results",
    "/tmp/results",
    "a/../../results",
    "a//b",
    "a\\..\\b",
    "C:results",
    "nul\0byte",
    "body/con/Com1",
    "body/Ball/position",
    "body/ball/position",
    "x" * 300,
    "=cmd|'/c calc'!A1",
    "line\nbreak,and comma",
)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=50.0, marker_rate=25.0), np.arange(3) * 0.02)
    return path


@pytest.fixture
def hostile(log, monkeypatch):
    """The log, in which scalars are called as a stranger may call them."""
    known = LogSource(log).entries

    class Hostile(LogSource):
        @property
        def entries(self):
            return {name: replace(known["energy/bend"], name=name) for name in HOSTILE}

        @entries.setter
        def entries(self, _):
            pass

        def blocks(self, wanted):
            for rows, block in super().blocks([known["energy/bend"]]):
                yield rows, {entry.name: block["energy/bend"] for entry in wanted}

    monkeypatch.setattr(module, "LogSource", Hostile)
    return log


def listed(directory):
    return sorted(str(path.relative_to(directory)) for path in directory.rglob("*") if path.is_file())


@pytest.mark.parametrize("kind", [CSV, PARQUET])
def test_files_of_hostile_names_stay_in_the_directory_and_replace_nothing(hostile, tmp_path, kind):
    inside = tmp_path / "deep" / "down"
    inside.mkdir(parents=True)
    outside = inside.parent / f"results{kind}"
    outside.write_text("precious")
    export(hostile, inside / "out", kind)
    assert outside.read_text() == "precious"
    assert sorted(path.name for path in inside.iterdir()) == ["out"]
    assert len(listed(inside / "out")) == len(HOSTILE)
    assert listed(tmp_path) == sorted(f"deep/down/out/{name}" for name in listed(inside / "out")) + [
        f"deep/results{kind}"
    ]


def test_members_of_an_npz_unpack_into_the_directory_they_are_unpacked_in(hostile, tmp_path):
    export(hostile, tmp_path / "run.npz", NPZ)
    with zipfile.ZipFile(tmp_path / "run.npz") as archive:
        names = archive.namelist()
    assert len({name.lower() for name in names}) == len(HOSTILE) + 4
    for name in names:
        assert not name.startswith("/") and not {"", ".", ".."} & set(name.split("/"))
        assert not set(name) & set('\\:\0\n*?"<>|') and all(len(part) < 250 for part in name.split("/"))


def test_a_csv_header_of_a_hostile_name_is_one_cell_that_no_spreadsheet_executes(hostile, tmp_path):
    export(hostile, tmp_path / "run.csv", CSV)
    with (tmp_path / "run.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert len(header) == len(HOSTILE) + 1
    assert "'=cmd|'/c calc'!A1 [J]" in header and not any(cell[0] in "=+-@\t\r" for cell in header)
    assert len(rows) == 3 and all(np.isfinite(float(cell)) for row in rows for cell in row)


@pytest.mark.parametrize("text", ["=1+1", "+1", "-x", "@SUM(A1)", "\t=1", "\r=1"])
def test_text_that_a_spreadsheet_executes_begins_with_an_apostrophe(text):
    assert text_cell(text) == f"'{text}"


def test_an_export_does_not_follow_a_link_out_of_its_directory(log, tmp_path, capsys):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "energy").symlink_to(elsewhere)
    assert main(["export", str(log), "--csv", str(tmp_path / "out"), "--force"]) == 2
    assert "out/energy: is a link" in capsys.readouterr().err
    assert list(elsewhere.iterdir()) == []


def test_an_export_keeps_a_file_that_comes_while_it_is_written(log, tmp_path, monkeypatch):
    write = module._write_tables

    def meanwhile(source, tables):
        write(source, tables)
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / "com.csv").write_text("precious")

    monkeypatch.setattr(module, "_write_tables", meanwhile)
    with pytest.raises(OutputError, match=r"out/com.csv: cannot be written: File exists"):
        export(log, tmp_path / "out", CSV, ["com"])
    assert (tmp_path / "out" / "com.csv").read_text() == "precious"


PARTS = st.sampled_from(["", ".", "..", "con", "NUL", "a", "A", "b.csv", "~", "%", "é", "\0", "\ud800", "x" * 150])


@given(st.lists(st.one_of(st.lists(PARTS, max_size=4).map("/".join), st.text(max_size=20)), unique=True))
def test_any_names_give_paths_inside_that_no_file_system_takes_for_the_same(names):
    found = file_names(names)
    assert len({path.lower() for path in found.values()}) == len(names) == len(found)
    for path in found.values():
        parts = path.split("/")
        assert path.isascii() and not {"", ".", ".."} & set(parts) and not set(path) & set('\\:.\0 *?"<>|')
        assert all(len(part) < 240 and part.lower() not in ("con", "nul") for part in parts)
        assert not Path(path).is_absolute()


def test_names_that_scenes_allow_keep_their_letters():
    names = ["com", "energy/bend", "rod/strip_2/top/position", "body/Ball/contact_wrench"]
    assert file_names(names) == dict(zip(names, names, strict=True))
    assert set(file_names(["units"], taken=["units"]).values()).isdisjoint({"units"})
