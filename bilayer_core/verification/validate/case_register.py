"""All cases, family by family: a new family is a file with its `CASES`, and a line here."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fnmatch import fnmatch

from bilayer_core.errors import InputError
from bilayer_core.verification.validate import (
    beams,
    bending,
    contacts,
    diffusion_series,
    ends,
    fluid,
    friction,
    gradients,
    helix,
    impacts,
    joints,
    jumps,
    laminate,
    light,
    loads,
    mechanisms,
    motion,
    paths,
    plane,
    poses,
    profiles,
    reactions,
    ribbons,
    rings,
    sheared,
    stability,
    starts,
    strips,
    torsion,
    unlike,
    viscosity,
)
from bilayer_core.verification.validate.validation_case import Case, Result

FAMILIES = (
    bending,
    helix,
    ends,
    impacts,
    joints,
    torsion,
    laminate,
    unlike,
    beams,
    plane,
    loads,
    stability,
    gradients,
    mechanisms,
    profiles,
    reactions,
    poses,
    paths,
    rings,
    starts,
    contacts,
    ribbons,
    strips,
    sheared,
    friction,
    motion,
    jumps,
    viscosity,
    fluid,
    light,
    diffusion_series,
)
CASES = tuple(case for family in FAMILIES for case in family.CASES)


def select(pattern: str | None = None, quick: bool = False) -> list[Case]:
    """Return the cases whose name contains `pattern`, or matches it where it has wildcards; without the long ones on
    request.

    Raises InputError if there is none.
    """
    text = (pattern or "").casefold()
    if any(sign in text for sign in "*?["):
        found = [case for case in CASES if fnmatch(case.name.casefold(), text)]
    else:
        found = [case for case in CASES if text in case.name.casefold()]
    found = [case for case in found if not (quick and case.long)]
    if not found:
        families = ", ".join(dict.fromkeys(case.family for case in CASES))
        raise InputError(
            f"--only: no case matches {pattern!r}; a part of a name is allowed, such as one of: {families}"
        )
    return found


def run(cases: Iterable[Case], show: Callable[[Result], None]) -> list[Result]:
    """Run cases one after the other; `show` sees each result at once."""
    results = []
    for case in cases:
        results.append(case.run())
        show(results[-1])
    return results
