"""How fast, and how accurate for that: models, integrators, steps and meshes, and other programs beside them."""
