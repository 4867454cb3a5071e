"""The verb ``info``."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say


@click.command(cls=Verb)
@click.argument("file", metavar="FILE.mcap")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
@click.option("--quantities", is_flag=True, help="List the quantities that export, plot and read_log know, with units.")
def info(file: str, as_json: bool, quantities: bool) -> None:
    """Say what a log holds."""
    from bilayer_core.record.log_reader import read_info

    if quantities:
        _list_quantities(file, as_json)
        return
    found = read_info(file)
    if as_json:
        click.echo(json.dumps(asdict(found), indent=2))
        return
    rows = {
        "scene": f"{found.scene} ({found.title})",
        "time": f"{found.start_time:g} s to {found.last_time:g} s",
        "complete": f"{'yes' if found.complete else 'no'} ({found.termination})",
        "size": f"{found.size / 1e6:.3g} MB",
        "stimuli": ", ".join(found.channels) or "none",
        "settings": ", ".join(f"{key} {value}" for key, value in found.settings.items()),
        "versions": ", ".join(f"{key} {value}" for key, value in found.versions.items()),
    }
    for name, text in rows.items():
        say(f"{name:10}{text}")
    for lack in found.lacks:
        say(f"{'lacks':10}{lack}")
    for topic, content in found.topics.items():
        say(f"  {topic:36}{content['type']:40}{content['count']} messages")


def _list_quantities(file: str, as_json: bool) -> None:
    from bilayer_core.record.log_source import LogSource

    entries = LogSource(file).entries.values()
    if as_json:
        told = [{"name": of.name, "unit": of.unit, "axes": of.axes, "labels": of.labels} for of in entries]
        click.echo(json.dumps(told, indent=2))
        return
    for entry in entries:
        unit = f"[{entry.unit}]" if entry.unit else ""
        of_nodes = "each node: " if entry.of_shape and entry.labels else "each node" if entry.of_shape else ""
        say(f"  {entry.name:44}{unit:12}{of_nodes}{' '.join(entry.labels)}".rstrip())
