"""One curve for both layers of a rod: where it lies, and what it carries (`laminate_section` has the derivation)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from bilayer_core.model.findings import Figure
from bilayer_core.model.immersed import add_fluid
from bilayer_core.model.laminate_section import (
    Cells,
    WholeSection,
    cells_of,
    driven_cells,
    layer_cells,
    plate_cells,
    side,
)
from bilayer_core.model.lit_elements import add_lit_elements, is_light
from bilayer_core.model.plate_section import PlateSection
from bilayer_core.model.section import Section, outline, sections
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.strands import (
    Collected,
    StrandElements,
    StrandShape,
    add_strands,
    is_closed,
    stations_of,
    strand_lengths,
    strand_shape,
    with_copies,
)
from bilayer_core.model.strip_choice import plate_of, section_of
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import Response, responses
from bilayer_core.scene.pattern import stacked
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Rod, RodCopy

Array = np.ndarray
NAME = "laminate"
ON_CURVE = 1e-9
"""Part of the thickness by which a mass centre may be off the curve and count as on it."""
UNEVEN = 0.1
"""Part by which the distances of the two faces from the curve may differ without a warning."""


@dataclass(frozen=True)
class _Placed:
    """A layer at the middle of edges; shapes (n_edge,)."""

    section: Section
    present: Array  # part of the edge that it covers
    length: Array  # of its middle at the start [m]
    height: Array  # of its middle over the path [m]

    @property
    def mass(self) -> Array:
        """[kg]"""
        return self.present * self.section.mass * self.length

    def spin_inertia(self, centre: Array) -> Array:
        """Return the moment of inertia about a line at a height over the path [kg m²]."""
        return self.present * self.length * self.section.spin_inertia + self.mass * (self.height - centre) ** 2


def add_laminate(found: Collected, scene: SceneConfig, rod: Rod, body_index: dict[str, int]) -> None:
    """Add all copies of a rod: strands with the stiffness and mass of its layers, and their drag."""
    lit = any(is_light(scene, law) for layer in rod.layers for law in layer.eigenstrain)
    for _, alike in groupby(enumerate(rod.copies), lambda copy: copy[0] if lit else id(copy[1].rod)):
        _add_copies(found, scene, [copy for _, copy in alike], body_index)


def _add_copies(found: Collected, scene: SceneConfig, copies: list[RodCopy], body_index: dict[str, int]) -> None:
    """Add copies that differ in their places alone, at once."""
    rod = copies[0].rod
    layers = _placed(scene, rod)
    axis = _axis_of(scene, rod)
    nodes = np.arange(stations_of(rod)[1] + 1)
    place = stacked(copy.place for copy in copies)
    shape = strand_shape(rod, np.full(len(nodes), axis), 0, nodes[-1], place)
    cells = cells_of(rod, int(nodes[-1]))
    parts = [
        layer_cells(scene, rod, slot, axis, shape, layer.length / shape.lengths, cells)
        for slot, layer in enumerate(layers)
    ]
    plate = None if plate_of(scene, rod) is None else plate_cells(scene, rod, cells)
    whole = WholeSection(scene, rod, parts, cells, shape, axis, plate)
    low, high = _faces(rod, axis)
    strip = section_of(scene, rod) == "strip"
    strands = _strands(found, copies, axis, shape, (low, high), strip)
    mass, centre = sum(layer.mass for layer in layers), _mass_centre(rod, layers, axis)
    elements = StrandElements(
        edge_mass=mass,
        spin_inertia=sum(layer.spin_inertia(axis + centre) for layer in layers),
        half_width=0.5 * outline(rod, nodes[:-1] + 0.5)[0],
        axial_stiffness=whole.axial_stiffness,
        rest_strain=whole.rest_strain,
        joint_stiffness=whole.joint_stiffness,
        joint_rest=whole.joint_rest,
        node_radius=np.maximum(high, -low),
        retardation_time=scene.materials[rod.layers[0].material].retardation_time,
        modulus=found.modulus(scene, rod, rod.layers[0]),
    )
    middle = _middle(rod, axis)
    path = -axis if abs(axis) > ON_CURVE * _thickness(rod).sum(axis=0).max() else 0.0
    halves_mass = np.stack([0.5 * mass, 0.5 * mass], axis=1)
    if shape.closed:  # the first and the last node have none, see `model.strands.add_strands`
        halves_mass[0, 0] = halves_mass[-1, 1] = 0.0
    found.add(
        first_moment=np.tile(halves_mass * centre[:, None], (len(copies), 1)),
        second_moment=np.tile(halves_mass.sum(axis=1) * centre**2, len(copies)),
        middle=np.tile(middle, len(copies)),
        off_curve=np.tile((centre != 0.0) | (middle != 0.0) | (path != 0.0), len(copies)),
    )
    found.rods += [[(0, int(nodes[-1]), strand.first_node, strand.first_edge)] for strand in strands]
    found.path_height += [path] * len(copies)
    joints = add_strands(found, scene, rod, strands, shape, elements, body_index)
    if strip:
        _add_strip_joints(found, rod, plate, whole, joints, shape)
    coupling = whole.strain_coupling()
    coupled = coupling.any(axis=-1) & (joints >= 0)
    found.add(coupled_joint=joints[coupled], strain_coupling=coupling[coupled])
    _add_eigenstrain(found, scene, rod, whole, cells, strands, axis, joints)
    add_fluid(found, scene.fluid, rod, found.rods[-len(copies) :])


def _add_strip_joints(
    found: Collected,
    rod: Rod,
    plate: PlateSection | None,
    whole: WholeSection,
    joints: Array,
    shape: StrandShape,
) -> None:
    """Add the joints of a strip, those of a plate or of layers with one Poisson's ratio; see `forces.flattening`."""
    there = joints >= 0
    order = np.argsort(joints[there])

    def of_joints(values: Array) -> Array:
        return np.broadcast_to(values, joints.shape)[there][order]

    membrane, bending = whole.plates()
    constants = {"curl": whole.curl, "plate": bending / (1.0 - whole.curl**2), "membrane": membrane, "offset": 0.0}
    turned = {"skew": 0.0, "coupling": 0.0}  # of the opposite sign in a mirror image
    if plate is not None:
        (along, both, _), skew = plate.narrow, plate.across[1]
        stiffer, coupled = whole.mean_at_nodes(plate.plate / along), whole.mean_at_nodes(both / along)
        constants |= {"plate": bending * stiffer, "offset": whole.mean_at_nodes(plate.offset)}
        turned = {"skew": 2.0 * whole.mean_at_nodes(skew), "coupling": bending * coupled}
    handedness = np.reshape(shape.handedness, (-1, 1))
    found.add(
        strip_joint=of_joints(joints),
        strip_start=of_joints(shape.strains()[..., 2] + handedness * _wound(rod, shape)),
        strip_rest=of_joints(whole.curl_rest),
        strip_free=of_joints(whole.free_rest),
        **{f"strip_{name}": of_joints(np.array(value)) for name, value in constants.items()},
        **{f"strip_{name}": of_joints(value * handedness) for name, value in turned.items()},
    )


def _wound(rod: Rod, shape: StrandShape) -> Array:
    """Return by how much the layers of a strip, all alike, would twist it at nodes [rad], shape (n_copy, n_node)."""
    places = rod.edge_length * rod.on_path(np.arange(shape.voronoi.shape[-1]))
    return values_at(rod.layers[0].natural_twist, places) * shape.voronoi


def _strands(
    found: Collected, copies: list[RodCopy], axis: float, shape: StrandShape, faces: tuple[Array, Array], strip: bool
) -> list[StrandArrays]:
    """Return the strand of each copy; `faces` are heights of the two faces over the curve [m]."""
    rod, (low, high) = copies[0].rod, faces
    nodes, layer = shape.lengths.shape[1] + 1, rod.layers[0].name if len(rod.layers) == 1 else NAME
    width, layers = outline(rod, np.arange(nodes))
    thickness, offset = high - low, 0.5 * (high + low)
    strands = []
    for number, (copy, curvature) in enumerate(zip(copies, shape.curvature, strict=True)):
        first = found.node_count + number * nodes, found.edge_count + number * (nodes - 1)
        drawn = _drawn_layers(copy, axis, first, layers, curvature) if len(layers) > 1 else ()
        strands.append(
            StrandArrays(
                name=f"{copy.name}/{layer}",
                rod=copy.name,
                layer=layer,
                first_station=0,
                first_node=first[0],
                node_count=nodes,
                first_edge=first[1],
                width=width,
                thickness=thickness,
                offset=offset,
                curvature=curvature,
                closed=shape.closed,
                round=rod.radius is not None,
                strip=strip,
                layers=drawn,
            )
        )
    return strands


def _placed(scene: SceneConfig, rod: Rod) -> list[_Placed]:
    return scene.keep("layers in place", (rod,), lambda: _layers_in_place(scene, rod))


def axis_parts(scene: SceneConfig, rod: Rod) -> tuple[Array, Array]:
    """Return moments about the path and weights of the edges, shapes (n_edge,): the height of the curve over the path
    is the sum of those over the sum of these.

    It is the mean height of the neutral axis where most edges have the same layers. B = 0 there: Σ (EA/λ) (y − y₀) = 0
    with λ in proportion to the layers' lengths, whatever y₀ is.
    """
    layers = _placed(scene, rod)
    present = np.array([layer.present >= 0.5 for layer in layers])
    there = _prevailing(present)
    if plate_of(scene, rod) is not None:
        middles = rod.edge_length * rod.on_path(np.arange(present.shape[1]) + 0.5)
        return there * PlateSection(scene, rod, middles, present.astype(float)).axis, there.astype(float)
    weight = [
        there * own * layer.section.axial_stiffness / layer.length for own, layer in zip(present, layers, strict=True)
    ]
    return sum(w * layer.height for w, layer in zip(weight, layers, strict=True)), np.sum(weight, axis=0)


def hold_axis(scene: SceneConfig, rod: Rod, height: float) -> None:
    """Let a scene of which nothing is built have the curve of a rod at a height over the path [m], off its axis."""
    for copy in rod.copies:
        scene.keep("axis", (copy.rod,), lambda: height)


def _axis_of(scene: SceneConfig, rod: Rod) -> float:
    """Return the height of the curve over the path [m]."""

    def made() -> float:
        moment, weight = axis_parts(scene, rod)
        return float(moment.sum() / weight.sum())

    return scene.keep("axis", (rod,), made)


def _layers_in_place(scene: SceneConfig, rod: Rod) -> list[_Placed]:
    last_node = stations_of(rod)[1]
    nodes, edges = rod.on_path(np.arange(last_node + 1)), np.arange(last_node)
    own = edges % (rod.stations - 1)
    heights = [
        side(rod, slot) * values_at(layer.thickness, rod.edge_length * nodes) for slot, layer in enumerate(rod.layers)
    ]
    layers = []
    for slot, (layer, lengths) in enumerate(
        zip(rod.layers, strand_lengths(rod, np.array(heights), last_node), strict=True)
    ):
        section = sections(rod, layer, scene.materials[layer.material], edges + 0.5)
        present = rod.covered_parts(own, layer)
        layers.append(_Placed(section, present, lengths, side(rod, slot) * section.thickness))
    return layers


def _prevailing(present: Array) -> Array:
    """Return which edges have the most frequent set of layers; shape (n_edge,), of `present` (n_layer, n_edge)."""
    kind = (1 << np.arange(len(present))[::-1]) @ present  # a bit for each layer
    count = np.bincount(kind).tolist()
    return kind == max(range(len(count)), key=lambda k: (count[k], k.bit_count()))


def _thickness(rod: Rod) -> Array:
    """Return the thicknesses of the layers at the middle of edges [m], shape (n_layer, n_edge)."""
    return outline(rod, np.arange(stations_of(rod)[1]) + 0.5)[1]


def _mass_centre(rod: Rod, layers: list[_Placed], axis: float) -> Array:
    """Return the height of the mass centre over the curve at each edge [m]; 0 where it is rounding, shape (n_edge,)."""
    mass = sum(layer.mass for layer in layers)
    centre = sum(layer.mass * (layer.height - axis) for layer in layers) / mass
    return np.where(np.abs(centre) > ON_CURVE * _thickness(rod).sum(axis=0), centre, 0.0)


def _middle(rod: Rod, axis: float) -> Array:
    """Return the height of the middle of the section over the curve at each edge [m]; 0 where it is rounding, shape
    (n_edge,).
    """
    layers = _thickness(rod)
    middle = (0.0 if len(layers) == 1 else 0.5 * (layers[1] - layers[0])) - axis
    return np.where(np.abs(middle) > ON_CURVE * layers.sum(axis=0), middle, 0.0)


def _faces(rod: Rod, axis: float) -> tuple[Array, Array]:
    """Return the heights of the two faces over the curve at each node [m].

    Beyond the end of a layer its thickness falls to 0 within the length of an edge, so that they depend on where the
    layer ends, and not only on the nearest station.
    """
    stations = rod.on_path(np.arange(stations_of(rod)[1] + 1))
    spans = [rod.span_of(layer) for layer in rod.layers]
    layers = [
        values_at(layer.thickness, rod.edge_length * stations)
        * np.clip(1.0 + np.minimum(stations - first, last - stations), 0.0, 1.0)
        for layer, (first, last) in zip(rod.layers, spans, strict=True)
    ]
    if len(layers) == 1:
        return -0.5 * layers[0] - axis, 0.5 * layers[0] - axis
    return -layers[0] - axis, layers[1] - axis


def _drawn_layers(
    copy: RodCopy, axis: float, at: tuple[int, int], thickness: Array, curvature: Array
) -> tuple[StrandArrays, ...]:
    """Return each layer on those nodes of a laminate's strand where it is: its first node and edge, thicknesses of
    layers [m], shape (n_layer, n_node), and curvature [1/m] of the strand, shape (n_node,).
    """
    rod, layers = copy.rod, []
    along = rod.edge_length * rod.on_path(np.arange(len(curvature)))
    for slot, layer in enumerate(rod.layers):
        first, last = stations_of(rod, layer)
        own = slice(first, last + 1)
        layers.append(
            StrandArrays(
                name=f"{copy.name}/{layer.name}",
                rod=copy.name,
                layer=layer.name,
                first_station=first,
                first_node=at[0] + first,
                node_count=last - first + 1,
                first_edge=at[1] + first,
                width=values_at(rod.width_of(layer), along[own]),
                thickness=thickness[slot, own],
                offset=side(rod, slot) * thickness[slot, own] - axis,
                curvature=curvature[own],
                closed=is_closed(rod, first, last),
            )
        )
    return tuple(layers)


def uneven_faces(rod: Rod, scene: SceneConfig) -> Iterator[Figure]:
    """Yield the rods for which contact with rods counts from a face that is not where the nearer one is."""
    rod = rod.copies[0].rod  # whose layers are those of all
    low, high = _faces(rod, _axis_of(scene, rod))
    difference = np.abs(high + low)
    if np.any(difference > UNEVEN * np.maximum(high, -low)):
        near, far = np.minimum(high, -low).min(), np.maximum(high, -low).max()
        yield Figure(
            f"rods.{rod.name}",
            "faces are",
            f"{1e3 * near:.3g} to {1e3 * far:.3g} mm from the laminate's curve",
            f"equal within {100 * UNEVEN:g} %",
            float((difference / np.maximum(high, -low)).max()) / UNEVEN,
            "contact with rods counts from the farther one on both sides: the nearer feels them up to "
            f"{1e3 * difference.max():.3g} mm too early",
        )


def _on_cells(response: Response, cells: Cells) -> Array | float:
    """Return by how much of a response each cell grows, shape (n_cell,)."""
    return 1.0 if response.along is None else response.along[cells.edge]


@dataclass
class SharedRow:
    """The parts in cells of laws that have no edge and no node in common: their strains are computed at once."""

    last: int  # edge
    grown: Array  # shape (n_cell,)


def _share(rows: list[SharedRow], driven: Array, grown: Array) -> int:
    """Put a law, by the edges that it drives and its parts in cells, where it has room; return which row that is."""
    for index, row in enumerate(rows):
        if row.last + 1 < driven.min():
            row.last, row.grown = int(driven.max()), row.grown + grown
            return index
    rows.append(SharedRow(int(driven.max()), grown))
    return len(rows) - 1


def _add_eigenstrain(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    whole: WholeSection,
    cells: Cells,
    strands: list[StrandArrays],
    axis: float,
    joints: Array,
) -> None:
    """Add the rest strains of edges and joints that follow the laws of layers.

    Where the stimulus of a law is a light, each edge has a law of its own; there is one strand then.
    """
    first_edge = np.array([[strand.first_edge] for strand in strands])
    of_edges: list[tuple[Array, ...]] = []
    of_joints: list[tuple[Array, ...]] = []
    laws_on: list[tuple[int, Array, tuple[int, bool], int]] = []
    shared: dict[tuple[int, bool], list[SharedRow]] = {}
    strip = section_of(scene, rod) == "strip"
    followed = [
        (slot, layer, law, hat)
        for slot, layer in enumerate(rod.layers)
        for given in layer.eigenstrain
        for law, hat in ([(given, None)] if is_light(scene, given) else given.at_points(rod.path.length))
    ]
    for slot, layer, law, hat in followed:
        edges, covered = np.array(rod.driven_edges(layer, law)), driven_cells(rod, cells, layer, law)
        part = 1.0 if hat is None else values_at(hat, rod.edge_length * rod.on_path(cells.middle))
        if is_light(scene, law):
            heights = np.full(rod.stations - 1, axis)
            laws = add_lit_elements(found, scene, rod, layer, law, edges, strands[0].first_edge, heights)
            groups = [
                (numbers, with_copies(rod, own), 1.0)
                for numbers, own in zip(laws.tolist(), edges[:, None], strict=True)
            ]
        else:
            groups = [
                (
                    found.law(scene, law, response),
                    with_copies(rod, edges),
                    _on_cells(response, cells) * part,
                )
                for response in responses(rod, layer, law)
            ]
        for numbers, driven, along in groups:
            inside = np.zeros(cells.edge.max() + 1, dtype=bool)
            inside[driven] = True
            grown = along * (covered & inside[cells.edge])
            for by, number in enumerate(numbers):
                if number >= 0:
                    which = slot, bool(by)
                    laws_on.append((number, driven, which, _share(shared.setdefault(which, []), driven, grown)))
    strains = {
        which: whole.driven(which[0], np.stack([row.grown for row in rows])[:, None], which[1])
        for which, rows in shared.items()
    }
    for number, driven, which, row in laws_on:
        at = np.union1d(driven, driven + 1)  # nodes of these edges
        weight, bend, curl, free, twist = (
            part[row][:, own] for part, own in zip(strains[which], (driven, at, at, at, at), strict=True)
        )
        joint = joints[:, at]
        of_edges.append((first_edge + driven, np.full(weight.shape, number), weight))
        for name, turn in (("curled", curl), ("freed", free), ("twisted", twist)) if strip else ():
            turned = (turn != 0.0) & (joint >= 0)
            laws_of = np.full(turned.sum(), number)
            found.add(**{f"{name}_joint": joint[turned], f"{name}_law": laws_of, f"{name}_weight": turn[turned]})
        bent = (bend != 0.0) & (joint >= 0)
        copy, _ = np.nonzero(bent)
        of_joints.append((copy, joint[bent], np.full(len(copy), number), bend[bent]))
    if not of_edges:
        return
    edge, law_of_edge, weight = (np.concatenate(part, axis=1) for part in zip(*of_edges, strict=True))
    copy, joint, law_of_joint, bend = (np.concatenate(part) for part in zip(*of_joints, strict=True))
    by_copy = np.argsort(copy, kind="stable")
    found.add(
        driven_edge=edge.ravel(),
        driven_law=law_of_edge.ravel(),
        driven_weight=weight.ravel(),
        driven_joint=joint[by_copy],
        driven_joint_law=law_of_joint[by_copy],
        driven_joint_weight=bend[by_copy],
    )
