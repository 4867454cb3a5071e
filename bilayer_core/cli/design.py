"""The verb ``design``."""

from __future__ import annotations

import click

from bilayer_core.cli.options import Verb, output_directory, scene_argument, set_option
from bilayer_core.cli.signals import Interruption
from bilayer_core.cli.terminal import say
from bilayer_core.cli.watch import Interrupt, compile_kernels
from bilayer_core.errors import InputError


@click.command(cls=Verb)
@scene_argument
@click.option("--target", "targets", multiple=True, required=True, metavar="CURVE.csv", help="Columns x, y, z [m].")
@click.option(
    "--target-at",
    "levels",
    multiple=True,
    metavar="CHANNEL=VALUE[,…]",
    help="Stimulus at which each target is wanted, in their order; by default the largest.",
)
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="PATH=LO:HI[:POINTS]",
    help="A number, or a profile along the rod; PATH=V,V,…[:PIECES] for these values alone.",
)
@click.option("--smoothness", type=click.FloatRange(min=0.0), help="Weight of roughness of patterns; default: 1e-3.")
@set_option
@click.option("--out", metavar="DIR", help="Write the scene, the pattern as csv, a report and a picture.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--quiet", is_flag=True, help="No progress.")
def design(
    scene: str,
    targets: tuple[str, ...],
    levels: tuple[str, ...],
    vary: tuple[str, ...],
    smoothness: float | None,
    overrides: tuple[str, ...],
    out: str | None,
    force: bool,
    quiet: bool,
) -> int:
    """Find the pattern with which SCENE takes wanted shapes.

    The curve of a rod, clamped where it begins, comes as near to each target as the bounds of the pattern allow. A
    search that is interrupted writes the best pattern so far.
    """
    from bilayer_core.studies.shaping import design_files
    from bilayer_core.studies.shaping.shape_search import SMOOTH
    from bilayer_core.studies.shaping.shape_search import design as find_design
    from bilayer_core.studies.shaping.target_curve import read_curve

    directory = None if out is None else output_directory(out)
    if directory is not None:
        from bilayer_core.extras import require

        require("--out: figures", "matplotlib")
        design_files.check_outputs(directory, force)
    at = [_level(text) for text in levels] or None
    for path in targets:
        read_curve(path)  # refused before kernels compile
    compile_kernels(quiet)
    with Interrupt() as interrupt:
        found = find_design(
            scene,
            list(targets),
            vary,
            at=at,
            overrides=overrides,
            smoothness=SMOOTH if smoothness is None else smoothness,
            progress=None if quiet else _tell,
            interrupted=interrupt.grant,
        )
    say(str(found))
    for path in () if directory is None else design_files.write_files(found, directory, force):
        say(f"wrote {path}")
    if interrupt.granted:
        raise Interruption(interrupt.wished)
    return 0


def _level(text: str) -> dict[str, float]:
    """Return the values of channels in a text such as ``humidity=0.5,light=1``."""
    found = {}
    for part in text.split(","):
        channel, _, value = part.partition("=")
        try:
            found[channel.strip()] = float(value)
        except ValueError:
            raise InputError(f"--target-at {text}: must be CHANNEL=VALUE, such as humidity=0.5") from None
    return found


def _tell(text: str) -> None:
    say(f"  {text}", err=True)
