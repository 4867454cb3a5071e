"""Diffusion of moisture or heat through the layers of a rod."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter

from bilayer_core.scene.faults import Fault
from bilayer_core.scene.part import Name, Part
from bilayer_core.scene.units import NonNegativeLength, PlainNumber, PositiveLength, PositiveNumber, real

PositiveDiffusivity = Annotated[float, *real("a diffusivity", "m^2/s", "2e-11 m^2/s", above=0.0)]
PositiveExchange = Annotated[float, *real("an exchange coefficient", "m/s", "1e-6 m/s", above=0.0)]
PositiveSourceRate = Annotated[float, *real("a rate", "1/s", "2", above=0.0)]


class DiffusivityCurve(Part):
    """A diffusivity that depends on the field: linear between values of the field, constant beyond them."""

    at: list[PlainNumber] = Field(min_length=1)
    """Values of the field in the unit of the stimulus, increasing."""
    value: list[PositiveDiffusivity] = Field(min_length=1)
    """Diffusivity there, as many."""

    @property
    def varies(self) -> bool:
        """True if it is not the same everywhere."""
        return min(self.value) < max(self.value)

    def _faults(self) -> Iterator[Fault]:
        for index, (before, after) in enumerate(zip(self.at, self.at[1:], strict=False), start=1):
            if after <= before:
                yield ("at", index), after, f"must be above the value before it ({before:g})"
        if len(self.at) != len(self.value):
            yield ("value",), f"{len(self.value)} entries", f"must be as many as `at`, {len(self.at)}"


class _NumberOrCurve:
    """Validator of a diffusivity; a curve's faults stand at its own keys."""

    def __init__(self) -> None:
        self._number, self._curve = TypeAdapter(PositiveDiffusivity), TypeAdapter(DiffusivityCurve)

    def describe(self) -> str:
        """Return a description of the allowed values."""
        return "a diffusivity [m^2/s] above 0, such as 2e-11 m^2/s, or a curve {at: [...], value: [...]} over the field"

    def __call__(self, value: Any) -> Any:
        """Return the number or the curve, in SI units."""
        return (self._curve if isinstance(value, dict | DiffusivityCurve) else self._number).validate_python(value)


Diffusivity = Annotated[
    float | DiffusivityCurve,
    BeforeValidator(_NumberOrCurve(), json_schema_input_type=PositiveDiffusivity | DiffusivityCurve),
]


class Face(Part):
    """A face of a rod through which the field enters and leaves its outer layer."""

    sees: Literal["stimulus", "ambient"] = "stimulus"
    """What is outside: the stimulus, or `ambient`."""
    exchange: PositiveExchange | None = None
    """h of the flux h × (value outside − value at the face); without it the face takes the value outside at once."""


class Source(Part):
    """Light that a layer absorbs, or current that heats it: a source in the layer."""

    layer: Name
    """One with a diffusivity."""
    rate: PositiveSourceRate
    """How fast the stimulus 1 would raise the layer's mean value if nothing left it."""
    depth: PositiveLength | None = None
    """Over which the source fades e-fold, from the layer's outer face inwards; by default it is uniform."""


class Diffusion(Part):
    """Diffusion of a field through the thickness of a rod. It takes the place of the lag in the layers it names."""

    stimulus: str
    """The channel that drives it; laws of the named layers with this stimulus follow the field."""
    diffusivity: dict[Name, Diffusivity]
    """Of layers by their names; the field does not enter a layer that is not named. It may depend on the field."""
    bottom: Face | None = None
    """Outer face of the first layer; by default nothing passes it."""
    top: Face | None = None
    """Outer face of the last layer."""
    source: Source | None = None
    """In a layer; by default there is none."""
    partition: PositiveNumber = 1.0
    """Content of the second layer over that of the first where both are in equilibrium."""
    ambient: PlainNumber = 0.0
    """Outside faces that do not see the stimulus, in its unit."""
    along: bool = False
    """Whether the field also spreads along the rod, whose ends are closed."""
    interval: tuple[NonNegativeLength, PositiveLength] | None = None
    """With `along`: where the stimulus acts, from and to along the path; faces elsewhere see `ambient`."""

    @property
    def varies(self) -> bool:
        """True if a diffusivity depends on the field."""
        return any(isinstance(value, DiffusivityCurve) and value.varies for value in self.diffusivity.values())

    @property
    def faces(self) -> tuple[tuple[str, Face], ...]:
        """Open faces by their keys."""
        return tuple((key, face) for key, face in (("bottom", self.bottom), ("top", self.top)) if face is not None)

    def _faults(self) -> Iterator[Fault]:
        if not self.diffusivity:
            yield ("diffusivity",), {}, "must name a layer or two"
        if self.source is not None and self.source.layer not in self.diffusivity:
            yield ("source", "layer"), self.source.layer, f"must be one of {', '.join(self.diffusivity)}"
        if not self.faces:
            yield ("top",), None, "must be given, or `bottom`: nothing passes a closed face"
        elif self.source is None and not any(face.sees == "stimulus" for _, face in self.faces):
            yield (self.faces[0][0], "sees"), "ambient", "must be stimulus on a face, or `source` be given"
        if self.interval is not None and not self.along:
            yield ("interval",), self.interval, "must be left out where `along` is false: laws have an `interval`"
        if self.varies:
            needs = "where a diffusivity depends on the field: only a uniform field is then known to be in equilibrium"
            if self.source is not None:
                yield ("source",), self.source.layer, f"must be left out {needs}"
            for key, face in self.faces:
                if face.sees != "stimulus":
                    yield (key, "sees"), face.sees, f"must be stimulus {needs}"
            if self.along:
                yield ("along",), True, "must be false where a diffusivity depends on the field"
        if len(self.diffusivity) < 2 and self.partition != 1.0:
            yield ("partition",), self.partition, "must be left out: the field is in one layer only"
