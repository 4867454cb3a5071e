"""Distances, the barrier and friction laws, and the bound on a Newton step that keeps surfaces apart.

A *contact point* is a point with a radius that may touch surfaces: a node with half its layer's thickness, a point that
a scene gives to a body, the centre of a ball, a corner of a box, a point on the rim of a cylinder. A *surface* is that
of a convex shape. Rods touch each other by files of their own.
"""
