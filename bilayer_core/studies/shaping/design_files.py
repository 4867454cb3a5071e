"""Files of a design: the scene, the pattern for a printer, a report, and a picture of wanted, made and pattern."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.log.file.output_paths import check_output_path, draft_of, write_text
from bilayer_core.observed.system import versions
from bilayer_core.scene.loader import scene_text
from bilayer_core.studies.shaping.design_result import DesignResult

SCENE, PATTERN, REPORT, PICTURE = "designed.yaml", "pattern.csv", "report.json", "design.png"
WANTED, MADE = "#000000", "#D55E00"
"""Of Okabe and Ito's colours, which the colour-blind tell apart."""
WIDTH, HEIGHT, DOTS = 9.0, 4.0, 200
"""Of the picture [inch], and [1/inch]."""


def check_outputs(directory: Path, force: bool) -> None:
    """Refuse files that cannot be written; InputError names them."""
    for name in (SCENE, PATTERN, REPORT, PICTURE):
        check_output_path(directory / name, force)


def report_of(result: DesignResult) -> dict[str, Any]:
    """Return all figures of a design for JSON, in SI units."""
    return {
        "scene": result.scene.name,
        "largest_distance": result.largest,
        "rms_distance": result.rms,
        "equilibria": result.equilibria,
        "termination": result.termination,
        "values_at_bounds": result.at_bounds,
        "moved_by_an_error_of_1_percent": result.sensitivity,
        "shapes": [
            {
                "target": shape.target.source,
                "stimulus": shape.stimulus,
                "target_length": shape.target.length,
                "length": shape.length,
                "ends_apart": shape.ends_apart,
                "largest_distance": float(shape.distances.max()) / result.size,
                "stable": shape.stable,
                "reached_from_the_start": shape.reached,
                "made": shape.made.tolist(),
            }
            for shape in result.shapes
        ],
        "pattern": {
            v.path: {
                "bounds": [v.low, v.high],
                "palette": list(v.palette),
                "at": list(v.at),
                "value": v.in_scene(own).tolist(),
            }
            for v, own in zip(result.varied, result.values, strict=True)
        },
        "versions": versions(),
    }


def write_files(result: DesignResult, directory: Path, force: bool) -> list[Path]:
    """Write scene, pattern, report and picture.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    report = json.dumps(report_of(result), indent=2, allow_nan=False) + "\n"
    texts = {SCENE: scene_text(result.scene), PATTERN: pattern_text(result), REPORT: report}
    for name, text in texts.items():
        write_text(directory / name, text, force)
    _write_picture(result, directory / PICTURE, force)
    return [directory / name for name in (*texts, PICTURE)]


def pattern_text(result: DesignResult) -> str:
    """Return a csv row for each value: its path, where it is along the rod [m], and itself in SI units."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("path", "at", "value"))
    for v, own in zip(result.varied, result.values, strict=True):
        for at, value in zip(v.at or ("",), v.in_scene(own).tolist(), strict=True):
            rows.writerow((v.path, at, repr(value)))
    return text.getvalue()


def _write_picture(result: DesignResult, path: Path, force: bool) -> None:
    """Draw curves in the plane where they are widest at the left, each pattern by itself at the right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(result.varied), 2)
    left, rights = figure.add_subplot(grid[:, 0]), [figure.add_subplot(grid[k, 1]) for k in range(len(result.varied))]
    drawn = np.concatenate([shape.target.points for shape in result.shapes])
    one, other = sorted(np.argsort(np.ptp(drawn, axis=0))[1:].tolist())
    for k, shape in enumerate(result.shapes):
        for points, color, style, label in (
            (shape.target.points, WANTED, "--", "wanted"),
            (shape.made, MADE, "-", "made"),
        ):
            x, y = 1e3 * points[:, one], 1e3 * points[:, other]
            left.plot(x, y, style, color=color, linewidth=1.2, label=label if k == 0 else None)
    left.set_aspect("equal", adjustable="datalim")
    left.set_xlabel(f"{'xyz'[one]} [mm]", fontsize=8)
    left.set_ylabel(f"{'xyz'[other]} [mm]", fontsize=8)
    left.legend(frameon=False, fontsize=7)
    for right, v, own in zip(rights, result.varied, result.values, strict=True):
        along, values = v.at or (0.0, result.size), v.in_scene(own) if v.at else np.repeat(own, 2)
        right.plot(1e3 * np.array(along), values, ".-", linewidth=1.0, markersize=3)
        right.set_title(v.path, fontsize=6, loc="left")
    rights[-1].set_xlabel("along the rod [mm]", fontsize=8)
    for axes in (left, *rights):
        axes.tick_params(labelsize=7)
        axes.grid(linewidth=0.3, alpha=0.5)
    figure.suptitle(f"{result.scene.name}: rms distance {100 * result.rms:.3g} % of the rod", fontsize=8)
    with draft_of(path, force) as draft:
        figure.savefig(draft, dpi=DOTS)
