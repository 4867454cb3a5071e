"""Films, animations and sheets: many pictures of a run, and a look at their pixels."""

import subprocess

import numpy as np
import pytest
from PIL import Image
from support.pictures import is_ball, is_blue, is_red, pixels

from bilayer_core.cli import main
from bilayer_core.view import sheet
from bilayer_core.view.render import Look, Studio
from bilayer_core.view.theme import BACKGROUND


@pytest.mark.parametrize(
    ("count", "width", "height", "columns"),
    [(6, 400, 300, 3), (6, 300, 600, 6), (6, 900, 300, 2), (6, 2600, 300, 1), (1, 400, 300, 1), (7, 300, 500, 7)],
)
def test_a_sheet_has_no_empty_place_and_a_sensible_shape(count, width, height, columns):
    assert sheet.columns_for(count, width, height) == columns


@pytest.mark.parametrize(
    ("times", "decimals"), [([0.0, 3.5, 7.0], 1), ([0.0, 0.04, 0.08], 2), ([0.001, 0.002], 3), ([1.0], 1)]
)
def test_times_are_written_with_decimals_that_tell_them_apart(times, decimals):
    assert sheet.decimals_for(times) == decimals


def test_a_sheet_shows_the_robot_in_each_part_with_its_time_over_one_colour_bar(log, tmp_path):
    studio = Studio(log, Look.of())
    studio.sheet(tmp_path / "sheet.png", studio.spread(4))
    whole = pixels(tmp_path / "sheet.png")
    assert whole.shape[1] <= sheet.SHEET_WIDTH
    body = whole[: -sheet.FOOTER_HEIGHT - sheet.GAP]
    gaps = np.nonzero((body == BACKGROUND).all(axis=(0, 2)))[0]
    columns = 1 + len([g for g in gaps if g - 1 not in gaps and 0 < g < whole.shape[1] - sheet.GAP])
    assert columns in (2, 4)
    width, height = (whole.shape[1] + sheet.GAP) // columns - sheet.GAP, (len(body) + sheet.GAP) * columns // 4
    for k in range(4):
        top, left = k // columns * height, k % columns * (width + sheet.GAP)
        cell = body[top : top + height - sheet.GAP, left : left + width]
        assert is_ball(cell).mean() > 0.005
        assert (cell[5:30, 5:70].min(axis=2) > 180).sum() > 20  # time, in white
    footer = whole[-sheet.FOOTER_HEIGHT :]
    assert is_red(footer).sum() > 100 and is_blue(footer).sum() > 100


def test_an_animation_has_a_picture_for_each_time(log, tmp_path):
    studio = Studio(log, Look.of())
    studio.gif(tmp_path / "run.gif", studio.spread(3), 20.0)
    animation = Image.open(tmp_path / "run.gif")
    assert animation.n_frames == 3 and max(animation.size) <= sheet.GIF_SIZE
    assert animation.info["duration"] == 50
    shares = []
    for index in range(3):
        animation.seek(index)
        shares.append(is_red(np.asarray(animation.convert("RGB")).astype(int))[: int(0.8 * animation.height)].mean())
    assert shares[0] == 0.0 and shares[2] > 0.005


def frames_of(path, size):
    """The pictures of a film, shape (n, height, width, 3)."""
    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24"]
    data = subprocess.run([*command, "-"], capture_output=True, check=True).stdout
    return np.frombuffer(data, np.uint8).reshape(-1, size[1], size[0], 3)


def test_a_film_lasts_as_long_as_the_run_at_least_five_seconds_and_moves(log, tmp_path, capsys):
    path, size = tmp_path / "run.mp4", (320, 180)
    assert main(["render", str(log), "--mp4", str(path), "--size", "320x180", "--fps", "5"]) == 0
    assert capsys.readouterr().out == f"film       {path}: 25 pictures, 5 s, 1.25x slower\n"
    frames = frames_of(path, size).astype(int)
    assert len(frames) == 25
    robot = [is_red(frame)[: int(0.8 * size[1])].sum() for frame in frames]
    assert robot[0] < 30 < 300 < robot[-1]
    changes = np.abs(np.diff(frames, axis=0)).max(axis=(1, 2, 3))
    assert np.count_nonzero(changes > 30) >= 20
    assert path.stat().st_size < 300_000


def test_shapes_between_those_in_the_log_are_on_the_way_from_one_to_the_next(log):
    studio = Studio(log, Look.of())
    before, between, after = (studio._moments.at(time) for time in (1.0, 1.01, 1.04))
    assert between.positions == pytest.approx(0.75 * before.positions + 0.25 * after.positions, abs=1e-12)
    assert np.linalg.norm(between.material_frames, axis=1) == pytest.approx(np.ones(len(between.material_frames)))
