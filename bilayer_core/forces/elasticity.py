"""Stretching, bending, twisting and bonds, in space and in a plane."""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..kinematics.copying import copy
from ..model.force_places import place_of
from ..model.records.parts import Plane, Space
from ..model.records.problem import Problem
from ..model.records.status import READY
from ..model.records.step import Place, Stage
from .bend_twist import bend_twist
from .coupling import bond_translation
from .planar import (
    in_plane_frames,
    planar_bend,
    planar_bond,
    planar_stretch,
    planar_stretch_bend,
    polar_to_edges,
)
from .stretch import stretch
from .stretch_bend import natural_curvature, stretch_bend

STRETCHING, BENDING, TWISTING, BOND = map(place_of, ("stretching", "bending", "twisting", "bond"))


@kernel
def add_in_space(space, off_axis, bonds, strands, at, stage, sums, with_hessian):
    """Stretching, bending, twisting and bonds of dimension 3."""
    if not space.exists:
        return
    if sums.selected[STRETCHING]:
        sums.energy[STRETCHING] = stretch(
            strands.axial_stiffness,
            strands.rest_length,
            stage.rest_edge,
            at.length,
            at.tangent,
            sums.edge,
            sums.edge_hessian,
            with_hessian,
        )
    if sums.selected[BENDING] or sums.selected[TWISTING]:
        _bend_off_axis(off_axis, strands, at, stage)
        sums.energy[BENDING], sums.energy[TWISTING] = bend_twist(
            strands.first_bend,
            strands.bend_count,
            strands.joint_a,
            strands.joint_b,
            strands.joint_stiffness,
            stage.natural,
            at.length,
            at.tangent,
            at.director1,
            at.director2,
            stage.twist,
            at.joint_strain,
            sums.edge,
            sums.edge_hessian,
            sums.cross_hessian,
            with_hessian,
        )
        _add_off_axis(off_axis, strands, at, sums, with_hessian)
    _add_bonds(bonds, space, strands, at, stage, sums, with_hessian)


@kernel
def take_rest(off_axis, stage):
    """Natural curvature of a stage, but for what strains off the axis add."""
    if not off_axis.exists:
        return
    copy(stage.rest_joint, off_axis.rest)


@kernel
def _bend_off_axis(off_axis, strands, at, stage):
    """Natural curvature of joints off the axis."""
    if not off_axis.exists:
        return
    natural_curvature(
        off_axis.joint,
        off_axis.slope,
        strands.joint_a,
        strands.joint_b,
        strands.rest_length,
        at.length,
        stage.rest_joint,
        off_axis.rest,
    )


@kernel
def _add_off_axis(off_axis, strands, at, sums, with_hessian):
    if not off_axis.exists:
        return
    stretch_bend(
        off_axis.joint,
        off_axis.slope,
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        off_axis.rest,
        at.joint_strain,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        sums.edge,
        sums.edge_hessian,
        sums.cross_hessian,
        with_hessian,
    )


@kernel
def add_in_plane(plane, off_axis, bonds, strands, at, stage, sums, with_hessian):
    """Stretching, bending and bonds of dimension 2."""
    if not plane.exists:
        return
    plane.polar_gradient[:] = 0.0
    in_plane_frames(strands.axes, at.length, at.tangent, plane.frame)
    if sums.selected[STRETCHING]:
        sums.energy[STRETCHING] = planar_stretch(
            strands.axial_stiffness,
            strands.rest_length,
            stage.rest_edge,
            at.length,
            plane.polar_gradient,
            plane.polar_hessian,
            with_hessian,
        )
    if sums.selected[BENDING]:
        _bend_off_axis(off_axis, strands, at, stage)
        sums.energy[BENDING] = planar_bend(
            strands.first_bend,
            strands.bend_count,
            strands.joint_a,
            strands.joint_b,
            strands.joint_stiffness,
            stage.natural,
            plane.side,
            plane.frame,
            at.joint_strain,
            plane.polar_gradient,
            plane.polar_hessian,
            plane.cross_hessian,
            with_hessian,
        )
        _add_off_axis_in_plane(plane, off_axis, strands, at, sums, with_hessian)
    _add_bonds_in_plane(plane, bonds, strands, at, stage, sums, with_hessian)
    polar_to_edges(strands.axes, plane.frame, plane.polar_gradient, sums.edge)


@kernel
def _add_off_axis_in_plane(plane, off_axis, strands, at, sums, with_hessian):
    if not off_axis.exists:
        return
    planar_stretch_bend(
        off_axis.joint,
        off_axis.slope,
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        off_axis.rest,
        at.joint_strain,
        plane.side,
        plane.frame,
        plane.polar_gradient,
        plane.polar_hessian,
        plane.cross_hessian,
        with_hessian,
    )


@kernel
def _add_bonds_in_plane(plane, bonds, strands, at, stage, sums, with_hessian):
    if not bonds.exists:
        return
    if not sums.selected[BOND]:
        return
    rotation = planar_bend(
        strands.bend_count,
        strands.joint_a.shape[0],
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        stage.rest_joint,
        plane.side,
        plane.frame,
        at.joint_strain,
        plane.polar_gradient,
        plane.polar_hessian,
        plane.cross_hessian,
        with_hessian,
    )
    sums.energy[BOND] = rotation + planar_bond(
        strands.bend_count,
        strands.axes,
        at.position,
        strands.edge_node,
        bonds.top,
        bonds.bottom,
        bonds.stiffness,
        bonds.rest,
        plane.side,
        plane.frame,
        plane.polar_gradient,
        plane.polar_hessian,
        plane.cross_hessian,
        sums.pair,
        plane.pair_hessian,
        plane.mixed_hessian,
        with_hessian,
    )


@kernel
def _add_bonds(bonds, space, strands, at, stage, sums, with_hessian):
    if not bonds.exists:
        return
    if not sums.selected[BOND]:
        return
    bending, twisting = bend_twist(
        strands.bend_count,
        strands.joint_a.shape[0],
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        stage.rest_joint,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        stage.twist,
        at.joint_strain,
        sums.edge,
        sums.edge_hessian,
        sums.cross_hessian,
        with_hessian,
    )
    translation = bond_translation(
        at.position,
        strands.edge_node,
        bonds.top,
        bonds.bottom,
        bonds.stiffness,
        bonds.rest,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        sums.edge,
        sums.edge_hessian,
        sums.pair,
        sums.pair_hessian,
        space.top_hessian,
        space.bottom_hessian,
        space.bond_hessian,
        with_hessian,
    )
    sums.energy[BOND] = bending + twisting + translation


@piece(float, Space, Problem, Place, Stage, bool)
def add_elasticity_in_space(space, p, at, stage, with_hessian):
    """Elasticity of dimension 3."""
    add_in_space(space, p.off_axis, p.bonds, p.strands, at, stage, p.sums, with_hessian)
    return math.inf


@piece(float, Plane, Problem, Place, Stage, bool)
def add_elasticity_in_plane(plane, p, at, stage, with_hessian):
    """Elasticity of dimension 2."""
    add_in_plane(plane, p.off_axis, p.bonds, p.strands, at, stage, p.sums, with_hessian)
    return math.inf


@piece(int, int, Problem, Place, Stage)
def start_elasticity(_, p, start, stage):
    """Natural curvatures of the stage."""
    take_rest(p.off_axis, stage)
    return READY
