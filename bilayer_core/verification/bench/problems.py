"""The problems: a scene each, and by what its error is judged. A new one is an entry of `PROBLEMS`.

Scenes are bundled ones, changed where a shorter or livelier run tells more; robots keep what they do.
"""

from __future__ import annotations

from dataclasses import dataclass

from bilayer_core.errors import InputError
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.faults import suggestion
from bilayer_core.scene.loader import load_scene
from bilayer_core.verification.bench.configurations import Configuration, Family
from bilayer_core.verification.bench.track import Headline, Measure, Trajectory, advance, rise

TOLERANCES = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
TOLERANCES_OF_A_MESH = 3
QUICK_TOLERANCES = (1e-4,)


@dataclass(frozen=True)
class Problem:
    """A benchmark problem."""

    name: str
    title: str
    scene: str  # Name of a bundled scene
    changes: tuple[str, ...]  # Overrides, ``PATH=VALUE`` each
    rod: str  # Whose stations are varied
    duration: float  # Simulated time [s]
    measure: Measure
    levels: tuple[tuple[int, tuple[float, ...]], ...]
    """Meshes (stations) with the steps [s] that are tried on each, coarse to fine."""
    reference_levels: tuple[tuple[int, float], ...]
    """Stations and steps [s] of the runs whose limit is the reference: edges doubled and steps halved from each to
    the next. Where a layer ends within the rod, a station of each of these meshes stands there: otherwise its
    length would change with the mesh, and nothing converge.
    """
    second: str = "generalised_alpha"  # The integrator that checks the reference
    tolerances: tuple[float, ...] = TOLERANCES  # Of adaptive steps; each finer mesh begins with the next of them
    integrators: tuple[str, ...] = tuple(INTEGRATORS)
    euler_levels: tuple[tuple[int, tuple[float, ...]], ...] = ()
    """More levels for implicit Euler: it wants shorter steps where motion is fast, and does with longer ones where a
    robot is all but at rest.
    """
    quick_levels: tuple[tuple[int, tuple[float, ...]], ...] = ()
    """Those of a quick benchmark; none: the problem is not part of it."""

    def config(self, stations: int | None = None, *more: str) -> SceneConfig:
        """Return the scene, with a mesh."""
        mesh = () if stations is None else (f"rods.{self.rod}.stations={stations}",)
        return load_scene(self.scene, [*self.changes, *mesh, *more])

    def configurations(self, family: Family, quick: bool) -> list[Configuration]:
        """Return the runs of a family."""
        levels = self.quick_levels if quick else self.levels
        found = []
        for number, (stations, steps) in enumerate(levels):
            if family.adaptive:
                steps = QUICK_TOLERANCES if quick else self.tolerances[number : number + TOLERANCES_OF_A_MESH]
            found += [Configuration(family, stations, step) for step in steps]
        if family.integrator == "implicit_euler" and not (quick or family.adaptive):
            found += [Configuration(family, stations, step) for stations, steps in self.euler_levels for step in steps]
        return found


def halved(stations: int, dt: float, count: int) -> tuple[tuple[int, float], ...]:
    """Return the levels of a reference: edges doubled and steps halved `count` - 1 times."""
    return tuple(((stations - 1) * 2**k + 1, dt / 2**k) for k in range(count))


SNAP = (
    "stimuli.swelling.schedule={type: ramp, start: 0 s, end: 20 ms, from: 0, to: 1}",
    "rods.strip.layers.active.eigenstrain.gain=5 %",
    "rods.strip.section=beam",  # as its reference, and the splines that check it
)
FAST_GRIP = (
    "stimuli.humidity.schedule={type: ramp, start: 0 s, end: 2.66 s, from: 0, to: 1}",
    "bodies.hub.motion.times=[2.7 s, 3.3 s]",
)
ONE_ARM = ("rods.arm.pattern.count=1", "bodies.hub.motion.mass=0.11875 g")
"""An eighth of the swimmer moves as the whole (tests/robots/test_swimming.py)."""
OF_ROBOTS = ("implicit_euler", "sdirk2", "generalised_alpha")
"""Integrators tried on robots: the paper's, and of those of second order one of two stages and one of a single one."""
ROBOT_TOLERANCES = (1e-3, 2e-4, 5e-5)
STRIDE, STROKE = 2.4, 0.6  # periods [s]

PROBLEMS = (
    Problem(
        "cantilever",
        "Cantilever released from straight, 1 s",
        "cantilever",
        (),
        "strip",
        1.0,
        Trajectory("tip", until=0.5, spacing=2e-3, length=0.1),
        levels=(
            (11, (8e-3, 4e-3, 2e-3)),
            (21, (8e-3, 4e-3, 2e-3, 1e-3)),
            (41, (4e-3, 2e-3, 1e-3, 5e-4)),
            (81, (1e-3, 5e-4)),
            (101, (1e-3, 5e-4)),
        ),
        euler_levels=((21, (2.5e-4, 1.25e-4)), (41, (2.5e-4, 1.25e-4))),
        reference_levels=halved(51, 5e-4, 3),
        quick_levels=((21, (4e-3,)), (41, (4e-3, 2e-3))),
    ),
    Problem(
        "snap",
        "Bilayer snaps into an arc of 215° within 20 ms",
        "bending",
        SNAP,
        "strip",
        0.2,
        Trajectory("com", until=0.2, spacing=1e-3, length=0.1),
        levels=(
            (11, (4e-3, 2e-3, 1e-3)),
            (21, (4e-3, 2e-3, 1e-3, 5e-4)),
            (41, (2e-3, 1e-3, 5e-4, 2.5e-4)),
        ),
        euler_levels=((11, (2.5e-4, 1.25e-4)), (21, (2.5e-4, 1.25e-4)), (41, (1.25e-4,))),
        reference_levels=halved(21, 5e-4, 3),
        quick_levels=((11, (2e-3,)), (21, (2e-3, 1e-3))),
    ),
    Problem(
        "helix",
        "Helical layer on a straight one winds up, 0.2 s",
        "helix",
        (),
        "strip",
        0.2,
        Trajectory("com", until=0.2, spacing=1e-3, length=0.23),
        levels=((24, (4e-3, 2e-3, 1e-3)), (47, (2e-3, 1e-3, 5e-4)), (93, (1e-3, 5e-4))),
        euler_levels=((24, (5e-4, 2.5e-4)), (47, (2.5e-4, 1.25e-4))),
        reference_levels=halved(24, 1e-3, 4),
    ),
    Problem(
        "gripping",
        "Gripper closes on the ball and lifts it, five times as fast",
        "gripping",
        FAST_GRIP,
        "arm",
        3.5,
        Trajectory("tip", until=3.5, spacing=2e-2, length=0.0539),
        levels=((25, (4e-3, 2e-3)), (50, (4e-3, 2e-3, 1e-3)), (99, (2e-3,))),
        euler_levels=((25, (28e-3, 14e-3, 7e-3)), (50, (14e-3,))),
        reference_levels=halved(50, 1e-3, 3),
        integrators=OF_ROBOTS,
        tolerances=ROBOT_TOLERANCES,
    ),
    Problem(
        "crawling",
        "Inchworm, second stride",
        "crawling_inchworm",
        (),
        "body",
        2 * STRIDE,
        Headline("the stride", "mm", 1e3, advance("com", 0, STRIDE, 2 * STRIDE), (STRIDE,)),
        levels=((40, (16e-3, 8e-3, 4e-3)), (80, (16e-3, 8e-3, 4e-3, 2e-3)), (159, (4e-3,))),
        euler_levels=((80, (64e-3, 32e-3)),),
        reference_levels=halved(80, 4e-3, 3),
        integrators=OF_ROBOTS,
        tolerances=ROBOT_TOLERANCES,
        quick_levels=((80, (16e-3,)),),
    ),
    Problem(
        "jumping",
        "Jumper with a film that damps, rise of its mass centre",
        "jumping",
        ("materials.film.retardation_time=0.2ms",),
        "loop",
        1.3,
        Headline("the rise", "mm", 1e3, rise),
        levels=((26, (2e-3, 1e-3)), (51, (2e-3, 1e-3, 5e-4)), (101, (5e-4,))),
        euler_levels=((51, (2.5e-4, 6.25e-5)),),
        reference_levels=halved(51, 1.25e-4, 3),
        integrators=OF_ROBOTS,
        tolerances=ROBOT_TOLERANCES,
    ),
    Problem(
        "swimming",
        "Swimmer, second stroke",
        "swimming",
        ONE_ARM,
        "arm",
        2 * STROKE,
        Headline("the stroke", "mm", 1e3, advance("com", 2, STROKE, 2 * STROKE), (STROKE,)),
        levels=((20, (10e-3, 4e-3, 2e-3)), (40, (10e-3, 4e-3, 2e-3, 1e-3)), (79, (4e-3, 2e-3))),
        euler_levels=((20, (5e-4, 2.5e-4, 1.25e-4)), (40, (5e-4, 2.5e-4, 1.25e-4))),
        reference_levels=halved(40, 2e-3, 3),
        integrators=OF_ROBOTS,
        tolerances=ROBOT_TOLERANCES,
    ),
)


def problem(name: str) -> Problem:
    """Return the problem of this name. Raises InputError if there is none."""
    names = [each.name for each in PROBLEMS]
    if name not in names:
        raise InputError(f"{name}: no such problem{suggestion(name, names)}; there are {', '.join(names)}")
    return PROBLEMS[names.index(name)]
