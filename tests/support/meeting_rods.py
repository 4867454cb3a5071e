"""Models of rods that come near each other, and their contact by itself."""

import numpy as np
from support.evaluations import at_rest
from support.sample_scenes import contact, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.model.build_model import build_model

D_HAT = 1e-3


WIDTH = 2e-3  # of rods that count as round


def turned(rod_dict, direction, normal=(0, 0, 1)):
    """The rod along another direction."""
    rod_dict["path"]["direction"], rod_dict["normal"] = list(direction), list(normal)
    return rod_dict


def model_of(rods, **more):
    """The model of rods that are as wide as round ones may be."""
    rods = [{**each, "width": WIDTH} for each in rods]
    return build_model(load_scene(scene(rods, contact={**contact(coefficient=0.4), "rods": True}, **more)))


def parallel_rods(rng, own=({}, {})):
    """Two rods side by side on different meshes, the second longer: insides, nodes and ends of segments face points;
    they may have keys of their own.
    """
    rods = [rod([layer()], length=0.02, stations=6, name="a"), rod([layer()], length=0.03, stations=14, name="b")]
    rods = [one | keys for one, keys in zip(rods, own, strict=True)]
    model = model_of([rods[0], {**rods[1], "path": {**rods[1]["path"], "start": [-0.004, 0, 5e-3]}}])
    position = model.start_position.copy()
    position[6:, 2] = 1.7e-3
    return model, position + 1e-4 * rng.standard_normal(position.shape)


def crossed_rods(rng):
    """Two rods that cross between their nodes."""
    rods = [rod([layer()], length=0.02, stations=4, name="a"), rod([layer()], length=0.02, stations=4, name="b")]
    rods[1]["path"]["start"] = [0.01, -0.01, 0.01]
    model = model_of([rods[0], turned(rods[1], (0, 1, 0))])
    position = model.start_position.copy()
    position[4:, 2] = 1.6e-3
    return model, position + 1e-4 * rng.standard_normal(position.shape)


def folded_rod(rng):
    """A bilayer folded onto itself, with kinks in the segments: points face corners from inside."""
    stations = 31
    model = model_of([rod([layer("bottom"), layer("top")], length=0.06, stations=stations)])
    radius = 1.4e-3  # of the fold's path
    arc = np.linspace(0.0, 0.06, stations) - 0.03
    angle = np.clip(arc / radius, -0.5 * np.pi, 0.5 * np.pi)
    straight = arc - radius * angle
    x = radius * np.cos(angle) - np.abs(straight)
    z = radius * np.sin(angle) + 2e-4 * np.cos(400.0 * arc)
    position = model.start_position.copy()
    for strand, height in zip(model.strands, (-0.5e-3, 0.5e-3), strict=True):
        own = slice(strand.first_node, strand.first_node + stations)
        position[own] = np.stack([x, np.zeros(stations), z], axis=1)
        position[own] -= height * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    return model, position + 5e-5 * rng.standard_normal(position.shape)


CASES = {"parallel": parallel_rods, "crossed": crossed_rods, "folded": folded_rod}


class Rods:
    """Contact of the rods of a model at positions of their nodes, as steps evaluate it."""

    def __init__(self, model):
        self.evaluator, self.at = at_rest(model, 0.01)
        self.layout = model.layout

    def start(self, position, origin=None):
        """Freeze contacts for friction; nodes come from `origin`."""
        self.at.position[:] = position
        self.evaluator.start_stage(self.at)
        if origin is not None:
            self.evaluator.stage.origin_position[:] = origin

    def evaluate(self, position, force="rod barrier"):
        """Energy and gradient by nodes, edges between them included."""
        self.at.position[:] = position
        energy = self.evaluator.forces(self.at, (force,))[force]
        sums, rods = self.evaluator.sums, self.evaluator.model.rods
        gradient, by_edge = sums.node.copy(), sums.edge[: rods.edge_count, :3]
        np.add.at(gradient, rods.edge_node + 1, by_edge)
        np.subtract.at(gradient, rods.edge_node, by_edge)
        return energy, gradient

    def bound(self, position, node_step):
        """How far a step of nodes may go."""
        self.at.position[:] = position
        step = np.zeros(self.layout.size)
        step[self.layout.node[:, None] + np.arange(3)] = node_step
        self.evaluator.evaluate(self.at, ("rod barrier", "rod friction"))
        return self.evaluator.bound(self.at, step, np.zeros((0, 6)))

    @property
    def contacts(self):
        """Those found last."""
        return self.evaluator.problem.rod_contact.contacts

    @property
    def lagged(self):
        """Those of friction."""
        return self.evaluator.problem.rod_contact.sliding
