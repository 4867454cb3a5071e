"""Classes of the parts of a scene, for scenes that programs make: `bilayer_core` has them by these names."""

from bilayer_core.scene.body import Body, BodyDrag, ContactPoint, Free, Guided, Prescribed
from bilayer_core.scene.config import (
    AddedMass,
    Contact,
    Coupling,
    Damping,
    Fluid,
    Light,
    Material,
    Output,
    Solver,
    Stimulus,
)
from bilayer_core.scene.config import SceneConfig as Scene
from bilayer_core.scene.diffusion import Diffusion, Face, Source
from bilayer_core.scene.eigenstrain import Eigenstrain, StiffnessChange
from bilayer_core.scene.friction import Coefficients, Friction
from bilayer_core.scene.imperfection import Imperfection
from bilayer_core.scene.joint import Joint
from bilayer_core.scene.load import Load, PointMass
from bilayer_core.scene.mechanism import Sliding, Turning
from bilayer_core.scene.paths import ArcPath, HelixPath, SpiralPath, StraightPath
from bilayer_core.scene.pattern import Grid, Listed, Mirror, Placed, Rotation, Translation
from bilayer_core.scene.point_paths import PolylinePath, SplinePath
from bilayer_core.scene.rod import FibreDirection, Fibres, Layer, Rod
from bilayer_core.scene.schedule import Hold, Ramp, Sequence, SequencePart, Table
from bilayer_core.scene.shape import (
    Box,
    BoxObstacle,
    Cylinder,
    CylinderObstacle,
    Plane,
    PlaneObstacle,
    Sphere,
    SphereObstacle,
)
from bilayer_core.scene.waveform import PulseTrain, Sine, Square

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
    "Rod",
    "Rotation",
    "Scene",
    "Sequence",
    "SequencePart",
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
]
