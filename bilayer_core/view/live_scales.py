"""Scales of a run that goes on: nobody knows yet what will come, so they grow with it."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from bilayer_core.errors import SceneError
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Description
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import strains_at
from bilayer_core.scene.loader import parse_scene
from bilayer_core.view.arrows import reaction_references
from bilayer_core.view.colouring import STRAIN, Colouring, choose_colouring, colouring_up_to
from bilayer_core.view.scales import ARROW_SHARE, SHOWN_SHARE, Scales, choose_scales, rounded_up

GROWTH = 1.5
"""Times what has come, of a limit that was too small: it is not to change at every frame."""
CHANGE = 2.0
"""Factor by which the size that arrows are scaled by changes before they are."""
FRAMES = 5000
"""Frames with contact that decide on it, the last ones."""


class LiveScales:
    """Scales and colours of quantities from the present time on.

    Parameters
    ----------
    run : RunData
        The first frames, at least one with a shape.
    colour : str
        What the colours of rods say.

    Attributes
    ----------
    scales : Scales
    colouring : Colouring
    reactions : dict
        Size that the forces and moments on bodies are scaled by, of those that act [N, N m].
    contact : bool
        Whether anything has touched yet.
    moves : bool
        Whether the robot may go away from where it is.
    """

    def __init__(self, run: RunData, colour: str = STRAIN):
        self.scales: Scales = choose_scales(run)
        self.colouring: Colouring = choose_colouring(run, colour)
        scene = _scene_of(run.description)
        if colour == STRAIN and (largest := _largest_eigenstrain(scene)) > self.colouring.limit:
            self.colouring = colouring_up_to(colour, rounded_up(largest))
        self.moves = _moves(scene, run.description)
        self.reactions: dict[str, float] = {}
        self.contact = False
        self._largest: deque[float] = deque(maxlen=FRAMES)
        self._reference = 0.0
        self.update(run)

    def update(self, run: RunData) -> bool:
        """Take further frames into account. Returns whether anything looks another way from them on."""
        before = self.scales, self.colouring, dict(self.reactions), self.contact
        if len(run.shape_times):
            self._update_contact(run.contact_forces)
            found = choose_colouring(run, self.colouring.quantity).limit
            if found > self.colouring.limit:
                self.colouring = colouring_up_to(self.colouring.quantity, rounded_up(GROWTH * found))
        if len(run.times):
            for name, reference in reaction_references(run, self.scales.size).items():
                if reference > self.reactions.get(name, 0.0):
                    self.reactions[name] = GROWTH * reference
        return before != (self.scales, self.colouring, self.reactions, self.contact)

    def _update_contact(self, forces: np.ndarray) -> None:
        """Scale contact arrows as for a whole run, so that a few frames of impact do not make all others invisible."""
        largest = np.linalg.norm(forces, axis=2).max(axis=1, initial=0.0)
        self._largest.extend(largest[largest > 0.0].tolist())
        if not self._largest:
            return
        reference = float(np.percentile(self._largest, 95))
        if self.contact and self._reference / CHANGE < reference < self._reference * CHANGE:
            return
        self.contact, self._reference = True, reference
        self.scales = replace(
            self.scales,
            metres_per_newton=1.0 / rounded_up(reference / (ARROW_SHARE * self.scales.size)),
            shown_force=SHOWN_SHARE * reference,
        )


def _scene_of(description: Description) -> SceneConfig | None:
    """Return the scene; None if this version cannot read it, so that nothing is known about the rest of the run."""
    try:
        return parse_scene(description.scene_text, description.scene_name)
    except SceneError:
        return None


def _largest_eigenstrain(scene: SceneConfig | None) -> float:
    """Return the largest eigenstrain of any layer at the ends of its channels' ranges."""
    found = [0.0]
    for rod in scene.rods if scene else ():
        for layer in rod.layers:
            for law in layer.eigenstrain:
                channel = scene.stimuli[law.stimulus]
                ends = np.array([channel.minimum, channel.maximum])
                found += np.abs(strains_at(rod, layer, law, ends)).ravel().tolist()
    return max(of for of in found if np.isfinite(of))


def _moves(scene: SceneConfig | None, description: Description) -> bool:
    """Return whether the rods are held by nothing that stays where it is."""
    holding = [body.name for body in description.bodies if body.holds_rods and body.prescribed]
    if scene is None:
        return not holding
    still = {body.name for body in scene.bodies if body.motion.type == "prescribed" and not body.motion.moves}
    return not still & set(holding)
