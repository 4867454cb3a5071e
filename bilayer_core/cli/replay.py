"""The verb ``replay``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bilayer_core.cli.json_output import json_option, json_to
from bilayer_core.cli.nodes import become_replay_node
from bilayer_core.cli.options import DIFFERS, Duration, Verb, named_numbers, set_option
from bilayer_core.cli.signals import Interruption
from bilayer_core.cli.terminal import say, say_start
from bilayer_core.cli.watch import Interrupt, compile_kernels, count_bar
from bilayer_core.errors import InputError
from bilayer_core.simulation.progress_bar import progress_bar

if TYPE_CHECKING:
    from bilayer_core.runs.replay import Verification

OF_VERIFY = ("tolerance", "derived", "json")
OF_FROM = ("set", "stimulus", "load", "duration", "log", "rrd", "vary")
OF_ROS = ("rate", "loop")
"""Options that belong to one of the ways to replay; ``--force`` and ``--quiet`` belong to the first two."""
THENCE = "From there on; null: its schedule."
MANY = "Many runs, each with another value of stimulus.CHANNEL, load.NAME or a key of the scene, overlaid in one --rrd."


@click.command(cls=Verb)
@click.argument("path", metavar="LOG.mcap")
@click.option("--verify", "verifies", is_flag=True, help="Simulate the run again, and compare every state in the log.")
@click.option("--tolerance", type=float, metavar="X", help="Allowed difference of positions, over the longest rod.")
@click.option("--derived", is_flag=True, help="For --verify: compare markers, energies and the like as well.")
@json_option("Write what came of it")
@click.option("--from", "moment", type=Duration(from_zero=True), metavar="T", help="Continue from this time.")
@set_option
@click.option("--stimulus", multiple=True, metavar="CHANNEL=VALUE", help=THENCE)
@click.option("--load", multiple=True, metavar="NAME=FACTOR", help=THENCE)
@click.option("--duration", type=Duration(), help="How long to continue; default: to the end of the log's run.")
@click.option("--log", metavar="NEW.mcap", help="Write a log of the continued run.")
@click.option("--rrd", metavar="FILE.rrd", help="Write a rerun recording of the continued run.")
@click.option("--vary", metavar="NAME=FROM:TO:COUNT", help=MANY)
@click.option("--ros", "publishes", is_flag=True, help="Publish its messages on ROS 2: the node replay_node.")
@click.option("--rate", type=float, metavar="R", help="Seconds of the log per second, for --ros.")
@click.option("--loop", is_flag=True, help="Begin again at the end, for --ros.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--quiet", is_flag=True, help="Neither progress nor summary.")
def replay(path: str, verifies: bool, moment: float | None, publishes: bool, **options: Any) -> int:
    """Make the run of a log again: to verify it (--verify), or another one from an instant on (--from). Or publish
    its messages on ROS 2 (--ros).

    Exit code 1 if --verify finds a difference, or that states or inputs are missing.
    """
    from bilayer_core.log.file.log_head import read_head

    if verifies + (moment is not None) + publishes != 1:
        raise InputError(
            "replay: say either --verify, to compare the run with its log, or --from T, to go on from T, or --ros, to "
            "publish its messages"
        )
    options["set"], options["json"] = options.pop("overrides"), options.pop("json_file")
    if publishes:
        _refuse(options, (*OF_FROM, *OF_VERIFY, "force", "quiet"), "is not for --ros")
        become_replay_node(path, options["rate"], options["loop"])
    _refuse(options, OF_ROS, "is for --ros")
    read_head(Path(path))  # what is no log is told before kernels are compiled
    if verifies:
        _refuse(options, OF_FROM, "is for --from; --verify makes the run as it was")
        return _verify(path, options)
    _refuse(options, OF_VERIFY, "is for --verify")
    for name in ("stimulus", "load"):
        options[name] = named_numbers(f"--{name}", options[name])
    if options["vary"] is not None:
        if options["rrd"] is None or options["log"] is not None:
            raise InputError("--vary: its runs go into one recording; name that by --rrd, and no --log")
        _branch_out(path, moment, options)
    else:
        _go_on(path, moment, options)
    return 0


def _refuse(options: dict[str, Any], names: tuple[str, ...], reason: str) -> None:
    """Raise InputError with a reason if one of some options is given."""
    for name in names:
        value = options[name]
        if value is not None and value is not False and value != ():
            raise InputError(f"--{name}: {reason}")


def _verify(path: str, options: dict[str, Any]) -> int:
    from bilayer_core.runs.replay import verify

    tolerance, derived = options["tolerance"], options["derived"]
    if tolerance is not None and not tolerance > 0.0:
        raise InputError(f"--tolerance: {tolerance} is not allowed; it must be a part of the longest rod above 0")
    if tolerance is not None and derived:
        raise InputError(
            "--derived: compares messages byte by byte, and --tolerance lets states differ; give one of them"
        )
    with json_to(options["json"], options["force"]) as write_json:
        compile_kernels(options["quiet"])
        found = verify(path, tolerance, derived)
        write_json(json.dumps(_as_json(found), indent=2))
        if not options["quiet"]:
            _tell(found)
    return 0 if found.passed else DIFFERS


def _as_json(found: Verification) -> dict:
    differences = {"first": found.first, "largest": found.largest}
    return {
        "pass": found.passed,
        "states": found.states,
        "inputs": found.inputs,
        "tolerance": found.tolerance,
        "stopped": found.stopped,
        "whole": found.wholeness.whole if found.wholeness.hashed else None,
        "not_whole": found.wholeness.reason,
        "derived": found.derived,
        "first_derived": found.first_derived,
        "not_compared": found.not_compared,
        "changed": {name: list(pair) for name, pair in found.changed.items()},
        **{name: None if of is None else vars(of) for name, of in differences.items()},
    }


def _tell(found: Verification) -> None:
    how = "equal bit for bit" if found.tolerance is None else f"equal within {found.tolerance:g} of the longest rod"
    count = f"{found.states} states, {found.inputs} inputs"
    count += "" if found.derived is None else f", {found.derived} derived messages"
    if found.passed:
        say(f"{count}: all {how}")
    elif found.equal:
        say(f"not whole: {count} up to t = {found.last_time:.9g} s were compared, and are {how}")
    if found.first is not None:
        say(f"not {how}; the first difference is at {found.first}")
    if found.largest is not None and not (found.equal and found.tolerance is None):
        say(f"largest difference of a position: {found.largest}")
    if found.first_derived:
        say(f"the first difference of a derived message is at {found.first_derived}")
    if found.stopped:
        say(f"the run {found.stopped}")
    if found.wholeness.reason:
        say(f"the log: {found.wholeness.reason}")
    if found.not_compared:
        say(f"not compared: {', '.join(_short(found.not_compared))}")
    for name, (then, now) in found.changed.items():
        say(f"  {name:20}{then} in the log, {now} here")


def _short(topics: tuple[str, ...]) -> list[str]:
    """Return topics as a run names them, those of all bodies or channels as one."""
    from bilayer_core.log.messages.topics import LOG_NAMESPACE

    return list(dict.fromkeys(topic.removeprefix(f"{LOG_NAMESPACE}/").split("/")[0] or topic for topic in topics))


def _go_on(path: str, moment: float, options: dict[str, Any]) -> None:
    from bilayer_core.cli.report import summary_lines
    from bilayer_core.log.file.mcap_log import McapRecorder
    from bilayer_core.runs.replay import branch

    interrupt, observers = Interrupt(), []
    simulator, inputs = branch(path, moment, options["set"], options["stimulus"], options["load"])
    output, begin = simulator.scene.output, simulator.time
    if options["log"] is not None:
        if Path(options["log"]).resolve() == Path(path).resolve():
            raise InputError(f"--log: {options['log']} is the log that is gone on from; choose another name")
        observers.append(McapRecorder(options["log"], output.rate, output.marker_rate, options["force"]))
    if options["rrd"] is not None:
        from bilayer_core.view.rerun_view import RrdRecorder

        observers.append(RrdRecorder(options["rrd"], output.rate, options["force"]))
    duration = options["duration"] or _time_left(path, begin)
    if not options["quiet"]:
        say_start(begin, moment)
    compile_kernels(options["quiet"])
    with interrupt, progress_bar(simulator.scene.name, begin, begin + duration, options["quiet"]) as show:
        simulator.run(duration, observers=observers, interrupted=interrupt.grant, progress=show, inputs=inputs)
    if not options["quiet"]:
        for line in summary_lines({**simulator.summary(), "duration": duration}, set(), False):
            say(line)
    if interrupt.granted:
        raise Interruption(interrupt.wished)


def _time_left(log: str, time: float) -> float:
    """Return the simulated time from an instant to the end of a log's run [s]."""
    from bilayer_core.log.run.log_reader import read_info

    left = read_info(log).last_time - time
    if left <= 0.0:
        raise InputError(f"--from: the log ends at t = {time:g} s; say with --duration how long to go on")
    return left


def _branch_out(path: str, moment: float, options: dict[str, Any]) -> None:
    from bilayer_core.log.file.output_paths import check_output_path
    from bilayer_core.log.run.log_reader import read_state
    from bilayer_core.runs.branches import Varied, run_branches
    from bilayer_core.view.rerun_view import require_rerun, write_branches

    require_rerun()
    check_output_path(options["rrd"], options["force"], ".rrd")
    varied, begin = Varied.read(options["vary"]), float(read_state(path, moment)[0][0])
    until = begin + (options["duration"] or _time_left(path, begin))
    if not options["quiet"]:
        say_start(begin, moment)
    compile_kernels(options["quiet"])
    common = {"overrides": options["set"], "stimuli": options["stimulus"], "loads": options["load"]}
    branches = []
    with count_bar(len(varied.values), options["quiet"]) as show:
        for of in run_branches(path, moment, varied, until, **common):
            branches.append(of)
            show(f"{varied.name} = {of.value:g}")
    write_branches(branches, varied.name, options["rrd"], options["force"])
    if not options["quiet"]:
        say(f"{len(branches)} branches from t = {begin:g} s to {until:g} s by {varied.name}: {options['rrd']}")
        for of in branches:
            if of.stopped:
                say(f"  {varied.name} = {of.value:g} stopped at t = {of.run.times[-1]:g} s: {of.stopped}")
