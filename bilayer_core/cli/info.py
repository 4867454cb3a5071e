"""The verb ``info``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say

if TYPE_CHECKING:
    from bilayer_core.log.run.log_reader import LogInfo


@click.command(cls=Verb)
@click.argument("file", metavar="FILE.mcap|BAG")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
@click.option("--quantities", is_flag=True, help="List the quantities that export, plot and read_log know, with units.")
def info(file: str, as_json: bool, quantities: bool) -> None:
    """Say what a log, a bag of `ros2 bag record` or another MCAP file holds."""
    from bilayer_core.log.run.log_reader import read_info

    if quantities:
        _list_quantities(file, as_json)
        return
    found = read_info(file)
    if as_json:
        click.echo(json.dumps(asdict(found), indent=2))
        return
    for name, text in _rows_of_log(found) if found.kind == "log" else _rows_of_bag(found):
        say(f"{name:10}{text}")
    for lack in found.lacks:
        say(f"{'lacks':10}{lack}")
    for topic, content in found.topics.items():
        say(f"  {topic:36}{content['type']:40}{content['count']} messages")


def _rows_of_log(found: LogInfo) -> Iterator[tuple[str, str]]:
    yield "scene", f"{found.scene} ({found.title})"
    yield "time", f"{found.start_time:g} s to {found.last_time:g} s"
    yield "complete", f"{'yes' if found.complete else 'no'} ({found.termination})"
    yield "size", f"{found.size / 1e6:.3g} MB"
    yield "stimuli", ", ".join(found.channels) or "none"
    yield "settings", ", ".join(f"{key} {value}" for key, value in found.settings.items())
    yield "versions", ", ".join(f"{key} {value}" for key, value in found.versions.items())


def _rows_of_bag(found: LogInfo) -> Iterator[tuple[str, str]]:
    yield "kind", f"{'a bag of messages of sim_node' if found.runs else 'an MCAP file'}, not a log of a run"
    if found.recorded:
        yield "recorded", " to ".join(dict.fromkeys(found.recorded))
    yield "size", f"{found.size / 1e6:.3g} MB"
    yield "read by", ", ".join(found.commands) or "no command but info: it holds no messages of sim_node"
    for run in found.runs:
        name = f"{found.path}{run.address}" if len(found.runs) > 1 else run.node
        described = "" if run.described else ", without a description"
        yield "run", f"{name}, simulated {run.start_time:g} s to {run.last_time:g} s{described}"
    if found.scene:
        yield "scene", f"{found.scene} ({found.title})"
        yield "stimuli", ", ".join(found.channels) or "none"


def _list_quantities(file: str, as_json: bool) -> None:
    from bilayer_core.log.run.log_source import LogSource

    entries = LogSource(file).entries.values()
    if as_json:
        told = [{"name": of.name, "unit": of.unit, "axes": of.axes, "labels": of.labels} for of in entries]
        click.echo(json.dumps(told, indent=2))
        return
    for entry in entries:
        unit = f"[{entry.unit}]" if entry.unit else ""
        of_nodes = "each node: " if entry.of_shape and entry.labels else "each node" if entry.of_shape else ""
        say(f"  {entry.name:44}{unit:12}{of_nodes}{' '.join(entry.labels)}".rstrip())
