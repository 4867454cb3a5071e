"""Readings of the present state of a simulation: time, shape, forces, energies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.model.impacts import reason_of_stiffness
from bilayer_core.model.model import Model
from bilayer_core.model.plan import Plan
from bilayer_core.model.state import State
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.system import versions
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import scene_text
from bilayer_core.simulation import observation as observe
from bilayer_core.simulation.capture import make_frame
from bilayer_core.simulation.energy_budget import EnergyLedger
from bilayer_core.simulation.friction_changes import coefficients
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.statistics import RunStatistics, center_of_mass
from bilayer_core.simulation.step_choice import Steps
from bilayer_core.simulation.stepper import Stepper
from bilayer_core.simulation.views.body import BodyView, body_views
from bilayer_core.simulation.views.clamp import ClampView, clamp_views
from bilayer_core.simulation.views.joint import JointView, joint_views
from bilayer_core.simulation.views.present import ByName, Present
from bilayer_core.simulation.views.rod import RodView, rod_views

Array = np.ndarray


class Readings(ABC):
    """Readings of a simulation, none of which changes it.

    Attributes
    ----------
    scene : SceneConfig
    plan : Plan
        Model, dimension and integrator, and the terms that are computed.
    model : Model
    steps : Steps
    dt : float
        Length of fixed steps, or of the first adaptive one [s].
    tolerance : float or None
        Of adaptive steps.
    statistics : RunStatistics
    cpu_time, wall_time : float
        Of the steps [s].
    """

    scene: SceneConfig
    plan: Plan
    model: Model
    steps: Steps
    dt: float
    tolerance: float | None
    statistics: RunStatistics
    cpu_time: float
    wall_time: float
    _state: State
    _stepper: Stepper
    _ledger: EnergyLedger | None

    @abstractmethod
    def compile(self) -> float:
        """Compile all kernels that are not in the cache, and compute the forces of the first state.

        Returns
        -------
        float
            CPU time of this [s].
        """

    @property
    def reasons(self) -> dict[str, str]:
        """Why `model`, `dimension`, `integrator` and `stepping` are what they are, and `contact_stiffness` if that is
        not the scene's.
        """
        return {**self.plan.reasons, "stepping": self.steps.reason, **reason_of_stiffness(self.model)}

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._state.time[0])

    @property
    def positions(self) -> Array:
        """Positions of nodes, layer by layer, then of contact points of bodies [m], shape (nodes, 3)."""
        return observe.positions_with_points(self.model, self._state)

    @property
    def velocities(self) -> Array:
        """Their velocities [m/s], shape (nodes, 3)."""
        return observe.velocities_with_points(self.model, self._state)

    @property
    def contact_forces(self) -> Array:
        """Barrier and friction force on each of them [N], shape (nodes, 3)."""
        return self._seen().contact_force

    @property
    def com(self) -> Array:
        """Mass centre of the rods [m], shape (3,)."""
        return center_of_mass(self.model, self._state)

    @property
    def stimulus(self) -> dict[str, float]:
        """Value of each channel over the last step, in its unit."""
        self.compile()
        return dict(zip(self.scene.stimuli, self._stepper.stimulus.tolist(), strict=True))

    @property
    def friction(self) -> dict[str, float]:
        """Coefficients of friction that act, by their keys in `contact.friction`; empty where there is none."""
        return coefficients(self.model, self._state)

    @property
    def rods(self) -> ByName[RodView]:
        """Every rod by name: positions, strain, curvature, directors and contact forces of its nodes, and its layers.

        Copies of a pattern have names of their own, such as ``arm_0``.
        """
        return rod_views(self._present)

    @property
    def bodies(self) -> ByName[BodyView]:
        """Every body by name: its pose, and the force and moment of contact and of the rods that it holds."""
        return body_views(self._present)

    @property
    def clamps(self) -> ByName[ClampView]:
        """Every end of a rod that a body holds, by ``ROD.start`` or ``ROD.end``: the force and moment that it bears."""
        return clamp_views(self._present)

    @property
    def joints(self) -> ByName[JointView]:
        """Every joint between bodies by name: the force and moment that it bears, and how far it gives way."""
        return joint_views(self._present)

    @property
    def _present(self) -> Present:
        return Present(self.model, self._state, self._evaluated, self._seen)

    def _evaluated(self) -> Stepper:
        """Return the stepper, with forces of the present state."""
        self.compile()
        self._stepper.engine.evaluate_end()
        return self._stepper

    def _seen(self) -> Parts:
        """Return all observables of the present state."""
        self.compile()
        return self._stepper.observe(self._state)[0]

    @property
    def curvatures(self) -> Array:
        """Curvature χ through the thickness at every node [1/m], shape (nodes,)."""
        return self._seen().curvature

    def energy(self) -> dict[str, float]:
        """Return the energy of each term.

        Returns
        -------
        dict of str to float
            By the name of the term [J].
        """
        return observe.energies(self.model, self._seen())

    @property
    def energy_account(self) -> Array:
        """Account of the energy that steps supplied, lost and made; slots in `engine.energy_account`."""
        return self._state.account.copy()

    def budget(self) -> dict[str, Any]:
        """Return where the energy went since the start, `reset`, `load_state` or `solve_static`; see `EnergyLedger`.

        Returns
        -------
        dict
            Energies by name [J].

        Raises
        ------
        InputError
            If the simulator keeps no budget.
        """
        if self._ledger is None:
            raise InputError("budget: is not kept; make the simulator with budget=True")
        self.compile()
        return self._ledger.budget()

    @property
    def description(self) -> Description:
        """Description of the run: everything that does not change while it lasts."""
        settings = {
            "model": self.plan.model,
            "dimension": str(self.plan.dimension),
            "integrator": self.plan.integrator,
            "dt": repr(self.dt),
            "tolerance": "none" if self.tolerance is None else repr(self.tolerance),
            "newton_tolerance": repr(self.steps.newton_tolerance),
            **versions(),
        }
        return observe.describe(self.model, self._state, settings, scene_text(self.scene))

    def frame(self) -> Frame:
        """Return a snapshot.

        Returns
        -------
        Frame
            The present values.
        """
        self.compile()
        return make_frame(self._stepper, self._state, self.time, self.statistics, self.cpu_time)
