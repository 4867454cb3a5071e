"""Figures 3 and 4 of the paper, and how two rods come near the laminate, from the cases; matplotlib is needed here and
nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np

from bilayer_core.log.file.output_paths import draft_of
from bilayer_core.scene.config import Coupling
from bilayer_core.verification.validate import bending, helix, laminate
from bilayer_core.verification.validate.closed_forms import bonded_helix, timoshenko, timoshenko_as_printed
from bilayer_core.verification.validate.torsion import MESHES
from bilayer_core.verification.validate.validation_case import Case

INK, BLUE, ORANGE, GREY = "#222222", "#1f77b4", "#d95f02", "#999999"
DPI = 150
TURNS, TURN_STATIONS = 1.5, 151


def draw(cases: Iterable[Case], directory: Path) -> list[Path]:
    """Draw what belongs to the families of these cases; return the files written."""
    families = {case.family for case in cases}
    wanted = [(name, figure) for family, name, figure in FIGURES if family in families]
    paths = []
    for name, figure in wanted:
        paths.append(directory / name)
        figure(paths[-1])
    return paths


def bending_figure(path: Path) -> None:
    """Draw Fig. 3: normalised curvature against ratios of modulus and of thickness."""
    figure, axes = figure_of(1, 2, (9.0, 3.8))
    fine = np.logspace(-1.0, 1.0, 200)
    for axis, (sweep, ratios), label in zip(
        axes, bending.SWEEPS.items(), ("modulus ratio m = E₂/E₁", "thickness ratio n = h₂/h₁"), strict=True
    ):
        pairs = [(x, 1.0) if sweep == "m" else (1.0, x) for x in fine]
        axis.plot(fine, [timoshenko(*pair) for pair in pairs], color=INK, label="Timoshenko")
        printed = [timoshenko_as_printed(*pair) for pair in pairs]
        axis.plot(fine, printed, color=GREY, linestyle=":", label="the same as the paper prints it")
        for (model, (compute, _)), mark, colour in zip(bending.MODELS.items(), "ox", (BLUE, ORANGE), strict=True):
            values = [compute(m, n, bending.FIGURE_STRAIN) for m, n in ratios]
            filled = {"markerfacecolor": "none"} if mark == "o" else {}
            axis.plot(bending.RATIOS, values, mark, color=colour, markersize=7, label=model, **filled)
        axis.set(xscale="log", xlabel=label, ylabel="κh/η", ylim=(0.0, 1.6))
        axis.grid(color="0.9")
    axes[0].legend(frameon=False, fontsize=8, loc="lower center")
    save(figure, path)


def helix_figure(path: Path) -> None:
    """Draw Fig. 4: ribbons of a turn and a half as computed, and helices of least energy."""
    figure, axes = figure_of(2, 3, (9.0, 6.4), projection="3d")
    for row, torsion in zip(axes, helix.TORSIONS, strict=True):
        for axis, natural in zip(row, helix.NATURAL, strict=True):
            radius, pitch = bonded_helix(*natural, torsion)
            length = TURNS * math.hypot(2.0 * math.pi * radius, pitch)
            points, across = helix.equilibrium(torsion, *natural, TURN_STATIONS, length)
            axes_of_helix, origin = _axis(points)
            points, across = 1e3 * (points - origin) @ axes_of_helix, across @ axes_of_helix
            edges = points[None] + 5.0 * np.array([-1.0, 1.0])[:, None, None] * across
            axis.plot_surface(*np.moveaxis(edges, -1, 0), color=BLUE, alpha=0.55, linewidth=0.0)
            axis.plot(*_ideal_helix(points, 1e3 * radius, 1e3 * pitch).T, color=INK, linewidth=1.0)
            axis.set_title(
                f"torsion: {torsion}, χ = {natural[0]:g}, τ = {natural[1]:g} 1/m\n"
                f"radius {1e3 * radius:.1f} mm, pitch {1e3 * pitch:.0f} mm",
                fontsize=8,
            )
            axis.set_aspect("equal")
            axis.tick_params(labelsize=6)
            axis.locator_params(nbins=4)
    figure.suptitle("ribbons: two bonded rods; lines: helices of least energy [mm]", fontsize=9)
    save(figure, path)


def laminate_figure(path: Path) -> None:
    """Draw how far two bonded rods are from the laminate, against the stiffness of their bond."""
    figure, axis = figure_of(1, 1, (6.4, 4.2))
    curves = {f"grows by a wave, {edges} edges": partial(laminate.wave, edges) for edges in MESHES}
    for (label, compute), shade in zip(curves.items(), ("#9ecae1", "#4292c6", "#08519c"), strict=True):
        axis.plot(laminate.MULTIPLES, _apart(compute), "o-", color=shade, markersize=5, label=label)
    uniform = f"grows uniformly, {laminate.EDGES} edges"
    axis.plot(laminate.MULTIPLES, _apart(laminate.uniform), "s-", color=ORANGE, markersize=5, label=uniform)
    axis.axvline(Coupling().translation, color=GREY, linestyle=":")
    axis.annotate("default", (Coupling().translation, 0.3), (5, 0), textcoords="offset points", color=GREY, fontsize=9)
    axis.set(
        xscale="log",
        yscale="log",
        ylim=(1e-7, 1.0),
        xlabel="stiffness of the bond, as a multiple of the section's own",
        ylabel="relative difference of curvature",
    )
    axis.grid(color="0.9")
    axis.legend(frameon=False, fontsize=9, loc="lower left")
    save(figure, path)


def _apart(compute: Callable[[float | None], float]) -> list[float]:
    return [abs(compute(multiple) / compute(None) - 1.0) for multiple in laminate.MULTIPLES]


def _axis(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the axes of a helix as columns, the last along it, the first towards the middle of its points; a point on
    it.
    """
    center, step = len(points) // 2, len(points) // 6
    r = points[center - step : center + 2 * step + 1 : step]
    d = np.diff(r, axis=0)
    axis = np.cross(d[1] - d[0], d[2] - d[1])
    axis /= np.linalg.norm(axis)
    axis *= np.sign(axis @ d[1])
    chord = d[1] - (d[1] @ axis) * axis
    inward = np.cross(axis, chord)
    inward *= np.sign(inward @ (d[2] - d[0])) / np.linalg.norm(inward)
    radius, _ = helix.screw(r)
    angle = 2.0 * math.asin(min(1.0, 0.5 * np.linalg.norm(chord) / radius))
    origin = 0.5 * (r[1] + r[2]) + radius * math.cos(0.5 * angle) * inward
    return np.column_stack([-inward, np.cross(axis, -inward), axis]), origin


def _ideal_helix(points: np.ndarray, radius: float, pitch: float) -> np.ndarray:
    """Return the helix of given radius and pitch about z through the middle of points, along them, shape (400, 3)."""
    center = len(points) // 2
    x, d = points[center], points[center + 1] - points[center]
    sense = np.sign(x[0] * d[1] - x[1] * d[0])
    z = np.linspace(points[:, 2].min(), points[:, 2].max(), 400)
    angle = math.atan2(x[1], x[0]) + sense * 2.0 * math.pi * (z - x[2]) / pitch
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def figure_of(rows: int, columns: int, size: tuple[float, float], **axes):
    """Return a figure of `size` [in] without a window, and its axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, subplot_kw=axes)


def save(figure, path: Path) -> None:
    with draft_of(path, force=True) as draft:
        figure.savefig(draft, dpi=DPI)


FIGURES = (
    ("bending", "fig3.png", bending_figure),
    ("helix", "fig4.png", helix_figure),
    ("laminate", "two_rods.png", laminate_figure),
)
"""Family, file name and function of each figure."""
