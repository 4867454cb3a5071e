"""How a recording is shown: views, camera, and the text beside them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Description
from bilayer_core.observed.system import versions
from bilayer_core.view.arrows import reaction_arrows
from bilayer_core.view.camera import is_worth_following
from bilayer_core.view.colouring import Colouring
from bilayer_core.view.scales import Scales, place_moving_eye
from bilayer_core.view.theme import BACKGROUND

TIMELINE = "sim_time"
MIDDLE = "world/middle"
"""Entity that the camera follows."""
EVENTS = "events"
GRAVITY = "gravity"
LEGEND_ROOM = 0.6
"""Empty time to the right of the curves, by the time that they take: the legend stands there and covers none."""
LEAST_ROWS = 3
"""Height of a plot in lines of text, its title among them; one with more curves is higher."""
CHANNEL_COLOURS = (
    (90, 168, 255),
    (255, 159, 67),
    (64, 224, 148),
    (255, 107, 129),
    (190, 140, 255),
    (240, 220, 90),
    (120, 220, 230),
    (210, 210, 210),
)


@dataclass(frozen=True)
class Plot:
    """Axes of curves over time."""

    path: str  # Entity of the curves, below ``plots/``
    title: str  # With the unit
    curves: int = 1  # How many there may be


def energy_groups(run: RunData, known: Collection[str] = ()) -> dict[str, dict[str, np.ndarray]]:
    """Return the energies that ever act, or are `known` to, by name of the axes that show them [mJ]: gravity, whose
    zero is anywhere, would flatten the others.
    """
    acting = {name: 1e3 * values for name, values in run.energy.items() if name in known or np.any(values)}
    groups = {
        "energy": {name: values for name, values in acting.items() if name != GRAVITY},
        GRAVITY: {name: values for name, values in acting.items() if name == GRAVITY},
    }
    return {group: series for group, series in groups.items() if series}


def entity_name(name: str) -> str:
    """Return the entity name of a curve in the recording."""
    return name.split(" [")[0].replace(" ", "_").replace(",", "")


def blueprint(run: RunData, scales: Scales, colouring: Colouring) -> rrb.Blueprint:
    """Return the layout of a finished run.

    The robot is large at the left, over its legend. Curves are at the right, in tabs, with axes for each energy and
    with the events.
    """
    description = run.description
    plots = [Plot("stimulus", "Stimulus", len(description.channels))] if description.channels else []
    bodies = len(description.bodies)
    plots += [Plot("contact_force", "Contact force [N]", bodies + 1)] if run.contact_forces.any() else []
    plots += [Plot("clamp_force", "Force on clamps [N]", bodies)] if run.clamp_wrenches.any() else []
    groups = energy_groups(run)
    plots += [Plot("height", "Height of mass centres [mm]", bodies + 1)]
    plots += [Plot(name, f"{name.capitalize()} [mJ]", len(series)) for name, series in groups.items()]
    plots += [Plot("solver", "Solver", 2)]
    alone = [
        Plot(f"{group}/{entity_name(name)}", f"{name} [mJ]") for group, series in groups.items() for name in series
    ]
    curves = Curves.between(float(run.times[0]), float(run.times[-1]))
    return arranged(_robot(run, scales), colouring.title, curves, plots, alone, events=bool(run.events))


@dataclass(frozen=True)
class Curves:
    """Which part of the time plots show: the right part of their axes stays empty, for the legend."""

    axis: rr.TimeRange  # What axes of time span
    shown: rr.VisibleTimeRange | None = None  # Of which times there are curves; all of them if it is None

    @classmethod
    def between(cls, begin: float, end: float) -> Curves:
        """Return the curves of a run that is over, by the times of its first and last frame [s]."""
        moment = rr.TimeRangeBoundary.absolute
        room = LEGEND_ROOM * (end - begin) or 1.0
        return cls(rr.TimeRange(start=moment(seconds=begin), end=moment(seconds=end + room)))

    @classmethod
    def until_now(cls, length: float) -> Curves:
        """Return the curves of a run that goes on: of the last `length` [s] up to the time that is shown."""
        boundary = rr.TimeRangeBoundary
        ahead = boundary.cursor_relative(seconds=LEGEND_ROOM * length)
        return cls(
            rr.TimeRange(start=boundary.cursor_relative(seconds=-length), end=ahead),
            rr.VisibleTimeRange(TIMELINE, start=boundary.infinite(), end=boundary.cursor_relative()),
        )

    def view(self, plot: Plot, legend: bool = True) -> rrb.TimeSeriesView:
        """Return the view of a plot, with the legend at the right of the curves."""
        return rrb.TimeSeriesView(
            name=plot.title,
            origin=f"plots/{plot.path}",
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend),
            axis_x=rrb.archetypes.TimeAxis(view_range=self.axis),
            time_ranges=self.shown,
        )

    def stack(self, plots: Sequence[Plot], name: str | None = None) -> rrb.Vertical:
        """Return plots below each other, each as high as its legend needs."""
        heights = [max(plot.curves + 1, LEAST_ROWS) for plot in plots]
        return rrb.Vertical(*map(self.view, plots), row_shares=heights, name=name)


def arranged(
    robot: rrb.Spatial3DView,
    colours: str,
    curves: Curves,
    plots: Sequence[Plot],
    alone: Sequence[Plot],
    events: bool,
    play: str = "paused",
) -> rrb.Blueprint:
    """Return the window with these views.

    `colours` is the title of the legend of colours; plots `alone` have a tab of their own.
    """
    legend = rrb.Spatial2DView(
        name=colours,
        origin="legend",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-12, 269], y_range=[-4, 40]),
    )
    text = rrb.TextDocumentView(name="Run", origin="summary")
    tabs: list = [curves.stack(plots, name="Curves")]
    tabs += [rrb.Grid(*(curves.view(plot, legend=False) for plot in alone), name="Energies")] if alone else []
    right: rrb.Container | rrb.View = rrb.Tabs(*tabs)
    if events:
        right = rrb.Vertical(right, rrb.TextLogView(name="Events", origin=EVENTS), row_shares=[5, 1])
    content = rrb.Horizontal(
        rrb.Vertical(robot, rrb.Horizontal(legend, text, column_shares=[3, 5]), row_shares=[9, 2]),
        right,
        column_shares=[5, 3],
    )
    return whole(content, time_panel="collapsed", play=play)


def _robot(run: RunData, scales: Scales) -> rrb.Spatial3DView:
    """Return the view of the robot; the eye follows the robot where it would look small to an eye at rest."""
    eye, target = place_moving_eye(run)
    still, moving = (float(np.linalg.norm(a - b)) for a, b in ((scales.eye, scales.target), (eye, target)))
    follows = is_worth_following(still, moving)
    if not follows:
        eye, target = scales.eye, scales.target
    return robot_view(eye, target, follows)


def robot_view(eye: np.ndarray, target: np.ndarray, follows: bool, name: str = "Robot") -> rrb.Spatial3DView:
    """Return the view of the robot from an eye, which may follow it, towards a target [m], shape (3,)."""
    return rrb.Spatial3DView(
        name=name,
        origin="world",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=eye,
            look_target=target,
            eye_up=(0.0, 0.0, 1.0),
            tracking_entity=MIDDLE if follows else None,
        ),
    )


def whole(content: rrb.Container | rrb.View, time_panel: str, play: str = "paused") -> rrb.Blueprint:
    """Return the layout of a window; `play` is how time runs in it."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=TIMELINE, state=time_panel, play_state=play),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def summary(run: RunData, scales: Scales, colouring: Colouring) -> str:
    """Return what is shown and at which scales, as plain text."""
    contact = bool(run.contact_forces.any())
    reactions = {name: arrows.metres_per_unit for name, arrows in reaction_arrows(run, scales).items()}
    span = f", simulated: {run.times[-1] - run.times[0]:.6g} s"
    return explanation(run.description, scales, colouring, contact, reactions, span)


def explanation(
    description: Description,
    scales: Scales,
    colouring: Colouring,
    contact: bool,
    reactions: Mapping[str, float],
    more: str = "",
) -> str:
    """Return what is shown at which scales, as plain text; `contact` says whether there are contact forces, `reactions`
    how long the arrows of those that act are, by their sizes [m/N, 1/N].
    """
    nodes = sum(strand.nodes.stop - strand.nodes.start for strand in description.strands)
    settings = [f"{name} {_short(text)}" for name, text in description.settings.items() if name not in versions()]
    lines = [
        f"{description.scene_name}: {description.title}",
        f"Strands: {len(description.strands)}, nodes: {nodes}{more}.",
        f"Colour: {colouring.sentence()}.",
    ]
    if contact:
        lines.append(f"Arrows: contact force on each node, {10 / scales.metres_per_newton:.4g} mN for 10 mm.")
    for name, metres_per_unit in reactions.items():
        colour, unit = ("Blue", "mN") if name == "clamp_forces" else ("Purple", "mN m")
        size = f"{10 / metres_per_unit:.4g} {unit} for 10 mm"
        lines.append(f"{colour}: {name.split('_')[1]} of rods on bodies, {size}.")
    if any(obstacle.shape.kind == "plane" for obstacle in description.obstacles):
        lines.append(f"Squares on the ground: {1e3 * scales.cell:g} mm.")
    if settings:
        lines.append(f"Computed with: {', '.join(settings)}.")
    return "\n".join(lines)


def _short(text: str) -> str:
    """Return a number with four digits, which a log has with all of them; other text unchanged."""
    try:
        return f"{float(text):.4g}"
    except ValueError:
        return text
