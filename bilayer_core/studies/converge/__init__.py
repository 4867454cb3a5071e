"""How far the figures of a run depend on its time step and its mesh."""
