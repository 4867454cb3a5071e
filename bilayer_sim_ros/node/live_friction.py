"""Coefficients of friction as parameters: given at the start they are the scene's, set later they act from a tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future

from bilayer_core.errors import InputError
from bilayer_core.log.messages.events import Event, changed_setting
from bilayer_core.model.set_friction import COEFFICIENTS
from bilayer_core.scene.config import SceneConfig
from bilayer_core.simulation.friction_changes import refuse_friction
from bilayer_core.simulation.simulator import Simulator
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.node.parameters import FRICTION, FRICTION_OF_SCENE, Value
from bilayer_sim_ros.services.requests import answered

KEYS = dict(zip(FRICTION, COEFFICIENTS, strict=True))
"""Parameter -> key of `contact.friction`."""


def friction_overrides(scene: SceneConfig, parameters: Mapping[str, Value]) -> list[str]:
    """Return the overrides of a scene by parameters before it is run; InputError if it has no friction to change."""
    given = {name: parameters[name] for name in KEYS if parameters[name] != FRICTION_OF_SCENE}
    if given and (scene.contact is None or scene.contact.friction is None):
        name, value = next(iter(given.items()))
        raise InputError(
            f"parameter '{name}' is {value!r}; the scene {scene.name!r} has no contact.friction, so allowed is "
            f"{FRICTION_OF_SCENE:g}, as the scene says"
        )
    return [f"contact.friction.{KEYS[name]}={value!r}" for name, value in given.items()]


class LiveFriction:
    """Has coefficients change at the next tick, and tells so when they do.

    `commands`: where changes wait for a tick; they are forgotten with the other commands in a reset. `tell`: publishes
    and logs an event; called in the stepping thread.
    """

    def __init__(self, simulator: Simulator, commands: Commands, tell: Callable[[Event], None]):
        self._model, self._commands, self._tell = simulator.model, commands, tell

    @property
    def changes(self) -> dict[str, Callable[[Value], Future]]:
        """For `LiveParameters`: each refuses with an InputError, or answers when the change waits for its tick."""
        return {name: lambda value, name=name: self._ask(name, value) for name in KEYS}

    def _ask(self, name: str, value: float) -> Future:
        key, given = KEYS[name], None if value == FRICTION_OF_SCENE else value
        try:
            refuse_friction(self._model, given, key)
        except InputError as error:
            raise InputError(f"parameter '{name}' is {value!r}: {error}") from error

        def act(simulator: Simulator, _: float) -> None:
            simulator.set_friction(given, key)
            acting = simulator.friction[key]
            self._tell(changed_setting(simulator.time, f"contact.friction.{key} is {acting:g}"))

        self._commands.ask((name, ""), act)
        return answered("")
