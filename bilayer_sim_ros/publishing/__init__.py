"""Output of a run on topics, in files and to viewers."""
