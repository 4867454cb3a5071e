"""Quantities of a log as csv, parquet and npz, read by other tools."""

import csv
import json

import numpy as np
import pandas
import pytest
from support import synthetic_run

from bilayer_core import read_log
from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run import export as module
from bilayer_core.log.run.export import CSV, NPZ, PARQUET, export

TIMES = np.arange(0, 26) * 0.02
ROD = "rod/arm_1/active"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=50.0, marker_rate=25.0), TIMES)
    return path


@pytest.fixture(scope="module")
def run(log):
    return read_log(log)


def test_npz_has_every_quantity_bit_for_bit_with_units_and_labels(log, run, tmp_path):
    export(log, tmp_path / "run.npz", NPZ)
    with np.load(tmp_path / "run.npz", allow_pickle=False) as data:
        units, labels = dict(data["units"]), dict(data["labels"])
        np.testing.assert_array_equal(data["time"], run.times)
        np.testing.assert_array_equal(data["shape_time"], run.shape_times)
        assert set(data.files) == {*run.quantities, "time", "shape_time", "units", "labels"}
        for name, quantity in run.quantities.items():
            np.testing.assert_array_equal(data[name], quantity.values)
            assert units[name] == quantity.unit and labels.get(name, "").split() == list(quantity.labels)


def test_a_csv_table_has_all_over_time_with_units_in_its_first_line(log, run, tmp_path):
    export(log, tmp_path / "run.csv", CSV)
    table = pandas.read_csv(tmp_path / "run.csv")
    assert len(table) == len(TIMES) and not any("rod/" in name for name in table)
    np.testing.assert_array_equal(table["time [s]"], run.times)
    np.testing.assert_array_equal(table["com.z [m]"], run.com[:, 2])
    np.testing.assert_array_equal(table["body/ball/contact_wrench.mz [N m]"], run.contact_wrenches[:, 1, 5])


def test_a_directory_has_a_file_of_each_quantity_with_rows_for_nodes(log, run, tmp_path):
    for kind, read in ((CSV, pandas.read_csv), (PARQUET, pandas.read_parquet)):
        out = tmp_path / kind[1:]
        export(log, out, kind)
        files = {str(path.relative_to(out).with_suffix("")): path for path in out.rglob("*") if path.is_file()}
        assert set(files) == set(run.quantities)
        table = read(files[f"{ROD}/position"])
        position = run[f"{ROD}/position"]
        nodes = position.values.shape[1]
        assert list(table)[:2] == (["time [s]", "node"] if kind == CSV else ["time", "node"])
        np.testing.assert_array_equal(table["node"], np.tile(np.arange(nodes), len(position.times)))
        np.testing.assert_array_equal(table.iloc[:, 0], np.repeat(position.times, nodes))
        z = table["z [m]" if kind == CSV else "z"].to_numpy().astype(np.float32)
        np.testing.assert_array_equal(z.reshape(-1, nodes), position.values[..., 2])


def test_parquet_tells_units_of_its_columns(log, tmp_path):
    from pyarrow import parquet

    export(log, tmp_path / "run.parquet", PARQUET, ["com", "energy/*"])
    schema = parquet.read_schema(tmp_path / "run.parquet")
    assert schema.field("com.x").metadata[b"unit"] == b"m"
    assert json.loads(schema.metadata[b"units"])["energy/bend"] == "J"
    assert schema.names[:4] == ["time", "com.x", "com.y", "com.z"]


def test_quantities_are_named_or_matched(log, tmp_path, capsys):
    assert main(["export", str(log), f"{ROD}/*", "--csv", str(tmp_path / "rod.csv")]) == 0
    with (tmp_path / "rod.csv").open() as file:
        head = next(csv.reader(file))
    assert head[:3] == ["time [s]", "node", "position.x [m]"] and "curvature [1/m]" in head
    for words, message in (
        (["coms", "--npz", "a.npz"], "quantity 'coms': there is none; near it: com"),
        (["nothing/*", "--npz", "a.npz"], "quantity 'nothing/*': there is none"),
        (["com", f"{ROD}/strain", "--csv", "a.csv"], "is one table, and the quantities have other rows"),
        (["com", "--npz", "a.csv"], r"must end in .npz"),
        (["com", "--csv", "a.npz"], r"must end in .csv, or be the name of a directory"),
        (["com"], "say what to write"),
    ):
        words = [str(tmp_path / word) if word.startswith("a.") else word for word in words]
        assert main(["export", str(log), *words]) == 2
        assert message in capsys.readouterr().err


def test_nothing_is_overwritten_without_being_asked_and_failures_leave_nothing(log, tmp_path, monkeypatch, capsys):
    out, table = tmp_path / "out", tmp_path / "com.csv"
    table.write_text("precious")
    out.mkdir()
    (out / "mine.txt").write_text("precious")
    for path in (out, table):
        assert main(["export", str(log), "com", "--csv", str(path)]) == 2
        assert "--force" in capsys.readouterr().err
        assert main(["export", str(log), "com", "--csv", str(path), "--force"]) == 0
    assert (out / "mine.txt").read_text() == "precious" and (out / "com.csv").exists()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "_write_tables", full)
    assert main(["export", str(log), "--parquet", str(tmp_path / "new")]) == 3
    assert "No space left" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["com.csv", "out"]


def test_a_log_without_frames_is_exported_as_tables_without_rows(tmp_path):
    recorder = McapRecorder(tmp_path / "run.mcap")
    recorder.start(synthetic_run.description())
    recorder.close(True)
    export(tmp_path / "run.mcap", tmp_path / "run.npz", NPZ)
    export(tmp_path / "run.mcap", tmp_path / "run.csv", CSV)
    export(tmp_path / "run.mcap", tmp_path / "run.parquet", PARQUET, ["rod/arm_0/active/strain"])
    table = pandas.read_csv(tmp_path / "run.csv")
    assert len(table) == 0 and "com.z [m]" in table
    assert list(pandas.read_parquet(tmp_path / "run.parquet")) == ["time", "node", "strain"]
    with np.load(tmp_path / "run.npz") as data:
        assert data["com"].size == data["time"].size == 0
