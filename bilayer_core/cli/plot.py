"""The verb ``plot``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say
from bilayer_core.errors import InputError

SUFFIX = ".mcap"


class Limits(click.ParamType):
    """Two numbers, such as 0:2.5."""

    name = "limits"

    def convert(self, value: Any, param: click.Parameter | None, context: click.Context | None) -> tuple[float, float]:
        """Return both."""
        try:
            low, high = map(float, value.split(":"))
        except ValueError:
            low = high = math.nan
        if not -math.inf < low < high < math.inf:
            self.fail(f"found {value!r}; allowed are two numbers, the smaller one first, such as 0:2.5", param, context)
        return low, high


@click.command(cls=Verb)
@click.argument("logs_and_quantities", metavar="LOG.mcap|BAG... QUANTITY...", nargs=-1, required=True)
@click.option("--x", "over", metavar="QUANTITY", help="Draw over this instead of time: com.x.")
@click.option("--xlim", type=Limits(), metavar="A:B", help="Limits, in the unit that the axis shows.")
@click.option("--ylim", type=Limits(), metavar="A:B", help="Likewise, of a single panel.")
@click.option("--title", default="", metavar="TEXT", help="Title above the figure.")
@click.option("--out", metavar="FIGURE", help="Write a .pdf, .png or .svg instead of opening a window.")
@click.option("--node", type=int, metavar="N", help="Which node of rods; -1 is the last one, the default.")
@click.option("--width", default="single", metavar="W", help="Width: single or double column, or millimetres.")
@click.option("--label", "labels", multiple=True, metavar="TEXT", help="Name of a log in the legend; once for each.")
@click.option("--force", is_flag=True, help="Replace an existing file.")
def plot(
    logs_and_quantities: tuple[str, ...],
    over: str | None,
    xlim: tuple[float, float] | None,
    ylim: tuple[float, float] | None,
    title: str,
    out: str | None,
    node: int | None,
    width: str,
    labels: tuple[str, ...],
    force: bool,
) -> None:
    """Draw quantities of logs over time or over one another: com.z, 'energy/*', rod/strip/position.z.

    Quantities of one unit share a panel; those of several logs are drawn over each other. `bilayer info LOG
    --quantities` lists all names.
    """
    from bilayer_core.view.plot import WIDTHS, Axis, plot

    logs = [word for word in logs_and_quantities if _is_log(word)]
    quantities = [word for word in logs_and_quantities if word not in logs]
    if not logs:
        raise InputError(
            f"plot: none of {', '.join(logs_and_quantities)} is a log ({SUFFIX}) or a bag; name at least one"
        )
    if not quantities:
        raise InputError(
            f"plot: say which quantities, such as com.z; `bilayer info {logs[0]} --quantities` lists those of the log"
        )
    axis = Axis(over, xlim, ylim, title)
    plot(logs, quantities, out, node, width if width in WIDTHS else _millimetres(width), labels, force, axis)
    if out:
        say(f"figure    {Path(out)}")


def _is_log(word: str) -> bool:
    """Return whether a word names a log or a bag, and not a quantity."""
    from bilayer_core.log.run.bag import split_address

    path, _, _ = split_address(word)
    return path.suffix.lower() == SUFFIX or (path.is_dir() and any(path.glob(f"*{SUFFIX}")))


def _millimetres(width: str) -> float:
    try:
        found = float(width.removesuffix("mm"))
    except ValueError:
        found = 0.0
    if not 30.0 <= found <= 1000.0:
        raise InputError(f"--width: {width} is not allowed; it must be single, double, or 30 to 1000 (mm)")
    return found
