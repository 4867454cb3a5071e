"""A log as a node that plays it."""
