"""The page about stability: what is promised, what was found, by what machine and commit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from bilayer_core.log.file.output_paths import write_text
from bilayer_core.testing.judge import LARGEST_RESIDUAL, MOST_GAIN, MOST_ITERATIONS, MOST_MADE, MOST_REJECTED
from bilayer_core.verification.stress.journal import Journal
from bilayer_core.verification.stress.region import LARGEST_BEND, LARGEST_MACH, LARGEST_STRAIN
from bilayer_core.verification.stress.stress_case import Outcome, Record
from bilayer_core.verification.stress.torture import NOT_EXPRESSIBLE, TORTURES

PAGE = "stability.md"
LEAST_ACCURATE, MOST_REFUSED, LEAST_REMEDIES = 0.70, 0.05, 0.90
"""Parts of the cases inside the region, and of the remedies tried."""

PROMISES = (
    ("positions, velocities", "numbers, at every accepted step"),
    ("gaps", "above zero at every accepted step; nothing passes through anything within one, by an independent check"),
    ("energy without driving", f"T + V rises by less than {MOST_GAIN:g} of the largest energy of the run"),
    ("energy with driving", f"T + V less the work supplied rises by at most {MOST_MADE:g} of the largest"),
    ("energy budget", f"closes to {100 * LARGEST_RESIDUAL:g} % of its largest row inside the region"),
    ("momentum", "of a free flight changes by gravity alone, to √n of Newton's tolerance in n steps"),
    ("effort", f"at most {MOST_ITERATIONS} Newton iterations an attempt, {MOST_REJECTED} attempts a step, on average"),
    ("refusals", "name the cause, the time, the distance to the limit and the remedy"),
)


def worst(records: Sequence[Record], count: int) -> list[Record]:
    """Return the cases to look at first: failures, refusals without a remedy that works, the largest errors inside."""

    def rank(record: Record) -> tuple[int, float]:
        if record.outcome is Outcome.FAILED:
            return 3, 0.0
        if record.outcome is Outcome.REFUSED and not record.remedy_works:
            return 2, 0.0
        return int(record.inside), record.error or 0.0

    return sorted(records, key=rank, reverse=True)[:count]


def counts(records: Sequence[Record]) -> dict[str, Counter]:
    """Return the outcomes inside and outside the region."""
    found = {"inside": Counter(), "outside": Counter()}
    for record in records:
        found["inside" if record.inside else "outside"][record.outcome] += 1
    return found


def remedies(records: Sequence[Record]) -> tuple[int, int]:
    """Return how many refusals there were, and how many of their remedies worked."""
    refused = [record for record in records if record.outcome is Outcome.REFUSED]
    return len(refused), sum(bool(record.remedy_works) for record in refused)


def shortfalls(records: Sequence[Record]) -> list[str]:
    """Return which of the goals are not reached."""
    inside = counts(records)["inside"]
    total, found = sum(inside.values()), []
    failed = sum(record.outcome is Outcome.FAILED for record in records)
    if failed:
        found.append(f"{failed} cases FAILED")
    if total and inside[Outcome.ACCURATE] < LEAST_ACCURATE * total:
        found.append(f"{100 * inside[Outcome.ACCURATE] / total:.1f} % of the cases inside are accurate, wanted 70 %")
    if inside[Outcome.REFUSED] > MOST_REFUSED * total:
        found.append(f"{100 * inside[Outcome.REFUSED] / total:.1f} % of the cases inside are refused, allowed 5 %")
    refused, worked = remedies(records)
    if worked < LEAST_REMEDIES * refused:
        found.append(f"{worked} of {refused} remedies work, wanted 90 %")
    return found


def summary_lines(records: Sequence[Record]) -> Iterator[str]:
    """Yield the lines that a terminal shows at the end."""
    for where, outcomes in counts(records).items():
        total = sum(outcomes.values())
        parts = ", ".join(f"{outcomes[outcome]} {outcome}" for outcome in Outcome)
        yield f"{where} the region of validity: {total} cases, {parts}"
    refused, worked = remedies(records)
    yield f"{refused} refusals, the remedies of {worked} work"


def write_page(journal: Journal, directory: Path) -> Path:
    """Write `stability.md`."""
    path = directory / PAGE
    write_text(path, "\n".join(_page(journal)) + "\n", force=True)
    return path


def _page(journal: Journal) -> Iterator[str]:
    records, head = list(journal.records.values()), journal.head
    yield "# Numerical stability"
    yield ""
    yield "Made by `bilayer stress --out DIR` as DIR/stability.md. The judge and its limits are in"
    yield "`bilayer_core/testing/judge.py`; in `bilayer_core/verification/stress`, `region.py` has the region of"
    yield "validity, `matrix.py` and `torture.py` the cases."
    yield ""
    machine = head["machine"]
    yield f"{len(records)} cases on {machine['cpu']}, {machine['cores']} cores, Python {machine['python']}, "
    yield f"commit {head['commit'] or 'unknown'}, {str(head['date'])[:10]}; "
    yield f"{sum(record.cpu_time for record in records) / 60:.0f} minutes of CPU, reruns and checks included."
    yield ""
    yield "## What is promised"
    yield ""
    yield from _table(("quantity", "promise"), PROMISES)
    yield "Inside the region of validity answers are accurate (their error against a run with a tenth of the tolerance,"
    yield "or a quarter of the step, is below 1 % of a strip's length) or at least stable. The region is decided by"
    yield f"numbers of the scene alone: eigenstrain at most {100 * LARGEST_STRAIN:g} %, curvature × thickness at most"
    yield f"{LARGEST_BEND:g}, impacts at {LARGEST_MACH:g} of the speed of sound, a barrier that holds the weight and"
    yield "the impact, a step or a tolerance that resolves the motion."
    yield ""
    yield from _outcomes(records)
    yield from _extremes(records)
    yield from _worst_cases(records)
    yield from _torture_cases(records)


def _outcomes(records: Sequence[Record]) -> Iterator[str]:
    yield "## Outcomes"
    yield ""
    counted = counts(records)
    for record in records:
        counted.setdefault(f"`{record.name.split('/')[0]}`", Counter())[record.outcome] += 1
    rows = [(name, outcomes.total(), *(outcomes[outcome] for outcome in Outcome)) for name, outcomes in counted.items()]
    yield from _table(("", "cases", *Outcome), rows)
    refused, worked = remedies(records)
    yield f"{refused} cases were refused; what the message says to change was done, and works in {worked} of them."
    yield ""
    yield "![Outcomes by axis](stability_axes.png)"
    yield ""
    yield "![Effort and error](stability_effort.png)"
    yield ""


def _extremes(records: Sequence[Record]) -> Iterator[str]:
    yield "## Extremes"
    yield ""
    figures = (
        ("smallest gap over the barrier distance", "gap_over_barrier", min),
        ("largest rise of energy without driving, over the largest energy", "energy_gain", max),
        ("most energy made by steps, over the largest energy", "numerical", max),
        ("largest residual of the budget inside the region, over its largest row", "budget_residual", max),
        ("largest strain inside the region", "max_strain", max),
        ("most regularised matrices", "regularised", max),
        ("most steps that do not resolve their contact", "unresolved", max),
    )
    rows = []
    for title, key, choose in figures:
        own = [r for r in records if r.figures.get(key) is not None and (r.inside or "inside" not in title)]
        if own:
            extreme = choose(own, key=lambda record: abs(record.figures[key]) if choose is max else record.figures[key])
            rows.append((title, f"{extreme.figures[key]:.3g}", f"`{extreme.name}`"))
    yield from _table(("figure", "value", "case"), rows)


def _worst_cases(records: Sequence[Record]) -> Iterator[str]:
    yield "## The ten worst"
    yield ""
    yield "`bilayer stress` writes them to DIR/worst as scenes; `bilayer stress --scene FILE` runs one again."
    yield ""
    rows = []
    for record in worst(records, 10):
        error = "" if record.error is None else f"{100 * record.error:.2g} %"
        why = (record.reason or record.decision or "; ".join(record.warnings[:1])).splitlines()
        rows.append((f"`{record.name}`", record.outcome, error, why[0] if why else ""))
    yield from _table(("case", "outcome", "error", "why"), rows)


def _torture_cases(records: Sequence[Record]) -> Iterator[str]:
    yield "## Torture cases"
    yield ""
    yield "Scenes in `config/torture`, each on a ladder of steps, stations, stiffness, friction or integrators:"
    yield "`bilayer stress --only 'torture/*'`."
    yield ""
    rows = []
    for torture in TORTURES:
        own = [r for r in records if r.name.startswith(f"torture/{torture.number:02d} ")]
        held = f"{sum(r.outcome is Outcome.ACCURATE for r in own)} of {len(own)}" if own else "not run"
        rows.append((torture.number, torture.name, torture.source, torture.expected, torture.decided, held))
    yield from _table(("", "case", "source", "what must come out", "what decides", "rungs that hold"), rows)
    yield "What scenes cannot express, or nothing sure decides:"
    yield ""
    yield from (f"- {number} {name}: {why}" for number, name, why in NOT_EXPRESSIBLE)
    yield ""


def _table(titles: Sequence[str], rows: Sequence[Sequence[object]]) -> Iterator[str]:
    """Yield the lines of a table and an empty line; a bar within a cell becomes a slash."""
    for row in (titles, ["---"] * len(titles), *rows):
        yield f"| {' | '.join(str(cell).replace('|', '/') for cell in row)} |"
    yield ""
