"""The command `bilayer fit`: what it prints and writes, and how each way of ending is told."""

import csv
import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml
from benchmarks.fit_coverage import SCENE, TIMES, TIP, TRUTH, exact_data
from PIL import Image
from support.processes import TIMEOUT, command, environment

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main

MODULUS, GAIN = TRUTH
ASKED = ["--parameter", f"{MODULUS}=0.1MPa:10MPa:0.6MPa", "--parameter", f"{GAIN}=1%:10%"]
FILES = {"report.json", "residuals.csv", "fitted.yaml", "fit.png"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene, and data of its tip in millimetres with a hole."""
    folder = tmp_path_factory.mktemp("fit")
    (folder / "strip.yaml").write_text(yaml.safe_dump(SCENE))
    exact, noise = exact_data(), np.random.default_rng(2)
    with open(folder / "points.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time [ms]", f"{TIP}.x [mm]", f"{TIP}.z [mm]"])
        for k, moment in enumerate(TIMES):
            x, z = (1e3 * exact[f"{TIP}.{axis}"][k] + noise.normal(0.0, 0.3) for axis in "xz")
            rows.writerow([f"{1e3 * moment:g}", "" if k == 2 else f"{x:.3f}", f"{z:.3f}"])
    return folder


@pytest.fixture
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    return folder


def fitted(*arguments):
    return main(["fit", "strip.yaml", "--data", "points.csv", *arguments])


@pytest.fixture(scope="module")
def written(folder):
    """The directory of a fit, and what it printed."""
    run = [*command("fit", "strip.yaml", "--data", "points.csv", *ASKED, "--out", "out", "--json", "-")]
    done = subprocess.run(run, cwd=folder, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    return folder / "out", done


def test_the_table_has_values_intervals_correlations_and_noise(written):
    out, done = written
    lines = done.stderr.splitlines()
    assert any(line.startswith("strip: 15 values of points.csv, ") for line in lines)
    row = next(line.split() for line in lines if line.startswith(MODULUS))
    value, low, high = (float(row[k]) for k in (1, 3, 5))
    assert row[2] == "MPa" and low < 1.0 < high and low < value < high
    assert any(line.startswith(f"2 {GAIN}") for line in lines) and "estimated noise" in done.stderr
    assert "numerical noise measured in" in done.stderr and "iteration 1: " in done.stderr
    assert all(f"wrote out/{name}" in done.stderr for name in FILES)


def test_the_report_is_the_json_on_standard_output_in_si_units(written):
    out, done = written
    report = json.loads(done.stdout)
    assert report == json.loads((out / "report.json").read_text())
    for path, truth in TRUTH.items():
        low, high = report["parameters"][path]["interval"]
        assert low < truth < high
    assert report["values"] == 15 and report["degrees_of_freedom"] == 13 and report["converged"] is True
    assert report["correlations"][MODULUS][MODULUS] == 1.0 and not report["sigma_known"]
    assert report["sigma"][f"{TIP}.x"] == pytest.approx(0.3e-3, rel=0.6)
    assert report["parameters"][MODULUS]["logarithmic"] and not report["parameters"][GAIN]["logarithmic"]


def test_the_scene_with_the_fitted_values_runs_as_the_fit_does(written):
    out, done = written
    report = json.loads(done.stdout)
    scene = load_scene(out / "fitted.yaml")
    assert scene.materials["gel"].youngs_modulus == report["parameters"][MODULUS]["value"]
    simulator = Simulator(scene)
    rows = list(csv.DictReader((out / "residuals.csv").open()))
    last = rows[-1]
    for moment in TIMES:
        simulator.run(until=float(moment))
    assert float(last["fit"]) == pytest.approx(1e3 * simulator.rods["strip"].positions[-1, 2], rel=1e-12)
    assert last["quantity"] == f"{TIP}.z" and last["unit"] == "mm" and float(last["time"]) == TIMES[-1]


def test_residuals_have_a_row_for_each_value_and_are_data_less_fit(written):
    out, _ = written
    rows = list(csv.DictReader((out / "residuals.csv").open()))
    assert len(rows) == 15 and list(rows[0]) == [
        "time", "quantity", "unit", "data", "sigma", "start", "fit", "residual",
    ]  # fmt: skip
    for row in rows:
        assert float(row["residual"]) == pytest.approx(float(row["data"]) - float(row["fit"]), abs=1e-9)
    assert {row["time"] for row in rows if row["quantity"] == f"{TIP}.x"}.isdisjoint({"0.12"})


def test_the_picture_shows_data_fit_and_start(written):
    out, _ = written
    picture = np.asarray(Image.open(out / "fit.png").convert("RGB")).reshape(-1, 3).astype(int)

    def near(colour):
        return int((np.abs(picture - colour).max(axis=1) < 40).sum())

    assert near((255, 255, 255)) < 0.98 * len(picture)
    assert near((0xD5, 0x5E, 0x00)) > 300 and near((0x56, 0xB4, 0xE9)) > 300 and near((0, 0, 0)) > 300


def test_files_that_are_there_are_kept_without_force(written, here, capsys):
    out, _ = written
    before = (out / "report.json").read_bytes()
    assert fitted(*ASKED, "--out", "out", "--quiet") == 2
    assert "exists already; choose another name, or replace it with --force" in capsys.readouterr().err
    assert (out / "report.json").read_bytes() == before
    assert fitted(*ASKED[2:], "--out", "out", "--force", "--quiet") == 0
    assert {path.name for path in out.iterdir()} == FILES


def test_quiet_fits_print_the_table_alone(here, capsys):
    assert fitted("--parameter", f"{MODULUS}=0.5MPa:2MPa", "--quiet", "--sigma", "rod/*=0.3mm") == 0
    out, told = capsys.readouterr()
    assert told == "" and "given noise" in out and "chi squared" in out and "correlation" not in out


def test_what_cannot_be_told_apart_ends_with_1_and_writes_nothing(here, capsys):
    asked = ["--parameter", f"{MODULUS}=0.1MPa:10MPa", "--parameter", "materials.gel.density=500:2000"]
    loose = ["--set", "gravity=[0, 0, 0]", "--set", "damping.mass=0"]
    assert fitted(*asked, *loose, "--out", "none", "--json", "none.json", "--quiet") == 1
    told = capsys.readouterr().err
    assert told.startswith("bilayer: nothing was fitted: the data cannot tell parameters apart at the start")
    assert f"{MODULUS} and materials.gel.density: the data tell only" in told and "--set PATH=VALUE" in told
    assert not list((here / "none").iterdir()) and not (here / "none.json").exists()


def test_a_fit_that_has_not_converged_ends_with_1_and_writes_what_it_has(here, capsys, monkeypatch):
    monkeypatch.setattr("bilayer_core.studies.fitting.descent.MOST_EVALUATIONS", 1)
    assert fitted(*ASKED[2:], "--json", "early.json", "--quiet") == 1
    assert "not converged after as many evaluations as a fit may make" in capsys.readouterr().out
    assert json.loads((here / "early.json").read_text())["converged"] is False


@pytest.mark.parametrize(
    "arguments,told",
    [
        (["--parameter", "materials.gel.youngs_modulos=1MPa:2MPa"], "did you mean youngs_modulus?"),
        (["--parameter", f"{MODULUS}=2MPa:1MPa"], "the lower bound 2MPa must be below the upper one"),
        (["--parameter", f"{MODULUS}=-1MPa:1MPa"], "must be a pressure [Pa] above 0"),
        (["--parameter", "materials.gel.poisson_ratio=0.1:0.4"], "has no influence on any value"),
        ([*ASKED, "--sigma", "rod/*"], "must be QUANTITY=VALUE"),
        ([*ASKED, "--sigma", "com.z=1mm"], "points.csv has no such column"),
        ([*ASKED, "--set", "duration=0.2 s"], "points.csv: line 7: the time 0.24 s is beyond the end of the scene"),
        ([*ASKED, "--dt", "3 ms"], "points.csv: the time 0.04 s is no multiple of the fixed step, 0.003 s"),
        ([*ASKED, "--dt", "soft"], "solver.dt: found"),
        ([*ASKED, "--set", "rods.strip.layers.passive.thickness=-1mm"], "must be a length [m] above 0"),
        ([*ASKED, "--json", "report.txt"], "report.txt: must end in .json"),
        ([*ASKED, "--out", "points.csv"], "points.csv: cannot be made a directory"),
        (["--data", "nowhere.csv", *ASKED], "nowhere.csv: "),
        ([], "Missing option '--parameter'"),
    ],
)
def test_bad_input_ends_with_2_and_one_message(here, capsys, arguments, told):
    assert fitted(*arguments, "--quiet") == 2
    out, err = capsys.readouterr()
    assert told in err and out == "" and "Traceback" not in err
    assert err.startswith("bilayer: ") and err.count("\n") == 1 or err.startswith("Usage: ")


def test_without_matplotlib_a_picture_is_refused_before_anything_is_run(here, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert fitted(*ASKED, "--out", "drawn", "--quiet") == 2
    assert "pip install 'bilayer_sim_ros[plot]'" in capsys.readouterr().err


def test_fits_import_no_matplotlib_unless_they_draw(folder):
    words = ["fit", "strip.yaml", "--data", "points.csv", "--parameter", f"{MODULUS}=0.5MPa:2MPa", "--quiet"]
    program = (
        f"import sys\nfrom bilayer_core.cli import main\ncode = main({words})\n"
        "print(code, 'matplotlib' in sys.modules)\n"
    )
    run = [sys.executable, "-c", program]
    done = subprocess.run(run, cwd=folder, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert done.stdout.splitlines()[-1] == "0 False", done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="signals of POSIX")
@pytest.mark.parametrize(
    "number,told",
    [
        (signal.SIGINT, "interrupted"),
        pytest.param(signal.SIGTERM, "ended by SIGTERM", marks=pytest.mark.verify),
    ],
)
def test_an_interrupted_fit_ends_with_one_line_and_leaves_no_files(folder, tmp_path, number, told):
    slow = ["--set", "solver.tolerance=1e-9", "--out", str(tmp_path / "cut")]
    process = subprocess.Popen(
        command("fit", "strip.yaml", "--data", "points.csv", *ASKED, *slow),
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr.readline().startswith("  start: ")  # it is in the midst of its runs
        time.sleep(0.2)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, out, err.splitlines()[-1]) == (128 + number, "", f"bilayer: {told}")
    assert not list((tmp_path / "cut").iterdir())
