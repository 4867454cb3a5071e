"""Modes of diffusion through the layers of a rod: first-order lags whose sum is the field.

In layer l, of content S_l a at the value a of the field (in the unit of the stimulus) and of diffusivity D_l, with a
source of the stimulus u, and with faces that exchange h S_l (u − a),

    S_l ∂a/∂t = ∂/∂z(S_l D_l ∂a/∂z) + S_l r g(z) u,    a and S_l D_l ∂a/∂z continuous at the interface

or a = u at a face. Only the ratio of both S counts, the partition coefficient. Tested with polynomials of degree
`DEGREE` in each layer, for which the integrals are exact, this is M a' + K a = b u with symmetric M and K. The
steady state f solves K f = b, with f = 1 at faces where a = u. With the eigenvectors K v = λ M v, vᵀM v = 1, and
γ = vᵀ M f,

    a = Σ γ_m v_m y_m + r u,    y_m' = λ_m (u − y_m),    r = f − Σ γ_m v_m

Each y_m is a lag of the stimulus with the time constant 1/λ_m, for which a step has an exact solution
(`scene.transduction`): a layer with a lag is a field with one mode. r is 0 unless a = u at a face; it is what
polynomials miss of the thin layer there, and goes to the fastest mode. Any linear functional of a is a sum over modes.

A layer takes the mean of the field, and its gradient across the layer: with ζ = −1 … 1 through its thickness h,

    ā = ½ ∫ a dζ,    G = 3/2 ∫ a ζ dζ

so that the eigenstrain g a bends the layer by itself to the curvature −g G/h towards its normal. What is left of the
profile has neither force nor moment.

Where D depends on a, these are the modes for the largest diffusivity of each layer, and coordinates for the field that
it has (`engine.varied_diffusion`); all else stays.

Along a rod of n edges, whose ends are closed, cosines cos(π k (e + ½)/n) of the edges e are eigenvectors of the second
difference: each k has its own K + q_k Σ D_l M_l, q_k = (2 − 2 cos(π k/n))/Δs², and its own modes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre

from bilayer_core.scene.diffusion import Diffusion, DiffusivityCurve
from bilayer_core.scene.eigenstrain import Following
from bilayer_core.scene.rod import Layer, Rod

Array = np.ndarray
DEGREE, DEGREE_OF_VARIED = 11, 19
"""Of polynomials in each layer: mean and gradient are within 1e-4 of the series from D t/h² = 0.003 on. Where the
diffusivity depends on the field, fronts are steeper.
"""
GAUSS_POINTS = 24
"""In each layer whose diffusivity varies."""
NEGLIGIBLE = 1e-13
"""Weight of a mode, of the sum of all, that is rounding."""


@dataclass(frozen=True, eq=False)
class VariedModes:
    """Modes of a field whose diffusivity depends on it, at Gauss points through its layers."""

    amplitude: Array  # γ, shape (n_mode,)
    rate: Array  # λ [1/s], shape (n_mode,)
    value: Array
    slope: Array
    """`value`, `slope`: v and ∂v/∂z [1/m], shape (n_point, n_mode)."""
    weight: Array  # S dz of points [m], shape (n_point,)
    curve: Array  # the curve of each point, shape (n_point,)
    curves: list[tuple[Array, Array]]  # values of the field, and diffusivities there [m²/s], of each layer that varies


@dataclass(frozen=True)
class Response:
    """How the eigenstrain of a layer follows a stimulus: by a sum of lags."""

    lags: tuple[tuple[float, float], ...]  # Time constants of each mode for a rising and a falling stimulus [s]
    mean: tuple[float, ...]
    mean_reference: float
    gradient: tuple[float, ...] = ()
    """`mean`, `gradient`: weights of modes in the mean of the layer's field, and in its gradient across the layer;
    the latter is empty where there is none.
    """
    gradient_reference: float = 0.0
    """`mean_reference`, `gradient_reference`: values of both, in the unit of the stimulus, at which there is no
    eigenstrain.
    """
    along: Array | None = None  # Multiple of both on each edge of the path, shape (n_edge,); None for 1
    varied: VariedModes | None = None  # None where no diffusivity depends on the field


def responses(rod: Rod, layer: Layer, law: Following) -> list[Response]:
    """Return the responses of a layer by a law, whose sum is its eigenstrain: one, or where the field spreads along
    the rod one for each cosine.
    """
    field = rod.diffusion_of(layer, law)
    if field is None:
        return [Response(lags=(law.lags,), mean=(1.0,), mean_reference=law.reference)]
    made = rod.keep("modes", (field,), lambda: list(_cosines(rod, field)))
    return [_response(part, layer, law) for part in made]


def strains_at(rod: Rod, layer: Layer, law: Following, stimulus: Array) -> Array:
    """Return the mean eigenstrains of a layer by the bounds of a law where it has long had a stimulus all along the
    rod, shape (n_bound, n).
    """
    return np.array([strain_at(rod, layer, bound, stimulus) for bound in law.bounds])


def strain_at(rod: Rod, layer: Layer, law: Following, stimulus: Array) -> Array:
    """Return that of a law whose gain is a number."""
    field = rod.diffusion_of(layer, law)
    if field is None:
        return law.strain_at(stimulus)
    part = whole_field(rod, field)
    weight, offset = part.weights(part.modes.functionals[0][part.modes.names.index(layer.name)])
    return law.gain * (weight.sum() * stimulus + offset - law.reference)


def whole_field(rod: Rod, field: Diffusion) -> FieldPart:
    """Return a field that is alike all along its rod."""
    return rod.keep("field", (field,), lambda: FieldPart(FieldModes(rod, field), 1.0, 1.0, None))


def _response(part: FieldPart, layer: Layer, law: Following) -> Response:
    slot = part.modes.names.index(layer.name)
    (mean, mean_offset), (gradient, gradient_offset) = (part.weights(of[slot]) for of in part.modes.functionals)
    return Response(
        lags=tuple((time, time) for time in part.modes.times.tolist()),
        mean=tuple(mean.tolist()),
        mean_reference=law.reference * part.constant - mean_offset,
        gradient=tuple(gradient.tolist()),
        gradient_reference=-gradient_offset,
        along=part.along,
        varied=part.modes.varied,
    )


@dataclass(frozen=True)
class FieldPart:
    """One cosine of a field along a rod, or all of it: its modes, the part of the stimulus and of the ambient that
    act in it, and 1 where it has what does not change along the rod.
    """

    modes: FieldModes
    driven: float
    constant: float
    along: Array | None

    def weights(self, functional: Array) -> tuple[Array, float]:
        """Return the weights of modes in a linear functional of the field, and what the ambient adds to it."""
        modes = self.modes
        weight = modes.amplitude * (functional[modes.free] @ modes.vectors)
        weight[np.argmin(modes.times)] += functional @ modes.steady - weight.sum()
        beside = self.constant - self.driven  # of faces that would see the stimulus and see the ambient
        ambient = modes.ambient * (self.constant * modes.beside + beside * modes.surrounding)
        return self.driven * weight, float(functional @ ambient)


def _cosines(rod: Rod, field: Diffusion) -> Iterator[FieldPart]:
    """Yield the parts of a field."""
    if not field.along:
        yield whole_field(rod, field)
        return
    count = rod.stations - 1
    edges = np.arange(count)
    first, last = (0.0, count) if field.interval is None else np.array(field.interval) / rod.edge_length
    acts = np.clip(np.minimum(edges + 1.0, last) - np.maximum(edges, first), 0.0, 1.0)
    for k in range(count):
        cosine = np.cos(np.pi * k * (edges + 0.5) / count)
        driven = float(acts @ cosine) * (1.0 if k == 0 else 2.0) / count
        if k > 0 and abs(driven) <= NEGLIGIBLE:
            continue
        wave = (2.0 - 2.0 * np.cos(np.pi * k / count)) / rod.edge_length**2
        yield FieldPart(FieldModes(rod, field, wave), driven, float(k == 0), cosine)


class FieldModes:
    """Modes of a field in the layers it is in, for one wave along the rod.

    Attributes
    ----------
    names : tuple of str
        Layers, bottom first.
    times : Array
        1/λ [s], shape (n_mode,).
    vectors, amplitude : Array
        v at free points, shape (n_free, n_mode), and γ.
    steady : Array
        f at all points.
    free : Array
        Points where the field is not given.
    surrounding, beside : Array
        Steady states at all points where 1 is outside the faces that see the stimulus, and outside the others.
    functionals : tuple of Array
        Mean and gradient of each layer as sums over points, shapes (n_layer, n_point).
    """

    def __init__(self, rod: Rod, field: Diffusion, wave: float = 0.0):
        layers = [layer for layer in rod.layers if layer.name in field.diffusivity]
        self.names, self.ambient = tuple(layer.name for layer in layers), field.ambient
        self.degree = degree = DEGREE_OF_VARIED if field.varies else DEGREE
        own_points, own_mass, own_stiffness = _element(degree)
        points = degree * len(layers) + 1
        mass, stiffness = np.zeros((points, points)), np.zeros((points, points))
        seen, other, lit = np.zeros(points), np.zeros(points), np.zeros(points)
        means, gradients = np.zeros((len(layers), points)), np.zeros((len(layers), points))
        for slot, layer in enumerate(layers):
            own = slice(degree * slot, degree * (slot + 1) + 1)
            content, diffusivity = field.partition**slot, float(_curve(field.diffusivity[layer.name])[1].max())
            part = 0.5 * layer.thickness * content * own_mass
            mass[own, own] += part
            stiffness[own, own] += 2.0 / layer.thickness * content * diffusivity * own_stiffness
            stiffness[own, own] += wave * diffusivity * part
            means[slot, own], gradients[slot, own] = 0.5 * own_mass.sum(axis=1), 1.5 * own_mass @ own_points
            if field.source is not None and field.source.layer == layer.name:
                fades = _fading(rod, layer, field.source.depth, degree)
                lit[own] += 0.5 * layer.thickness * content * field.source.rate * fades
        given = np.zeros(points, dtype=bool)
        for key, face in field.faces:
            at, content = (0, 1.0) if key == "bottom" else (points - 1, field.partition ** (len(layers) - 1))
            outside = seen if face.sees == "stimulus" else other
            if face.exchange is None:
                given[at], outside[at] = True, 1.0
            else:
                stiffness[at, at] += content * face.exchange
                outside[at] = content * face.exchange
        self.free = np.flatnonzero(~given)
        self.surrounding = self._steady(stiffness, given, seen)
        self.beside = self._steady(stiffness, given, other)
        self.steady = self.surrounding + self._steady(stiffness, given, lit)
        lower = np.linalg.inv(np.linalg.cholesky(mass[np.ix_(self.free, self.free)]))
        rates, turned = np.linalg.eigh(lower @ stiffness[np.ix_(self.free, self.free)] @ lower.T)
        self.vectors, self.times = lower.T @ turned, 1.0 / rates
        self.amplitude = self.vectors.T @ (mass @ self.steady)[self.free]
        acting = np.abs(self.amplitude) > NEGLIGIBLE * np.abs(self.amplitude).max()
        self.vectors, self.times, self.amplitude = self.vectors[:, acting], self.times[acting], self.amplitude[acting]
        self.functionals = means, gradients
        self.varied = self._varied(layers, field) if field.varies else None

    def _varied(self, layers: list[Layer], field: Diffusion) -> VariedModes:
        """Return the modes at Gauss points."""
        degree = self.degree
        modes = np.zeros((degree * len(layers) + 1, len(self.times)))
        modes[self.free] = self.vectors
        zeta, weight = legendre.leggauss(GAUSS_POINTS)
        coefficients = np.linalg.inv(legendre.legvander(_element(degree)[0], degree))
        shapes = legendre.legvander(zeta, degree) @ coefficients
        slopes = legendre.legvander(zeta, degree - 1) @ legendre.legder(coefficients)
        slots = [n for n, of in enumerate(layers) if np.ptp(_curve(field.diffusivity[of.name])[1]) > 0.0]
        own = [modes[degree * slot : degree * (slot + 1) + 1] for slot in slots]
        thickness = [layers[slot].thickness for slot in slots]
        return VariedModes(
            amplitude=self.amplitude,
            rate=1.0 / self.times,
            value=np.concatenate([shapes @ of for of in own]),
            slope=np.concatenate([2.0 / h * (slopes @ of) for h, of in zip(thickness, own, strict=True)]),
            weight=np.concatenate([0.5 * layers[n].thickness * field.partition**n * weight for n in slots]),
            curve=np.repeat(np.arange(len(slots)), GAUSS_POINTS),
            curves=[_curve(field.diffusivity[layers[slot].name]) for slot in slots],
        )

    def _steady(self, stiffness: Array, given: Array, outside: Array) -> Array:
        """Return the steady state where points that are given have the value there, and others that flux in."""
        found, free = np.where(given, outside, 0.0), self.free
        flux = outside[free] - stiffness[np.ix_(free, np.flatnonzero(given))] @ outside[given]
        found[free] = np.linalg.solve(stiffness[np.ix_(free, free)], flux)
        return found


def _curve(diffusivity: float | DiffusivityCurve) -> tuple[Array, Array]:
    """Return values of the field, and diffusivities there [m²/s]."""
    if isinstance(diffusivity, DiffusivityCurve):
        return np.array(diffusivity.at), np.array(diffusivity.value)
    return np.zeros(1), np.array([diffusivity])


@cache
def _element(degree: int) -> tuple[Array, Array, Array]:
    """Return Gauss-Lobatto points on −1 … 1, and ∫ φ_i φ_j and ∫ φ_i' φ_j' of the polynomials that are 1 at one of
    them and 0 at the others.
    """
    last = np.zeros(degree + 1)
    last[-1] = 1.0
    points = np.concatenate([[-1.0], np.sort(legendre.legroots(legendre.legder(last)).real), [1.0]])
    values = np.linalg.inv(legendre.legvander(points, degree))
    norms = 2.0 / (2.0 * np.arange(degree + 1) + 1.0)
    mass = values.T @ (norms[:, None] * values)
    slopes = np.vstack([legendre.legder(values), np.zeros(degree + 1)])
    return points, mass, slopes.T @ (norms[:, None] * slopes)


def _fading(rod: Rod, layer: Layer, depth: float | None, degree: int) -> Array:
    """Return ∫ g φ dζ of a source g with the mean 1 that fades from the outer face of a layer inwards."""
    points, mass, _ = _element(degree)
    if depth is None:
        return mass.sum(axis=1)
    zeta, weight = legendre.leggauss(10 * degree)
    from_below = len(rod.layers) == 2 and layer is rod.layers[0]
    inwards = 0.5 * layer.thickness * (1.0 + (zeta if from_below else -zeta))
    source = weight * np.exp(-inwards / depth)
    shapes = legendre.legvander(zeta, degree) @ np.linalg.inv(legendre.legvander(points, degree))
    return 2.0 * source @ shapes / source.sum()
