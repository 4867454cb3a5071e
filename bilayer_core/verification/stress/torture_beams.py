"""Torture cases of single beams at rest: rolled up, and bent out of their plane."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.kirchhoff import angle_between, cantilever
from bilayer_core.verification.stress.ladder import Rung, Torture, balanced
from bilayer_core.verification.stress.stress_case import Decision

Array = np.ndarray


def closes(trial: Trial, statically: bool = False) -> Decision:
    """Return the distance of the tip from the clamp over the length.

    The energy of a bend θ between two edges is EI/(2 l) (2 tan(θ/2))², so a moment M bends it by the part (M l/EI)²/3
    less than M l/EI.
    """
    balanced(trial) if statically else trial.run()
    simulator = trial.simulator
    rod = simulator.scene.rods[0]
    turns = abs(simulator.scene.loads[0].moment[1]) / WHOLE_TURN
    bend = 2.0 * math.pi * turns / (rod.stations - 1)
    gap = float(np.linalg.norm(simulator.positions[-1] - simulator.positions[0])) / rod.path.length
    return Decision("distance of tip and clamp over the length", gap, 0.0, bend**2 / 3.0 + CLOSED)


WHOLE_TURN = 2.6179939e-2
"""2π EI/L of the scene [N m]."""
CLOSED = 5e-3
"""Of the length: what a bending stiffness that is off by half a percent would leave."""


def as_kirchhoff(trial: Trial, statically: bool = False) -> Decision:
    """Return the error of the tip's displacement, or of its turn, whichever is larger."""
    balanced(trial) if statically else trial.run()
    frame, start = trial.simulator.frame(), trial.simulator.model.start_position
    before, along = start[-1] - start[-2], frame.positions[-1] - frame.positions[-2]
    tip, axes = cantilever(trial.simulator.scene)
    turned = angle_between(axes[:, 0], before / np.linalg.norm(before))
    off = float(np.linalg.norm(frame.positions[-1] - tip) / np.linalg.norm(tip - start[-1]))
    off_tangent = angle_between(along / np.linalg.norm(along), axes[:, 0])
    off_normal = angle_between(frame.directors[-1], axes[:, 1])
    worst = max(off, off_tangent / turned, off_normal / turned)
    return Decision("error of the tip's displacement or turn, to a Kirchhoff rod", worst, 0.0, 2e-3)


def _bend(rung: str, *overrides: str, statically: bool = False) -> Rung:
    return Rung(rung, overrides, partial(as_kirchhoff, statically=True) if statically else None)


def _blade(degrees: float, newtons: float) -> tuple[str, ...]:
    angle = math.radians(degrees)
    return (
        f"rods.blade.normal=[0, {math.sin(angle):.9g}, {math.cos(angle):.9g}]",
        f"loads.weight.force=[0, 0, {-newtons}]",
    )


BEAMS = (
    Torture(
        1,
        "roll-up",
        "roll_up",
        "code_aster V6.02.103",
        "closes to a circle",
        "tip within 0.5 % of the length of the clamp, beside what so many bends leave open",
        closes,
        (
            Rung("statics, 41 stations", (), partial(closes, statically=True)),
            Rung("statics, 161 stations", ("rods.strip.stations=161",), partial(closes, statically=True)),
            Rung("in time, plane"),
            Rung("in time, space", ("solver.dimension=3",)),
            Rung("21 stations", ("rods.strip.stations=21",)),
            Rung("implicit Euler, dt 10 ms", ("solver.integrator=implicit_euler", "solver.dt=0.01")),
            Rung("within 50 ms", ("loads.roll.schedule.end=0.05",)),
            Rung("two turns", ("loads.roll.moment=[0, -5.2359878e-2, 0]", "rods.strip.stations=81")),
        ),
    ),
    Torture(
        2,
        "45 degree bend",
        "bathe_bend",
        "Bathe and Bolourchi 1979; kynema",
        "u = (−23.65, 13.72, 53.58) in",
        "displacement and turn of the tip within 0.2 % of a Kirchhoff rod's; that differs from the shear-flexible "
        "reference by less than 0.3 %",
        as_kirchhoff,
        (
            _bend("statics, 21 stations", "rods.beam.stations=21", statically=True),
            _bend("statics, 41 stations", statically=True),
            _bend("statics, 161 stations", "rods.beam.stations=161", statically=True),
            _bend("in time"),
            _bend("in time, implicit Euler, dt 0.2 s", "solver.integrator=implicit_euler", "solver.dt=0.2"),
            _bend("in time, tr_bdf2, tolerance 1e-2", "solver.integrator=tr_bdf2", "solver.tolerance=1e-2"),
        ),
    ),
    Torture(
        3,
        "Princeton beam",
        "princeton",
        "Dowell and Traybar 1975; Bauchau 2015",
        "flap, lag and twist as measured",
        "displacement and turn of the tip within 0.2 % of a Kirchhoff rod's, not of the measured ones",
        as_kirchhoff,
        (
            *(
                _bend(f"statics, {degrees:g} degrees, {newtons:g} N", *_blade(degrees, newtons), statically=True)
                for degrees, newtons in ((15, 4.448), (30, 8.896), (45, 13.345), (60, 13.345), (75, 13.345))
            ),
            _bend("in time, 45 degrees, 13.345 N", *_blade(45, 13.345)),
            _bend("in time, 161 stations", "rods.blade.stations=161", *_blade(60, 13.345)),
        ),
    ),
)
