"""The verb ``run``."""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext, redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bilayer_core.cli.json_output import STANDARD_OUTPUT
from bilayer_core.cli.options import Duration, Rate, Verb, named_numbers, scene_argument, set_option
from bilayer_core.cli.report import summary_lines
from bilayer_core.cli.signals import Interruption
from bilayer_core.cli.terminal import say, say_start
from bilayer_core.cli.watch import Interrupt, compile_kernels
from bilayer_core.errors import BilayerError, InputError, OutputError, SimulationError, naming
from bilayer_core.simulation.progress_bar import progress_bar

if TYPE_CHECKING:
    from bilayer_core.scene.config import SceneConfig
    from bilayer_core.simulation.simulator import Simulator
    from bilayer_core.studies.converge.study import Study

SOLVER_OPTIONS = ("dt", "model", "dimension", "integrator", "tolerance")
TOLERANCE_HELP = (
    "Adaptive steps: largest error per step, over the longest rod. The error of a whole run is larger; "
    "`--error-estimate` tells it."
)
ERROR_HELP = "Show the global error of the headline numbers, from runs at twice and half the step."
QUARTER_HELP = "With --error-estimate: a run at a quarter of the step as well, for what half the step does not resolve."
INSTEAD = "All the time, in place of its schedule."
OUTPUT_SUFFIXES = {"log": ".mcap", "rrd": ".rrd", "summary": ".json", "save_state": ".npz"}
"""How the names of outputs end, by their options."""


@click.command(cls=Verb)
@scene_argument
@click.option("--duration", type=Duration(), help="Simulated time of this run; default: to the end of the scene.")
@click.option("--dt", metavar="TIME", help="Fixed steps of this length; with --tolerance the first one.")
@click.option("--model", metavar="NAME", help="auto, two_rod or laminate.")
@click.option("--dimension", metavar="D", help="auto, 2 or 3.")
@click.option("--integrator", metavar="NAME", help="auto, or a name of `solver.integrator` in `bilayer schema`.")
@click.option("--tolerance", metavar="X", help=TOLERANCE_HELP)
@set_option
@click.option("--stimulus", multiple=True, metavar="CHANNEL=VALUE", help=INSTEAD)
@click.option("--load", multiple=True, metavar="NAME=FACTOR", help=INSTEAD)
@click.option("--log", metavar="FILE.mcap", help="Write a log.")
@click.option(
    "--log-rate",
    type=Rate(),
    metavar="HZ",
    help="Frames recorded per simulated second; the run stays the same.",
)
@click.option("--tf", is_flag=True, help="Log frames of bodies and ends of rods on /tf.")
@click.option("--rrd", metavar="FILE.rrd", help="Write a rerun recording.")
@click.option("--summary", metavar="FILE.json|-", help="Write all figures of the run; - is standard output.")
@click.option("--settle", is_flag=True, help="Start at the static equilibrium: `--set start=settle`.")
@click.option("--save-state", metavar="FILE.npz", help="Write the last state.")
@click.option("--from-state", metavar="FILE", help="Continue from a saved state, or from the end of a log.")
@click.option("--at", type=Duration(from_zero=True), metavar="T", help="Start from the log of --from-state at T.")
@click.option("--budget", is_flag=True, help="Show where the energy went (steps cost four to thirteen times as much).")
@click.option("--error-estimate", is_flag=True, help=ERROR_HELP)
@click.option("--quarter-step", is_flag=True, help=QUARTER_HELP)
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--verbose", is_flag=True, help="Show all figures, and what was chosen for the scene.")
@click.option("--quiet", is_flag=True, help="Neither progress nor summary.")
def run(scene: str, duration: float | None, overrides: tuple[str, ...], quiet: bool, **options: Any) -> None:
    """Simulate SCENE as fast as this machine can."""
    from bilayer_core.scene.loader import load_scene

    changes = [*overrides, *(f"solver.{key}={options[key]}" for key in SOLVER_OPTIONS if options[key] is not None)]
    if options["dt"] is not None and options["tolerance"] is None:
        changes.append("solver.tolerance=null")  # fixed steps, whatever the scene says
    if options["settle"]:
        if options["from_state"] is not None:
            raise InputError("--settle: has no meaning with --from-state, which has the shape to start with")
        changes.append("start=settle")
    config = load_scene(scene, changes)
    interrupt = Interrupt()
    observers = _open_outputs(config, options)
    simulator = _make_simulator(config, options["from_state"], options["at"], options["budget"], quiet)
    for channel, value in named_numbers("--stimulus", options["stimulus"]).items():
        simulator.set_stimulus(channel, value)
    for name, factor in named_numbers("--load", options["load"]).items():
        simulator.set_load(name, factor)
    duration = _duration(simulator, duration)
    if not quiet and options["at"] is not None:
        say_start(simulator.time, options["at"])
    if options["quarter_step"] and not options["error_estimate"]:
        raise InputError("--quarter-step: adds a run to those of --error-estimate; give that too")
    judge = _Judge(simulator, duration, quiet, options["quarter_step"]) if options["error_estimate"] else None
    failure = _simulate(simulator, duration, observers, interrupt, quiet, judge)
    if judge is not None and failure is None and not interrupt.granted:
        judge.estimate()
    summary = _summary(simulator, duration, failure, judge)
    failure = failure or (judge and judge.failure)
    failure = _write_outputs(simulator, summary, options, failure)
    try:
        if not quiet:
            with redirect_stdout(sys.stderr) if _is_stdout("summary", options) else nullcontext():
                _tell(simulator, summary, options, judge)
    finally:  # that nobody reads what is told hides nothing
        if failure is not None:
            raise failure
        if interrupt.granted:
            raise Interruption(interrupt.wished)
        if judge is not None and judge.interruption is not None:
            raise judge.interruption


def _is_stdout(key: str, options: dict[str, Any]) -> bool:
    """Return whether an output goes to standard output, which then has nothing else."""
    return key == "summary" and options[key] == STANDARD_OUTPUT


class _Judge:
    """The runs at twice and half the step, beside the one that was asked for, and what comes of them."""

    def __init__(self, simulator: Simulator, duration: float, quiet: bool, quarter: bool):
        from bilayer_core.studies.converge.quantities import Watch

        self._scene, self._duration, self._quiet, self._quarter = simulator.scene, duration, quiet, quarter
        self._start, self._watch = simulator.save_state(), Watch(simulator)
        self.look = self._watch.look
        self.study: Study | None = None
        self.failure: SimulationError | None = None
        self.interruption: Interruption | None = None

    def estimate(self) -> None:
        """Make the runs. One that stops is this command's failure, and so is Ctrl-C, once the outputs are written."""
        from bilayer_core.processes import usable_cores
        from bilayer_core.studies.converge.study import estimate_error

        def tell(name: str) -> None:
            if not self._quiet:
                say(f"  run at {name} done", err=True)

        try:
            self.study = estimate_error(
                self._scene,
                self._duration,
                workers=min(2, usable_cores()),
                progress=tell,
                own=self._watch.figures(),
                start=self._start,
                quarter=self._quarter,
            )
        except SimulationError as failure:
            self.failure = failure
        except Interruption as interruption:
            interruption.heeded = True
            self.interruption = interruption


def _open_outputs(config: SceneConfig, options: dict[str, Any]) -> list:
    """Return the recorders. An output that cannot be written raises an error here, before anything is computed."""
    from bilayer_core.log.file.output_paths import check_output_path

    force, output = options["force"], config.output
    paths = {key: options[key] for key in OUTPUT_SUFFIXES if options[key] and not _is_stdout(key, options)}
    for place, (key, path) in enumerate(paths.items()):
        check_output_path(path, force, OUTPUT_SUFFIXES[key])
        if Path(path).resolve() in {Path(other).resolve() for other in [*paths.values()][:place]}:
            raise InputError(f"{path}: is named for two outputs; give each a file of its own")
    observers, rate = [], options["log_rate"] or output.rate
    if options["log"]:
        from bilayer_core.log.file.mcap_log import McapRecorder
        from bilayer_core.log.messages.topics import LOG_NAMESPACE

        tf = LOG_NAMESPACE.strip("/") if options["tf"] else ""
        observers.append(McapRecorder(options["log"], rate, output.marker_rate, force, tf=tf))
    elif options["tf"]:
        raise InputError("--tf: is written into a log; give --log FILE.mcap too")
    if options["rrd"]:
        from bilayer_core.view.rerun_view import RrdRecorder

        observers.append(RrdRecorder(options["rrd"], rate, force))
    return observers


def _make_simulator(
    config: SceneConfig, from_state: str | None, at: float | None, budget: bool, quiet: bool
) -> Simulator:
    """Return a simulator that is ready to step."""
    from bilayer_core.engine.needed_pieces import needed_pieces
    from bilayer_core.simulation.simulator import Simulator

    if at is not None and from_state is None:
        raise InputError("--at: is a time of the log of --from-state; give that too")
    simulator = Simulator(config, budget=budget)
    if from_state is not None:
        from bilayer_core.log.run.state_file import read_saved_state

        state = read_saved_state(from_state, simulator.description, at)
        with naming(from_state):
            simulator.load_state(state)
    compile_kernels(quiet, partial(needed_pieces, simulator.model))
    simulator.compile()
    return simulator


def _duration(simulator: Simulator, asked: float | None) -> float:
    """Return the simulated time of this run [s]."""
    if asked is not None:
        return asked
    left = simulator.scene.duration - simulator.time
    if left <= 0.0:
        raise InputError(
            f"--from-state: is at t = {simulator.time:g} s, the scene ends at {simulator.scene.duration:g} s; "
            "say with --duration how long to go on"
        )
    return left


def _simulate(
    simulator: Simulator,
    duration: float,
    observers: list,
    interrupt: Interrupt,
    quiet: bool,
    judge: _Judge | None,
) -> BilayerError | None:
    """Run, and return what stopped the simulation, if anything did, for the outputs to be completed first."""
    begin = simulator.time
    try:
        with interrupt, progress_bar(simulator.scene.name, begin, begin + duration, quiet) as show:
            look = judge.look if judge is not None else None
            simulator.run(duration, observers=observers, interrupted=interrupt.grant, progress=show, each_step=look)
    except (SimulationError, OutputError) as failure:
        return failure
    return None


def _summary(
    simulator: Simulator, duration: float, failure: BilayerError | None, judge: _Judge | None
) -> dict[str, Any]:
    """Return all figures of the run."""
    from bilayer_core.simulation.run_result import Termination

    summary = {**simulator.summary(), "duration": duration}
    if isinstance(failure, SimulationError):
        summary |= {"termination": Termination.FAILED.value, "reason": failure.reason}
        summary |= {"remedy": str(failure.remedy)} if failure.remedy else {}
    elif simulator.termination == Termination.FAILED.value:
        summary["reason"] = str(failure)
    if judge is not None and judge.study is not None:
        from bilayer_core.cli.error_table import errors_of

        summary["global_error"] = errors_of(judge.study)
    return summary


def _write_outputs(
    simulator: Simulator, summary: dict[str, Any], options: dict[str, Any], failure: BilayerError | None
) -> BilayerError | None:
    """Write the last state and the summary, each whatever happened before.

    Returns the first failure, which `failure` is if there was one; later ones are notes to it.
    """
    from bilayer_core.log.file.output_paths import write_text
    from bilayer_core.log.run.state_file import write_state

    def state(path: str) -> None:
        write_state(path, simulator.save_state(), simulator.description, options["force"])

    def figures(path: str) -> None:
        text = json.dumps(summary, indent=2, allow_nan=False)
        if _is_stdout("summary", options):
            click.echo(text)
        else:
            write_text(path, text + "\n", options["force"])

    for key, write in (("save_state", state), ("summary", figures)):
        if not options[key]:
            continue
        try:
            write(options[key])
        except OutputError as loss:
            if failure is None:
                failure = loss
            else:
                failure.add_note(str(loss))
    return failure


def _tell(simulator: Simulator, summary: dict[str, Any], options: dict[str, Any], judge: _Judge | None) -> None:
    """Print what happened."""
    bodies = {body.name: body.motion for body in simulator.scene.bodies}
    moved = {name for name, motion in bodies.items() if motion.type == "free" or getattr(motion, "axis", None)}
    for line in summary_lines(summary, moved, options["verbose"]):
        say(line)
    for key in OUTPUT_SUFFIXES:
        if options[key] and Path(options[key]).exists():
            say(f"  {key.replace('_', ' '):22}{options[key]}")
    if options["budget"]:
        from bilayer_core.cli.budget_table import print_budget

        print_budget(summary["budget"])
    if judge is not None and judge.study is not None:
        from bilayer_core.cli.error_table import print_errors

        print_errors(judge.study)
