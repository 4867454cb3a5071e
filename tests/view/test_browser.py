"""What a browser shows: the ready layout of recordings, of branches and of a run that goes on."""

import io
import re
import shutil
import subprocess
import time
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright
from support import processes, synthetic_run

from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.view.branch_recording import FIRST
from bilayer_core.view.recording_layout import CHANNEL_COLOURS
from bilayer_core.view.rerun_view import write_branches
from bilayer_core.view.theme import BACKGROUND, BALL_COLOURS

pytestmark = pytest.mark.verify
SIZE = {"width": 1280, "height": 800}
LIMIT = 120.0
"""Longest wait for an address, and for a finished picture [s]."""
FLAGS = (
    "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --no-first-run "
    "--disable-background-networking --disable-component-update --disable-sync"
).split()
TITLE = "Four ribbons ![and a ball](http://stranger.invalid/ball.png)"
TIMES = np.arange(0, 26) * 0.16


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log with a title by which Markdown would fetch a picture."""
    path = tmp_path_factory.mktemp("browser") / "run.mcap"
    recorder = McapRecorder(path, rate=25.0, marker_rate=25.0)
    recorder.start(replace(synthetic_run.description(), title=TITLE))
    for moment in TIMES:
        recorder.observe(synthetic_run.frame(float(moment), float(TIMES[-1])))
    recorder.close(True)
    return path


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def shown(directory, *arguments):
    """``bilayer view`` as a process, the address that it prints, and all that it has printed."""
    with (directory / "said.txt").open("w+") as said:
        command = processes.command("view", *arguments)
        process = subprocess.Popen(
            command, cwd=directory, env=processes.environment(), stdout=said, stderr=subprocess.STDOUT
        )
        try:
            deadline = time.monotonic() + LIMIT
            while not (found := re.search(r"http://\S+\?url=\S+", (directory / "said.txt").read_text())):
                assert process.poll() is None and time.monotonic() < deadline, (directory / "said.txt").read_text()
                time.sleep(0.1)
            yield SimpleNamespace(address=found[0], said=lambda: (directory / "said.txt").read_text())
        finally:
            process.terminate()
            process.wait()


def look(browser, address, directory, is_finished):
    """The first finished picture of a page as whole numbers, shape (height, width, 3), and the hosts that it asked."""
    hosts = set()
    page = browser.new_page(viewport=SIZE)
    page.route(lambda url: urlsplit(url).hostname != "127.0.0.1", lambda route: route.abort())
    page.on("request", lambda request: hosts.add(urlsplit(request.url).hostname))
    try:
        page.goto(address)
        deadline, before = time.monotonic() + LIMIT, b""
        while True:
            page.wait_for_timeout(500)
            now = page.screenshot(path=directory / "page.png", timeout=1e3 * LIMIT)
            picture = np.asarray(Image.open(io.BytesIO(now)).convert("RGB")).astype(int)
            if now == before and is_finished(picture):
                return picture, hosts
            assert time.monotonic() < deadline, f"the layout is not shown: {directory}/page.png"
            before = now
    finally:
        page.close()


def places(picture, colour, tolerance=24):
    """Rows and columns of a colour, from 0 to 1 from the upper left corner."""
    found = np.nonzero(np.abs(picture - colour).max(axis=2) < tolerance)
    return found[0] / picture.shape[0], found[1] / picture.shape[1]


def has_robot(picture):
    """Whether the view of the robot fills more than a third of the page, from its upper left corner on."""
    rows, columns = places(picture, np.array(BACKGROUND[:3]), tolerance=60)  # background, and the ground before it
    return len(rows) > picture[..., 0].size / 3 and np.median(columns) < 0.5 and np.median(rows) < 0.5


def has_plots(picture, colour=CHANNEL_COLOURS[0]):
    """Whether curves stand in the right part of the page, below each other."""
    rows, columns = places(picture, colour, tolerance=60)
    curves = rows[(columns > 0.64) & (rows < 0.83)]
    return len(curves) > 300 and np.ptp(curves) > 0.4


def has_ball(picture):
    """Whether the ball is in the middle of the view of the robot, larger than a thumbnail shows it."""
    rows, columns = places(picture, np.array(BALL_COLOURS[0]))
    return len(rows) > 1000 and np.ptp(rows) > 0.1 and 0.2 < np.median(columns) < 0.42


def test_a_log_in_the_browser_has_its_layout_and_a_title_fetches_nothing(log, browser):
    with shown(log.parent, "--web", "run.mcap") as viewing:
        picture, hosts = look(
            browser, viewing.address, log.parent, lambda p: has_robot(p) and has_plots(p) and has_ball(p)
        )
        said = viewing.said()
    assert said == f"run.mcap: {viewing.address} (served to this machine only, until Ctrl-C)\n"
    assert "127.0.0.1" in hosts and "stranger.invalid" not in hosts


def test_branches_in_the_browser_have_their_layout(log, browser, tmp_path):
    run = read_log(log)
    branches = [SimpleNamespace(value=0.1, run=run, stopped="")]
    write_branches(branches, "stimulus.humidity", tmp_path / "branches.rrd", force=False)
    with shown(tmp_path, "--web", "branches.rrd") as viewing:
        picture, _ = look(browser, viewing.address, tmp_path, lambda p: has_robot(p) and has_plots(p, FIRST))
    assert has_robot(picture) and has_plots(picture, FIRST)


def test_a_run_that_goes_on_has_its_layout_in_the_browser(log, browser):
    with shown(log.parent, "--follow", "--serve", "run.mcap") as viewing:
        picture, _ = look(browser, viewing.address, log.parent, lambda p: has_robot(p) and has_plots(p))
    assert has_robot(picture) and has_plots(picture)
