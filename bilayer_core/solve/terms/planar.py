"""Elasticity in a plane: stretching, bending and bonds, in lengths and angles of edges."""

from __future__ import annotations

import numpy as np

from ...forces.planar import (
    in_plane_frames,
    planar_bend,
    planar_bond,
    planar_stretch,
    planar_stretch_bend,
    polar_to_edges,
)
from ...forces.stretch_bend import natural_curvature
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, StepContext, Term


class PlanarElasticity(Term):
    """Stretching, bending, and the bond where there are paired layers."""

    def __init__(self, model: Model, out: Accumulators, names: tuple[str, ...] | None = None):
        super().__init__(model, out)
        self._coupled = (model.coupled_joint, model.strain_slope, model.joint_a, model.joint_b)
        self._rest = np.zeros_like(model.joint_rest)
        self._rest_read_only = self._rest.view()
        self._rest_read_only.flags.writeable = False  # as the model's: another type would be another specialisation
        self.names = names or (("stretching", "bending", "bond") if len(model.pair_top) else ("stretching", "bending"))

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        if len(self.model.coupled_joint):
            self._rest[:] = context.rest.joint

    def add(self, at: Configuration, with_hessian: bool) -> None:
        axes, out, matrix = self.model.directions, self.out, self.out.matrix
        matrix.polar_gradient.fill(0.0)
        in_plane_frames(axes, at.length, at.tangent, matrix.frame)
        for name in self.names:
            out.energy[name] = getattr(self, f"_{name}")(at, with_hessian)
        polar_to_edges(axes, matrix.frame, matrix.polar_gradient, out.edge)

    def parts(self) -> tuple[Term, ...]:
        parts = tuple(PlanarElasticity(self.model, self.out, (name,)) for name in self.names)
        for part in parts:
            part.start_step(self.context)
        return parts

    def _stretching(self, at: Configuration, with_hessian: bool) -> float:
        model, matrix = self.model, self.out.matrix
        law = (model.axial_stiffness, model.rest_length, self.context.rest.edge, at.length)
        return planar_stretch(*law, matrix.polar_gradient, matrix.polar_hessian, with_hessian)

    def _bend(self, first: int, last: int, rest: np.ndarray, at: Configuration, with_hessian: bool) -> float:
        model, matrix = self.model, self.out.matrix
        return planar_bend(
            first,
            last,
            model.joint_a,
            model.joint_b,
            model.joint_stiffness,
            rest,
            model.plane.side,
            matrix.frame,
            at.joint_strain,
            matrix.polar_gradient,
            matrix.polar_hessian,
            matrix.cross_hessian,
            with_hessian,
        )

    def _bending(self, at: Configuration, with_hessian: bool) -> float:
        model, matrix, rest = self.model, self.out.matrix, self._rest_read_only
        if not len(model.coupled_joint):
            return self._bend(0, model.bend_count, self.context.rest.joint, at, with_hessian)
        natural_curvature(*self._coupled, model.rest_length, at.length, self.context.rest.joint, self._rest)
        energy = self._bend(0, model.bend_count, rest, at, with_hessian)
        planar_stretch_bend(
            *self._coupled,
            model.joint_stiffness,
            rest,
            at.joint_strain,
            model.plane.side,
            matrix.frame,
            matrix.polar_gradient,
            matrix.polar_hessian,
            matrix.cross_hessian,
            with_hessian,
        )
        return energy

    def _bond(self, at: Configuration, with_hessian: bool) -> float:
        model, matrix, out = self.model, self.out.matrix, self.out
        rotation = self._bend(model.bend_count, len(model.joint_a), self.context.rest.joint, at, with_hessian)
        return rotation + planar_bond(
            model.bend_count,
            model.directions,
            at.position,
            model.edge_node,
            model.pair_top,
            model.pair_bottom,
            model.pair_stiffness,
            model.pair_rest,
            model.plane.side,
            matrix.frame,
            matrix.polar_gradient,
            matrix.polar_hessian,
            matrix.cross_hessian,
            out.pair,
            matrix.pair_hessian,
            matrix.mixed_hessian,
            with_hessian,
        )
