"""Elasticity of layers and of the bond between them."""

from __future__ import annotations

import numpy as np

from ...forces.bend_twist import bend_twist
from ...forces.coupling import bond_translation
from ...forces.stretch import stretch
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, Term


class Stretching(Term):
    """Axial strain of edges, eigenstrain subtracted."""

    names = ("stretching",)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, out = self.model, self.out
        out.energy["stretching"] = stretch(
            model.axial_stiffness,
            model.rest_length,
            self.context.eigenstrain,
            at.length,
            at.tangent,
            out.edge,
            out.matrix.edge_hessian,
            with_hessian,
        )


class _Joints(Term):
    """A range of joints, with a stiffness (n_joint, 3) of its own."""

    def _bend_twist(self, first: int, last: int, stiffness: np.ndarray, at: Configuration, with_hessian: bool):
        model, out = self.model, self.out
        return bend_twist(
            first,
            last,
            model.joint_a,
            model.joint_b,
            stiffness,
            model.joint_rest,
            at.length,
            at.tangent,
            at.director1,
            at.director2,
            self.context.start.joint_strain[:, 2],
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
        energies = self._bend_twist(0, self.model.bend_count, self.model.joint_stiffness, at, with_hessian)
        self.out.energy["bending"], self.out.energy["twisting"] = energies

    def parts(self) -> tuple[Term, ...]:
        return _OneStrain(self, "bending", (0, 1)), _OneStrain(self, "twisting", (2,))


class _OneStrain(_Joints):
    """`BendingAndTwisting` with some of the three stiffnesses alone."""

    def __init__(self, whole: BendingAndTwisting, name: str, columns: tuple[int, ...]):
        super().__init__(whole.model, whole.out)
        self.names = (name,)
        self.context = whole.context
        self._stiffness = np.zeros_like(self.model.joint_stiffness)
        self._stiffness[:, columns] = self.model.joint_stiffness[:, columns]
        self._stiffness.flags.writeable = False  # as the model's: another type would be another specialisation

    def add(self, at: Configuration, with_hessian: bool) -> None:
        energies = self._bend_twist(0, self.model.bend_count, self._stiffness, at, with_hessian)
        self.out.energy[self.names[0]] = sum(energies)


class Bond(_Joints):
    """Translation and rotation of paired edges against each other."""

    names = ("bond",)

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._cross_hessian = out.matrix.cross_hessian[model.bend_count :]

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, out, matrix = self.model, self.out, self.out.matrix
        joints = (model.bend_count, len(model.joint_a), model.joint_stiffness)
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
