"""Torture cases of twisted rods: when they leave a plane or a line, and what is kept when they coil up.

*Plectoneme*: two helices of the radius r and the angle a to their common axis have the curvature sin²a/r and the
writhe sin 2a/(4π r) per length of rod. Without friction, the energy of a length l of rod in them, less the work of
torque and tension, is (½ B sin⁴a/r² + T − ½ M sin 2a/r) l. It does not change with a,

    M = 2 B/r sin³a cos a/cos 2a,

nor with l, so T = B/r² sin⁴a (½ + 1/cos 2a).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.kirchhoff import stiffness
from bilayer_core.verification.stress.ladder import Rung, Torture, first_broken
from bilayer_core.verification.stress.linking import gauss_integral, longer, twist
from bilayer_core.verification.stress.stress_case import Decision

Array = np.ndarray
X = np.array([1.0, 0.0, 0.0])


def torque(trial: Trial) -> float:
    """Return C τ of the natural twist of a rod that cannot untwist [N m]."""
    scene = trial.simulator.scene
    return float(stiffness(scene)[0] * scene.rods[0].layers[0].natural_twist)


def leaves_plane(trial: Trial) -> Decision:
    """Return how far a twisted ring gets out of its plane, over its radius."""
    scene = trial.simulator.scene
    radius, largest = scene.rods[0].path.radius, 0.0

    def look(_: float) -> None:
        nonlocal largest
        largest = max(largest, float(np.ptp(trial.simulator.positions[:, 1])) / radius)

    trial.run(each_step=look)
    part = torque(trial) / (math.sqrt(3.0) * stiffness(scene)[2] / radius)
    return _on_its_side(f"way out of the plane over the radius at {part:.3g} of √3 B/R", largest, part)


STAYS, LEAVES = 2e-3, 0.02
"""Parts of a length: of what stays where it is but for its imperfection, and of what has buckled."""


def _on_its_side(what: str, deflection: float, part: float) -> Decision:
    """Decide that a deflection is small below the critical torque, or large above it."""
    return Decision(what, deflection, *((0.0, STAYS) if part < 1.0 else (LEAVES, math.inf)))


def critical_torque(tension: float) -> float:
    """Return M L/B at which a clamped rod under T L²/B buckles: the smallest root of its characteristic determinant.

    Deflections are a + b s + c exp(i k₁ s) + d exp(i k₂ s), k = ½ (M ± √(M² − 4 T)); at s = ±½ they and their slopes
    are zero. Without tension k₂ = 0 would be a double root, so a little is put in.
    """
    tension = max(tension, 1e-6)

    def determinant(m: float) -> float:
        k = 0.5 * (m + np.array([1.0, -1.0]) * math.sqrt(m * m - 4.0 * tension))
        wave = [np.exp(0.5j * k * side) for side in (-1.0, 1.0)]
        rows = [[1.0, side, *w] for side, w in zip((-0.5, 0.5), wave, strict=True)]
        rows += [[0.0, 1.0, *(1j * k * w)] for w in wave]
        return float(np.linalg.det(np.array(rows)).imag)  # its complex conjugate is its opposite

    least = 2.0 * math.sqrt(tension) + 0.5
    tried = np.linspace(least, least + 20.0, 2001)
    values = [determinant(m) for m in tried]
    first = next(i for i in range(len(tried) - 1) if values[i] * values[i + 1] < 0.0)
    return float(brentq(determinant, tried[first], tried[first + 1]))


def leaves_line(trial: Trial) -> Decision:
    """Return how far a twisted rod gets from its line, over its length."""
    simulator, scene = trial.simulator, trial.simulator.scene
    length, largest = scene.rods[0].path.length, 0.0

    def look(_: float) -> None:
        nonlocal largest
        largest = max(largest, float(np.linalg.norm(simulator.positions[:, 1:], axis=1).max()) / length)

    trial.run(each_step=look)
    bending = float(stiffness(scene)[2])
    tension = scene.loads[0].force[0] if scene.loads else 0.0
    critical = critical_torque(tension * length**2 / bending)
    part = torque(trial) * length / bending / critical
    return _on_its_side(f"way from the line over the length at {part:.3g} of {critical:.4g} B/L", largest, part)


def turned(trial: Trial) -> float:
    """Return the total turns of the ends against each other, right-handed."""
    by = {
        body.name: body.motion.rotations for body in trial.simulator.scene.bodies if hasattr(body.motion, "rotations")
    }
    last = {name: rotations[-1][0] if rotations else 0.0 for name, rotations in by.items()}
    return (last.get("right", 0.0) - last.get("left", 0.0)) / (2.0 * math.pi)


def link(trial: Trial) -> tuple[float, float]:
    """Return the twist + writhe of the rod at present, and its writhe alone [turns].

    The directors of edges are those of their middles; at both ends the bodies that hold them say where they are.
    """
    simulator = trial.simulator
    frame, normal = simulator.frame(), np.array(simulator.scene.rods[0].normal)
    first, last = Rotation.from_quat(frame.body_quaternions[:2]).apply(normal)
    points = longer(frame.positions, X)
    bent = gauss_integral(points, points)
    return twist(points, np.concatenate([[first], frame.directors, [last]])) + bent, bent


def keeps_link(trial: Trial) -> Decision:
    """Return the twist + writhe at the end against the turns of the end."""
    trial.run()
    found, bent = link(trial)
    kept = Decision.near("turns of twist and writhe together", found, turned(trial), LINK)
    return first_broken(kept, Decision("turns of writhe alone", abs(bent), COILED, math.inf))


LINK = 1e-4
"""Relative, of the ends that are thought to go on straight; a passage of the rod through itself changes two turns."""
COILED = 0.3
"""Turns of writhe of what has buckled."""


def ply(tension: float, bending: float, radius: float) -> tuple[float, float]:
    """Return the angle [rad] and torque [N m] of a plectoneme under a tension [N]."""
    scale = tension * radius**2 / bending
    a = brentq(lambda a: math.sin(a) ** 4 * (0.5 + 1.0 / math.cos(2.0 * a)) - scale, 1e-6, 0.25 * math.pi - 1e-9)
    return a, 2.0 * bending / radius * math.sin(a) ** 3 * math.cos(a) / math.cos(2.0 * a)


def winds_up(trial: Trial) -> Decision:
    """Return the torque in a plectoneme, whose radius is half the distance of the strands where they touch."""
    trial.run()
    simulator, scene = trial.simulator, trial.simulator.scene
    kept = Decision.near("turns of twist and writhe together", link(trial)[0], turned(trial), LINK)
    gap = simulator.frame().min_gap
    radius = 0.5 * (scene.rods[0].layers[0].thickness + gap)
    _, expected = ply(scene.loads[0].force[0], float(stiffness(scene)[2]), radius)
    found = abs(float(simulator.clamps["thread.start"].wrench[3]))
    return first_broken(Decision.near("torque of the plectoneme", found, expected, 0.03, "N m"), kept)


def _twists(key: str, *parts: float, critical: float) -> list[tuple[str, str]]:
    return [(f"{part:g} of the critical torque", f"{key}={part * critical:.6g}") for part in parts]


RING_TWIST, ROD_TWIST, PULLED_TWIST = 61.5955, 79.896, 104.916
"""Critical twists of the scenes [rad/m], by which rungs are set; what decides is computed anew."""
TWIST = (
    Torture(
        4,
        "twisted ring",
        "twisted_ring",
        "Michell 1889; Zajac 1962",
        "stays planar below 2π√3 B/C, leaves the plane above",
        "way out of the plane below 0.2 % of the radius at 0.9 and 0.97 of √3 B/R, above 2 % at 1.03 and 1.1",
        leaves_plane,
        (
            *(
                Rung(name, (change,))
                for name, change in _twists(
                    "rods.ring.layers.gel.natural_twist", 0.9, 0.97, 1.03, 1.1, critical=RING_TWIST
                )
            ),
            Rung(
                "1.1, 121 stations",
                (f"rods.ring.layers.gel.natural_twist={1.1 * RING_TWIST}", "rods.ring.stations=121"),
            ),
            Rung(
                "0.97, 121 stations",
                (f"rods.ring.layers.gel.natural_twist={0.97 * RING_TWIST}", "rods.ring.stations=121"),
            ),
            Rung(
                "1.1, implicit midpoint",
                (
                    f"rods.ring.layers.gel.natural_twist={1.1 * RING_TWIST}",
                    "solver.integrator=implicit_midpoint",
                    "solver.dt=0.002",
                ),
            ),
        ),
    ),
    Torture(
        5,
        "twisted rod under tension",
        "greenhill",
        "Greenhill 1883",
        "growth changes sign at the critical twist",
        "deflection below 0.2 % of the length at 0.9 and 0.97 of the torque of its characteristic equation, above 2 % "
        "at 1.03 and 1.1",
        leaves_line,
        (
            *(
                Rung(name, (change, "loads=[]"))
                for name, change in _twists(
                    "rods.thread.layers.gel.natural_twist", 0.9, 0.97, 1.03, 1.1, critical=ROD_TWIST
                )
            ),
            *(
                Rung(f"{name}, T = 20 B/L²", (change,))
                for name, change in _twists("rods.thread.layers.gel.natural_twist", 0.97, 1.03, critical=PULLED_TWIST)
            ),
            Rung(
                "1.1, implicit Euler, dt 5 ms",
                (
                    f"rods.thread.layers.gel.natural_twist={1.1 * ROD_TWIST}",
                    "loads=[]",
                    "solver.integrator=implicit_euler",
                    "solver.dt=0.005",
                ),
            ),
        ),
    ),
    Torture(
        6,
        "twist buckling",
        "link",
        "newton; Călugăreanu, White",
        "link = twist + writhe kept",
        "twist + writhe, by the Gauss integral, within 1e-4 of the turns of the end, of which some are writhe",
        keeps_link,
        (
            Rung("4 turns"),
            Rung("8 turns", ("bodies.right.motion.rotations=[[0, 0, 0], [50.265482, 0, 0]]",)),
            Rung("4 turns, 161 stations", ("rods.thread.stations=161",)),
            Rung("4 turns, implicit Euler, dt 5 ms", ("solver.integrator=implicit_euler", "solver.dt=0.005")),
            Rung("4 turns, tolerance 1e-2", ("solver.tolerance=1e-2",)),
            Rung("4 turns within 0.2 s", ("bodies.right.motion.times=[0, 0.2]",)),
        ),
    ),
    Torture(
        7,
        "plectoneme",
        "plectoneme",
        "Clauvelin, Audoly and Neukirch 2009",
        "ply angle and torque follow from the tension",
        "torque within 3 % of that of two helices of the contact radius, and the link kept",
        winds_up,
        (
            Rung("10 turns"),
            Rung("12 turns", ("bodies.left.motion.rotations=[[0, 0, 0], [75.398224, 0, 0]]",)),
            Rung("10 turns, half the tension", ("loads.tension.force=[0.08, 0, 0]",)),
            Rung("10 turns, 201 stations", ("rods.thread.stations=201",)),
            Rung("10 turns, implicit Euler, dt 10 ms", ("solver.integrator=implicit_euler", "solver.dt=0.01")),
        ),
    ),
)
