"""The verb ``converge``."""

from __future__ import annotations

import json
from typing import Any

import click

from bilayer_core.cli.json_output import json_option, json_to
from bilayer_core.cli.options import Duration, Verb, scene_argument, set_option
from bilayer_core.cli.terminal import print_table, say
from bilayer_core.cli.watch import compile_kernels


@click.command(cls=Verb)
@scene_argument
@click.option("--duration", type=Duration(), help="Simulated time of each run; default: to the end of the scene.")
@click.option("--quantity", "quantities", multiple=True, metavar="NAME", help="A figure to judge, such as com.x.")
@set_option
@click.option("--workers", type=click.IntRange(1), help="Runs side by side; default: one a core.")
@json_option("Write all values")
@click.option("--quiet", is_flag=True, help="No progress.")
def converge(
    scene: str,
    duration: float | None,
    quantities: tuple[str, ...],
    overrides: tuple[str, ...],
    workers: int | None,
    json_file: str | None,
    quiet: bool,
) -> None:
    """Run SCENE at twice and half its time step, with half and twice its edges: observed orders and error bars."""
    from bilayer_core.processes import usable_cores
    from bilayer_core.scene.loader import load_scene
    from bilayer_core.studies.converge import study

    config = load_scene(scene, overrides)
    runs = len(study.planned_runs(config))
    done = 0

    def tell(name: str) -> None:
        nonlocal done
        done += 1
        if not quiet:
            say(f"  run {done} of {runs} done: {name}", err=True)

    with json_to(json_file) as write_json:
        compile_kernels(quiet)
        found = study.converge(config, duration, quantities, min(workers or usable_cores(), runs), tell)
        say(f"{config.name}: {found.integrator}, steps {found.stepping}")
        _print_table(found.rows)
        for name, reason in found.missing.items():
            say(f"  {name}: {reason}")
        write_json(json.dumps(_content(config.name, found), indent=2))


def _print_table(rows: list) -> None:
    from bilayer_core.studies.converge.quantities import unit_of
    from bilayer_core.studies.converge.study import BASE

    def texts(row: Any) -> tuple[str, ...]:
        unit, factor = unit_of(row.name)
        return (
            row.name,
            f"{factor * row.values[BASE]:.6g} {unit}",
            f"± {factor * row.bar:.2g}",
            f"{100 * row.time.change:+.2g} %",
            _order(row.time.order),
            f"{100 * row.mesh.change:+.2g} %",
            _order(row.mesh.order),
        )

    titles = ("figure", "value", "error bar", "half the step", "order", "twice the edges", "order")
    print_table(titles, map(texts, rows))


def _order(order: float | None) -> str:
    return "none seen" if order is None else f"{order:.2f}"


def _content(name: str, found: Any) -> dict[str, Any]:
    return {
        "scene": name,
        "integrator": found.integrator,
        "stepping": found.stepping,
        "quantities": [
            {
                "name": row.name,
                "values": row.values,
                "error_bar": row.bar,
                "time": {"change": row.time.change, "order": row.time.order, "bar": row.time.bar},
                "mesh": {"change": row.mesh.change, "order": row.mesh.order, "bar": row.mesh.bar},
            }
            for row in found.rows
        ],
        "missing": found.missing,
    }
