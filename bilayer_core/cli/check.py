"""The verb ``check``."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from typing import Any

import click

from bilayer_core.cli.options import Verb, scene_argument, set_option
from bilayer_core.cli.report import choices
from bilayer_core.cli.terminal import say

WIDTH = 100
"""Of the text beside a name [characters]."""
ERROR_OF_A_RUN = (
    "the tolerance bounds the error per step; that of a run is larger: `bilayer run --error-estimate` tells it"
)
SETTLES = "at the static equilibrium under gravity, stimuli and loads, which a run looks for first"


@click.command(cls=Verb)
@scene_argument
@set_option
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def check(scene: str, overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate SCENE, and say what will be computed and what is skipped, each with its reason."""
    from bilayer_core import Simulator, load_scene

    report = _report(Simulator(load_scene(scene, overrides)))
    if as_json:
        click.echo(json.dumps(report, indent=2))
        return
    for line in _lines(report):
        say(line)


def _report(simulator) -> dict[str, Any]:
    """Return a description of the planned computation, as the content of ``check --json``."""
    from bilayer_core.log.messages.topics import Rate, output_topics
    from bilayer_core.model.findings import told
    from bilayer_core.model.immersed import missing_wake
    from bilayer_core.model.impacts import impact_warnings
    from bilayer_core.model.twisted import twist_figures
    from bilayer_core.model.undamped_friction import unseen_vibrations
    from bilayer_core.model.validity import validity_figures
    from bilayer_core.runs.forecast import forecast

    scene, plan, model = simulator.scene, simulator.plan, simulator.model
    figures = (*validity_figures(scene, plan.model), *twist_figures(scene, plan.model, plan.dimension))
    size = forecast(simulator)
    rates = {Rate.OUTPUT: scene.output.rate, Rate.DISPLAY: min(scene.output.rate, scene.output.marker_rate)}
    return {
        "scene": scene.name,
        "title": scene.title,
        "robot": _parts(scene),
        "stimuli": {
            name: f"{c.minimum:g} to {c.maximum:g} [{c.unit}], {c.schedule.type}{_light(c)}"
            for name, c in scene.stimuli.items()
        },
        "model": plan.model,
        "dimension": plan.dimension,
        "integrator": plan.integrator,
        "stepping": str(simulator.steps),
        "reasons": simulator.reasons,
        "nodes": model.node_count - len(model.joined_node) + model.point_count,
        "dof": model.unknowns,
        "contact_stiffness": model.contact_stiffness or None,
        "dt": simulator.dt,
        "tolerance": simulator.tolerance,
        "max_step": None if simulator.tolerance is None else simulator.steps.longest,
        "duration": scene.duration,
        "start": scene.start,
        "terms": plan.terms,
        "contact_pairs": list(plan.contact_pairs),
        "outputs": [
            {"topic": topic.full_name(), "type": topic.type, "rate": rates[topic.rate]}
            for topic in output_topics(simulator.description)
        ],
        "log": {"bytes_per_second": round(size.per_second), "bytes": round(size.total)},
        "within_validity": list(told(figure for figure in figures if not figure.outside)),
        "unseen": [*unseen_vibrations(scene), *missing_wake(scene.fluid)],
        "warnings": [*plan.warnings, *told(impact_warnings(model)), *simulator.start_warnings],
    }


def _parts(scene) -> dict[str, list[str]]:
    """Return descriptions of the parts of the robot and of its surroundings, by name."""
    from bilayer_core.model.edge_figures import edge_figures
    from bilayer_core.model.findings import few
    from bilayer_core.scene.mechanism import resistance
    from bilayer_core.scene.profile import extremes

    parts = {}
    for rod in scene.rods:
        copies = f"{rod.pattern.copies} of them, each " if rod.pattern else ""
        widths = dict.fromkeys(_millimetres(extremes(rod.width_of(layer))) for layer in rod.layers)
        wide = f"{' and '.join(widths)} wide"
        if rod.radius is not None:
            hole = f", hole {_millimetres(extremes(rod.inner_radius))}" if rod.inner_radius != 0.0 else ""
            wide = f"round, radius {_millimetres(extremes(rod.radius))}{hole}"
        section = f"{1e3 * rod.path.length:.4g} mm long, {wide}"
        stations = f"{rod.stations} stations {1e3 * rod.edge_length:.3g} mm apart"
        layers = ", ".join(f"{layer.name} {_millimetres(extremes(layer.thickness))}" for layer in rod.layers)
        held = [
            f"{end} held by {few(list(names))}"
            for end, key in (("start", "clamp_start"), ("end", "clamp_end"))
            if (names := {name: None for copy in rod.copies if (name := getattr(copy.rod, key))})
        ]
        rubs = _friction(scene, rod, "its axis" if rod.friction is not None else "")
        shape = f"{rod.path.describe()}, " if rod.path.describe() else ""
        free = "no ends" if rod.closed else "both ends free"
        lines = [
            f"{copies}{shape}{section}, {stations}; {', '.join(held) or free}{rubs}",
            f"bottom to top: {layers}" if rod.radius is None else f"one layer: {rod.layers[0].name}",
        ]
        if rod.pattern and (rod.pattern.stimuli or rod.pattern.gains):
            lines.append(_own_laws(rod.pattern))
        figures = edge_figures(scene, rod)
        for layer, least, most in zip(rod.layers, *figures.multiple_range, strict=True):
            if least < most:
                lines.append(f"moduli of {layer.name} change to {least:.3g} to {most:.3g} times their own")
        strain, curvature = figures.eigenstrain.max(), figures.free_curvature().max()
        natural = abs(figures.natural_change()).max()
        if natural > 0.0:
            lines.append(
                f"natural curvature of its layers: if nothing hinders it, they bend it by up to {natural:.3g} 1/m"
            )
        if curvature > 0.0:
            bends = f"curvature up to {curvature:.3g} 1/m, radius {1e3 / curvature:.3g} mm"
            if rod.path.shape != "straight" or natural > 0.0:
                bends = f"curvature changed by up to {curvature:.3g} 1/m"
            lines.append(f"eigenstrain up to {100 * strain:.3g} %: if nothing hinders it, {bends}")
        parts[rod.name] = lines
    for body in scene.bodies:
        surface = f", {body.surface.shape}" if body.surface else ""
        parts[body.name] = [f"{body.motion.describe()}{surface}{_friction(scene, body, _axis(scene, body.surface))}"]
    for joint in scene.joints:
        resisted = resistance(joint.turning, joint.sliding)
        parts[f"joint {joint.name}"] = [f"{joint.type} of {' and '.join(joint.bodies)}{resisted}"]
    for obstacle in scene.obstacles:
        parts[obstacle.name] = [f"{obstacle.type}, fixed{_friction(scene, obstacle, _axis(scene, obstacle))}"]
    return parts


def _light(channel) -> str:
    """Return where a channel shines from, as the rest of a sentence."""
    if channel.light is None:
        return ""
    hidden = "hidden by rods, bodies and obstacles" if channel.light.shadow else "hidden by nothing: shadow is false"
    return f", light from {_vector(channel.light.from_direction)}; faces turned away are dark, others {hidden}"


def _friction(scene, part, axis: str) -> str:
    """Return the coefficients of a part's own, or those along an axis if it has one, as the rest of a sentence."""
    law, own = scene.friction, part.friction
    holds = law if own is None else own
    if own is None and not (axis and law is not None and law.acts):
        return ""
    if not axis or not (own is None or own.directed):
        return f", friction {holds.coefficient:g}"
    forward, backward, sideways = holds.each_way
    return f", friction {forward:g} along {axis}, {backward:g} against it, {sideways:g} sideways"


def _axis(scene, surface) -> str:
    """Return the direction by which friction on a surface differs; empty without one."""
    law = scene.friction
    if surface is not None and surface.grain is not None:
        return f"its grain, {_vector(surface.grain)} in its frame"
    return f"{_vector(law.axis)} in the world" if surface is not None and law is not None and law.axis else ""


def _vector(components) -> str:
    return f"({', '.join(f'{component:.3g}' for component in components)})"


def _own_laws(pattern) -> str:
    """Return by what the eigenstrains of copies differ."""
    from bilayer_core.model.findings import few

    told = [f"{name} is {few(channels, 4)}" for name, channels in pattern.stimuli.items()]
    told += [f"gain times {few([f'{gain:g}' for gain in pattern.gains], 4)}"] if pattern.gains else []
    return f"copy by copy: {'; '.join(told)}"


def _millimetres(limits: tuple[float, float]) -> str:
    """Format a length, or the range of one that varies [m], in mm."""
    least, most = (f"{1e3 * limit:.4g}" for limit in limits)
    return f"{least} mm" if least == most else f"{least} to {most} mm"


def _lines(report: dict[str, Any]) -> Iterator[str]:
    yield f"{report['scene']}: {report['title']}"
    yield "robot and surroundings"
    for name, lines in report["robot"].items():
        yield from _block(name, lines)
    if report["stimuli"]:
        yield "stimuli"
        for name, text in report["stimuli"].items():
            yield from _block(name, [text])
    yield "computation"
    for name, choice in choices(report):
        yield from _block(name, [choice])
    yield from _block("size", [f"{report['nodes']} nodes, {report['dof']} unknowns"])
    yield from _block("time", [_time(report)])
    if report["start"] == "settle":
        yield from _block("start", [SETTLES])
    if report["tolerance"] is not None:
        yield from _block("accuracy", [ERROR_OF_A_RUN])
    if report["unseen"]:
        yield from _block("not seen", report["unseen"])
    yield from _forces(report["terms"])
    yield "contact pairs"
    for pair in report["contact_pairs"] or ["none"]:
        yield from textwrap.wrap(pair, WIDTH + 16, initial_indent="  ", subsequent_indent="    ")
    yield "output, in simulated time"
    for stream in report["outputs"]:
        yield f"  {stream['topic']:36}{stream['type']:40}{stream['rate']:g} Hz"
    log = report["log"]
    yield from _block(
        "log", [f"at most {_size(log['bytes_per_second'])} a second, {_size(log['bytes'])} for the whole scene"]
    )
    yield "validity of the model"
    for text in report["within_validity"]:
        yield from _block("within", [text])
    for text in report["warnings"]:
        yield from _block("WARNING", [text])
    count = len(report["warnings"])
    yield f"no faults, {count or 'no'} warning{'' if count == 1 else 's'}"


def _time(report: dict[str, Any]) -> str:
    """Return how much time is simulated, in which steps."""
    duration, dt = report["duration"], report["dt"]
    if report["tolerance"] is None:
        return f"{duration:g} s in {round(duration / dt)} steps of {1e3 * dt:g} ms"
    return f"{duration:g} s, the first step {1e3 * dt:g} ms long, none longer than {1e3 * report['max_step']:g} ms"


def _size(size: int) -> str:
    """Format a number of bytes as users read it."""
    return (
        f"{size / 1e9:.3g} GB" if size >= 999.5e6 else f"{size / 1e6:.2g} MB" if size >= 1e5 else f"{size / 1e3:.2g} kB"
    )


def _block(name: str, lines: list[str]) -> Iterator[str]:
    """Yield lines with a name at the left and text beside it; long lines continue with an indent."""
    parts = [part for line in lines for part in textwrap.wrap(line, WIDTH, subsequent_indent="  ")]
    for index, part in enumerate(parts):
        yield f"  {name if index == 0 else '':{max(14, len(name) + 2)}}{part}"


def _forces(terms: dict[str, str]) -> Iterator[str]:
    """Yield a line with the terms that are computed, then the skipped terms by reason."""
    yield "forces"
    yield from _block("active", [", ".join(name for name, state in terms.items() if state == "active")])
    skipped: dict[str, list[str]] = {}
    for name, state in terms.items():
        if state != "active":
            skipped.setdefault(state.removeprefix("skipped: "), []).append(name)
    yield from _block("skipped", [f"{', '.join(names)}: {reason}" for reason, names in skipped.items()])
