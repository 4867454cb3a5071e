"""The verbs about scenes: ``scenes``, ``schema`` and ``check``."""

from __future__ import annotations

import json
from typing import Any

import click

from bilayer_core.cli.options import Verb, scene_argument, set_option


@click.command(cls=Verb)
def scenes() -> None:
    """List the bundled scenes."""
    from bilayer_core.scene.bundled import bundled_scenes
    from bilayer_core.scene.text import read_yaml

    found = bundled_scenes()
    width = max(map(len, found))
    for name, path in found.items():
        title = read_yaml(path.read_text(encoding="utf-8"), str(path))["title"]
        click.echo(f"{name:{width}}  {title}")


@click.command(cls=Verb)
@click.option("--markdown", is_flag=True, help="As a page of tables.")
def schema(markdown: bool) -> None:
    """Print every key of scene files: as JSON Schema, with which editors complete and check, or as a page to read."""
    if markdown:
        from bilayer_core.scene.key_tables import page

        click.echo(page(), nl=False)
        return
    from bilayer_core.scene.key_notes import json_schema

    click.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))


@click.command(cls=Verb)
@scene_argument
@set_option
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def check(scene: str, overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate SCENE, and say what will be computed and what is skipped, each with its reason."""
    from bilayer_core import Simulator, load_scene

    report = _report(Simulator(load_scene(scene, overrides)))
    if as_json:
        click.echo(json.dumps(report, indent=2, ensure_ascii=False))
        return
    for line in _lines(report):
        click.echo(line)


def _report(simulator) -> dict[str, Any]:
    """What will be computed, as the content of ``check --json``."""
    from bilayer_core.record.topics import Rate, output_topics

    scene, plan, model = simulator.scene, simulator.plan, simulator.model
    rates = {Rate.OUTPUT: scene.output.rate, Rate.DISPLAY: min(scene.output.rate, scene.output.marker_rate)}
    return {
        "scene": scene.name,
        "title": scene.title,
        "model": plan.model,
        "dimension": plan.dimension,
        "integrator": plan.integrator,
        "reasons": plan.reasons,
        "nodes": model.node_count + model.point_count,
        "dof": model.unknowns,
        "dt": simulator.dt,
        "duration": scene.duration,
        "terms": plan.terms,
        "contact_pairs": list(plan.contact_pairs),
        "outputs": [
            {"topic": topic.full_name(), "type": topic.type, "rate": rates[topic.rate]}
            for topic in output_topics(simulator.description)
        ],
        "warnings": list(plan.warnings),
    }


def _lines(report: dict[str, Any]):
    yield f"{report['scene']}: {report['title']}"
    for key in ("model", "dimension", "integrator"):
        yield f"  {key:12}{report[key]} ({report['reasons'][key]})"
    yield f"  {'size':12}{report['nodes']} nodes, {report['dof']} unknowns"
    yield f"  {'time':12}{report['duration']:g} s in steps of {1e3 * report['dt']:g} ms"
    yield "forces"
    for name, state in report["terms"].items():
        yield f"  {name:14}{state}"
    yield "contact pairs"
    yield from (f"  {pair}" for pair in report["contact_pairs"] or ["none"])
    yield "output"
    for stream in report["outputs"]:
        yield f"  {stream['topic']:36}{stream['type']:40}{stream['rate']:g} Hz"
    if report["warnings"]:
        yield "warnings"
        yield from (f"  {warning}" for warning in report["warnings"])
