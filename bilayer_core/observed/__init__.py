"""Observations of a run and actions on it from outside, shared by the modules that make, record and show runs."""
