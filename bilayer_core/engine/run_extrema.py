"""Extrema over a run: heights, gaps, contact forces, curvature, strain, and what touches what.

The strain of the outermost fibre is that beyond the shape that layers take without load: with ε and χ of a curve, ε̄ and
χ̄ at rest, and y the height of a face over it, (ε − ε̄) − y (χ − χ̄). Curvature × thickness takes the whole section. A
beam that loads bend is judged as a plate by χ − χ̄ (`model.bent_plates`).
"""

from __future__ import annotations

import math

from bilayer_core.forces.bend_twist import bending_strain
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, RunExtrema, Stage, StateArrays, Work


@kernel
def _strain(strands, stage, at, e):
    """Return ε − ε̄ of an edge."""
    return at.length[e] / strands.rest_length[e] - 1.0 - stage.rest_edge[e]


@kernel
def _strain_about(strands, stage, at, j):
    """Return the mean of ε − ε̄ of the edges of a joint; a clamp edge has none."""
    a, b = strands.joint_a[j], strands.joint_b[j]
    if a >= strands.edge_count:
        return _strain(strands, stage, at, b)
    if b >= strands.edge_count:
        return _strain(strands, stage, at, a)
    return 0.5 * (_strain(strands, stage, at, a) + _strain(strands, stage, at, b))


@piece(int, Problem, StateArrays, Configuration, Stage, RunExtrema)
def count_shape(p, state, at, stage, extrema):
    """Take the shape of a state, which is `at`, into the extrema: curvature, strain, and heights of bodies."""
    strands, voronoi = p.strands, extrema.voronoi_length
    for j in range(voronoi.shape[0]):
        bend = bending_strain(at, strands.joint_a[j], strands.joint_b[j])
        curvature = abs(bend) / voronoi[j]
        extrema.curvature = max(extrema.curvature, curvature)
        extrema.curvature_by_thickness = max(extrema.curvature_by_thickness, curvature * extrema.thickness[j])
        rest = p.off_axis.rest[j, 0] if p.off_axis.exists else stage.rest_joint[j, 0]
        by_loads = (abs(bend - rest) / voronoi[j] - extrema.free[j]) * extrema.plate[j]
        if by_loads > extrema.bent_plate:
            extrema.bent_plate, extrema.most_bent = by_loads, j
        stretch = _strain_about(p.strands, stage, at, j)
        for f in range(2):
            strain = abs(stretch - extrema.faces[j, f] * (bend - rest) / voronoi[j])
            extrema.fibre_strain = max(extrema.fibre_strain, strain)
    for e in range(strands.edge_count):
        strain = abs(_strain(strands, stage, at, e))
        extrema.strain, extrema.fibre_strain = max(extrema.strain, strain), max(extrema.fibre_strain, strain)
    for b in range(extrema.body_top.shape[0]):
        extrema.body_top[b] = max(extrema.body_top[b], state.body_position[b, 2])
    return READY


@piece(int, Problem, StateArrays, Configuration, Work, float, float, RunExtrema)
def count_end(p, state, at, work, gap, time, extrema):
    """Take the end of a step into the extrema: the smallest gap there [m] and the time [s] are given. What the step
    supplied and lost is added to the energy that went through.
    """
    strands, nodes = p.strands, p.strands.node_mass.shape[0]
    height = largest = 0.0
    for i in range(nodes):
        height += strands.node_mass[i] * state.position[i, 2]
        force = p.sums.contact_point[i, 0] ** 2 + p.sums.contact_point[i, 1] ** 2 + p.sums.contact_point[i, 2] ** 2
        largest = max(largest, force)
    raised = p.raised
    for r in range(raised.edge.shape[0]):
        moment = raised.first_moment[r, 0] + raised.first_moment[r, 1]
        height += moment * state.director1[raised.edge[r], 2]
    for b in range(extrema.robot_mass.shape[0]):
        height += extrema.robot_mass[b] * state.body_position[b, 2]
    extrema.height, extrema.least_gap = max(extrema.height, height / extrema.mass), min(extrema.least_gap, gap)
    extrema.contact_force = max(extrema.contact_force, math.sqrt(largest))
    extrema.put_in += abs(work.account.supplied)
    extrema.taken_out += abs(work.account.lost)
    _count_contacts(p.surfaces, time, extrema)
    return count_shape(p, state, at, work.stage, extrema)


@kernel
def _count_contacts(surfaces, time, extrema):
    """Count the nodes that touch each surface, themselves or with a border; near pairs are in the order of surfaces."""
    if not surfaces.exists:
        return
    count, last = extrema.nodes, extrema.last_surface
    count[:], last[:] = 0, -1
    for c in range(surfaces.near_count[0]):
        i, s = surfaces.near_node[c], surfaces.near_surface[c]
        if surfaces.near_gap[c] < surfaces.d_hat and i < last.shape[0] and last[i] != s:
            count[s] += 1
            last[i] = s
    for s in range(count.shape[0]):
        extrema.most_nodes[s] = max(extrema.most_nodes[s], count[s])
        if count[s] > 0 and math.isnan(extrema.first_contact[s]):
            extrema.first_contact[s] = time
