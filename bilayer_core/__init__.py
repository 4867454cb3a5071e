"""Simulation of bilayer soft robots: scenes, the numerical core, logs, pictures and the command line.

``load_scene``, ``Simulator``, ``Recorder``, ``estimate_error``, ``fit``, ``design``, ``read_log``, ``compare``,
``sweep``, ``optimise``, ``read_results``, ``__version__`` and the classes of scenes (``Scene``, ``Rod``, ``Layer``,
...) are loaded at their first use: importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:  # what checkers of types take for true, without an import of milliseconds
    from bilayer_core.log.run.compare import compare
    from bilayer_core.log.run.log_reader import read_log
    from bilayer_core.log.run.recorder import Recorder
    from bilayer_core.scene.loader import load_scene
    from bilayer_core.scene.scene_classes import *
    from bilayer_core.simulation.simulator import Simulator
    from bilayer_core.studies.converge.study import estimate_error
    from bilayer_core.studies.fitting.fit import fit
    from bilayer_core.studies.shaping.shape_search import design
    from bilayer_core.studies.sweeps.optimise import optimise
    from bilayer_core.studies.sweeps.run_sweep import sweep
    from bilayer_core.studies.sweeps.sweep_result import read_results

    __version__: str

DISTRIBUTION = "bilayer_sim_ros"
_HOME = {
    "Recorder": "bilayer_core.log.run.recorder",
    "Simulator": "bilayer_core.simulation.simulator",
    "compare": "bilayer_core.log.run.compare",
    "design": "bilayer_core.studies.shaping.shape_search",
    "estimate_error": "bilayer_core.studies.converge.study",
    "fit": "bilayer_core.studies.fitting.fit",
    "load_scene": "bilayer_core.scene.loader",
    "optimise": "bilayer_core.studies.sweeps.optimise",
    "read_log": "bilayer_core.log.run.log_reader",
    "read_results": "bilayer_core.studies.sweeps.sweep_result",
    "sweep": "bilayer_core.studies.sweeps.run_sweep",
}

__all__ = [
    "AddedMass",
    "ArcPath",
    "Body",
    "BodyDrag",
    "Box",
    "BoxObstacle",
    "Coefficients",
    "Contact",
    "ContactPoint",
    "Coupling",
    "Cylinder",
    "CylinderObstacle",
    "Damping",
    "Diffusion",
    "Eigenstrain",
    "Face",
    "FibreDirection",
    "Fibres",
    "Fluid",
    "Free",
    "Friction",
    "Grid",
    "Guided",
    "HelixPath",
    "Hold",
    "Imperfection",
    "Joint",
    "Layer",
    "Light",
    "Listed",
    "Load",
    "Material",
    "Mirror",
    "Output",
    "Placed",
    "Plane",
    "PlaneObstacle",
    "PointMass",
    "PolylinePath",
    "Prescribed",
    "PulseTrain",
    "Ramp",
    "Recorder",
    "Rod",
    "Rotation",
    "Scene",
    "Sequence",
    "SequencePart",
    "Simulator",
    "Sine",
    "Sliding",
    "Solver",
    "Source",
    "Sphere",
    "SphereObstacle",
    "SpiralPath",
    "SplinePath",
    "Square",
    "StiffnessChange",
    "Stimulus",
    "StraightPath",
    "Table",
    "Translation",
    "Turning",
    "__version__",
    "compare",
    "design",
    "estimate_error",
    "fit",
    "load_scene",
    "optimise",
    "read_log",
    "read_results",
    "sweep",
]


def __getattr__(name: str) -> object:
    if name == "__version__":
        return _installed_version()
    if name in __all__:
        return getattr(import_module(_HOME.get(name, "bilayer_core.scene.scene_classes")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


def _installed_version() -> str:
    """Return the version of the installed distribution; a checkout that is only on the import path has none and says
    so.
    """
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"
