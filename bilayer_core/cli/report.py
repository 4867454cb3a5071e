"""The summary of a run as lines of text."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

FEW, MANY = 2, 6
"""Bodies and pairs that are told of, in brief and with `--verbose`."""


def choices(report: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the names of what was chosen for a scene, and what that is, with the reasons."""
    for key, reason in report["reasons"].items():
        chosen = report[key]
        yield key.replace("_", " "), f"{f'{chosen:.0e} Pa' if isinstance(chosen, float) else chosen} ({reason})"


def summary_lines(summary: dict[str, Any], moved: set[str], verbose: bool) -> Iterator[str]:
    """Yield three lines that tell how a run went, what came of it and how good it is, then what to be aware of.

    `summary`: as `Simulator.summary` gives it. `moved`: names of the bodies that forces may lift. `verbose`: whether a
    line for each figure comes instead of the second and the third.
    """
    factor = summary["real_time_factor"]
    times = f", {factor:.3g} times as fast as real time" if factor else ""
    done = f"{summary['scene']}: {summary['termination']}, {summary['simulated']:g} s in {summary['steps']} steps"
    yield f"{done} and {summary['cpu_time']:.3g} s of CPU time{times}"
    if verbose:
        yield from _figures(summary, moved)
    else:
        lifted = [f"{name} lifted by {1e3 * summary['bodies'][name]['lift_end']:.2f} mm" for name in sorted(moved)]
        results = [*_first(lifted, FEW), f"mass centre moved by {_moved_by(summary)}", *_pressing(summary, FEW)]
        yield f"  {', '.join(results)}"
        gap = [] if summary["min_gap"] is None else [f"smallest gap {1e3 * summary['min_gap']:.3g} mm"]
        shape = (
            f"largest curvature {summary['max_curvature']:.3g} 1/m, strain {100 * summary['max_fibre_strain']:.2g} %"
        )
        quality = [shape, *gap, *_numerical(summary)]
        yield f"  {', '.join(quality)}; --verbose shows all figures, and what was chosen"
    for warning in summary["warnings"]:
        yield f"  {'WARNING':22}{warning}"
    for text in summary["unseen"] if "global_error" not in summary else ():  # whose table tells it
        yield f"  {'not seen':22}{text}"


def _moved_by(summary: dict[str, Any]) -> str:
    """Return the displacement of the mass centre, without what is rounding."""
    parts = (round(1e3 * part, 4) + 0.0 for part in summary["displacement"])
    return f"({', '.join(f'{part:.4g}' for part in parts)}) mm"


def _pressing(summary: dict[str, Any], most: int) -> list[str]:
    """Return the normal forces of what touches at the end, the largest first."""
    pressed = sorted(summary["pair_forces"].items(), key=lambda pair: -pair[1])
    return _first([f"{pair} {1e3 * force:.3g} mN" for pair, force in pressed], most)


def _first(told: list[str], most: int) -> list[str]:
    """Return the first of some texts, and how many more there are."""
    return told[:most] + ([f"… ({len(told) - most} more)"] if len(told) > most else [])


def _numerical(summary: dict[str, Any]) -> list[str]:
    """Return the numerical energy over what went through the run, if anything did."""
    through = summary["energy_through"]
    return [f"numerical energy {100 * summary['numerical_energy'] / through:+.2g} %"] if through > 0.0 else []


def _figures(summary: dict[str, Any], moved: set[str]) -> Iterator[str]:
    """Yield a line for each choice and each figure."""
    for name, choice in choices(summary):
        yield f"  {name:22}{choice}"
    yield f"  {'size':22}{summary['nodes']} nodes, {summary['dof']} unknowns"
    iterations = summary["newton_iterations"]
    each = f", {1e3 * summary['cpu_time'] / iterations:.2g} ms each" if iterations else ""
    yield f"  {'Newton iterations':22}{iterations}{each}"
    refused = f", {summary['rejected_steps']} attempts refused" if summary["rejected_steps"] else ""
    yield f"  {'steps':22}{summary['steps']}{refused}; last correction at most {summary['largest_residual']:.1g} m/s"
    if summary["tolerance"] is not None and summary["steps"]:
        lengths = ", ".join(f"{name} {1e3 * length:.3g} ms" for name, length in summary["step_length"].items())
        yield f"  {'their length':22}{lengths}; {summary['inaccurate_steps']} attempts refused for their error"
    yield f"  {'mass centre moved by':22}{_moved_by(summary)}"
    bend = f"times thickness {summary['max_curvature_by_thickness']:.2g}"
    yield f"  {'largest curvature':22}{summary['max_curvature']:.3g} 1/m in the run, {bend}"
    fibre = f"{100 * summary['max_fibre_strain']:.3g} % of an outermost fibre"
    yield f"  {'largest strain':22}{fibre}, {100 * summary['max_strain']:.3g} % of an edge, without eigenstrain"
    if summary["energy_through"] > 0.0:
        share = summary["numerical_energy"] / summary["energy_through"]
        again = f"; {summary['gaining_steps']} attempts refused that made some" if summary["gaining_steps"] else ""
        yield f"  {'numerical energy':22}{100 * share:+.2g} % of what went through the run{again}"
    if summary["min_gap"] is not None:
        yield f"  {'smallest gap':22}{1e3 * summary['min_gap']:.4g} mm in the run"
        yield f"  {'largest contact force':22}{1e3 * summary['max_contact_force']:.3g} mN on a node in the run"
        if summary["pair_forces"]:
            yield f"  {'pressing at the end':22}{', '.join(_pressing(summary, MANY))}"
    for name, body in summary["bodies"].items():
        if body["first_contact"] is not None:
            now, most = body["contact_nodes"], body["most_contact_nodes"]
            touched = f"first at {body['first_contact']:.3f} s, by {now} nodes at the end, by {most} at most"
            yield f"  {name + ' touched':22}{touched}"
        if name in moved:
            heights = f"{1e3 * body['lift']:.2f} mm at most, {1e3 * body['lift_end']:.2f} mm at the end"
            yield f"  {name + ' lifted by':22}{heights}"
    if summary["joints"]:
        worst = [max(joint[key] for joint in summary["joints"].values()) for key in ("distance", "angle")]
        yield f"  {'joints give way by':22}{1e6 * worst[0]:.2g} um and {1e6 * worst[1]:.2g} urad at most at the end"
    for name, part in [*summary["bodies"].items(), *summary["joints"].items()]:
        yield from _motions(name, part)


def _motions(name: str, part: dict) -> Iterator[str]:
    """Yield a line for each hinge, rail or joint where something resists its motion: how far it has turned or slid."""
    for key, word, unit, factor in (("turning", "turned", "deg", 180.0 / math.pi), ("sliding", "slid", "mm", 1e3)):
        if key in part:
            beyond = part.get(f"{key}_beyond_limit", 0.0)
            more = f", {factor * beyond:.2g} {unit} beyond its limit at most" if beyond > 0.0 else ""
            yield f"  {f'{name} {word} by':22}{factor * part[key]:.4g} {unit}{more}"
