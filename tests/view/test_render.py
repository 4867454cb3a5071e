"""Pictures without a screen: what is cut out, how sheets are laid out, and a look at their pixels."""

import dataclasses

import numpy as np
import pytest
import synthetic_run
from PIL import Image

from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.record.log_reader import read_log
from bilayer_core.record.mcap_log import McapRecorder
from bilayer_core.view import sheet
from bilayer_core.view.arrows import reaction_arrows
from bilayer_core.view.layout import BACKGROUND
from bilayer_core.view.render import Studio
from bilayer_core.view.rrd_writer import BALL_COLOURS
from bilayer_core.view.scales import ARROW_SHARE, choose_scales, seen_from

TIMES = np.arange(0, 101) * 0.04


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("render") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=25.0, marker_rate=25.0), TIMES)
    return path


@pytest.fixture(scope="module")
def studio(log):
    with Studio(log) as studio:
        yield studio


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def is_red(image):
    r, g, b = np.moveaxis(image, -1, 0)
    return (r > 150) & (r > 2 * g) & (r > 2 * b)


def is_ball(image):
    """The stronger of the ball's colours, in any light."""
    r, g, b = np.moveaxis(image, -1, 0)
    red, green, blue = BALL_COLOURS[0]
    return (r > 120) & (np.abs(g - r * green / red) < 20) & (np.abs(b - r * blue / red) < 30)


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


def test_what_is_looked_at_is_in_the_middle_and_slopes_are_those_of_perspective():
    eye, target = np.array([0.0, -2.0, 0.0]), np.zeros(3)
    slopes = seen_from(eye, target, np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 2, 0]], float))
    assert slopes == pytest.approx(np.array([[0, 0], [0.5, 0], [0, 0.5], [0.25, 0]]), abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "say what to draw: --png OUT.png, --sheet OUT.png or --gif OUT.gif"),
        (["--png", "x.gif"], "x.gif: must end in .png"),
        (["--gif", "x.png"], "x.png: must end in .gif"),
        (["--png", "x.png", "--sheet", "x.png"], "x.png: is named for two outputs"),
        (["--sheet", "x.png", "--at", "1", "--frames", "3"], "--frames: says how many pictures, --at of which times"),
        (["--png", "x.png", "--at", "1", "--at", "2"], "--png: is one picture"),
        (["--gif", "x.gif", "--frames", "100000000"], "100000000 is not in the range 1<=x<=400"),
        (["--gif", "x.gif", *401 * ["--at", "1"]], "--at: is given 401 times; at most 400 are allowed"),
        (["--png", "there.png"], "there.png: exists already"),
        (["--png", "x.png", "--at", "-1"], "must be a time [s] at least 0"),
        (["--png", "x.png"], "run.mcap: cannot be read"),
    ],
)
def test_what_cannot_be_drawn_is_refused_before_anything_is(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.png").write_bytes(b"precious")
    assert main(["render", "run.mcap", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["there.png"]


@pytest.mark.slow
def test_a_sheet_shows_the_robot_large_with_times_and_without_the_viewers_notices(studio, tmp_path):
    studio.sheet(tmp_path / "sheet.png", studio.spread(4))
    whole = pixels(tmp_path / "sheet.png")
    assert 2 * whole.shape[0] < whole.shape[1] <= sheet.SHEET_WIDTH  # four in a row
    width = (whole.shape[1] + sheet.GAP) // 4 - sheet.GAP
    height = whole.shape[0] - sheet.FOOTER_HEIGHT - sheet.GAP
    cells = [whole[:height, left : left + width] for left in range(0, whole.shape[1], width + sheet.GAP)]
    assert len(cells) == 4
    heights = [np.nonzero(is_ball(cell))[0].mean() for cell in cells]
    assert heights[0] - heights[3] > 0.25 * height  # lifted
    for cell in cells:
        assert is_ball(cell).mean() > 0.005
        red = np.nonzero(is_red(cell) | is_ball(cell))
        assert min(part.min() for part in red) > 5 and red[0].max() < height - 5 and red[1].max() < width - 5
        time = cell[5:40, 5:90]
        assert (time.min(axis=2) > 180).sum() > 40  # text, in white
        corner = cell[:30, -60:]
        assert (corner.min(axis=2) > 120).sum() == 0
    footer = whole[-sheet.FOOTER_HEIGHT + 2 :]
    assert (np.abs(footer - BACKGROUND).max(axis=2) > 60).sum() > 300


@pytest.mark.slow
def test_one_picture_is_cut_closer_than_a_sheet_of_the_whole_motion(studio, tmp_path):
    studio.picture(tmp_path / "end.png")
    image = pixels(tmp_path / "end.png")
    assert is_ball(image).mean() > 0.05 and is_red(image).mean() > 0.05


def is_blue(image):
    r, g, b = np.moveaxis(image, -1, 0)
    return (b > r + 60) & (b > g + 20)


def test_reactions_are_drawn_where_they_are_asked_for(log, studio, tmp_path):
    studio.picture(tmp_path / "without.png")
    with Studio(log, reactions=True) as other:
        other.picture(tmp_path / "with.png")
    assert not is_blue(pixels(tmp_path / "without.png")).any()
    assert is_blue(pixels(tmp_path / "with.png")).sum() > 100


def test_arrows_of_forces_and_moments_have_scales_of_their_own(log):
    run = read_log(log)
    wrenches = np.zeros((len(run.times), 2, 6))
    wrenches[:, 0, 2], wrenches[:, 0, 4] = 2.0, -3e-3
    run = dataclasses.replace(run, clamp_wrenches=wrenches)
    scales = choose_scales(run)
    force, moment = (reaction_arrows(run, scales)[name] for name in ("clamp_forces", "clamp_moments"))
    longest = [np.linalg.norm(of.forces, axis=2).max() * of.metres_per_unit for of in (force, moment)]
    assert all(0.5 * ARROW_SHARE * scales.size < length <= ARROW_SHARE * scales.size for length in longest)
    assert np.array_equal(moment.origins, run.body_positions)
    rounded = dataclasses.replace(run, clamp_wrenches=wrenches * (1.0, 1.0, 1.0, 1.0, 1e-9, 1.0))
    assert list(reaction_arrows(rounded, scales)) == ["clamp_forces"]
    assert reaction_arrows(dataclasses.replace(run, clamp_wrenches=0.0 * wrenches), scales) == {}


@pytest.mark.slow
def test_an_animation_has_a_picture_for_each_time(studio, tmp_path):
    studio.gif(tmp_path / "run.gif", studio.spread(3))
    animation = Image.open(tmp_path / "run.gif")
    assert animation.n_frames == 3 and max(animation.size) <= sheet.GIF_SIZE
    shares = []
    for index in range(3):
        animation.seek(index)
        shares.append(is_red(np.asarray(animation.convert("RGB")).astype(int)).mean())
    assert shares[0] == 0.0 and shares[2] > 0.005


@pytest.mark.slow
def test_a_time_that_the_log_does_not_hold_is_refused(studio, tmp_path):
    with pytest.raises(InputError, match=r"holds 0 s to 4 s, and not 5 s"):
        studio.picture(tmp_path / "late.png", 5.0)
