"""Times in which fields diffuse through layers, beside those of the scene."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

import numpy as np

from bilayer_core.model.findings import Figure
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion import Diffusion
from bilayer_core.scene.diffusion_modes import whole_field
from bilayer_core.scene.rod import Rod

LEAST_OF_WAVE = 0.05
"""Part of a wave that reaches a layer below which it hardly moves."""


def diffusion_figures(scene: SceneConfig, rod: Rod) -> Iterator[Figure]:
    """Yield how long the fields of a rod take."""
    for field in rod.diffusion:
        yield from _figures(scene, rod, field)


def _figures(scene: SceneConfig, rod: Rod, field: Diffusion) -> Iterator[Figure]:
    where, part, interval = f"rods.{rod.name}.diffusion", whole_field(rod, field), 1.0 / scene.output.rate
    modes = part.modes
    slowest, fastest = float(modes.times.max()), float(modes.times.min())
    yield Figure(
        where,
        f"slowest time constant of {field.stimulus}",
        f"{slowest:.3g} s (fastest of {len(modes.times)}: {fastest:.2g} s)",
        f"at most the duration, {scene.duration:g} s",
        slowest / scene.duration,
        "the run ends before the layers have taken up most of it" if slowest > scene.duration else "",
    )
    if slowest < interval:
        yield Figure(
            where,
            f"slowest time constant of {field.stimulus}, to be seen in outputs,",
            f"{slowest:.3g} s",
            f"at least 1/output.rate, {interval:g} s",
            interval / slowest,
            "the layers are in equilibrium from one output to the next: a higher `output.rate` shows more",
        )
    channel = scene.stimuli[field.stimulus]
    period = getattr(channel.schedule, "period", None)
    if period is None:
        return
    turned = 1.0 / (1.0 + 2j * pi / period * modes.times)
    for name, functional in zip(modes.names, modes.functionals[0], strict=True):
        weight, _ = part.weights(functional)
        follows = float(np.abs(weight @ turned) / np.abs(weight.sum()))
        yield Figure(
            where,
            f"part of the wave of {period:g} s that the mean of a layer follows",
            f"{100 * follows:.2g} % in {name}",
            f"at least {100 * LEAST_OF_WAVE:g} %",
            LEAST_OF_WAVE / follows,
            "the layer sees little more than the mean of its stimulus" if follows < LEAST_OF_WAVE else "",
        )
