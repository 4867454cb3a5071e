"""Files of a fit: report, residuals, the scene with its fitted values."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

from bilayer_core.log.file.output_paths import check_output_path, write_text
from bilayer_core.log.run.csv_cells import text_cell
from bilayer_core.observed.system import versions
from bilayer_core.scene.loader import scene_text
from bilayer_core.studies.fitting.fit_result import FitResult

REPORT, RESIDUALS, SCENE, PICTURE = "report.json", "residuals.csv", "fitted.yaml", "fit.png"
HEADINGS = ("time", "quantity", "unit", "data", "sigma", "start", "fit", "residual")


def check_outputs(directory: Path, force: bool) -> None:
    """Refuse files that cannot be written; InputError names them."""
    for name in (REPORT, RESIDUALS, SCENE, PICTURE):
        check_output_path(directory / name, force)


def report_of(result: FitResult) -> dict[str, Any]:
    """Return all figures of a fit for JSON, in SI units; what is not known is None."""
    names = list(result.values)
    return {
        "scene": result.scene.name,
        "data": result.data.source,
        "parameters": {
            fitted.path: {
                "value": fitted.value,
                "interval": None if fitted.interval is None else list(fitted.interval),
                "at_bound": fitted.at_bound or None,
                "start": fitted.parameter.start,
                "bounds": [fitted.parameter.low, fitted.parameter.high],
                "logarithmic": fitted.parameter.logarithmic,
                "difference_step": fitted.step,
            }
            for fitted in result.parameters
        },
        "level": 0.95,
        "correlations": {
            one: {other: _number(value) for other, value in zip(names, row, strict=True)}
            for one, row in zip(names, result.correlations.tolist(), strict=True)
        },
        "sigma": result.sigma,
        "sigma_known": result.sigma_known,
        "values": int(result.data.present.sum()),
        "degrees_of_freedom": result.freedom,
        "chi_squared": result.chi_squared,
        "probability": result.probability,
        "numerical_noise": _number(result.numerical_noise),
        "converged": result.converged,
        "termination": result.termination,
        "iterations": result.iterations,
        "runs": result.runs,
        "refused_runs": list(result.refused),
        "warnings": list(result.warnings),
        "versions": versions(),
    }


def write_files(result: FitResult, directory: Path, report: str, force: bool) -> list[Path]:
    """Write report, residuals and scene; the picture is `picture.write_picture`'s.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    texts = {REPORT: report + "\n", RESIDUALS: residuals_text(result), SCENE: scene_text(result.scene)}
    for name, text in texts.items():
        write_text(directory / name, text, force)
    return [directory / name for name in texts]


def residuals_text(result: FitResult) -> str:
    """Return a csv row for each value of the data, in the units of the data."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(HEADINGS)
    data, residuals = result.data, result.residuals
    for k, column in enumerate(data.columns):
        for j, time in enumerate(data.times.tolist()):
            if data.present[j, k]:
                sigma = result.sigma[column.name] if column.sigma is None else column.sigma[j]
                found = (column.values[j], sigma, result.started[j, k], result.fitted[j, k], residuals[j, k])
                shown = [repr(float(value / column.factor)) for value in found]
                rows.writerow([repr(time), text_cell(column.name), text_cell(column.shown_unit), *shown])
    return text.getvalue()


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
