"""The verb ``fit``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from bilayer_core.cli.json_output import json_option, json_to
from bilayer_core.cli.options import Verb, output_directory, scene_argument, set_option
from bilayer_core.cli.terminal import print_table, say
from bilayer_core.cli.watch import compile_kernels

if TYPE_CHECKING:
    from bilayer_core.studies.fitting.fit_result import FitResult

NOT_CONVERGED = 1
"""Exit code of a fit that ended before it had converged."""
WIDTH = 140
"""Of tables [characters]."""


@click.command(cls=Verb)
@scene_argument
@click.option("--data", required=True, metavar="FILE.csv", help="Columns: time, and quantities such as com.z [mm].")
@click.option(
    "--parameter", "parameters", multiple=True, required=True, metavar="PATH=LO:HI[:START]", help="A number to fit."
)
@click.option("--sigma", multiple=True, metavar="QUANTITY=VALUE", help="Noise of a column; estimated if there is none.")
@set_option
@click.option("--dt", metavar="TIME", help="Fixed steps of this length, of which all times are multiples.")
@click.option("--starts", default=1, show_default=True, help="Places from which to go to the nearest minimum.")
@click.option("--out", metavar="DIR", help="Write report, residuals, picture and the scene with the fitted values.")
@json_option("Write the report")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--quiet", is_flag=True, help="No progress.")
def fit(
    scene: str,
    data: str,
    parameters: tuple[str, ...],
    sigma: tuple[str, ...],
    overrides: tuple[str, ...],
    dt: str | None,
    starts: int,
    out: str | None,
    json_file: str | None,
    force: bool,
    quiet: bool,
) -> int:
    """Find values of parameters with which SCENE agrees best with measured data.

    Least squares; 95 % intervals and correlations. Parameters that the data cannot tell apart are named instead, with
    exit code 1.
    """
    from bilayer_core.studies.fitting import outputs
    from bilayer_core.studies.fitting.fit import fit as fit_scene

    directory = None if out is None else output_directory(out)
    if directory is not None:
        from bilayer_core.extras import require

        require("--out: figures", "matplotlib")
        outputs.check_outputs(directory, force)
    with json_to(json_file) as write_json:
        compile_kernels(quiet)
        found = fit_scene(
            scene,
            data,
            parameters,
            sigma=sigma,
            overrides=overrides,
            dt=dt,
            starts=starts,
            progress=None if quiet else _tell,
        )
        report = json.dumps(outputs.report_of(found), indent=2, allow_nan=False)
        _print(found)
        if directory is not None:
            from bilayer_core.studies.fitting.picture import write_picture

            written = outputs.write_files(found, directory, report, force)
            write_picture(found, directory / outputs.PICTURE, force)
            for path in (*written, directory / outputs.PICTURE):
                say(f"wrote {path}")
        write_json(report)
    return 0 if found.converged else NOT_CONVERGED


def _tell(text: str) -> None:
    say(f"  {text}", err=True)


def _print(found: FitResult) -> None:
    values = f"{int(found.data.present.sum())} values of {found.data.source}"
    say(f"{found.scene.name}: {values}, {found.iterations} iterations, {found.runs} runs; {found.termination}")
    rows = []
    for fitted in found.parameters:
        parameter, shown = fitted.parameter, fitted.parameter.shown
        interval = fitted.interval and [shown(end) for end in fitted.interval]
        bounds = f"{shown(parameter.low, 4)} to {shown(parameter.high, 4)}"
        rows.append((fitted.path, shown(fitted.value), *(interval or ("–", "–")), shown(parameter.start, 4), bounds))
    print_table(("parameter", "fitted", "95 % from", "to", "start", "bounds"), rows, WIDTH)
    if len(found.parameters) > 1:
        rows = [
            (f"{k} {fitted.path}", *("–" if v != v else f"{v:.3f}" for v in row))
            for k, (fitted, row) in enumerate(zip(found.parameters, found.correlations.tolist(), strict=True), 1)
        ]
        print_table(("correlation", *(str(k + 1) for k in range(len(rows)))), rows, WIDTH)
    rows = []
    for k, column in enumerate(found.data.columns):
        here = found.data.present[:, k]
        rms = float((found.residuals[here, k] ** 2).mean() ** 0.5)
        unit = f" {column.shown_unit}" if column.shown_unit else ""
        rows.append((column.name, *(f"{v / column.factor:.4g}{unit}" for v in (found.sigma[column.name], rms))))
    print_table(("data", "given noise" if found.sigma_known else "estimated noise", "rms residual"), rows, WIDTH)
    if found.chi_squared is not None:
        say(f"  chi squared {found.chi_squared:.4g} of {found.freedom} degrees of freedom")
    if found.refused:
        count = len(found.refused)
        say(f"  {count} runs could not be made on the way; the first: {found.refused[0]}")
    for warning in found.warnings:
        say(f"  WARNING {warning}")
