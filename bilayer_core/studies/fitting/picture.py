"""The picture of a fit: data, start and fit over time, and residuals; matplotlib is imported when it is drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bilayer_core.log.file.output_paths import draft_of
from bilayer_core.studies.fitting.fit_result import FitResult

MOST_COLUMNS = 12
"""That are drawn; the title says when there are more."""
WIDTH, ROW, FRAME = 7.0, 1.9, 0.9
"""Of the picture, of each column of the data, and of what is around them [inch]."""
DOTS = 200
"""[1/inch]"""
DATA, FIT, START = "#000000", "#D55E00", "#56B4E9"
"""Of Okabe and Ito's colours, which the colour-blind tell apart."""


def write_picture(result: FitResult, path: Path, force: bool) -> None:
    """Draw a fit to a png file.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = result.data.columns[:MOST_COLUMNS]
    figure = Figure(figsize=(WIDTH, ROW * len(columns) + FRAME), layout="constrained")
    FigureCanvasAgg(figure)
    all_axes = figure.subplots(len(columns), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
    for k, (left, right) in enumerate(all_axes):
        _draw_column(result, k, left, right)
    all_axes[0, 0].legend(frameon=False, fontsize=7)
    for axes in all_axes[-1]:
        axes.set_xlabel("time [s]", fontsize=8)
    figure.suptitle(_title(result), fontsize=8)
    with draft_of(path, force) as draft:
        figure.savefig(draft, dpi=DOTS)


def _draw_column(result: FitResult, k: int, left, right) -> None:  # type: ignore[no-untyped-def]
    """Draw data, start and fit at the left, and residuals at the right."""
    data, column = result.data, result.data.columns[k]
    here = data.present[:, k]
    times, factor = data.times, column.factor
    sigma = np.full(times.size, result.sigma[column.name]) if column.sigma is None else column.sigma
    left.plot(times, result.started[:, k] / factor, "--", color=START, linewidth=1.0, label="start")
    left.plot(times, result.fitted[:, k] / factor, "-", color=FIT, linewidth=1.2, label="fit")
    bars = {"fmt": ".", "color": DATA, "markersize": 4, "elinewidth": 0.6}
    left.errorbar(times[here], column.values[here] / factor, sigma[here] / factor, label="data", **bars)
    left.set_ylabel(_label(column.name, column.shown_unit), fontsize=7)
    right.axhline(0.0, color=FIT, linewidth=1.0)
    right.errorbar(times[here], result.residuals[here, k] / factor, sigma[here] / factor, **bars)
    right.set_ylabel(_label("residual", column.shown_unit), fontsize=7)
    for axes in (left, right):
        axes.tick_params(labelsize=7)
        axes.grid(linewidth=0.3, alpha=0.5)


def _label(name: str, unit: str) -> str:
    head, _, tail = name.rpartition("/")
    short = name if len(name) < 24 else f"{head}/\n{tail}"
    return f"{short} [{unit}]" if unit else short


def _title(result: FitResult) -> str:
    lines = [f"{result.scene.name}: bars are one standard deviation of the noise", *map(str, result.parameters)]
    count = len(result.data.columns)
    if count > MOST_COLUMNS:
        lines.append(f"the first {MOST_COLUMNS} of {count} columns of the data")
    return "\n".join(lines)
