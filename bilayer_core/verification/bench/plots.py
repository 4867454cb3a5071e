"""The results as pictures; matplotlib is needed here and nowhere else."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from bilayer_core.verification.bench import pareto, scaling, tables, work_precision
from bilayer_core.verification.bench.configurations import Family
from bilayer_core.verification.bench.converged_answers import read_file
from bilayer_core.verification.bench.problems import PROBLEMS, Problem
from bilayer_core.verification.validate.paper_figures import figure_of, save

COLOURS = {
    "implicit_euler": "#d62728",
    "sdirk2": "#1f77b4",
    "tr_bdf2": "#2ca02c",
    "generalised_alpha": "#9467bd",
    "implicit_midpoint": "#ff7f0e",
}
MARKS = {("two_rod", 3): "o", ("two_rod", 2): "s", ("laminate", 3): "^", ("laminate", 2): "D"}
SERIES = ("#1f77b4", "#2ca02c", "#17becf", "#9467bd", "#d62728", "#ff7f0e", "#8c564b", "#e377c2")
INK, GREY, GOLD = "#222222", "#888888", "#f2b705"
WIDE = (9.6, 5.4)
TEXT = {"font.size": 12, "axes.titlesize": 14, "axes.labelsize": 13, "legend.fontsize": 10.5}
MANY_DECADES = 3e3
"""Ratio of the ends of an axis from which marks at 2 and 5 would run into each other."""


def draw(content: dict, directory: Path) -> list[Path]:
    """Draw all that there are records for; return the files written."""
    from matplotlib import rc_context

    paths = []
    with rc_context(TEXT):
        for problem in PROBLEMS:
            runs = [run for run in content[work_precision.PART] if run["problem"] == problem.name]
            if pareto.done(runs):
                paths.append(directory / f"work_precision_{problem.name}.png")
                work_precision_figure(problem, runs, tables.recommendation(content), paths[-1])
        if content["cantilever"]:
            paths.append(directory / "cantilever.png")
            cantilever_figure(content, paths[-1])
        if content[scaling.PART]:
            paths.append(directory / "scaling.png")
            scaling_figure(content[scaling.PART], paths[-1])
    return paths


def work_precision_figure(problem: Problem, runs: list[dict], chosen: Family | None, path: Path) -> None:
    """Draw the error against CPU time of all runs of a problem."""
    figure, axis = figure_of(1, 1, WIDE)
    bar = max(read_file()[problem.name][model]["bar"] for model in {run["model"] for run in runs})
    low = 0.5 * bar
    # what is nearer to the reference than its error bar is all the same, and is drawn within it
    runs = [{**run, "error": max(run["error"], low)} for run in pareto.done(runs)]
    for family in dict.fromkeys(map(Family.of, runs)):
        points = np.array([(r["cpu_time"], r["error"]) for r in runs if Family.of(r) == family]).T
        mark, colour = MARKS[family.model, family.dimension], COLOURS[family.integrator]
        face = "none" if family.adaptive else colour
        axis.plot(*points, mark, color=colour, markersize=7, alpha=0.8, markerfacecolor=face)
    best = [runs[i] for i in pareto.front([(run["cpu_time"], run["error"]) for run in runs])]
    axis.plot(*_columns(best), color=INK, linewidth=1.6, zorder=1, label="Pareto front")
    here = None if chosen is None else pareto.stand_in(chosen, map(Family.of, runs))
    ours = [run for run in runs if Family.of(run) == here]
    if ours:
        style = {"markersize": 13, "markerfacecolor": "none", "markeredgecolor": GOLD, "markeredgewidth": 2.2}
        axis.plot(*_columns(ours), "o", **style, label="recommended default")
    axis.axhline(pareto.AIM, color=GREY, linewidth=1.0, linestyle="--")
    axis.axhspan(0.5 * low, bar, color="0.9", zorder=0, label="within the reference's error bar")
    axis.set(xscale="log", yscale="log", xlabel="CPU time [s]", ylabel=problem.measure.error_label)
    axis.set_title(problem.title)
    axis.set_ylim(bottom=0.5 * low)
    _plain_times(axis)
    axis.grid(color="0.88", which="major")
    keys = [*_keys(map(Family.of, runs)), *axis.get_legend_handles_labels()[0]]
    figure.legend(handles=keys, loc="outside right upper", frameon=False)
    save(figure, path)


def _keys(families: Iterable[Family]) -> list:
    """Return the entries of a legend: a colour for each integrator, a mark for each model and dimension."""
    from matplotlib.lines import Line2D

    families = list(dict.fromkeys(families))
    integrators = dict.fromkeys(family.integrator for family in families)
    shapes = dict.fromkeys((family.model, family.dimension) for family in families)
    colours = [Line2D([], [], color=COLOURS[name], linewidth=6, label=name) for name in integrators]
    marks = [
        Line2D([], [], color=INK, marker=MARKS[shape], linestyle="none", label=f"{shape[0]} {shape[1]}-D")
        for shape in shapes
    ]
    hollow = Line2D([], [], color=INK, marker="o", linestyle="none", markerfacecolor="none", label="adaptive steps")
    return [*colours, *marks, *([hollow] if any(family.adaptive for family in families) else [])]


def cantilever_figure(content: dict, path: Path) -> None:
    """Draw the Pareto fronts of all tools on the common cantilever."""
    figure, axis = figure_of(1, 1, WIDE)
    for (label, runs), colour in zip(tables.cantilever_series(content).items(), SERIES, strict=False):
        runs = [run for run in pareto.done(runs) if run["error"] < 1.0]
        if not runs:
            continue
        best = [runs[i] for i in pareto.front([(run["cpu_time"], run["error"]) for run in runs])]
        ours = label.startswith("this")
        axis.plot(*_columns(runs), "o", color=colour, alpha=0.25, markersize=5, markeredgewidth=0.0)
        line = "-" if ours else "--"
        axis.plot(*_columns(best), line, marker="o", color=colour, linewidth=2.4 if ours else 1.8, label=_folded(label))
    axis.set(xscale="log", yscale="log", xlabel="CPU time of 1 s [s]")
    axis.set_ylabel("rms error of the tip over 0.5 s / length")
    axis.set_title("Common cantilever, 1 s, released from straight")
    _plain_times(axis)
    axis.grid(color="0.88", which="major")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside right upper", frameon=False)
    save(figure, path)


def scaling_figure(records: list[dict], path: Path) -> None:
    """Draw the CPU time of a step against nodes, with slopes."""
    figure, axis = figure_of(1, 1, WIDE)
    steep = scaling.slopes(records, scaling.MANY)
    for ((model, dimension), slope), colour in zip(scaling.slopes(records).items(), SERIES, strict=False):
        points = [r for r in records if (r["model"], r["dimension"]) == (model, dimension)]
        nodes, times = np.array([(r["nodes"], 1e3 * r["cpu_time"]) for r in points]).T
        mark = MARKS[model, dimension]
        many = steep.get((model, dimension))
        label = f"{model} {dimension}-D: slope {slope:.2f}" + (f", {many:.2f} from {scaling.MANY} on" if many else "")
        axis.plot(nodes, times, mark + "-", color=colour, label=label)
    nodes = np.array(sorted({record["nodes"] for record in records}))
    least = min(1e3 * record["cpu_time"] for record in records)
    axis.plot(nodes, 0.7 * least * nodes / nodes[0], color=GREY, linestyle="--", label="proportional to nodes")
    axis.set(xscale="log", yscale="log", xlabel="nodes along the strip", ylabel="CPU time of a step [ms]")
    axis.set_xticks(nodes, [str(n) for n in nodes], minor=False)
    axis.minorticks_off()
    axis.set_title(f"Bilayer that bends, {scaling.INTEGRATOR}, steps of {1e3 * scaling.DT:g} ms")
    axis.grid(color="0.88")
    axis.legend(frameon=False)
    save(figure, path)


def _plain_times(axis) -> None:
    """Mark 1, 2 and 5 of each decade, or 1 alone where there are many decades, as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter

    first, last = axis.get_xlim()
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if last < MANY_DECADES * first else (1.0,)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())


def _columns(runs: list[dict]) -> np.ndarray:
    return np.array([(run["cpu_time"], run["error"]) for run in runs]).T


def _folded(label: str) -> str:
    """Return a legend's entry on two lines."""
    head, _, tail = label.rpartition(", ")
    return f"{head},\n{tail}"
