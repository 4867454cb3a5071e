"""Stretching, bending, twisting and bonds, in space and in a plane."""

from __future__ import annotations

from ..forces.bend_twist import bend_twist
from ..forces.coupling import bond_translation
from ..forces.planar import (
    in_plane_frames,
    planar_bend,
    planar_bond,
    planar_stretch,
    planar_stretch_bend,
    polar_to_edges,
)
from ..forces.stretch import stretch
from ..forces.stretch_bend import natural_curvature, stretch_bend
from ..jit import inner
from .copying import copy
from .terms import place_of

STRETCHING, BENDING, TWISTING, BOND = map(place_of, ("stretching", "bending", "twisting", "bond"))


@inner
def add_in_space(space, off_axis, bonds, strands, at, stage, sums, with_hessian):
    """Stretching, bending, twisting and bonds of dimension 3."""
    if space is None:
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


@inner
def take_rest(off_axis, stage):
    """Natural curvature of a stage, but for what strains off the axis add."""
    if off_axis is None:
        return
    copy(stage.rest_joint, off_axis.rest_out)


@inner
def _bend_off_axis(off_axis, strands, at, stage):
    """Natural curvature of joints off the axis."""
    if off_axis is None:
        return
    natural_curvature(
        off_axis.joint,
        off_axis.slope,
        strands.joint_a,
        strands.joint_b,
        strands.rest_length,
        at.length,
        stage.rest_joint,
        off_axis.rest_out,
    )


@inner
def _add_off_axis(off_axis, strands, at, sums, with_hessian):
    if off_axis is None:
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


@inner
def add_in_plane(plane, off_axis, bonds, strands, at, stage, sums, with_hessian):
    """Stretching, bending and bonds of dimension 2."""
    if plane is None:
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
            sums.cross_hessian,
            with_hessian,
        )
        _add_off_axis_in_plane(plane, off_axis, strands, at, sums, with_hessian)
    _add_bonds_in_plane(plane, bonds, strands, at, stage, sums, with_hessian)
    polar_to_edges(strands.axes, plane.frame, plane.polar_gradient, sums.edge)


@inner
def _add_off_axis_in_plane(plane, off_axis, strands, at, sums, with_hessian):
    if off_axis is None:
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
        sums.cross_hessian,
        with_hessian,
    )


@inner
def _add_bonds_in_plane(plane, bonds, strands, at, stage, sums, with_hessian):
    if bonds is None:
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
        sums.cross_hessian,
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
        sums.cross_hessian,
        sums.pair,
        sums.pair_hessian,
        plane.mixed_hessian,
        with_hessian,
    )


@inner
def _add_bonds(bonds, space, strands, at, stage, sums, with_hessian):
    if bonds is None:
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
