"""The torture cases of the field, each with what decides it."""

from __future__ import annotations

from bilayer_core.verification.stress.ladder import Torture
from bilayer_core.verification.stress.stress_case import StressCase
from bilayer_core.verification.stress.torture_beams import BEAMS
from bilayer_core.verification.stress.torture_contact import CONTACT
from bilayer_core.verification.stress.torture_friction import FRICTION
from bilayer_core.verification.stress.torture_knot import KNOT
from bilayer_core.verification.stress.torture_motion import MOTION
from bilayer_core.verification.stress.torture_twist import TWIST

TORTURES: tuple[Torture, ...] = tuple(
    sorted((*BEAMS, *TWIST, *KNOT, *MOTION, *FRICTION, *CONTACT), key=lambda torture: torture.number)
)
"""Those that the scene format can express, by their number."""
NOT_EXPRESSIBLE: tuple[tuple[int, str, str], ...] = (
    (
        3,
        "Princeton beam as measured",
        "the measured figures are in none of our sources; flap, lag and twist are held against a Kirchhoff rod instead",
    ),
    (
        8,
        "overhand knots of other crossing numbers",
        "a path of points ties the knot of one crossing number, and would have to be made anew for each",
    ),
    (
        9,
        "knot inversion",
        "no reference decides when the loop of a knot snaps, and it depends on the twist that is tied in, which a path "
        "of points does not set",
    ),
    (11, "mode skipping of a ribbon", "it bends across its width, which a rod cannot; the delay of a snap is decided"),
    (14, "arch of wedge-shaped blocks", "there are no wedges among the surfaces; two leaning boards stand for it"),
    (
        23,
        "bundling flagella",
        "the fluid's drag is local: it carries no flow from one rod to another, which is what draws flagella together",
    ),
)
"""Number, name and reason of what the scene format cannot express, or nothing decides."""


def torture_cases() -> list[StressCase]:
    """Return all of them, on their ladders."""
    return [case for torture in TORTURES for case in torture.cases()]
