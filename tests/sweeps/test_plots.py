"""Pictures of results, and the table that they come from."""

import numpy as np
import pytest

from bilayer_core import read_results
from bilayer_core.errors import InputError
from bilayer_core.studies.sweeps.job import Outcome, Row
from bilayer_core.studies.sweeps.journal import Journal
from bilayer_core.studies.sweeps.plots import cell_borders, draw, front
from bilayer_core.studies.sweeps.sweep_result import Columns, SweepResult, write_table


def result(points, about, metric=lambda **of: sum(of.values())):
    """Results whose metric `height` is a function of what is varied; `cost` is its negative square."""
    rows = []
    for number, values in enumerate(points):
        row = Row(number, f"k{number}", values, "hash", "0.1.0")
        height = metric(**values)
        row.metrics = {"height": height, "cost": None if height is None else -(height**2)}
        row.outcome = Outcome.STOPPED if height is None else Outcome.DONE
        rows.append(row)
    return SweepResult(rows, about)


def about(*names, metrics=("height", "cost"), **rest):
    return Columns(names, metrics, **rest)


def grid(count):
    return [{"a": float(x), "b": float(y)} for x in range(count) for y in range(count)]


def pixels(path):
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def test_one_parameter_gives_lines_two_a_map_more_parallel_coordinates(tmp_path):
    one = draw(result([{"a": float(k)} for k in range(5)], about("a", metrics=["height"])), tmp_path)
    assert [path.name for path in one] == ["lines_height.png"]
    two = draw(result(grid(3), about("a", "b")), tmp_path)
    assert [path.name for path in two] == ["lines_height.png", "map_height.png", "lines_cost.png", "map_cost.png"]
    many = [{"a": float(k), "b": float(k % 3), "c": float(k % 5)} for k in range(15)]
    objectives = {"height": "maximise", "cost": "maximise"}
    assert [p.name for p in draw(result(many, about("a", "b", "c", objectives=objectives)), tmp_path)] == [
        "parallel.png",
        "pareto.png",
    ]
    for path in tmp_path.iterdir():
        image = pixels(path)
        assert image.shape[1] > 800
        assert 0.02 < (image.min(axis=2) < 250).mean() < 0.9  # it is neither blank nor filled


def test_a_map_has_the_colour_of_each_value_at_its_place(tmp_path):
    (tmp_path / "a").mkdir(), (tmp_path / "b").mkdir()
    paths = []
    for name, sign in (("a", 1.0), ("b", -1.0)):
        draw(
            result(grid(2), about("a", "b", metrics=["height"]), lambda a, b, sign=sign: sign * (a + 2.0 * b)),
            tmp_path / name,
        )
        paths.append(tmp_path / name / "map_height.png")
    image, other = pixels(paths[0]), pixels(paths[1])
    low, high = np.array([68, 1, 84]), np.array([253, 231, 37])  # the ends of viridis

    def place(picture, colour):
        rows, columns = np.nonzero(np.abs(picture - colour).sum(axis=2) < 12)
        field = columns < 0.8 * picture.shape[1]  # without the bar
        return rows[field].mean(), columns[field].mean()

    assert place(image, low)[0] > place(image, high)[0] and place(image, low)[1] < place(image, high)[1]
    assert place(other, low) == pytest.approx(place(image, high), abs=40.0)  # labels move the field a little


def test_cells_of_a_map_are_centred_on_their_values_on_both_kinds_of_axes():
    values = np.array([0.1, 1.0, 10.0])
    ratios = cell_borders(values, logarithmic=True)
    assert np.sqrt(ratios[:-1] * ratios[1:]) == pytest.approx(values)
    even = cell_borders(np.array([2.0, 4.0, 6.0]), logarithmic=False)
    assert even.tolist() == [1.0, 3.0, 5.0, 7.0]


def test_the_legend_of_lines_stands_beside_them(tmp_path):
    points = [{"a": float(k), "b": b} for k in range(6) for b in (1.0, 2.0, 3.0)]
    image = pixels(draw(result(points, about("a", "b", metrics=["height"]), lambda a, b: b), tmp_path)[0])
    coloured = np.nonzero(image.max(axis=2) - image.min(axis=2) > 60)
    lines = coloured[1][(coloured[0] > 0.8 * image.shape[0])]
    # level lines end with the field; what is coloured to the right of it is the legend
    assert coloured[1].max() > lines.max() + 20


def test_runs_that_are_not_done_are_marked_on_the_map(tmp_path):
    whole = draw(result(grid(4), about("a", "b", metrics=["height"])), tmp_path)[1]
    before = pixels(whole)
    draw(result(grid(4), about("a", "b", metrics=["height"]), lambda a, b: None if a == b == 3.0 else a + b), tmp_path)
    assert (np.abs(pixels(whole) - before).sum(axis=2) > 0).mean() > 0.01


def test_words_and_single_values_are_not_drawn_as_numbers(tmp_path):
    points = [{"a": name, "b": 1.0} for name in ("soft", "hard")]
    assert draw(result(points, about("a", "b"), lambda a, b: b), tmp_path) == []


def test_the_front_of_pareto_is_what_nothing_is_better_than():
    points = np.array([[0.0, 3.0], [1.0, 2.0], [1.0, 1.0], [2.0, 2.0], [3.0, 0.0], [3.0, 0.0]])
    assert front(points).tolist() == [True, False, False, True, True, True]


def test_axes_have_the_units_of_parameters_and_metrics_and_curves_fit_them(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    shown = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: shown.append(figure) or path.write_bytes(b"-"))
    told = about("a", "b", units={"a": "mm", "height": "m", "cost": "N m"}, title="A long title. " * 9)
    draw(result(grid(3), told, lambda a, b: 0.01 * (a + b)), tmp_path)
    lines, coloured = shown[:2]
    assert (lines.axes[0].get_xlabel(), lines.axes[0].get_ylabel()) == ("a [mm]", "height [mm]")
    assert [curve.get_ydata().tolist() for curve in lines.axes[0].get_lines()] == [
        [0, 10, 20],
        [10, 20, 30],
        [20, 30, 40],
    ]
    assert coloured.axes[1].get_ylabel() == "height [mm]" and coloured.axes[0].get_ylabel() == "b"
    assert shown[2].axes[0].get_ylabel() == "cost [mN\xa0m]"
    title, legend = lines._suptitle, lines.legends[0]
    lines.canvas.draw()
    assert title.get_window_extent().x0 > 0 and not title.get_window_extent().overlaps(legend.get_window_extent())


@pytest.mark.parametrize(("most", "told"), [(40.0, ["1", "2", "5", "10", "20"]), (1e5, ["$\\mathdefault{10^{1}}$"])])
def test_a_logarithmic_axis_of_few_decades_has_plain_numbers(tmp_path, monkeypatch, most, told):
    from matplotlib.figure import Figure

    shown = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: shown.append(figure) or path.write_bytes(b"-"))
    points = [{"a": a} for a in (0.9, 3.0, most)]
    draw(result(points, about("a", units={"a": "um"}, logarithmic=("a",))), tmp_path)
    shown[0].canvas.draw()
    assert shown[0].axes[0].get_xlabel() == "a [µm]"
    assert {*told} <= {text.get_text() for text in shown[0].axes[0].get_xticklabels()}


def test_results_come_back_from_their_table(tmp_path):
    given = result(grid(3), about("a", "b", units={"a": "mm"}, logarithmic=("b",), title="A title"))
    with Journal(tmp_path, {}) as journal:
        journal.add(given.rows)
        path = write_table(journal, journal.keys(), given.about, tmp_path)
    found = read_results(path)
    assert found.about == given.about and found.rows == given.rows
    assert read_results(tmp_path).outcomes == {"done": 9}
    import pandas

    table = pandas.read_parquet(path)
    assert table["height"].tolist() == given.column("height")
    assert list(table.columns[:5]) == ["number", "a", "b", "height", "cost"]


def test_values_of_several_kinds_have_a_table_and_missing_ones_are_null(tmp_path):
    rows = [Row(k, f"k{k}", {"a": value}, "h", "v", metrics={"m": value}) for k, value in enumerate([1, 2.5, None])]
    mixed = [Row(9, "k9", {"a": [1, 2]}, "h", "v", metrics={"m": None})]
    for name, held in (("numbers", rows), ("mixed", rows + mixed)):
        (tmp_path / name).mkdir()
        with Journal(tmp_path / name, {}) as journal:
            journal.add(held)
            write_table(journal, journal.keys(), Columns(("a",), ("m",)), tmp_path / name)
    assert read_results(tmp_path / "numbers").column("m") == [1.0, 2.5, None]
    assert read_results(tmp_path / "mixed").column("a") == ["1", "2.5", None, "[1, 2]"]


def test_what_is_no_table_of_results_is_named(tmp_path):
    for path in (tmp_path / "absent.parquet", tmp_path):
        with pytest.raises(InputError, match="is no table of a sweep that can be read"):
            read_results(path)


def test_an_unknown_column_or_a_metric_that_no_run_has_is_told():
    found = result(grid(2), about("a", "b"), lambda a, b: None)
    with pytest.raises(InputError, match="column 'hight': there is none; there are number, a, b, height"):
        found.column("hight")
    with pytest.raises(InputError, match="metric 'height': no run has a value of it"):
        found.best("height")
    assert "4 stopped" in repr(found) and len(repr(found)) < 2000
