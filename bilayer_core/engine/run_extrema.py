"""Extrema over a run: heights, gaps, contact forces, curvature, strain, and what touches what."""

from __future__ import annotations

import math

from bilayer_core.forces.bend_twist import bending_strain
from bilayer_core.forces.rod_arms import node_of
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, RunExtrema, Stage, StateArrays


@piece(int, Problem, StateArrays, Configuration, Stage, RunExtrema)
def count_shape(p, state, at, stage, extrema):
    """Take the shape of a state, which is `at`, into the extrema: curvature, strain, and heights of bodies."""
    strands, rest_edge, figures, voronoi = p.strands, stage.rest_edge, extrema.figures, extrema.voronoi_length
    sharpest = 0.0
    for j in range(voronoi.shape[0]):
        bend = bending_strain(at, strands.joint_a[j], strands.joint_b[j])
        sharpest = max(sharpest, abs(bend) / voronoi[j])
    largest = 0.0
    for e in range(strands.edge_count):
        largest = max(largest, abs(at.length[e] / strands.rest_length[e] - 1.0 - rest_edge[e]))
    figures[3], figures[4] = max(figures[3], sharpest), max(figures[4], largest)
    for b in range(extrema.body_top.shape[0]):
        extrema.body_top[b] = max(extrema.body_top[b], state.body_position[b, 2])
    return READY


@piece(int, Problem, StateArrays, Configuration, Stage, float, float, RunExtrema)
def count_end(p, state, at, stage, gap, time, extrema):
    """Take the end of a step into the extrema: the smallest gap there [m] and the time [s] are given."""
    strands, figures, nodes = p.strands, extrema.figures, p.strands.node_mass.shape[0]
    height = largest = 0.0
    for i in range(nodes):
        height += strands.node_mass[i] * state.position[i, 2]
        force = p.sums.contact_point[i, 0] ** 2 + p.sums.contact_point[i, 1] ** 2 + p.sums.contact_point[i, 2] ** 2
        largest = max(largest, force)
    raised = p.raised
    for r in range(raised.edge.shape[0]):
        moment = raised.first_moment[r, 0] + raised.first_moment[r, 1]
        height += moment * state.director1[raised.edge[r], 2]
    figures[0], figures[1] = max(figures[0], height / extrema.mass), min(figures[1], gap)
    figures[2] = max(figures[2], math.sqrt(largest))
    _count_contacts(p.surfaces, time, extrema)
    return count_shape(p, state, at, stage, extrema)


@kernel
def _count_contacts(surfaces, time, extrema):
    """Nodes that touch surfaces, themselves or with a border; near pairs are in the order of surfaces."""
    if not surfaces.exists:
        return
    count, last = extrema.nodes, extrema.last_surface
    count[:], last[:] = 0, -1
    for c in range(surfaces.near_count[0]):
        i, s = node_of(surfaces, surfaces.near_contact_point[c]), surfaces.near_surface[c]
        if surfaces.near_gap[c] < surfaces.d_hat and i < last.shape[0] and last[i] != s:
            count[s] += 1
            last[i] = s
    for s in range(count.shape[0]):
        extrema.most_nodes[s] = max(extrema.most_nodes[s], count[s])
        if count[s] > 0 and math.isnan(extrema.first_contact[s]):
            extrema.first_contact[s] = time
