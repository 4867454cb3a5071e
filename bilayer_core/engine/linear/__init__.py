"""The Newton matrix: assembly, band solver, border of bodies and of contact columns."""
