"""Elasticity of layers and of the bond between them."""

from __future__ import annotations

import numpy as np

from ...forces.bend_twist import bend_twist
from ...forces.coupling import bond_translation
from ...forces.stretch import stretch
from ...forces.stretch_bend import natural_curvature, stretch_bend
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, StepContext, Term

Array = np.ndarray


class Stretching(Term):
    """Axial strain of edges, eigenstrain subtracted."""

    names = ("stretching",)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, out = self.model, self.out
        out.energy["stretching"] = stretch(
            model.axial_stiffness,
            model.rest_length,
            self.context.rest.edge,
            at.length,
            at.tangent,
            out.edge,
            out.matrix.edge_hessian,
            with_hessian,
        )


class _Joints(Term):
    """A range of joints, with stiffness and rest strains (n_joint, 3) of its own."""

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self._twist = context.start.joint_strain[:, 2].copy()

    def _bend_twist(
        self, first: int, last: int, stiffness: Array, rest: Array, at: Configuration, with_hessian: bool
    ) -> tuple[float, float]:
        model, out = self.model, self.out
        return bend_twist(
            first,
            last,
            model.joint_a,
            model.joint_b,
            stiffness,
            rest,
            at.length,
            at.tangent,
            at.director1,
            at.director2,
            self._twist,
            at.joint_strain,
            out.edge,
            out.matrix.edge_hessian,
            out.matrix.cross_hessian,
            with_hessian,
        )


class BendingAndTwisting(_Joints):
    """Both curvatures and the twist at inner nodes and clamps."""

    names = ("bending", "twisting")

    def add(self, at: Configuration, with_hessian: bool) -> None:
        energies = self.add_with(self.model.joint_stiffness, at, with_hessian)
        self.out.energy["bending"], self.out.energy["twisting"] = energies

    def add_with(self, stiffness: Array, at: Configuration, with_hessian: bool) -> tuple[float, float]:
        """Add the derivatives with a stiffness (n_joint, 3); return the energies of bending and twisting [J]."""
        return self._bend_twist(0, self.model.bend_count, stiffness, self.context.rest.joint, at, with_hessian)

    def parts(self) -> tuple[Term, ...]:
        return _OneStrain(self, "bending", (0, 1)), _OneStrain(self, "twisting", (2,))


class BendingOffAxis(BendingAndTwisting):
    """The same where stretching bends: a curve that is not everywhere on the neutral axis."""

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._coupled = (model.coupled_joint, model.strain_slope, model.joint_a, model.joint_b)
        self._rest = np.zeros_like(model.joint_rest)
        self._rest_read_only = self._rest.view()
        self._rest_read_only.flags.writeable = False  # as the model's: another type would be another specialisation

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self._rest[:] = context.rest.joint

    def add_with(self, stiffness: Array, at: Configuration, with_hessian: bool) -> tuple[float, float]:
        model, out, rest = self.model, self.out, self._rest_read_only
        natural_curvature(*self._coupled, model.rest_length, at.length, self.context.rest.joint, self._rest)
        energies = self._bend_twist(0, model.bend_count, stiffness, rest, at, with_hessian)
        stretch_bend(
            *self._coupled,
            stiffness,
            rest,
            at.joint_strain,
            at.length,
            at.tangent,
            at.director1,
            at.director2,
            out.edge,
            out.matrix.edge_hessian,
            out.matrix.cross_hessian,
            with_hessian,
        )
        return energies


class _OneStrain(Term):
    """`BendingAndTwisting` with some of the three stiffnesses alone."""

    def __init__(self, whole: BendingAndTwisting, name: str, columns: tuple[int, ...]):
        super().__init__(whole.model, whole.out)
        self.names = (name,)
        self._whole = whole
        self._stiffness = np.zeros_like(self.model.joint_stiffness)
        self._stiffness[:, columns] = self.model.joint_stiffness[:, columns]
        self._stiffness.flags.writeable = False  # as the model's: another type would be another specialisation

    def add(self, at: Configuration, with_hessian: bool) -> None:
        self.out.energy[self.names[0]] = sum(self._whole.add_with(self._stiffness, at, with_hessian))


class Bond(_Joints):
    """Translation and rotation of paired edges against each other."""

    names = ("bond",)

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._cross_hessian = out.matrix.cross_hessian[model.bend_count :]

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, out, matrix = self.model, self.out, self.out.matrix
        joints = (model.bend_count, len(model.joint_a), model.joint_stiffness, self.context.rest.joint)
        rotation = self._bend_twist(*joints, at, with_hessian)
        translation = bond_translation(
            at.position,
            model.edge_node,
            model.pair_top,
            model.pair_bottom,
            model.pair_stiffness,
            model.pair_rest,
            at.length,
            at.tangent,
            at.director1,
            at.director2,
            out.edge,
            matrix.edge_hessian,
            out.pair,
            matrix.pair_hessian,
            matrix.top_hessian,
            matrix.bottom_hessian,
            self._cross_hessian,
            with_hessian,
        )
        out.energy["bond"] = sum(rotation) + translation
