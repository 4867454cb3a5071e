"""Figures of recorded quantities, as papers want them: units on the axes, small fonts, the width of a column.

Quantities of one unit share a panel; panels share the axis of time or of another quantity. matplotlib is imported when
a figure is drawn.
"""

from __future__ import annotations

import io
import math
import os
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.log.file.output_paths import check_output_path, draft_of
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.log.run.recorded import Recorded
from bilayer_core.log.run.run_data import RunData
from bilayer_core.log.run.tables import chosen_names, component_unit

SUFFIXES = (".pdf", ".png", ".svg")
MILLIMETRE = 1.0 / 25.4
"""[inch]."""
WIDTHS = {"single": 86.0, "double": 178.0}
"""Of the columns of most journals [mm]."""
PANEL_HEIGHT, FRAME_HEIGHT = 42.0, 14.0
"""Of each panel without its legend, and of what is below the last one [mm]."""
LEGEND_LINE, LETTER, HANDLE = 3.4, 1.4, 8.0
"""Height of a line of a legend; width of a letter of it, and of what stands before a name [mm]."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's, which the colour-blind tell apart."""
DASHES = ("-", "--", ":", "-.")
FONT_SIZE, DOTS = 8.0, 300.0
"""[pt] and, of png files, [1/inch]."""
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"))
WITH_PREFIX = ("m", "N", "J", "N m", "s", "m/s")
KINDS = {"m": "position", "N": "force", "N m": "moment", "J": "energy", "1/m": "curvature"}
"""What a panel with several quantities shows, by its unit."""
SYMBOLS = {"degC": "°C", "deg": "°", "um": "µm", "us": "µs", "uN": "µN"}
"""Units that papers print in another way."""
AXIS_LETTERS, MARGIN = 24, 0.03
"""In a line beside a panel; and of an axis beyond the curves, but for time."""
WORDS = {"com": "centre of mass", "min gap": "least gap"}
MOST_LINES = 40
"""In one panel."""
MOST_POINTS = 20_000
"""Of a line: more than a printed figure shows. Longer ones are drawn by the smallest and largest value of each part."""
STYLE = {
    "font.size": FONT_SIZE,
    "axes.labelsize": FONT_SIZE,
    "legend.fontsize": FONT_SIZE - 1.0,
    "xtick.labelsize": FONT_SIZE - 1.0,
    "ytick.labelsize": FONT_SIZE - 1.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.linewidth": 0.3,
    "grid.alpha": 0.5,
    "legend.frameon": False,
    "pdf.fonttype": 42,  # text that journals accept and that stays text
    "svg.fonttype": "none",
    "savefig.dpi": DOTS,
    "axes.unicode_minus": True,
}


@dataclass(frozen=True)
class Line:
    """One curve: of a component of a quantity, from one log."""

    run: int
    name: str
    unit: str
    times: np.ndarray
    values: np.ndarray
    over_unit: str = "s"
    """Of `times`, which may be another quantity."""


@dataclass(frozen=True)
class Axis:
    """Quantity that curves are drawn over, with the limits and the title of the figure."""

    name: str | None = None  # A quantity, with its component; by default time
    across: tuple[float, float] | None = None
    upwards: tuple[float, float] | None = None
    """`across`, `upwards`: limits of both axes, in the units that they show."""
    title: str = ""

    def over(self, run: RunData, lines: list[Line], node: int | None) -> list[Line]:
        """Return the curves of a run over the quantity; between its own times it goes on straight lines."""
        if self.name is None:
            return lines
        found = lines_of(run, 0, [self.name], node)
        if len(found) != 1:
            raise InputError(f"--x: {self.name!r} is {len(found)} curves; name one, such as {found[0].name}")
        (x,) = found
        return [replace(of, times=np.interp(of.times, x.times, x.values), over_unit=x.unit) for of in lines]


def lines_of(run: Recorded, number: int, wanted: Sequence[str], node: int | None = None) -> list[Line]:
    """Return the curves of some quantities of a run.

    Parameters
    ----------
    run : Recorded
    number : int
        Of the run, among those that are drawn.
    wanted : sequence of str
        Names such as ``com``, ``com.z``, ``energy/*`` or ``rod/strip/position.z``.
    node : int, optional
        Which node of a rod, from the end if negative; by default the last one.

    Raises
    ------
    InputError
        If there is no such quantity, component or node.
    """
    found = []
    for asked in wanted:
        name, component = _split(asked, run)
        for known in chosen_names(run.entries(), name, run.why_not):
            quantity = run[known]
            values, suffix = quantity.values, ""
            if "node" in quantity.axes:
                count = values.shape[1]
                place = -1 if node is None else node
                if not -count <= place < count:
                    raise InputError(f"--node: {place} is not allowed; {known} has nodes 0 to {count - 1}")
                values, suffix = values[:, place], f", node {place % count}"
            if not quantity.labels:
                if component:
                    raise InputError(f"quantity {asked!r}: {known} has no components")
                found.append(Line(number, known + suffix, quantity.unit, quantity.times, values))
                continue
            if component and component not in quantity.labels:
                raise InputError(f"quantity {asked!r}: {known} has the components {', '.join(quantity.labels)}")
            for k, label in enumerate(quantity.labels):
                if component in ("", label):
                    unit = component_unit(quantity.unit, label)
                    found.append(Line(number, f"{known}.{label}{suffix}", unit, quantity.times, values[:, k]))
    return found


def plot(
    logs: Sequence[str | Path],
    quantities: Sequence[str],
    out: str | Path | None = None,
    node: int | None = None,
    width: str | float = "single",
    labels: Sequence[str] = (),
    force: bool = False,
    axis: Axis | None = None,
) -> None:
    """Draw quantities of logs, the same of several logs in one panel.

    Parameters
    ----------
    logs : sequence of str or Path
    quantities : sequence of str
        As of `lines_of`.
    out : str or Path, optional
        A file that ends in .pdf, .png or .svg; without one a window is opened.
    node : int, optional
        As of `lines_of`.
    width : str or float
        ``single`` or ``double`` column, or a width [mm].
    labels : sequence of str
        What the legend calls each log; by default the names of their files.
    force : bool
        Replace an existing file.
    axis : Axis, optional
        What they are drawn over; by default time.

    Raises
    ------
    InputError
        If a log or quantity is not there, the file cannot be written, or matplotlib is missing.
    """
    require("plot", "matplotlib")
    if out is not None:
        if Path(out).suffix.lower() not in SUFFIXES:
            raise InputError(f"{out}: must end in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
        check_output_path(out, force, Path(out).suffix.lower())
    if labels and len(labels) != len(logs):
        raise InputError(f"--label: is given {len(labels)} times, and there are {len(logs)} logs; give one for each")
    lines, axis = [], axis or Axis()
    for k, log in enumerate(logs):
        try:
            run = _run(log)
            lines += axis.over(run, lines_of(run, k, quantities, node), node)
        except InputError as error:
            raise InputError(str(error) if str(log) in str(error) else f"{log}: {error}") from error
    names = list(labels) or _short_names(logs)
    import matplotlib
    import matplotlib.pyplot as pyplot

    with matplotlib.rc_context(STYLE):
        if out is None and matplotlib.get_backend().lower() in ("agg", "pdf", "svg", "ps", "template"):
            raise InputError("plot: there is no screen to show the figure on; give --out FIGURE.pdf, .png or .svg")
        figure = draw(lines, names, width, axis)
        try:
            if out is None:
                pyplot.show()
                return
            suffix, content = Path(out).suffix.lower(), io.BytesIO()  # the pdf backend fails badly on a full disk
            creator = {"Creator": "bilayer plot"} if suffix == ".pdf" else None
            figure.savefig(content, format=suffix.removeprefix("."), metadata=creator)
            with draft_of(out, force) as draft:
                draft.write_bytes(content.getvalue())
        finally:
            pyplot.close(figure)


def draw(lines: Sequence[Line], names: Sequence[str], width: str | float = "single", axis: Axis | None = None):
    """Return a figure of curves, with a panel for each unit; `names` are those of the runs."""
    import matplotlib.pyplot as pyplot

    axis = axis or Axis()
    panels: dict[str, list[Line]] = {}
    for line in lines:
        panels.setdefault(line.unit, []).append(line)
    for unit, held in panels.items():
        if len(held) > MOST_LINES:
            raise InputError(
                f"plot: {len(held)} curves [{unit or '1'}] in one panel cannot be told apart; name at most "
                f"{MOST_LINES}, or single components such as com.z"
            )
    inches = WIDTHS.get(width, width) * MILLIMETRE
    several = len({line.run for line in lines}) > 1
    legends = [_Legend.of(held, names, several, inches / MILLIMETRE) for held in panels.values()]
    rows = sum(legend.rows for legend in legends)
    height = (PANEL_HEIGHT * len(panels) + FRAME_HEIGHT + LEGEND_LINE * rows) * MILLIMETRE
    figure, all_axes = pyplot.subplots(
        len(panels), sharex=True, squeeze=False, figsize=(inches, height), layout="constrained"
    )
    for axes, (unit, held), legend in zip(all_axes[:, 0], panels.items(), legends, strict=True):
        _draw_panel(axes, unit, held, legend)
    last = all_axes[-1, 0]
    if axis.name is None:
        last.set_xlabel("time [s]")
    else:
        unit = lines[0].over_unit
        factor, prefix = prefix_of(unit, [line.times for line in lines])
        last.set_xlabel(words_of(axis.name) + in_brackets(prefix + unit))
        for curve in (of for axes in figure.axes for of in axes.get_lines()):
            curve.set_xdata(np.asarray(curve.get_xdata()) / factor)
        last.margins(x=MARGIN)
        last.relim()
        last.autoscale()
    if axis.across is not None:
        last.set_xlim(axis.across)
    if axis.upwards is not None:
        if len(panels) > 1:
            raise InputError("--ylim: there are panels of several units; draw one unit, or leave it out")
        last.set_ylim(axis.upwards)
    if axis.title:
        figure.suptitle(textwrap.fill(axis.title, int(inches / MILLIMETRE / LETTER)), fontsize=FONT_SIZE)
    figure.align_ylabels()
    return figure


@dataclass(frozen=True)
class _Legend:
    """Legend of the curves of a panel, above its axes: there it covers none."""

    labels: tuple[str, ...]
    columns: int

    @classmethod
    def of(cls, held: list[Line], names: Sequence[str], several: bool, width: float) -> _Legend:
        """Return the legend of curves, in as many columns as fit into a width [mm]."""
        _, short = _common_and_rest(list(dict.fromkeys(line.name for line in held)))
        labels = [", ".join([short[line.name]] * (len(short) > 1) + [names[line.run]] * several) for line in held]
        columns = int((width - FRAME_HEIGHT) / (HANDLE + LETTER * max(map(len, labels))))
        return cls(tuple(labels), min(max(columns, 1), len(labels)))

    @property
    def rows(self) -> int:
        """Its lines; none if there is one curve, which the axis names."""
        return math.ceil(len(self.labels) / self.columns) if len(self.labels) > 1 else 0


def _draw_panel(axes, unit: str, held: list[Line], legend: _Legend) -> None:
    factor, prefix = prefix_of(unit, [line.values for line in held])
    own = list(dict.fromkeys(line.name for line in held))
    for line, label in zip(held, legend.labels, strict=True):
        first, second = (line.run, own.index(line.name)) if len(own) == 1 else (own.index(line.name), line.run)
        axes.plot(
            *_thinned(line.times, line.values / factor),
            color=COLOURS[first % len(COLOURS)],
            linestyle=DASHES[(second + first // len(COLOURS)) % len(DASHES)],
            label=label,
        )
    axes.set_ylabel(textwrap.fill(_label(own, unit) + in_brackets(prefix + unit), AXIS_LETTERS))
    axes.margins(x=0.0)
    if legend.rows:
        axes.legend(
            ncols=legend.columns,
            handlelength=1.6,
            labelspacing=0.2,
            columnspacing=1.0,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            borderaxespad=0.2,
        )


def in_brackets(unit: str) -> str:
    """Return a unit as it stands behind a label: `` [mm]``, or nothing for a plain number."""
    unit = SYMBOLS.get(unit, unit).replace(" ", "\N{NO-BREAK SPACE}")
    return f" [{unit}]" if unit else ""


def _label(own: list[str], unit: str) -> str:
    """Return a label for the quantities of a panel: what their names have in common, or else their kind."""
    if len(own) == 1:
        return words_of(own[0])
    common, _ = _common_and_rest(own)
    if common.endswith("wrench"):
        common = common.removesuffix("wrench") + KINDS[unit]
    starts = {name.partition("/")[0] for name in own}
    return words_of(common) or KINDS.get(unit) or (starts.pop() if len(starts) == 1 else "value")


def words_of(name: str) -> str:
    """Return a name of a quantity in words: ``strip position, z, node 50`` for ``rod/strip/position.z, node 50``."""
    head, comma, node = name.partition(", ")
    path, dot, component = head.rpartition(".")
    parts = (path or component).replace("_", " ").split("/")
    if parts[0] in ("rod", "body", "stimulus") and len(parts) > 1:
        parts = parts[1:]
    elif parts[0] == "energy":
        parts = [*parts[1:], "energy"]
    return WORDS.get(shown := " ".join(parts), shown) + (f", {component}" if dot else "") + comma + node


def _common_and_rest(names: list[str]) -> tuple[str, dict[str, str]]:
    """Return what all names begin with, and each name without that, in words: ``energy`` and ``kinetic``,
    ``body/ball/position`` and ``z``; without a common name of rod or body nothing, and ``ball position, z``.
    """
    if len(names) == 1:
        return names[0], {names[0]: ""}
    common = os.path.commonprefix(names)
    cut = max(common.rfind("/"), common.rfind(".")) + 1
    if common[:cut] in ("", "rod/", "body/"):
        return "", {name: words_of(name) for name in names}
    ends = {name.partition(", ")[2] for name in names}
    node = f", {ends.pop()}" if len(ends) == 1 and ends != {""} else ""
    rests = {name: name[cut:].removesuffix(node) for name in names}
    return common[: cut - 1] + node, {name: words_of(rest).removeprefix(", ") for name, rest in rests.items()}


def prefix_of(unit: str, held: Sequence[np.ndarray]) -> tuple[float, str]:
    """Return the factor and SI prefix by which the largest of all values is at least 1."""
    if unit not in WITH_PREFIX:
        return 1.0, ""
    finite = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in held]
    largest = max(finite, default=0.0)
    if largest == 0.0:
        return 1.0, ""
    return next(((factor, name) for factor, name in PREFIXES if largest >= factor), PREFIXES[-1])


def _thinned(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the extremes of the parts of a long curve, which look the same."""
    if len(times) <= MOST_POINTS:
        return times, values
    parts = np.array_split(np.arange(len(times)), MOST_POINTS // 2)
    picked = sorted({int(at) for of in parts for at in (of[values[of].argmin()], of[values[of].argmax()])})
    return times[picked], values[picked]


def _run(log: str | Path) -> RunData:
    run = read_log(log)
    if not run.times.size:
        raise InputError(f"{log}: holds no frame, there is nothing to draw")
    return run


def _split(asked: str, run: Recorded) -> tuple[str, str]:
    """Return the name and component of what is asked for."""
    if asked in run.entries():
        return asked, ""
    name, dot, component = asked.rpartition(".")
    return (name, component) if dot else (asked, "")


def _short_names(logs: Sequence[str | Path]) -> list[str]:
    """Return the names of the logs' files, with their directories where those are the same."""
    stems = [Path(log).stem for log in logs]
    return stems if len(set(stems)) == len(stems) else [str(Path(log).with_suffix("")) for log in logs]
