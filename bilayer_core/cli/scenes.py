"""The verbs about scenes: ``scenes`` and ``schema``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from bilayer_core.cli.options import Verb


@click.command(cls=Verb)
def scenes() -> None:
    """List the bundled scenes."""
    from bilayer_core.scene.bundled import bundled_scenes

    click.echo(titles(bundled_scenes()))


def titles(files: dict[str, Path]) -> str:
    """Return a line for each file of scenes or sweeps: its name and its title."""
    from bilayer_core.scene.text import read_yaml

    width = max(map(len, files))
    found = {name: read_yaml(path.read_text(encoding="utf-8"), str(path))["title"] for name, path in files.items()}
    return "\n".join(f"{name:{width}}  {title}" for name, title in found.items())


@click.command(cls=Verb)
@click.option("--markdown", is_flag=True, help="As a page of tables.")
def schema(markdown: bool) -> None:
    """Print every key of scene files: as JSON Schema, with which editors complete and check, or as a page to read."""
    if markdown:
        from bilayer_core.scene.key_tables import page

        click.echo(page(), nl=False)
        return
    from bilayer_core.scene.key_notes import json_schema

    click.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))
