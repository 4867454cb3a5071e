"""Pictures of results: lines, heat maps, parallel coordinates, and what cannot be had at once.

What is drawn follows from what was varied: one number gives lines of each metric, two a map, more parallel
coordinates. Two objectives give the front of Pareto. matplotlib is imported when a picture is drawn.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.extras import require
from bilayer_core.log.file.output_paths import draft_of
from bilayer_core.studies.sweeps.job import Row
from bilayer_core.studies.sweeps.sweep_result import SweepResult
from bilayer_core.view.plot import COLOURS, LETTER, MILLIMETRE, STYLE, in_brackets, prefix_of

WIDTH, HEIGHT = 110.0, 78.0
"""Of a picture [mm]."""
MOST_LINES = 8
"""Values of a second parameter that are lines of their own."""
DECADES = 3
MAP, MISSING = "viridis", "#bbbbbb"
Column = np.ndarray


def draw(result: SweepResult, directory: Path) -> list[Path]:
    """Draw all pictures that results give; existing ones are replaced.

    Returns
    -------
    list of Path
        The files written: ``lines_METRIC.png``, ``map_METRIC.png``, ``parallel.png``, ``pareto.png``.
    """
    require("--plot", "matplotlib")
    import matplotlib
    from matplotlib.figure import Figure

    paths = []
    with matplotlib.rc_context(STYLE):
        for name, paint in _pictures(result):
            figure = Figure(figsize=(WIDTH * MILLIMETRE, HEIGHT * MILLIMETRE), layout="constrained")
            paint(figure)
            if result.about.title:
                figure.suptitle(textwrap.fill(result.about.title, int(WIDTH / LETTER)), fontsize=8)
            path = directory / f"{name}.png"
            with draft_of(path, force=True) as draft:
                figure.savefig(draft)
            paths.append(path)
    return paths


def _pictures(result: SweepResult) -> Iterator[tuple[str, Any]]:
    done = [row for row in result.rows if row.outcome.value == "done"]
    varied = [name for name in result.about.parameters if len({str(row.parameters[name]) for row in result.rows}) > 1]
    numeric = [name for name in varied if _is_number([row.parameters[name] for row in result.rows])]
    measured = [name for name in result.about.metrics if _is_number([row.metrics.get(name) for row in done])]
    for metric in measured:
        if len(varied) == 1 and numeric or _few_lines(result, varied, numeric):
            yield f"lines_{metric}", lambda figure, m=metric: _lines(figure, result, done, varied, numeric, m)
        if len(varied) == len(numeric) == 2:
            yield f"map_{metric}", lambda figure, m=metric: _map(figure, result, numeric, m)
    if len(varied) > 2 and measured:
        yield "parallel", lambda figure: _parallel(figure, result, done, numeric, measured)
    wanted = [name for name in result.about.objectives if name in measured]
    if len(wanted) >= 2:
        yield "pareto", lambda figure: _pareto(figure, result, done, wanted)


def _is_number(values: list[Any]) -> bool:
    known = [value for value in values if value is not None]
    return bool(known) and all(isinstance(value, int | float) and not isinstance(value, bool) for value in known)


def _few_lines(result: SweepResult, varied: list[str], numeric: list[str]) -> bool:
    if len(varied) != 2 or not numeric:
        return False
    return len({str(row.parameters[_other(varied, numeric)]) for row in result.rows}) <= MOST_LINES


def _other(varied: list[str], numeric: list[str]) -> str:
    """Return the one of two parameters that is not along the axis."""
    return next(name for name in varied if name != numeric[0])


def _unit(result: SweepResult, name: str) -> tuple[float, str]:
    """Return what the numbers of a column are divided by for a picture, and the unit that they then have: metrics in SI
    units get a prefix, parameters keep the unit in which the sweep says them.
    """
    unit = result.about.units.get(name, "")
    if name in result.about.parameters:
        return 1.0, unit
    values = [row.metrics.get(name) for row in result.rows]
    factor, prefix = prefix_of(unit, [np.array([value for value in values if value is not None], dtype=float)])
    return factor, prefix + unit


def _label(result: SweepResult, name: str, value: str = "") -> str:
    shown, (_, unit) = name.replace("_", " "), _unit(result, name)
    return f"{shown} {value} {unit}".rstrip() if value else shown + in_brackets(unit)


def _scale(result: SweepResult, name: str) -> str:
    return "log" if name in result.about.logarithmic else "linear"


def _set_scale(axes: Any, which: str, result: SweepResult, name: str) -> None:
    """Set the scale of an axis; a logarithmic one of less than `DECADES` decades has plain numbers at 1, 2, 5, 10, …"""
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set(**{f"{which}scale": _scale(result, name)})
    axis = getattr(axes, f"{which}axis")
    values = [row.parameters[name] for row in result.rows]
    if _scale(result, name) == "log" and max(values) < 10**DECADES * min(values):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def _values(result: SweepResult, rows: list[Row], name: str) -> Column:
    """Return a column of some rows, in the unit of its label."""
    found = [row.parameters.get(name, row.metrics.get(name)) for row in rows]
    return np.array([np.nan if value is None else float(value) for value in found]) / _unit(result, name)[0]


def _lines(
    figure: Any, result: SweepResult, done: list[Row], varied: list[str], numeric: list[str], metric: str
) -> None:
    axes, along = figure.subplots(), numeric[0]
    groups: dict[str, list[Row]] = {}
    for row in done:
        groups.setdefault(str(row.parameters[_other(varied, numeric)]) if len(varied) == 2 else "", []).append(row)
    for k, (value, rows) in enumerate(groups.items()):
        x, y = _values(result, rows, along), _values(result, rows, metric)
        order = np.argsort(x, kind="stable")
        told = f"{_label(result, _other(varied, numeric), _short(value))}" if value else None
        axes.plot(x[order], y[order], "o-", markersize=2.5, color=COLOURS[k % len(COLOURS)], label=told)
    lost = [row for row in result.rows if row.outcome.value != "done"]
    for k, x in enumerate(_values(result, lost, along)):
        axes.axvline(x, color=MISSING, linewidth=0.5, zorder=0, label=None if k else "no result")
    axes.set(xlabel=_label(result, along), ylabel=_label(result, metric))
    _set_scale(axes, "x", result, along)
    if len(groups) > 1 or lost:
        figure.legend(loc="outside right center")


def _short(value: str) -> str:
    try:
        return f"{float(value):.4g}"
    except ValueError:
        return value


def _map(figure: Any, result: SweepResult, names: list[str], metric: str) -> None:
    axes, rows = figure.subplots(), list(result.rows)
    x, y, z = (_values(result, rows, name) for name in (*names, metric))
    levels = np.unique(x), np.unique(y)
    if len(levels[0]) * len(levels[1]) == len({*zip(x.tolist(), y.tolist(), strict=True)}):
        grid = np.full((len(levels[1]), len(levels[0])), np.nan)
        grid[np.searchsorted(levels[1], y), np.searchsorted(levels[0], x)] = z
        borders = [cell_borders(of, _scale(result, name) == "log") for of, name in zip(levels, names, strict=True)]
        drawn = axes.pcolormesh(*borders, grid, cmap=MAP)
        axes.grid(False)
    else:
        known = np.isfinite(z)
        drawn = axes.scatter(x[known], y[known], c=z[known], cmap=MAP, s=14)
    lost = ~np.isfinite(z)
    if lost.any():
        axes.scatter(
            x[lost], y[lost], marker="x", s=14, linewidths=0.7, color="#666666", label=f"no {metric.replace('_', ' ')}"
        )
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, 1.1))
    axes.set(xlabel=_label(result, names[0]), ylabel=_label(result, names[1]))
    _set_scale(axes, "x", result, names[0])
    _set_scale(axes, "y", result, names[1])
    figure.colorbar(drawn, label=_label(result, metric))


def cell_borders(levels: Column, logarithmic: bool) -> Column:
    """Return the borders half way between values, by their ratios if the axis is logarithmic; the outer cells are
    symmetric.

    Parameters
    ----------
    levels : ndarray
        At least two values, ascending, shape (n,).
    logarithmic : bool

    Returns
    -------
    ndarray
        Shape (n + 1,).
    """
    places = np.log(levels) if logarithmic else levels
    middles = 0.5 * (places[:-1] + places[1:])
    borders = np.array([2.0 * places[0] - middles[0], *middles, 2.0 * places[-1] - middles[-1]])
    return np.exp(borders) if logarithmic else borders


def _parallel(figure: Any, result: SweepResult, done: list[Row], numeric: list[str], measured: list[str]) -> None:
    """Draw one vertical axis a column, one line a run, coloured by the first objective or metric."""
    from matplotlib import cm, colors

    axes = figure.subplots()
    by = next(iter(result.about.objectives), measured[0])
    names = [*numeric, *(name for name in measured if name != by), by]
    table = np.array([_values(result, done, name) for name in names])
    table = table[:, np.isfinite(table).all(axis=0)]
    if not table.size:
        return
    low, high = table.min(axis=1), table.max(axis=1)
    heights = np.array(
        [np.log(row) if _scale(result, name) == "log" else row for name, row in zip(names, table, strict=True)]
    )
    parts = heights - heights.min(axis=1, keepdims=True)
    parts /= np.where(high > low, parts.max(axis=1), 1.0)[:, None]
    norm = colors.Normalize(low[-1], high[-1])
    for run in np.argsort(table[-1]):
        axes.plot(parts[:, run], color=cm.ScalarMappable(norm, MAP).to_rgba(table[-1, run]), linewidth=0.5, alpha=0.8)
    for k in range(len(names)):
        axes.axvline(k, color="#444444", linewidth=0.6)
        for height, value in ((-0.04, low[k]), (1.04, high[k])):
            axes.text(k, height, f"{value:.3g}", ha="center", va="bottom" if height > 1.0 else "top", fontsize=6)
    axes.set(xlim=(-0.3, len(names) - 0.7), ylim=(-0.14, 1.14), yticks=[])
    axes.set_xticks(range(len(names)), [_label(result, name) for name in names], rotation=25, ha="right")
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    figure.colorbar(cm.ScalarMappable(norm, MAP), ax=axes, label=_label(result, by))


def front(points: np.ndarray) -> np.ndarray:
    """Return which points no other one is better than in one column and as good in the rest, where more is better.

    Parameters
    ----------
    points : ndarray
        Shape (n, columns).

    Returns
    -------
    ndarray
        Of bool, shape (n,).
    """
    best = np.ones(len(points), bool)
    for k, point in enumerate(points):
        best[k] = not np.any(np.all(points >= point, axis=1) & np.any(points > point, axis=1))
    return best


def _pareto(figure: Any, result: SweepResult, done: list[Row], wanted: list[str]) -> None:
    axes, (first, second) = figure.subplots(), wanted[:2]
    x, y = _values(result, done, first), _values(result, done, second)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    signs = [1.0 if result.about.objectives[name] == "maximise" else -1.0 for name in (first, second)]
    on = front(np.column_stack([signs[0] * x, signs[1] * y]))
    order = np.argsort(x[on])
    axes.scatter(x[~on], y[~on], s=8, color=MISSING, label="runs")
    axes.plot(x[on][order], y[on][order], "o-", markersize=3, color=COLOURS[0], label="none is better in both")
    axes.set(xlabel=f"{_label(result, first)} ({result.about.objectives[first]})")
    axes.set(ylabel=f"{_label(result, second)} ({result.about.objectives[second]})")
    axes.legend()
