"""Build the arrays of a `Model` from a scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import PenetrationError
from ..kinematics.rotation import rotation_matrix
from ..scene.config import Body, Fluid, Free, Layer, Prescribed, Rod, SceneConfig
from .layout import number_unknowns
from .model import Bodies, Carriers, Model, StrandArrays, body_displacement
from .section import Bond, Section, bond, rectangle


@dataclass
class _Collected:
    """What grows while rods are added one after the other."""

    strands: list[StrandArrays] = field(default_factory=list)
    rods: list[list[tuple[int, int, int, int]]] = field(default_factory=list)
    columns: dict[str, list] = field(default_factory=dict)
    laws: list[tuple[int, float, float]] = field(default_factory=list)
    node_count: int = 0
    edge_count: int = 0

    def add(self, **values) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(np.atleast_1d(value))

    def column(self, name: str, dtype=float, width: int | None = None) -> np.ndarray:
        parts = self.columns.get(name)
        if not parts:
            array = np.zeros((0,) if width is None else (0, width), dtype)
        else:
            array = np.concatenate(parts).astype(dtype)
        array = np.ascontiguousarray(array)
        array.flags.writeable = False
        return array


def build_model(scene: SceneConfig) -> Model:
    """Arrays of the two-rod model of `scene`.

    Raises
    ------
    PenetrationError
        If a node or a body starts behind a surface, or touching it; the message says which and by how much.
    """
    found = _Collected()
    body_index = {body.name: index for index, body in enumerate(scene.bodies)}
    for rod in scene.rods:
        for copy, name in enumerate(rod.copies):
            _add_rod(found, scene, rod, name, _turn_of_copy(rod, copy), body_index)
    edge_count, bond_joints = found.edge_count, "bond_"
    bodies = _build_bodies(scene, found)
    walls = found.column("wall_tangent", width=3)
    wall_a = _resolve_walls(found.column("joint_a", np.int64), edge_count)
    wall_b = _resolve_walls(found.column("joint_b", np.int64), edge_count)

    def joined(name: str, dtype=float, width: int | None = None) -> np.ndarray:
        array = np.concatenate([found.column(name, dtype, width), found.column(bond_joints + name, dtype, width)])
        array.flags.writeable = False
        return array

    model = Model(
        scene=scene,
        strands=tuple(found.strands),
        layout=number_unknowns(found.rods, found.node_count, edge_count, found.column("attached_node", np.int64)),
        bodies=bodies,
        carriers=_build_carriers(scene, found, bodies),
        node_count=found.node_count,
        edge_count=edge_count,
        wall_count=len(walls),
        bend_count=len(wall_a),
        start_position=found.column("position", width=3),
        start_director1=np.concatenate([found.column("director1", width=3), found.column("wall_director1", width=3)]),
        wall_tangent=walls,
        attached_node=found.column("attached_node", np.int64),
        attached_body=found.column("attached_body", np.int64),
        attached_position=found.column("attached_position", width=3),
        wall_body=found.column("attached_body", np.int64),
        wall_joint=_joints_of_walls(wall_a, wall_b, edge_count, len(walls)),
        drag_node=found.column("drag_node", np.int64),
        drag_edge=found.column("drag_edge", np.int64, 2),
        drag_coefficient=found.column("drag_coefficient", width=3),
        node_mass=found.column("node_mass"),
        spin_inertia=found.column("spin_inertia"),
        half_width=found.column("half_width"),
        edge_node=found.column("edge_node", np.int64),
        rest_length=found.column("rest_length"),
        axial_stiffness=found.column("axial_stiffness"),
        eigenstrain_law=found.column("eigenstrain_law", np.int64),
        law_channel=np.array([law[0] for law in found.laws], dtype=np.int64),
        law_gain=np.array([law[1] for law in found.laws]),
        law_time_constant=np.array([law[2] for law in found.laws]),
        joint_a=np.concatenate([wall_a, found.column("bond_joint_a", np.int64)]),
        joint_b=np.concatenate([wall_b, found.column("bond_joint_b", np.int64)]),
        joint_stiffness=joined("joint_stiffness", width=3),
        joint_rest=joined("joint_rest", width=3),
        joint_node=joined("joint_node", np.int64),
        voronoi_length=found.column("voronoi_length"),
        pair_top=found.column("bond_joint_a", np.int64),
        pair_bottom=found.column("bond_joint_b", np.int64),
        pair_stiffness=found.column("pair_stiffness"),
        pair_rest=found.column("pair_rest", width=3),
    )
    _refuse_penetration(model)
    return model


def _resolve_walls(edges: np.ndarray, edge_count: int) -> np.ndarray:
    """Edges of joints; walls were entered as −1 − wall because the number of edges was not known then."""
    return np.where(edges < 0, edge_count - 1 - edges, edges)


def _joints_of_walls(joint_a: np.ndarray, joint_b: np.ndarray, edge_count: int, walls: int) -> np.ndarray:
    """The joint that each wall takes part in, shape (n_wall,)."""
    joints = np.empty(walls, dtype=np.int64)
    for edges in (joint_a, joint_b):
        of_wall = np.flatnonzero(edges >= edge_count)
        joints[edges[of_wall] - edge_count] = of_wall
    return joints


def _turn_of_copy(rod: Rod, copy: int):
    """Function that turns points (about the pattern's centre) or directions of the rod to those of one of its
    copies.
    """
    if rod.pattern is None:
        return lambda vectors, about=False: vectors
    turn = rotation_matrix(2.0 * np.pi * copy / rod.pattern.count * np.array(rod.pattern.axis))
    turn[np.abs(turn) < 1e-15] = 0.0  # quarter turns are exact
    center = np.array(rod.pattern.center)

    def apply(vectors: np.ndarray, about: bool = False) -> np.ndarray:
        return (vectors - center) @ turn.T + center if about else vectors @ turn.T

    return apply


def _add_rod(found: _Collected, scene: SceneConfig, rod: Rod, name: str, turn, body_index: dict[str, int]) -> None:
    tangent = np.array(rod.path.direction)
    normal = np.array(rod.normal)
    start = np.array(rod.path.start)
    sections = [rectangle(scene.materials[layer.material], rod.width, layer.thickness) for layer in rod.layers]
    heights = [0.0] if len(sections) == 1 else [-0.5 * sections[0].thickness, 0.5 * sections[1].thickness]
    spans = []
    for layer, section, height in zip(rod.layers, sections, heights, strict=True):
        first, last = rod.covered_stations(layer)
        arc = rod.edge_length * np.arange(first, last + 1)
        positions = turn(start + height * normal + np.outer(arc, tangent), about=True)
        spans.append((first, last, found.node_count, found.edge_count))
        strand = StrandArrays(
            f"{name}/{layer.name}",
            name,
            layer.name,
            found.node_count,
            len(arc),
            found.edge_count,
            rod.width,
            layer.thickness,
        )
        clamps = []
        if rod.clamp_start is not None and first == 0:
            clamps.append((body_index[rod.clamp_start], 0))
        if rod.clamp_end is not None and last == rod.stations - 1:
            clamps.append((body_index[rod.clamp_end], -1))
        _add_strand(found, scene, rod, layer, section, strand, positions, turn(tangent), turn(normal), clamps)
    found.rods.append(spans)
    if scene.fluid is not None:
        _add_drag(found, scene.fluid, rod, spans)
    if len(spans) == 2:
        law = bond(sections[0], sections[1], scene.coupling, rod.torsion)
        _add_bond(found, law, rod.edge_length, heights[1] - heights[0], spans)


def _add_strand(
    found: _Collected,
    scene: SceneConfig,
    rod: Rod,
    layer: Layer,
    section: Section,
    strand: StrandArrays,
    positions: np.ndarray,
    tangent: np.ndarray,
    normal: np.ndarray,
    clamps: list[tuple[int, int]],
) -> None:
    nodes, edges = strand.node_count, strand.node_count - 1
    first_edge = strand.first_edge
    rest = np.full(edges, rod.edge_length)
    voronoi = np.zeros(nodes)
    voronoi[:-1] += 0.5 * rest
    voronoi[1:] += 0.5 * rest
    found.strands.append(strand)
    found.add(
        position=positions,
        director1=np.tile(normal, (edges, 1)),
        node_mass=section.mass * voronoi,
        node_weight=voronoi,
        node_radius=np.full(nodes, 0.5 * section.thickness),
        spin_inertia=section.spin_inertia * rest,
        half_width=np.full(edges, 0.5 * section.width),
        edge_node=strand.first_node + np.arange(edges),
        rest_length=rest,
        axial_stiffness=np.full(edges, section.axial_stiffness),
        eigenstrain_law=np.full(edges, _law_of_layer(found, scene, layer)),
    )
    bend = np.array([*section.bending_stiffness, section.twisting_stiffness])
    inner = voronoi[1:-1]
    natural = np.array([layer.natural_curvature, 0.0, layer.natural_twist])
    found.add(
        joint_a=first_edge + np.arange(edges - 1),
        joint_b=first_edge + np.arange(1, edges),
        joint_stiffness=bend / inner[:, None],
        joint_rest=natural * inner[:, None],
        joint_node=strand.first_node + np.arange(1, nodes - 1),
        voronoi_length=inner,
    )
    for body, end in clamps:
        wall = -1 - sum(len(part) for part in found.columns.get("wall_tangent", []))
        node = strand.first_node if end == 0 else strand.first_node + nodes - 1
        edge = first_edge if end == 0 else first_edge + edges - 1
        found.add(
            wall_tangent=tangent[None],
            wall_director1=normal[None],
            attached_node=node,
            attached_body=body,
            attached_position=(positions[end] - np.array(scene.bodies[body].position))[None],
            joint_a=wall if end == 0 else edge,
            joint_b=edge if end == 0 else wall,
            joint_stiffness=(bend / voronoi[end])[None],
            joint_rest=(natural * voronoi[end])[None],
            joint_node=node,
            voronoi_length=voronoi[end],
        )
    found.node_count += nodes
    found.edge_count += edges


def _add_drag(found: _Collected, fluid: Fluid, rod: Rod, spans: list[tuple[int, int, int, int]]) -> None:
    """Drag of the whole section at each station, shared by its layers in proportion to their thickness: it acts at
    the middle.
    """
    length = np.full(rod.stations, rod.edge_length)
    length[[0, -1]] *= 0.5
    thickness = np.zeros(rod.stations)
    for (first, last, _, _), layer in zip(spans, rod.layers, strict=True):
        thickness[first : last + 1] += layer.thickness
    along, across = fluid.drag_along * rod.width, fluid.drag_across * rod.width
    whole = np.stack(
        [np.full(rod.stations, along), np.full(rod.stations, across), fluid.drag_across * thickness], axis=1
    )
    for (first, last, first_node, first_edge), layer in zip(spans, rod.layers, strict=True):
        station = np.arange(last - first + 1)
        covered = slice(first, last + 1)
        share = fluid.density * length[covered] * layer.thickness / thickness[covered]
        edges = np.stack([np.maximum(station - 1, 0), np.minimum(station, last - first - 1)], axis=1)
        found.add(
            drag_node=first_node + station,
            drag_edge=first_edge + edges,
            drag_coefficient=share[:, None] * whole[covered],
        )


def _law_of_layer(found: _Collected, scene: SceneConfig, layer: Layer) -> int:
    """Index of the eigenstrain law of a layer, −1 if it has none; equal laws are one."""
    if layer.eigenstrain is None:
        return -1
    channel = list(scene.stimuli).index(layer.eigenstrain.stimulus)
    law = (channel, layer.eigenstrain.gain, layer.eigenstrain.time_constant)
    if law not in found.laws:
        found.laws.append(law)
    return found.laws.index(law)


def _add_bond(found: _Collected, law: Bond, edge_length: float, distance: float, spans) -> None:
    bottom, top = spans
    first, last = max(bottom[0], top[0]), min(bottom[1], top[1])
    count = last - first
    found.add(
        bond_joint_a=top[3] + np.arange(first, last) - top[0],
        bond_joint_b=bottom[3] + np.arange(first, last) - bottom[0],
        bond_joint_stiffness=np.tile(edge_length * np.array([law.bending, law.tilt, law.twist]), (count, 1)),
        bond_joint_rest=np.zeros((count, 3)),
        bond_joint_node=np.full(count, -1),
        pair_stiffness=np.full(count, edge_length * law.translation),
        pair_rest=np.tile([distance, 0.0, 0.0], (count, 1)),
    )


def _build_bodies(scene: SceneConfig, found: _Collected) -> Bodies:
    free = [index for index, body in enumerate(scene.bodies) if not isinstance(body.motion, Prescribed)]
    count = len(scene.bodies)
    velocity, angular_velocity = np.zeros((count, 3)), np.zeros((count, 3))
    freedom, reach = [], []
    arms = found.column("attached_position", width=3)
    for place, index in enumerate(free):
        body, motion = scene.bodies[index], scene.bodies[index].motion
        allowed = np.zeros((6 * len(free), 6 if isinstance(motion, Free) else 1))
        if isinstance(motion, Free):
            velocity[index], angular_velocity[index] = motion.velocity, motion.angular_velocity
            allowed[6 * place : 6 * place + 6] = np.eye(6)
        else:
            velocity[index] = motion.speed * np.array(motion.axis)
            allowed[6 * place : 6 * place + 3, 0] = motion.axis
        freedom.append(allowed)
        own = [
            arms[found.column("attached_body", np.int64) == index],
            [point.position for point in body.contact_points],
        ]
        lengths = [np.linalg.norm(arm) for part in own for arm in part]
        reach.append(max([body.surface.radius if body.surface else 0.0, *lengths]))
    free_index = np.full(count, -1, dtype=np.int64)
    free_index[free] = np.arange(len(free))
    keyframes = [
        ([], []) if i in free else (b.motion.times, b.motion.displacements) for i, b in enumerate(scene.bodies)
    ]
    return Bodies(
        names=tuple(body.name for body in scene.bodies),
        free_index=free_index,
        body_of_free=np.array(free, dtype=np.int64),
        start_position=np.array([body.position for body in scene.bodies], dtype=float).reshape(count, 3),
        start_velocity=velocity,
        start_angular_velocity=angular_velocity,
        mass=np.array([scene.bodies[index].motion.mass for index in free]),
        second_moment=np.array([_second_moment(scene.bodies[index]) for index in free]).reshape(len(free), 3, 3),
        freedom=np.concatenate(freedom, axis=1) if freedom else np.zeros((0, 0)),
        reach=np.array(reach),
        radius=np.array([body.surface.radius if body.surface else 0.0 for body in scene.bodies]),
        times=tuple(np.array(times, dtype=float) for times, _ in keyframes),
        displacements=tuple(np.array(moves, dtype=float).reshape(-1, 3) for _, moves in keyframes),
    )


def _second_moment(body: Body) -> np.ndarray:
    """J = ½ tr(I) 1 − I of a free body [kg m²]; I = 2/5 m r² for a solid ball, 2/3 m r² for a shell. A guided body
    does not turn: any I.
    """
    motion = body.motion
    if not isinstance(motion, Free):
        inertia = np.eye(3)
    elif motion.inertia is not None:
        inertia = np.diag(motion.inertia)
    else:
        inertia = (2.0 / 3.0 if motion.shell else 0.4) * motion.mass * body.surface.radius**2 * np.eye(3)
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def _build_carriers(scene: SceneConfig, found: _Collected, bodies: Bodies) -> Carriers:
    points = [(index, point) for index, body in enumerate(scene.bodies) for point in body.contact_points]
    spheres = [index for index, body in enumerate(scene.bodies) if body.surface is not None]
    nodes = found.node_count
    first_sphere = nodes + len(points)
    free_body = np.full(first_sphere + len(spheres), -1, dtype=np.int64)
    free_body[first_sphere:] = bodies.free_index[spheres]
    first, second = [], []
    for place, body in enumerate(spheres):
        carrier = first_sphere + place
        others = [i for i in range(first_sphere) if i < nodes or points[i - nodes][0] != body]
        others += range(first_sphere, carrier)
        moving = [i for i in others if i < nodes or max(free_body[i], free_body[carrier]) >= 0]
        first += moving
        second += [carrier] * len(moving)
    return Carriers(
        weight=np.concatenate([found.column("node_weight"), [p.length for _, p in points], bodies.radius[spheres]]),
        radius=np.concatenate([found.column("node_radius"), [p.offset for _, p in points], bodies.radius[spheres]]),
        point_body=np.array([index for index, _ in points], dtype=np.int64),
        point_position=np.array([point.position for _, point in points], dtype=float).reshape(-1, 3),
        sphere_body=np.array(spheres, dtype=np.int64),
        free_body=free_body,
        pair_first=np.array(first, dtype=np.int64),
        pair_second=np.array(second, dtype=np.int64),
        plane_point=np.array([plane.point for plane in scene.obstacles], dtype=float).reshape(-1, 3),
        plane_normal=np.array([plane.normal for plane in scene.obstacles], dtype=float).reshape(-1, 3),
    )


def carrier_names(model: Model) -> list[str]:
    """What each carrier is called in messages."""
    names = [f"node {k} of {s.name}" for s in model.strands for k in range(s.node_count)]
    bodies = model.bodies.names
    names += [f"contact point {k} ({bodies[body]})" for k, body in enumerate(model.carriers.point_body)]
    return names + [f"body {bodies[body]}" for body in model.carriers.sphere_body]


def start_carriers(model: Model) -> np.ndarray:
    """Positions of all carriers at the start [m], shape (n_carrier, 3)."""
    bodies, carriers = model.bodies, model.carriers
    moved = np.array(
        [
            position + body_displacement(times, displacements, 0.0)
            for position, times, displacements in zip(
                bodies.start_position, bodies.times, bodies.displacements, strict=True
            )
        ]
    ).reshape(-1, 3)
    points = moved[carriers.point_body] + carriers.point_position
    return np.concatenate([model.start_position, points, moved[carriers.sphere_body]])


def _refuse_penetration(model: Model) -> None:
    carriers, position, names = model.carriers, start_carriers(model), None
    faults = []
    for plane, point, normal in zip(model.scene.obstacles, carriers.plane_point, carriers.plane_normal, strict=True):
        gap = (position - point) @ normal - carriers.radius
        faults += [(gap[i], i, plane.name) for i in np.flatnonzero(gap <= 0.0)]
    first, second = carriers.pair_first, carriers.pair_second
    gap = np.linalg.norm(position[first] - position[second], axis=1) - carriers.radius[first] - carriers.radius[second]
    names = carrier_names(model)
    faults += [(gap[k], first[k], names[second[k]]) for k in np.flatnonzero(gap <= 0.0)]
    if faults:
        depth, carrier, surface = min(faults)
        raise PenetrationError(
            f"{model.scene.name}: the scene starts in penetration: {names[carrier]} at "
            f"({', '.join(f'{1e3 * c:.3f}' for c in position[carrier])}) mm is {-1e3 * depth:.4g} mm behind "
            f"the surface of {surface}{f', and {len(faults) - 1} more' if len(faults) > 1 else ''}; "
            "all gaps must be positive at the start"
        )
