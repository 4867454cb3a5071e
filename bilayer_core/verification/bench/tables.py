"""The results as csv and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from bilayer_core.log.file.output_paths import write_text
from bilayer_core.model.plan import RECOMMENDED, make_plan
from bilayer_core.verification.bench import cantilever, commands, pareto, scaling, start, work_precision
from bilayer_core.verification.bench.configurations import Family
from bilayer_core.verification.bench.converged_answers import read_file, sharp
from bilayer_core.verification.bench.problems import PROBLEMS
from bilayer_core.verification.bench.results import PARTS
from bilayer_core.verification.csv_files import write_rows

NONE = "–"


def write_csv(content: dict, directory: Path) -> list[Path]:
    """Write a table DIR/<part>.csv for each part that has records, one line for each record."""
    paths = []
    for part in PARTS:
        if content[part]:
            paths.append(directory / f"{part}.csv")
            write_rows(paths[-1], [_flat(record) for record in content[part]])
    return paths


def write_page(content: dict, directory: Path) -> Path:
    """Write DIR/bench.md; returns its path."""
    path = directory / "bench.md"
    write_text(path, page(content), force=True)
    return path


def page(content: dict) -> str:
    """Return all tables in Markdown, those for the README among them."""
    compared, peers = bool(content[work_precision.PART]), bool(content[cantilever.PART])
    parts = [
        _where(content),
        *(["Quick: reduced problems, few points.", ""] if content["quick"] else []),
        *_section("Common cantilever", cantilever_table(content), peers),
        *_section("CPU time to an error of 1 %", costs_table(content), compared),
        *_section("Adaptive steps beside implicit Euler", beside_table(content), compared),
        *_section("References", references_table(content), compared),
        *_section("CPU time of a step against nodes", scaling_table(content), bool(content[scaling.PART])),
        *_section("First step of a new process", start_table(content), bool(content[start.PART])),
        *_section("Actions of a controller", commands_table(content), bool(content[commands.PART])),
    ]
    return "\n".join(parts) + "\n"


def _section(title: str, table: list[str], wanted: bool) -> list[str]:
    return [f"## {title}", "", *table, ""] if wanted else []


def _where(content: dict) -> str:
    machine, began = content["machine"], content["began"]
    ended = content.get("ended", began)
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items() if number)
    load = f" Load average {began['load'][0]:g} at the start, {ended['load'][0]:g} at the end." if began["load"] else ""
    return (
        f"{began['date'][:10]}, {machine['cpu']}, {machine['cores']} cores, {machine['system']}, Python "
        f"{machine['python']}, {versions}.{load}\n"
    )


def cantilever_table(content: dict) -> list[str]:
    """Return CPU seconds of the cheapest run of each tool that reaches an error."""
    head = [f"≤ {error:.0e}".replace("e-0", "e-") for error in cantilever.ERRORS]
    rows = [[label, *_cheapest_at(runs)] for label, runs in cantilever_series(content).items()]
    return _table(["tool", *head], rows)


def cantilever_series(content: dict) -> dict[str, list[dict]]:
    """Return the runs of the common cantilever by tool: ours by model and dimension, peers by how they are clamped."""
    series: dict[str, list[dict]] = {}
    for run in content[work_precision.PART]:
        if run["problem"] == "cantilever":
            series.setdefault(f"this simulator, {run['model']} {run['dimension']}-D", []).append(run)
    for peer in cantilever.PEERS:
        version = content["machine"]["versions"].get(peer.name)
        for shifted, clamp in ((False, "its own clamp"), (True, "shifted by half an edge")):
            runs = [r for r in content[cantilever.PART] if r["tool"] == peer.name and r["shifted"] is shifted]
            if runs:
                series[f"{peer.label} {version}, {clamp}"] = runs
    return series


def _cheapest_at(runs: list[dict]) -> list[str]:
    cells = []
    for error in cantilever.ERRORS:
        run = pareto.cheapest(runs, error)
        cells.append(NONE if run is None else _seconds(run["cpu_time"]))
    return cells


def costs_table(content: dict) -> list[str]:
    """Return CPU seconds of each family at one per cent, by problem, the best family first."""
    by_problem = pareto.costs(comparable(content))
    names = [problem.name for problem in PROBLEMS if problem.name in by_problem]
    best = {name: min(costs.values()) for name, costs in by_problem.items()}
    rows = []
    for family, score in pareto.scores(by_problem).items():
        cells = []
        for name in names:
            cost = by_problem[name].get(family)
            text = NONE if cost is None else "not reached" if math.isinf(cost) else _seconds(cost)
            cells.append(f"**{text}**" if cost == best[name] and cost is not None and math.isfinite(cost) else text)
        rows.append([family.label, *cells, f"{score:.2g}"])
    return _table(["model, integrator", *names, "mean ratio to the best"], rows)


def beside_table(content: dict) -> list[str]:
    """Return CPU seconds to an error of 1 %, or to that of a blurred reference: the longest fixed steps of implicit
    Euler, and adaptive ones of the default, with the model and the dimension of `auto`.
    """
    rows, bars = [], read_file()
    for problem in PROBLEMS:
        plan = make_plan(problem.config())
        default = Family(plan.model, plan.dimension, plan.integrator, True)
        families = replace(default, integrator="implicit_euler", adaptive=False), default
        ran = [[run for run in _of(content, problem.name) if Family.of(run) == family] for family in families]
        if not all(ran):
            continue
        error = max(pareto.AIM, bars[problem.name][plan.model]["bar"])
        euler, adaptive = (pareto.cheapest(runs, error) for runs in ran)
        ratio = f"{euler['cpu_time'] / adaptive['cpu_time']:.1f}" if euler and adaptive else NONE
        cells = [_beside(run, runs) for run, runs in zip((euler, adaptive), ran, strict=True)]
        rows.append([problem.name, f"{100 * error:.2g} %", *cells, ratio])
    return _table(["problem", "error", "implicit Euler [s]", f"{RECOMMENDED[0]}, adaptive [s]", "ratio"], rows)


def _of(content: dict, problem: str) -> list[dict]:
    return [run for run in content[work_precision.PART] if run["problem"] == problem]


def _beside(run: dict | None, tried: list[dict]) -> str:
    """Return the cost of a run with its step or tolerance; if none is accurate enough, how near the best comes."""
    if run is not None:
        step = f"tolerance {run['tolerance']:g}" if run["dt"] is None else f"{1e3 * run['dt']:g} ms"
        return f"{_seconds(run['cpu_time'])} ({step}, {run['stations']} stations)"
    best = min(pareto.done(tried), key=lambda run: run["error"], default=None)
    return NONE if best is None else f"not within {_seconds(best['cpu_time'])} ({100 * best['error']:.2g} %)"


def references_table(content: dict) -> list[str]:
    """Return the table of the references that errors are measured against."""
    stored = read_file()
    rows = []
    used = dict.fromkeys((run["problem"], run["model"]) for run in content[work_precision.PART])
    for problem in PROBLEMS:
        for model in (model for name, model in used if name == problem.name):
            entry = stored[problem.name][model]
            value = entry["values"][0][0] if len(entry["values"]) == 1 else None
            shown = NONE if value is None else f"{problem.measure.factor * value:.5g} {problem.measure.unit}"
            checks = "; ".join(f"{name}: {difference:.1e}" for name, difference in entry["checks"].items())
            rows.append([problem.name, problem.measure.error_label, model, shown, f"{entry['bar']:.1e}", checks])
    return _table(
        ["problem", "error", "model", "reference", "error bar", "second method, and how far it is away"], rows
    )


def scaling_table(content: dict) -> list[str]:
    """Return the milliseconds a step by nodes, and the slopes."""
    records = content[scaling.PART]
    nodes = sorted({record["nodes"] for record in records})
    steep = scaling.slopes(records, scaling.MANY)
    rows = []
    for (model, dimension), slope in scaling.slopes(records).items():
        times = {r["nodes"]: r["cpu_time"] for r in records if (r["model"], r["dimension"]) == (model, dimension)}
        cells = [f"{1e3 * times[n]:.3g}" if n in times else NONE for n in nodes]
        rows.append([f"{model} {dimension}-D", *cells, f"{slope:.2f}", _slope(steep.get((model, dimension)))])
    head = [f"{n} nodes [ms]" for n in nodes]
    return _table(["model", *head, "slope", f"from {scaling.MANY} nodes on"], rows)


def start_table(content: dict) -> list[str]:
    """Return the seconds from nothing to the first step."""
    rows = [
        [
            record["scene"],
            f"{record['model']} {record['dimension']}-D",
            *(
                f"{record[kind][key]:.2f}"
                for kind in ("cold", "warm")
                for key in ("cpu_time", "wall_time", "compile_time")
            ),
        ]
        for record in content[start.PART]
    ]
    head = [f"{kind}: {what} [s]" for kind in ("cold", "warm") for what in ("CPU", "wall", "of that kernels, CPU")]
    return _table(["scene", "model", *head], rows)


def commands_table(content: dict) -> list[str]:
    """Return actions per CPU second and errors [mm], by scene, shape of ramps, integrator and tolerance."""
    rows = [
        [
            record["scene"],
            record["shape"],
            record["integrator"],
            f"{record['tolerance_factor']:g}",
            f"{record['actions_per_second']:.3g}",
            f"{1e3 * record['error']:.2g}",
        ]
        for record in content[commands.PART]
    ]
    head = ["scene", "ramps", "integrator", "tolerance over the scene's", "actions per CPU second", "rms error [mm]"]
    return _table(head, rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]


def _slope(value: float | None) -> str:
    return NONE if value is None else f"{value:.2f}"


def _seconds(value: float) -> str:
    return f"{value:.2g}"


def _flat(record: dict, prefix: str = "") -> dict:
    """Return a record in which nested records become columns `outer.inner`."""
    found = {}
    for key, value in record.items():
        found |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


def recommendation(content: dict) -> Family | None:
    """Return the family to recommend."""
    return pareto.recommended(comparable(content))


def comparable(content: dict) -> list[dict]:
    """Return the runs of the problems whose references are sharp enough to compare families by."""
    runs = content[work_precision.PART]
    models: dict[str, set[str]] = {}
    for run in runs:
        models.setdefault(run["problem"], set()).add(run["model"])
    return [run for run in runs if sharp(run["problem"], models[run["problem"]])]
