"""The compiled engine: Newton's method on the incremental potential, steps, evaluations."""

from bilayer_core.engine import between_ends, engine, evaluator  # noqa: F401 (import all that declares pieces)
from bilayer_core.kinematics import marker_lines, node_frames  # noqa: F401
