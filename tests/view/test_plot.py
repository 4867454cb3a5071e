"""Figures of recorded quantities: what they show, with which units, and what is refused."""

import re

import matplotlib
import numpy as np
import pytest
from support import synthetic_run

from bilayer_core import read_log
from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.view.plot import MOST_POINTS, STYLE, Axis, Line, draw, lines_of, words_of

matplotlib.use("agg")
TIMES = np.arange(0, 26) * 0.02
ROD = "rod/arm_1/active"


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    directory = tmp_path_factory.mktemp("logs")
    for name, end in (("slow", 0.5), ("fast", 0.25)):
        synthetic_run.run(McapRecorder(directory / f"{name}.mcap", rate=50.0, marker_rate=25.0), TIMES[TIMES <= end])
    return directory


@pytest.fixture
def closing():
    import matplotlib.pyplot as pyplot

    yield
    pyplot.close("all")


def test_quantities_of_one_unit_share_a_panel_with_that_unit(logs, closing):
    run = read_log(logs / "slow.mcap")
    figure = draw(lines_of(run, 0, ["com.z", "energy/*", "body/ball/contact_wrench"]), ["slow"])
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == [
        "centre of mass, z [mm]",
        "energy [µJ]",
        "ball contact force [mN]",
        "ball contact moment\n[N\xa0m]",
    ]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    (line,) = figure.axes[0].get_lines()
    np.testing.assert_allclose(line.get_ydata(), 1e3 * run.com[:, 2])
    told = [text.get_text() for text in figure.axes[1].get_legend().get_texts()]
    assert told == list(synthetic_run.TERMS)


def test_a_quantity_is_drawn_over_another_one_within_limits(logs, closing):
    run, axis = read_log(logs / "slow.mcap"), Axis("body/ball/position.z", (20.0, 22.0), (0.0, 60.0), "One lift")
    figure = draw(axis.over(run, lines_of(run, 0, ["com.z"]), None), ["slow"], axis=axis)
    (axes,) = figure.axes
    (line,) = axes.get_lines()
    np.testing.assert_allclose(line.get_xdata(), 1e3 * run["body/ball/position"].values[:, 2])
    np.testing.assert_allclose(line.get_ydata(), 1e3 * run.com[:, 2])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("ball position, z [mm]", "centre of mass, z [mm]")
    assert (axes.get_xlim(), axes.get_ylim(), figure.get_suptitle()) == ((20.0, 22.0), (0.0, 60.0), "One lift")


def test_a_path_that_goes_straight_up_does_not_lie_on_the_frame(closing):
    upright = Line(0, "com.z", "m", np.array([0.0, 0.0, 0.05]), np.array([0.0, 0.02, 0.02]), "m")
    (axes,) = draw([upright], ["run"], axis=Axis("com.x")).axes
    assert axes.get_xlim() == pytest.approx((-1.5, 51.5))


@pytest.mark.parametrize(
    ("names", "unit", "label", "told"),
    [
        (["body/cube/position.x", "body/cube/position.z"], "m", "cube position [m]", ["x", "z"]),
        (
            ["rod/arm_0/position.x, node 9", "rod/arm_0/position.z, node 9"],
            "m",
            "arm 0 position, node 9\n[m]",
            ["x", "z"],
        ),
        (["rod/a/position.z, node 4", "rod/a/position.z, node 9"], "m", "a position [m]", ["z, node 4", "z, node 9"]),
        (["body/a/position.z", "body/b/position.z"], "m", "position [m]", ["a position, z", "b position, z"]),
        (["stimulus/heat", "stimulus/cold_air"], "degC", "stimulus [°C]", ["heat", "cold air"]),
        (["rod/jaw_0/contact_force.x, node 40"], "N", "jaw 0 contact force, x,\nnode 40 [N]", None),
    ],
)
def test_a_panel_says_what_its_curves_have_in_common_and_the_legend_the_rest(names, unit, label, told, closing):
    (axes,) = draw([Line(0, name, unit, np.arange(2.0), np.ones(2)) for name in names], ["run"]).axes
    assert axes.get_ylabel() == label
    legend = axes.get_legend()
    assert told == (legend and [text.get_text() for text in legend.get_texts()])


def test_no_label_is_longer_than_its_panel(closing):
    names = [("rod/left_fore_leg/contact_force.x, node 40", "N"), ("rod/left_fore_leg/position.x, node 40", "m")]
    with matplotlib.rc_context(STYLE):
        figure = draw([Line(0, name, unit, np.arange(2.0), np.ones(2)) for name, unit in names], ["run"])
        figure.canvas.draw()
    for axes in figure.axes:
        assert axes.yaxis.label.get_window_extent().height < 1.1 * axes.get_window_extent().height


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rod/arm_1/position.z, node 40", "arm 1 position, z, node 40"),
        ("energy/kinetic", "kinetic energy"),
        ("stimulus/humidity", "humidity"),
        ("min_gap", "least gap"),
    ],
)
def test_axes_have_labels_in_words(name, words):
    assert words_of(name) == words


def test_several_logs_are_drawn_over_each_other_and_named(logs, closing, tmp_path):
    runs = [read_log(logs / f"{name}.mcap") for name in ("slow", "fast")]
    figure = draw([line for k, run in enumerate(runs) for line in lines_of(run, k, ["com.z"])], ["slow", "fast"])
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["slow", "fast"]
    assert len({line.get_color() for line in axes.get_lines()}) == 2
    assert [len(line.get_xdata()) for line in axes.get_lines()] == [26, 13]


@pytest.mark.parametrize("wanted", [["com"], ["com", "energy/*"], ["body/*/position", f"{ROD}/contact_force"]])
def test_legends_stand_above_the_axes_within_the_figure(logs, closing, wanted):
    with matplotlib.rc_context(STYLE):
        figure = draw(lines_of(read_log(logs / "slow.mcap"), 0, wanted), ["slow"])
        figure.canvas.draw()
    for axes in figure.axes:
        legend, inside = axes.get_legend().get_window_extent(), axes.get_window_extent()
        assert legend.y0 >= inside.y1 and legend.y1 <= figure.bbox.y1 and legend.x1 <= figure.bbox.x1
        assert inside.width > 0.6 * figure.bbox.width and inside.height > 0.6 * figure.bbox.height / len(figure.axes)


@pytest.mark.parametrize("suffix", ["pdf", "png", "svg"])
def test_a_figure_has_the_width_of_a_column(suffix, logs, tmp_path):
    out = tmp_path / f"figure.{suffix}"
    assert main(["plot", str(logs / "slow.mcap"), "com.z", f"{ROD}/curvature", "--out", str(out)]) == 0
    data = out.read_bytes()
    if suffix == "png":
        from PIL import Image

        assert abs(Image.open(out).width - 86 / 25.4 * 300) <= 1.0
    elif suffix == "svg":
        assert b"centre of mass, z [mm]" in data
        assert float(re.search(rb'<svg[^>]* width="([\d.]+)pt"', data)[1]) == pytest.approx(86 / 25.4 * 72, abs=0.1)
    else:
        assert data.startswith(b"%PDF") and b"/Type3" not in data


def test_nodes_of_rods_are_counted_from_both_ends(logs):
    run = read_log(logs / "slow.mcap")
    values = run[f"{ROD}/position"].values
    for node, name in ((None, "node 40"), (0, "node 0"), (-2, "node 39")):
        (line,) = lines_of(run, 0, [f"{ROD}/position.x"], node)
        assert line.name == f"{ROD}/position.x, {name}"
        np.testing.assert_array_equal(line.values, values[:, -1 if node is None else node, 0])


def test_long_curves_keep_their_extremes(closing):
    times = np.arange(10 * MOST_POINTS) * 1e-3
    values = np.sin(times)
    values[123_457] = 7.0
    figure = draw([Line(0, "a", "", times, values)], ["run"])
    drawn = figure.axes[0].get_lines()[0]
    assert len(drawn.get_xdata()) <= 2 * MOST_POINTS and drawn.get_ydata().max() == 7.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["com.q"], "quantity 'com.q': com has the components x, y, z"),
        (["coms"], "slow.mcap: quantity 'coms': there is none; near it: com"),
        (["energy/bend.x"], "energy/bend has no components"),
        ([f"{ROD}/strain", "--node", "41"], "--node: 41 is not allowed; rod/arm_1/active/strain has nodes 0 to 40"),
        (["com", "--out", "a.jpg"], "must end in .pdf, .png or .svg"),
        (["com", "--width", "huge"], "--width: huge is not allowed"),
        (["com.z", "--x", "com", "--out", "a.pdf"], "--x: 'com' is 3 curves; name one, such as com.x"),
        (["com", "energy/bend", "--ylim", "0:1", "--out", "a.pdf"], "--ylim: there are panels of several units"),
        (["com", "--xlim", "2:1"], "found '2:1'; allowed are two numbers, the smaller one first"),
        (["com", "--label", "a", "--label", "b"], "--label: is given 2 times, and there are 1 logs"),
        (["com"], "there is no screen to show the figure on"),
        ([], "say which quantities, such as com.z"),
        (["com", "nothing.mcap", "--out", "a.pdf"], "nothing.mcap: cannot be read"),
    ],
)
def test_what_cannot_be_drawn_is_told_with_what_can(words, message, logs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(logs / "slow.mcap"), *words]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
