"""The verb ``new``."""

from __future__ import annotations

from pathlib import Path

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say
from bilayer_core.errors import InputError


class NewVerb(Verb):
    """A command whose help lists the templates."""

    def format_epilog(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the templates with their titles."""
        from bilayer_core.scene.new import templates

        with formatter.section("Templates"):
            formatter.write_dl(list(templates().items()))


@click.command(cls=NewVerb)
@click.argument("file", metavar="FILE.yaml")
@click.option("--template", metavar="NAME", help="What to start from; default: strip.")
@click.option("--from", "origin", metavar="SCENE", help="Start from a copy of this scene instead.")
@click.option("--force", is_flag=True, help="Replace an existing file.")
def new(file: str, template: str | None, origin: str | None, force: bool) -> None:
    """Write a scene to start from: complete, with comments, ready to run."""
    from bilayer_core.log.file.output_paths import check_output_path, write_text
    from bilayer_core.scene.new import DEFAULT_TEMPLATE, new_scene

    if template is not None and origin is not None:
        raise InputError("--template, --from: name one of the two")
    path = Path(file)
    text = new_scene(path, template or DEFAULT_TEMPLATE, origin)
    check_output_path(path, force)
    write_text(path, text, force)
    say(f"{path}: a scene to start from, like {origin or template or DEFAULT_TEMPLATE}")
    say(f"next: bilayer check {path}")
