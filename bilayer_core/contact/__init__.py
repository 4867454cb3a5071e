"""Distances, the barrier and friction laws, and the bound on a Newton step that keeps surfaces apart.

A *carrier* is a point with a radius that may touch surfaces: a node with half its layer's thickness, a contact point
of a body, the centre
of a ball with its radius. Contact is between a carrier and a plane, or between two carriers.
"""
