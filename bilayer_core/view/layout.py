"""How a recording is shown: views, camera, and the text beside them."""

from __future__ import annotations

import rerun.blueprint as rrb

from bilayer_core.record.run_data import RunData
from bilayer_core.simulation.observation import versions
from bilayer_core.view.arrows import REACTIONS, reaction_arrows
from bilayer_core.view.scales import Scales

TIMELINE = "sim_time"
BACKGROUND = (28, 30, 34)
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


def blueprint(run: RunData, scales: Scales) -> rrb.Blueprint:
    """The robot at the left, large, over its legend; curves at the right."""
    robot = _robot(scales, reactions=True)
    legend = rrb.Spatial2DView(
        name="Strain",
        origin="legend",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-12, 269], y_range=[-4, 40]),
    )
    text = rrb.TextDocumentView(name="Run", origin="summary")
    plots = [("stimulus", "Stimulus")] if run.description.channels else []
    plots += [("contact_force", "Contact force [N]")] if run.contact_forces.any() else []
    plots += [("clamp_force", "Force on clamps [N]")] if run.clamp_wrenches.any() else []
    plots += [("height", "Height of mass centres [mm]"), ("energy", "Energy [mJ]"), ("solver", "Solver")]
    curves = [
        rrb.TimeSeriesView(name=name, origin=f"plots/{group}", plot_legend=rrb.Corner2D.LeftTop)
        for group, name in plots
    ]
    content = rrb.Horizontal(
        rrb.Vertical(robot, rrb.Horizontal(legend, text, column_shares=[3, 5]), row_shares=[9, 2]),
        rrb.Vertical(*curves),
        column_shares=[5, 3],
    )
    return _whole(content, time_panel="collapsed")


def robot_alone(run: RunData, scales: Scales, reactions: bool = False) -> rrb.Blueprint:
    """The robot for pictures, with or without what its clamps bear; the viewer's notices, at the upper right, appear
    over the text beside it.
    """
    text = rrb.TextDocumentView(name="Run", origin="summary")
    return _whole(rrb.Horizontal(_robot(scales, reactions), text, column_shares=[4, 1]), time_panel="hidden")


def _robot(scales: Scales, reactions: bool) -> rrb.Spatial3DView:
    hidden = {} if reactions else {f"world/{name}": rrb.EntityBehavior(visible=False) for name in REACTIONS}
    return rrb.Spatial3DView(
        name="Robot",
        origin="world",
        background=BACKGROUND,
        line_grid=False,
        overrides=hidden,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=scales.eye, look_target=scales.target, eye_up=(0.0, 0.0, 1.0)
        ),
    )


def _whole(content: rrb.Container | rrb.View, time_panel: str) -> rrb.Blueprint:
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=TIMELINE, state=time_panel, play_state="paused"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def summary(run: RunData, scales: Scales) -> str:
    """What is shown and at which scales, in Markdown."""
    description = run.description
    nodes = sum(strand.nodes.stop - strand.nodes.start for strand in description.strands)
    settings = [f"{name} {_short(text)}" for name, text in description.settings.items() if name not in versions()]
    percent = 100 * scales.strain_limit
    lines = [
        f"**{description.scene_name}: {description.title}**",
        "",
        f"Strands: {len(description.strands)}, nodes: {nodes}, simulated: {run.times[-1] - run.times[0]:.6g} s.",
        "",
        f"- **Colour:** axial strain, from −{percent:g} % (blue) over 0 (grey) to +{percent:g} % (red).",
    ]
    if run.contact_forces.any():
        lines.append(f"- **Arrows:** contact force on each node, {10 / scales.metres_per_newton:.4g} mN for 10 mm.")
    for name, arrows in reaction_arrows(run, scales).items():
        colour, unit = ("Blue", "mN") if name == "clamp_forces" else ("Purple", "mN m")
        size = f"{10 / arrows.metres_per_unit:.4g} {unit} for 10 mm"
        lines.append(f"- **{colour}:** {name.split('_')[1]} of rods on bodies, {size}.")
    if any(obstacle.shape.kind == "plane" for obstacle in description.obstacles):
        lines.append(f"- **Squares on the ground:** {1e3 * scales.cell:g} mm.")
    lines.append(f"- **Computed with:** {', '.join(settings)}.")
    return "\n".join(lines)


def _short(text: str) -> str:
    """A number with four digits, which a log has with all of them; other text as it is."""
    try:
        return f"{float(text):.4g}"
    except ValueError:
        return text
