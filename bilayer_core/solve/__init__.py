"""The incremental potential of a step, its matrix, its minimum."""
