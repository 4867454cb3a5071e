"""The Newton matrix: assembly, band solver, border of bodies and of nodes that left the band."""
