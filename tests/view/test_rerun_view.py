"""Recordings for the viewer, and pictures that are looked at."""

import io
import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
from PIL import Image
from support import synthetic_run

from bilayer_core.errors import InputError
from bilayer_core.view import rerun_view, viewer_process
from bilayer_core.view.theme import BALL_COLOURS

TIMES = np.arange(0, 101) * 0.04
ROBOT = (slice(70, 860), slice(0, 1195))  # rows and columns of the view of the robot in a picture
LEGEND = (slice(900, 1040), slice(0, 450))
PLOTS = (slice(60, 1040), slice(1200, 1920))


@pytest.fixture(scope="module")
def recording(log):
    path = log.with_suffix(".rrd")
    rerun_view.convert_log(log, path)
    return path


@pytest.fixture(scope="module")
def viewer(recording):
    with viewer_process.HeadlessViewer() as viewer:
        viewer.open(recording)
        yield viewer


def picture(viewer, moment):
    """Colours at `moment` as whole numbers, shape (height, width, 3)."""
    viewer.set_time(moment)
    return np.asarray(Image.open(io.BytesIO(viewer.picture())).convert("RGB")).astype(int)


def rows_where(part, condition):
    return np.nonzero(condition(part[..., 0], part[..., 1], part[..., 2]))[0]


def is_red(r, g, b):
    return (r > 150) & (r > 2 * g) & (r > 2 * b)


def is_ball(r, g, b):
    """The stronger of the ball's colours, in any light."""
    red, green, blue = BALL_COLOURS[0]
    return (r > 120) & (np.abs(g - r * green / red) < 20) & (np.abs(b - r * blue / red) < 30)


def is_arrow(r, g, b):
    return (g > 120) & (g > 1.8 * r) & (g > 1.2 * b)


@pytest.mark.slow
def test_the_robot_is_red_round_the_ball_with_arrows_and_lifts_it(viewer):
    before, after = picture(viewer, 0.0)[ROBOT], picture(viewer, None)[ROBOT]
    assert after.shape == (790, 1195, 3)
    # Unstrained at first: no red, no force. Closed: red arms, green arrows.
    assert len(rows_where(before, is_red)) == 0
    assert len(rows_where(before, is_arrow)) == 0
    assert len(rows_where(after, is_red)) > 5000
    assert len(rows_where(after, is_arrow)) > 1000
    balls = [rows_where(image, is_ball) for image in (before, after)]
    assert min(len(rows) for rows in balls) > 15000
    assert balls[0].mean() - balls[1].mean() > 80  # the camera follows, and sees the arms curl down at the same time
    robot = np.concatenate([rows_where(after, is_red), balls[1]])
    assert robot.max() - robot.min() > 790 / 3
    # Well framed: robot and ball away from the edges.
    for image in (before, after):
        ground = image[-40:, :40].reshape(-1, 3).mean(axis=0)
        rows, columns = np.nonzero(np.abs(image - ground).max(axis=2) > 60)
        assert rows.min() > 40 and rows.max() < 790 - 25
        assert columns.min() > 100 and columns.max() < 1195 - 100


@pytest.mark.slow
def test_legend_and_curves_are_shown(viewer):
    whole = picture(viewer, None)
    legend, plots = whole[LEGEND], whole[PLOTS]
    assert len(rows_where(legend, is_red)) > 300
    assert len(rows_where(legend, lambda r, g, b: (b > 120) & (b > 1.4 * r))) > 1000
    for colour in [(90, 168, 255), (255, 159, 67), (64, 224, 148)]:
        near = np.abs(plots - colour).max(axis=2) < 40
        assert np.count_nonzero(near) > 300


@pytest.mark.slow
def test_legends_cover_no_curve(viewer):
    plots = picture(viewer, None)[PLOTS]
    for colour in [(240, 220, 90), (190, 140, 255), (255, 107, 129)]:  # energies, which have no axes but these
        columns = np.unique(np.nonzero(np.abs(plots - colour).max(axis=2) < 60)[1])
        curve = columns[columns < 0.63 * plots.shape[1]]  # the time that the run takes
        assert len(curve) > 0.9 * np.ptp(curve) and np.ptp(curve) > 0.5 * plots.shape[1]


@pytest.mark.slow
def test_the_viewer_has_nothing_to_complain_about(viewer):
    picture(viewer, None)
    assert viewer.complaints() == []
    views = {view.name: view for view in viewer.client.get_state().views}
    assert {"Robot", "axial strain [%]", "Run", "Stimulus", "Contact force [N]", "Solver"} <= views.keys()
    assert {"Energy [mJ]", "Gravity [mJ]", "Events"} <= views.keys()


@pytest.mark.slow
def test_the_recording_holds_every_strand_body_and_curve(viewer):
    found = {item.entity_path for item in viewer.client.get_recording_schema(paths_only=True).entities}
    expected = {f"/world/strands/{strand.name}" for strand in synthetic_run.description().strands}
    expected |= {"/world/bodies/ball", "/world/bodies/hub", "/world/obstacles/ground", "/world/contact_forces"}
    expected |= {"/plots/stimulus/humidity", "/plots/contact_force/on_ball", "/plots/height/robot", "/summary"}
    expected |= {"/plots/energy/bend", "/plots/solver/smallest_gap"}
    expected |= {"/plots/gravity/gravity", "/world/middle", "/events"}
    assert expected <= found
    timeline = next(item for item in viewer.client.get_state().recordings[0].timelines if item.name == "sim_time")
    assert (timeline.time_type, timeline.start, timeline.end) == ("duration", 0, 4 * 10**9)


@pytest.mark.slow
def test_a_screenshot_is_made_from_a_log_and_leaves_no_process(log, tmp_path):
    processes = set(psutil.Process().children(recursive=True))
    rerun_view.screenshot(log, tmp_path / "run.png", time=1.0)
    assert set(psutil.Process().children(recursive=True)) <= processes
    with Image.open(tmp_path / "run.png") as image:
        assert image.size == (1920, 1080)
        colours = np.asarray(image.convert("RGB")).astype(int)[ROBOT]
    assert len(rows_where(colours, is_ball)) > 2000


ABANDONED = """
import sys, time
from bilayer_core.view.viewer_process import HeadlessViewer

with HeadlessViewer():
    print("up", flush=True)
    time.sleep(600)
"""


@pytest.mark.slow
def test_the_viewer_dies_with_a_killed_process(root):
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen([sys.executable, "-c", ABANDONED], stdout=subprocess.PIPE, env=environment) as parent:
        parent.stdout.readline()
        below = psutil.Process(parent.pid).children(recursive=True)
        assert str(viewer_process.viewer_executable()) in {process.exe() for process in below}
        parent.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + 10
    while any(process.is_running() and process.status() != psutil.STATUS_ZOMBIE for process in below):
        assert time.monotonic() < deadline, "the viewer is an orphan"
        time.sleep(0.05)


def test_a_recording_is_written_at_the_end_of_a_run_and_its_path_checked_before(tmp_path):
    path = tmp_path / "run.rrd"
    recorder = rerun_view.RrdRecorder(path)
    assert not path.exists()
    synthetic_run.run(recorder, TIMES[:20], complete=False)
    assert path.stat().st_size > 100_000
    with pytest.raises(InputError, match=r"run\.rrd: exists already"):
        rerun_view.RrdRecorder(path)
    with pytest.raises(InputError, match="there is no directory"):
        rerun_view.RrdRecorder(tmp_path / "missing" / "run.rrd")


def test_a_missing_driver_is_said_with_the_packages_to_install(recording, tmp_path, monkeypatch):
    for name in viewer_process.DRIVER_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(viewer_process, "DRIVER_DIRECTORIES", (tmp_path,))
    with pytest.raises(InputError, match="apt-get install mesa-vulkan-drivers libvulkan1"):
        rerun_view.screenshot(recording, tmp_path / "run.png")


@pytest.mark.slow
def test_a_driver_that_does_not_work_is_said_with_the_packages_to_install(recording, tmp_path, monkeypatch):
    monkeypatch.setenv("VK_ICD_FILENAMES", str(tmp_path / "no_driver.json"))
    monkeypatch.setenv("VK_DRIVER_FILES", str(tmp_path / "no_driver.json"))
    with pytest.raises(InputError, match="apt-get install mesa-vulkan-drivers libvulkan1"):
        rerun_view.screenshot(recording, tmp_path / "run.png")


def test_files_that_cannot_be_shown_are_refused(tmp_path, recording):
    with pytest.raises(InputError, match=r"no\.rrd: there is no such file"):
        rerun_view.screenshot(tmp_path / "no.rrd", tmp_path / "run.png")
    with pytest.raises(InputError, match=r"no\.mcap: cannot be read"):
        rerun_view.convert_log(tmp_path / "no.mcap", tmp_path / "run.rrd")
    with pytest.raises(InputError, match=r"missing/run\.rrd: cannot be written"):
        rerun_view.convert_log(recording.with_suffix(".mcap"), tmp_path / "missing" / "run.rrd")


def test_importing_the_view_does_not_import_rerun(root):
    program = "import sys, bilayer_core.view.rerun_view; print('rerun' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"
