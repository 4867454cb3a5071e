"""Stress tests of the solver: hard cases, a matrix of settings, a judge of every step; `bilayer stress`."""
