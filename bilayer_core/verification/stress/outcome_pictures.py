"""The results as pictures: outcomes by axis, effort, error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bilayer_core.verification.stress.parameters import RANGES
from bilayer_core.verification.stress.stress_case import Outcome, Record
from bilayer_core.verification.validate.paper_figures import figure_of, save

COLOURS = {
    Outcome.ACCURATE: "#2a9d62",
    Outcome.STABLE: "#8cc5e3",
    Outcome.REFUSED: "#f2b705",
    Outcome.FAILED: "#c1272d",
}
ORDER = list(COLOURS)
COLUMNS = 4
EMPTY = "#eeeeee"


def draw(records: Sequence[Record], directory: Path) -> list[Path]:
    """Draw what there are results for; the files written."""
    written = []
    axes = [axis for axis in RANGES if any(record.axis == axis for record in records)]
    if axes:
        written.append(_outcomes_by_axis(records, axes, directory / "stability_axes.png"))
    if any(record.figures.get("substeps") for record in records):
        written.append(_effort(records, directory / "stability_effort.png"))
    return written


def _outcomes_by_axis(records: Sequence[Record], axes: Sequence[str], path: Path) -> Path:
    """Draw a heat map for each axis: the worst outcome of both models by value and robot; hatched outside the range."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch, Rectangle

    rows = -(-len(axes) // COLUMNS)
    figure, grid = figure_of(rows, COLUMNS, (3.2 * COLUMNS, 2.1 * rows))
    panels = np.ravel(grid)
    colours = ListedColormap([EMPTY, *COLOURS.values()])
    for panel, axis in zip(panels, axes, strict=False):
        cells = _cells([record for record in records if record.axis == axis])
        values = sorted({value for value, _ in cells}, key=float)
        robots = [robot for robot in RANGES[axis].robots if any(robot == r for _, r in cells)]
        worst = np.zeros((len(robots), len(values)))
        for (value, robot), (outcome, inside) in cells.items():
            row, column = robots.index(robot), values.index(value)
            worst[row, column] = 1 + ORDER.index(outcome)
            if not inside:
                corner = column - 0.5, row - 0.5
                panel.add_patch(Rectangle(corner, 1, 1, fill=False, hatch="///", edgecolor="white", linewidth=0))
        panel.imshow(worst, cmap=colours, vmin=0, vmax=len(ORDER), aspect="auto")
        panel.set_xticks(range(len(values)), [f"{float(v):g}" for v in values], rotation=60, fontsize=8)
        panel.set_yticks(range(len(robots)), robots, fontsize=9)
        panel.set_title(axis.replace("_", " "), fontsize=11)
        panel.tick_params(length=0)
    for panel in panels[len(axes) :]:
        panel.axis("off")
    keys = [Patch(color=colour, label=outcome.value) for outcome, colour in COLOURS.items()]
    keys.append(Patch(facecolor="#888888", hatch="///", edgecolor="white", label="outside the region of validity"))
    figure.legend(handles=keys, loc="outside lower center", ncol=len(keys), frameon=False, fontsize=11)
    save(figure, path)
    return path


def _cells(records: Sequence[Record]) -> dict[tuple[str, str], tuple[Outcome, bool]]:
    """Return the worst outcome of each value and robot of an axis, and whether it is inside the region."""
    cells: dict[tuple[str, str], tuple[Outcome, bool]] = {}
    for record in records:
        _, value, robot, *_ = record.name.split("/")
        worst = max(ORDER.index(record.outcome), ORDER.index(cells.get((value, robot), (ORDER[0], True))[0]))
        cells[value, robot] = ORDER[worst], record.inside
    return cells


def _effort(records: Sequence[Record], path: Path) -> Path:
    """Return the histograms of iterations and of rejected attempts a step, and of errors inside the region."""
    figure, panels = figure_of(1, 3, (13.0, 3.8))
    run = [record for record in records if record.figures.get("substeps")]
    iterations = [record.figures["iterations"] / record.figures["substeps"] for record in run]
    rejected = [record.figures["rejected"] / record.figures["substeps"] for record in run]
    errors = [max(record.error, 1e-9) for record in run if record.error is not None and record.inside]
    panels[0].hist(iterations, bins=np.geomspace(1, max(100, *iterations), 40), color="#1f77b4")
    panels[0].set_xlabel("Newton iterations a step, mean of a case")
    panels[0].set_xscale("log")
    panels[1].hist(rejected, bins=40, color="#9467bd")
    panels[1].set_xlabel("rejected attempts an accepted step")
    panels[1].set_yscale("log")
    panels[2].hist(errors, bins=np.geomspace(1e-9, max(1.0, *errors, 1.0), 40), color="#2ca02c")
    panels[2].axvline(0.01, color="#222222", linewidth=1)
    panels[2].set_xlabel("error over the length of a strip, inside the region")
    panels[2].set_xscale("log")
    for panel in panels:
        panel.set_ylabel("cases")
    save(figure, path)
    return path
