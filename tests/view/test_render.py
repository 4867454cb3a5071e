"""Pictures and films without a screen, and a look at their pixels."""

import dataclasses
import sys

import numpy as np
import pytest
from PIL import Image
from support import synthetic_run
from support.pictures import is_ball, is_blue, is_red, pixels

from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.log.run.run_data import RunData
from bilayer_core.view import stage, window
from bilayer_core.view.arrows import reaction_arrows
from bilayer_core.view.camera import HALF_SLOPE, Insets, Shot
from bilayer_core.view.colouring import choose_colouring, contact_pressure
from bilayer_core.view.overlay import round_length
from bilayer_core.view.render import Look, Studio
from bilayer_core.view.scales import ARROW_SHARE, choose_scales
from bilayer_core.view.theme import BACKGROUND
from bilayer_core.view.window import pixels_of

SIZE = (480, 360)


@pytest.fixture(scope="module")
def drawn(log, tmp_path_factory):
    """Draws a picture with the options that are given, once each; its colours, shape (height, width, 3 or 4)."""
    directory, known = tmp_path_factory.mktemp("pictures"), {}

    def draw(time=4.0, **look):
        key = (time, *sorted(look.items()))
        if key not in known:
            path = directory / f"{len(known)}.png"
            Studio(log, Look.of(**{"size": SIZE, **look})).picture(path, time)
            known[key] = np.asarray(Image.open(path)).astype(int)
        return known[key]

    return draw


def is_arrow(image):
    r, g, b = np.moveaxis(image[..., :3], -1, 0)
    return (g > 100) & (g > 1.5 * r) & (g > 1.2 * b)


def box(mask):
    """First and last row and column where something is."""
    rows, columns = np.nonzero(mask)
    return rows.min(), rows.max(), columns.min(), columns.max()


ROBOT = slice(0, int(0.85 * SIZE[1]))  # rows above the bars
BARS = slice(int(0.85 * SIZE[1]), SIZE[1])


def test_what_is_looked_at_is_in_the_middle_and_slopes_are_those_of_perspective():
    shot = Shot(np.array([0.0, -2.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]), None, 1.0)
    pixels = pixels_of(shot, np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 2, 0]], float), SIZE)
    slopes = (pixels / SIZE[1] - [0.5 * SIZE[0] / SIZE[1], 0.5]) * [2.0 * HALF_SLOPE, -2.0 * HALF_SLOPE]
    assert slopes == pytest.approx(np.array([[0, 0], [0.5, 0], [0, 0.5], [0.25, 0]]), abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "say what to draw: --png OUT.png, --sheet OUT.png, --gif OUT.gif or --mp4 OUT.mp4"),
        (["--mp4", "x.gif"], "x.gif: must end in .mp4"),
        (["--mp4", "x.mp4", "--size", "321x180"], "--size: a film's width and height are even, found 321x180"),
        (["--mp4", "x.mp4", "--background", "transparent"], "--background: a film cannot be transparent"),
        (["--png", "x.png", "--background", "greenish"], "--background: found 'greenish'; allowed are dark, white"),
        (["--png", "x.png", "--camera", "below"], "--camera: found 'below'; allowed are front, side, top"),
        (["--png", "x.png", "--camera", "10,100"], "an elevation is from -90 to 90 degrees"),
        (["--png", "x.png", "--camera", "10,20,0 mm"], "a distance is above 0 m"),
        (["--png", "x.png", "--camera", "10,20 m"], "--camera: found '10,20 m'; allowed are"),
        (["--png", "x.png", "--size", "10x10"], "width and height in pixels, each from 160 to 4096"),
        (["--png", "x.png", "--fps", "10"], "--fps: is that of a film"),
        (["--mp4", "x.mp4", "--speed", "1", "--frames", "9"], "--speed: says how many pictures a run takes"),
        (["--png", "x.png", "--colour", "stress"], "'stress' is not one of"),
        (["--png", "x.gif"], "x.gif: must end in .png"),
        (["--gif", "x.png"], "x.png: must end in .gif"),
        (["--png", "x.png", "--sheet", "x.png"], "x.png: is named for two outputs"),
        (["--sheet", "x.png", "--at", "1", "--frames", "3"], "--frames: says how many pictures, --at of which times"),
        (["--png", "x.png", "--frames", "2"], "--png: is one picture"),
        (["--gif", "x.gif", "--frames", "100000000"], "100000000 is not in the range 1<=x<=20000"),
        (["--gif", "x.gif", "--frames", "401"], "--frames: 401 is not in the range 1<=x<=400; a film may have more"),
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


CAMERAS = ("auto", "follow", "iso", "front", "side", "top", "30,50", "-120 deg, 0.3 rad")


@pytest.mark.parametrize(("camera", "time"), [*((camera, 4.0) for camera in CAMERAS), ("auto", 0.0), ("iso", 0.0)])
def test_the_robot_is_whole_in_the_picture_and_large(drawn, camera, time):
    alone = drawn(time, camera=camera, background="transparent")
    far = {"iso", "front", "side", "30,50", "-120 deg, 0.3 rad"} & {camera}
    robot = is_red(alone) | is_ball(alone) if time else is_ball(alone)
    top, bottom, left, right = box(robot[ROBOT])
    assert top > 5 and bottom < ROBOT.stop - 2 and left > 5 and right < SIZE[0] - 6
    if time and not far:
        assert max((bottom - top) / SIZE[1], (right - left) / SIZE[0]) > 1 / 3
    assert robot[ROBOT].sum() > 400


def test_one_picture_is_as_near_as_the_robot_allows(drawn):
    top, bottom, left, right = box((is_ball(drawn()) | is_red(drawn()) | is_arrow(drawn()))[ROBOT])
    assert bottom - top > 0.6 * SIZE[1]


def test_strain_is_red_and_contact_forces_are_green_arrows(drawn):
    before, after = drawn(0.0)[ROBOT], drawn(4.0)[ROBOT]
    assert not is_red(before).any() and not is_arrow(before).any()
    assert is_red(after).sum() > 3000 and is_arrow(after).sum() > 200


def test_colours_of_curvature_and_of_contact_differ_from_those_of_strain(drawn):
    curved, pressed = drawn(colour="curvature")[ROBOT], drawn(colour="contact", camera="40,-10")[ROBOT]
    assert not is_red(curved).any() and is_blue(curved).sum() > 3000  # they curl down: negative curvature
    tips = is_red(pressed).sum()
    assert 5 < tips < 0.05 * is_red(drawn(camera="40,-10")[ROBOT]).sum()


def test_the_pressure_of_contact_is_force_over_the_face_of_the_node(log):
    run = read_log(log)
    layer = run.description.layers[0]
    pressure = contact_pressure(run, layer)
    spacing = synthetic_run.LENGTH / (synthetic_run.NODES - 1)
    force = 0.02 * np.sqrt(1 + 0.4**2)
    assert pressure[-1, -5] == pytest.approx(force / (spacing * synthetic_run.WIDTH), rel=0.03)
    assert pressure[-1, -1] == pytest.approx(2 * force / (spacing * synthetic_run.WIDTH), rel=0.03)
    assert not pressure[0].any() and not pressure[-1, :-9].any()


@pytest.mark.parametrize(
    ("quantity", "title", "first", "last"),
    [
        ("strain", "axial strain [%]", "-6", "+6"),
        ("curvature", "curvature [1/m]", "-50", "+50"),
        ("contact", "contact pressure [kPa]", "0", "4"),
    ],
)
def test_the_colour_bar_says_quantity_unit_and_limits(log, quantity, title, first, last):
    found = choose_colouring(read_log(log), quantity)
    assert (found.title, found.ticks[0][1], found.ticks[-1][1]) == (title, first, last)


def test_the_colour_bar_is_there_with_all_its_colours(drawn):
    bars = drawn(0.0)[BARS, : SIZE[0] // 2]
    rows = np.nonzero(is_red(bars).any(axis=1) & is_blue(bars).any(axis=1))[0]
    assert 5 <= len(rows) <= 12
    row = bars[rows[len(rows) // 2]]
    columns = np.nonzero(is_blue(row))[0].min(), np.nonzero(is_red(row))[0].max()
    assert 0.2 * SIZE[0] < columns[1] - columns[0] < 0.5 * SIZE[0]
    assert (row[sum(columns) // 2] > 200).all()  # grey in its middle


@pytest.mark.parametrize("camera", ["front", "top", "iso"])
def test_the_scale_bar_is_as_long_as_it_says(log, drawn, camera):
    """The ball, of 40 mm, measured by the bar."""
    image = drawn(4.0, camera=camera, background="white")
    dark = (image[BARS, SIZE[0] // 2 + 40 :].max(axis=2) < 80).sum(axis=1)
    length = dark[-25:-10].max()
    setting = Studio(log, Look.of(camera, size=SIZE))._set([4.0], Insets(), 0.0)
    metres, _ = round_length(0.16 * SIZE[0] * setting.metres_per_pixel)
    ball = is_ball(image)[ROBOT]
    top, bottom, _, _ = box(ball)
    if camera != "iso":  # hidden in part, so that its height is that of the sphere from the front alone
        assert (bottom - top) * metres / length <= 2.02 * synthetic_run.RADIUS
    assert metres / length == pytest.approx(setting.metres_per_pixel, rel=0.05)


@pytest.mark.parametrize(("text", "length"), [("20 mm", 0.03), ("1 m", 1.0), ("5 um", 9.9e-6), ("2 km", 4e3)])
def test_lengths_of_scale_bars_are_round(text, length):
    assert round_length(length)[1] == text


def test_backgrounds_are_what_was_asked_for(drawn):
    corner = (slice(2, 8), slice(-8, -2))
    assert (drawn()[corner] == BACKGROUND).all()
    assert (drawn(background="white")[corner] == 255).all()
    assert (drawn(background="#f4f1e8")[corner] == (0xF4, 0xF1, 0xE8)).all()
    clear = drawn(background="transparent")
    assert clear.shape[2] == 4 and (clear[corner][..., 3] == 0).all()
    assert (clear[..., 3][is_ball(clear)] == 255).mean() > 0.9
    assert 0.2 < (clear[..., 3] > 0).mean() < 0.95


def test_a_body_without_a_surface_that_holds_rods_is_a_block(drawn, monkeypatch):
    with_block = drawn(4.0, camera="top")
    monkeypatch.setattr(stage, "HUB_SIDE", 0.1)
    middle = (slice(SIZE[1] // 4, SIZE[1] // 2), slice(SIZE[0] // 3, 2 * SIZE[0] // 3))
    without = drawn(4.0, camera="top ")[middle]
    assert (np.abs(with_block[middle] - without).max(axis=2) > 20).sum() > 100


@pytest.mark.parametrize("camera", ["top", "iso", "front"])
def test_faces_have_the_colours_of_the_bar(log, drawn, camera):
    """The largest strain of the upper layer, as bright as the bar within a fifth, on wide and on narrow faces."""
    image = drawn(4.0, camera=camera, background="white")
    run = read_log(log)
    colouring = choose_colouring(run)
    active = [run.strain_of(layer)[-1] for layer in run.description.layers if layer.layer == "active"]
    low, high = (255 * colouring.colours(np.array([end]))[0, :3] for end in (np.min(active), np.max(active)))
    seen = image[ROBOT][is_red(image[ROBOT])][:, 0]
    assert np.percentile(seen, 5) > 0.78 * min(low[0], high[0]) and np.percentile(seen, 95) < 1.02 * max(
        low[0], high[0]
    )


def test_ground_that_is_seen_from_the_side_fills_what_is_below_it(log, drawn):
    image = drawn(0.0, camera="front", background="white")
    setting = Studio(log, Look.of("front", size=SIZE))._set([0.0], Insets(), 0.0)
    (_, row), (_, above) = pixels_of(setting.shots[0], np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.01]]), SIZE)
    column = image[:, 3].mean(axis=1)
    edge = np.flatnonzero(column < 250)[0]
    assert abs(edge - row) <= 1 and above < row and (column[edge:] < 250).all()


@pytest.mark.parametrize("size", [(480, 360), (240, 360)])
def test_the_meaning_of_arrows_and_squares_is_in_pictures_of_every_shape(log, size):
    studio = Studio(log, Look.of(size=size))
    setting = studio._set([4.0], Insets(), 0.0)
    notes = studio._notes(setting)
    assert [note.partition(" ")[0] for note in notes] == ["green:", "squares"]
    written = [
        np.asarray(studio._overlay(size, setting.metres_per_pixel, of).write(Image.new("RGB", size, "white")))
        for of in (notes, [])
    ]
    apart = np.any(written[0] != written[1], axis=2)
    assert apart.sum() > 400 and not apart[0].any() and not apart[:, [0, -1]].any()


def test_what_is_drawn_has_a_darker_edge_two_pixels_wide():
    drawn = np.zeros((40, 60, 4), np.uint8)
    drawn[10:30, 20:50] = 200, 100, 50, 255
    edged = window.outlined(drawn)
    assert (edged[12:28, 22:48] == drawn[12:28, 22:48]).all() and (edged[..., 3] == drawn[..., 3]).all()
    changed = np.any(edged != drawn, axis=2)
    assert changed.sum() == 20 * 30 - 16 * 26 and (edged[10:12, 20:50, 0] == 120).all()


def test_several_instants_in_one_picture_are_pale_but_for_the_last(log, tmp_path, monkeypatch):
    studio = Studio(log, Look.of(size=SIZE, background="white"))
    studio.picture(tmp_path / "pale.png", 4.0, 1.2)
    monkeypatch.setattr(stage, "PALE", 1.0)
    studio.picture(tmp_path / "full.png", 4.0, 1.2)
    pale, full = (pixels(tmp_path / f"{name}.png")[ROBOT] for name in ("pale", "full"))
    earlier = np.abs(pale - full).max(axis=2) > 20
    assert earlier.sum() > 1000 and (pale[earlier].mean(axis=1) > full[earlier].mean(axis=1)).mean() > 0.9
    assert is_red(pale[~earlier]).sum() > 1000


def test_a_camera_that_follows_shows_the_way_and_whole_arrows(log):
    studio = Studio(log, Look.of("follow", size=SIZE, background="white"))
    times = [2.5, 3.2, 4.0]
    setting = studio._set(times, Insets(), 0.0)
    assert "line: way of the robot's middle" in studio._notes(setting)
    below = []
    for picture in studio._draw(setting):
        image = np.asarray(picture.convert("RGB")).astype(int)
        assert not is_arrow(image)[[0, -1]].any() and not is_arrow(image)[:, [0, -1]].any()
        below.append((image[-40:, SIZE[0] // 2 - 60 : SIZE[0] // 2 + 60].max(axis=2) < 90).sum())
    assert below[2] >= 40 > below[0]  # one pixel in each row at least


@pytest.mark.parametrize("look", [{}, {"camera": "top"}, {"background": "transparent"}, {"camera": "20,5,0.12 m"}])
def test_drawing_the_part_where_the_robot_is_gives_the_whole_picture(log, look, tmp_path, monkeypatch):
    """The same colours as if all of it had been drawn with twice as many pixels: no seam, nothing cut off."""
    studio, parts = Studio(log, Look.of(size=SIZE, **look)), []
    monkeypatch.setattr(stage, "outlined", lambda drawn: drawn)  # ground that is drawn with all else has no edge
    around = window.part_around
    monkeypatch.setattr(stage, "part_around", lambda *of: parts.append(around(*of)) or parts[-1])
    studio.picture(tmp_path / "part.png", 3.0)
    monkeypatch.setattr(stage, "part_around", lambda *of: (0, 0, *SIZE))
    monkeypatch.setattr(stage, "_hides", lambda *of: True)  # the ground is drawn with all else
    studio.picture(tmp_path / "whole.png", 3.0)
    part, whole = (np.asarray(Image.open(tmp_path / f"{name}.png")).astype(float) for name in ("part", "whole"))
    for image in (part, whole):
        image[..., :3] *= image[..., 3:] / 255 if image.shape[2] == 4 else 1.0  # what is hardly there has any colour
    left, upper, right, lower = parts[0]
    assert ((right - left) * (lower - upper) < 0.9 * SIZE[0] * SIZE[1]) == ("0.12" not in look.get("camera", ""))
    apart = np.abs(part - whole).max(axis=-1)
    inside = apart[upper:lower, left:right].copy()
    assert inside.max() <= 64 and (inside > 2).mean() < 2e-3  # rounding may move an edge over one sample in four
    apart[upper:lower, left:right] = 0
    assert apart.max() <= 6  # the ground, drawn without more pixels


def test_what_is_behind_a_plane_is_not_seen(drawn, log, tmp_path, monkeypatch):
    from_below = "20,-60"
    assert is_ball(drawn(camera="20,60")).any() and not is_ball(drawn(camera=from_below)).any()
    monkeypatch.setattr(stage, "_hides", lambda *of: False)
    Studio(log, Look.of(camera=from_below, size=SIZE)).picture(tmp_path / "through.png", 4.0)
    assert is_ball(pixels(tmp_path / "through.png")).any()


def test_pictures_laid_over_others_are_the_mean_of_their_pixels():
    random = np.random.default_rng(3)
    picture = random.integers(0, 256, (9, 11, 4), np.uint8)
    picture[..., :3] = np.minimum(picture[..., :3], picture[..., 3:])  # colours times opacity
    drawn = random.integers(0, 256, (8, 12, 4), np.uint8) * (random.random((8, 12, 1)) < 0.6)
    drawn[..., 3] = np.where(random.random((8, 12)) < 0.7, 255 * (drawn[..., 3] > 0), drawn[..., 3])
    drawn[..., :3] = np.minimum(drawn[..., :3], drawn[..., 3:])
    drawn[:2, :4], drawn[2:4, :2] = 0, 255
    expected = picture.astype(float)
    mean = drawn.reshape(4, 2, 6, 2, 4).mean(axis=(1, 3))
    expected[3:7, 2:8] = mean + (1 - mean[..., 3:] / 255) * expected[3:7, 2:8]
    window.lay_over(picture, drawn[::-1].copy()[::-1], (2, 3, 8, 7))
    apart = picture - expected
    assert -1.5 < apart.min() and apart.max() <= 0.5  # what is seen through is rounded down: no byte overflows


@pytest.mark.parametrize("half_height", [None, 0.1])
def test_the_part_of_a_picture_round_points_holds_them_all(half_height):
    eye, target = np.array([0.3, -1.0, 0.4]), np.array([0.0, 0.0, 0.05])
    up = np.array([0.0, 0.0, 1.0])
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    shot = Shot(eye, target, np.cross(back, right), half_height, 0.5)
    around = [target + a * right + b * shot.up for a in (-0.03, 0.05) for b in (0.0, 0.02)]
    left, upper, last, lower = window.part_around(shot, np.array(around), (400, 200))
    assert left < 200 < last and upper < 100 <= lower - window.ROOM
    pixels_per_metre = 200 / (2 * (half_height or HALF_SLOPE * np.linalg.norm(eye - target)))
    assert last - left == pytest.approx(0.08 * pixels_per_metre + 2 * window.ROOM, abs=2)
    assert window.part_around(shot, np.array(around), (400, 200), (90, 70))[2:] != (last, lower)
    assert window.part_around(shot, np.array([target - 50 * right]), (400, 200)) is None
    behind = window.part_around(shot, np.array([target, eye + back]), (400, 200))
    assert (behind == (0, 0, 400, 200)) == (half_height is None)


def test_reactions_are_drawn_where_they_are_asked_for(drawn):
    assert not is_blue(drawn(background="white")[ROBOT]).any()
    assert is_blue(drawn(background="white", reactions=True)[ROBOT]).sum() > 30


def test_arrows_of_forces_and_moments_have_scales_of_their_own(log):
    logged = read_log(log)
    run = RunData(**{part.name: getattr(logged, part.name) for part in dataclasses.fields(RunData)})
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


def test_a_run_whose_shapes_end_long_before_it_is_warned_of(tmp_path, capsys):
    path = tmp_path / "short.mcap"
    synthetic_run.run(McapRecorder(path, rate=25.0, marker_rate=1.0), 0.04 * np.arange(21))
    assert main(["render", str(path), "--png", str(tmp_path / "x.png"), "--size", "160x160"]) == 0
    told = capsys.readouterr().err
    assert "the run ends at t = 0.8 s, but its last shape is of t = 0 s" in told and "output.marker_rate" in told


def test_a_time_that_the_log_does_not_hold_is_refused(log, tmp_path):
    with pytest.raises(InputError, match=r"holds 0 s to 4 s, and not 5 s"):
        Studio(log, Look.of()).picture(tmp_path / "late.png", 5.0)


def test_what_is_missing_is_said_with_what_to_install(log, monkeypatch):
    monkeypatch.setattr(window.ctypes.util, "find_library", lambda name: None)
    with pytest.raises(InputError, match="apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"):
        Studio(log, Look.of())
    monkeypatch.setitem(sys.modules, "vtkmodules", None)
    with pytest.raises(InputError, match=r"pip install 'bilayer_sim_ros\[film\]'"):
        Studio(log, Look.of())
