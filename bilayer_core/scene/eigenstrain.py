"""Eigenstrain laws of a layer as a scene states them, and ready-made ones for four stimuli."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from bilayer_core.scene.faults import Fault, one_of, refuse_all
from bilayer_core.scene.part import Part
from bilayer_core.scene.profile import Profile, extremes, varying
from bilayer_core.scene.units import (
    NonNegativeLength,
    NonNegativeTime,
    Number,
    PlainNumber,
    PositiveLength,
    PositiveNumber,
)

# Orders of magnitude. Each has what is published, and what is assumed.
LAWS: dict[str, dict[str, float]] = {
    # Of the relative humidity, 0 to 1. Published: films of poly(N-vinylcaprolactam) swell by up to 4 % below 40 %
    # humidity and respond within seconds ("Applicability of Vapor-Deposited Thermoresponsive Hydrogel Thin Films in
    # Ultrafast Humidity Sensors/Actuators", figshare 11604297); they are far thinner than a millimetre. Assumed: the
    # same along a strip; drying half as fast; saturation.
    "humidity_hydrogel": {
        "gain": 0.1,
        "time_constant_rising": 2.0,
        "time_constant_falling": 4.0,
        "saturation": 0.1,
    },
    # Of the temperature in degrees Celsius. Assumed: 3e-4 1/K, the order of silicone elastomers; h²/(π² a) of
    # conduction with h = 1 mm, a = 1e-7 m²/s.
    "temperature_elastomer": {
        "gain": 3e-4,
        "reference": 20.0,
        "time_constant_rising": 1.0,
        "time_constant_falling": 1.0,
    },
    # Of light, 1 for about 0.5 W/cm². Published: response in 1 s, relaxation in 3 s at 550 mW/cm²
    # ("Graphene-polydimethylsiloxane/chromium bilayer-based flexible, reversible, and large bendable photomechanical
    # actuators"). Assumed: that these are time constants; the gain, 3e-4 1/K over 60 K.
    "light_photothermal": {"gain": 0.018, "time_constant_rising": 1.0, "time_constant_falling": 3.0},
    # Of a heating current, 1 for full drive. Published: nickel-titanium contracts by as much as 8 % (ASME IMECE2002,
    # p. 277). Assumed: gain and time constants. Hysteresis, and heating with the square of the current, are not
    # modelled.
    "current_sma": {
        "gain": -0.04,
        "time_constant_rising": 0.3,
        "time_constant_falling": 1.5,
        "saturation": 0.08,
    },
}
"""Keys of an eigenstrain that a law stands for, each of which a scene may state otherwise."""


def _gain_or_law(schema: dict[str, Any]) -> None:
    """Tell editors that one of the two is enough."""
    schema["required"].remove("gain")
    schema["anyOf"] = [{"required": ["gain"]}, {"required": ["law"]}]


class Following(Part):
    """Law by which a layer follows a stimulus, with a first-order lag."""

    stimulus: str
    """One of the channels in `stimuli`."""
    gain: Number
    """Per unit of the stimulus, near `reference`."""
    reference: PlainNumber = 0.0
    """Stimulus at which nothing changes, in the unit of the channel."""
    time_constant: NonNegativeTime | None = None
    """Both ways; without any the material follows at once."""
    time_constant_rising: NonNegativeTime | None = None
    """While the stimulus is above what the material has reached."""
    time_constant_falling: NonNegativeTime | None = None
    """While it is below."""
    saturation: PositiveNumber | None = None
    """Magnitude that it tends to but does not exceed."""

    def _faults(self) -> Iterator[Fault]:
        directions = ("time_constant_rising", "time_constant_falling")
        given = [key for key in directions if getattr(self, key) is not None]
        if self.time_constant is not None and given:
            yield ("time_constant",), self.time_constant, f"must be left out where `{given[0]}` is given"

    @property
    def lags(self) -> tuple[float, float]:
        """Time constants for a rising and a falling stimulus [s]."""
        both = self.time_constant or 0.0
        rising, falling = self.time_constant_rising, self.time_constant_falling
        return both if rising is None else rising, both if falling is None else falling

    def strain_at(self, stimulus: np.ndarray) -> np.ndarray:
        """Return the value where the material has reached a stimulus (`scene.transduction.eigenstrain_of`)."""
        strain = self.gain * (stimulus - self.reference)
        return strain if self.saturation is None else self.saturation * np.tanh(strain / self.saturation)

    @property
    def bounds(self) -> tuple[Self, ...]:
        """Laws with a gain alike all along the rod, between which this one is everywhere."""
        return (self,)

    @property
    def limit(self) -> float:
        """Saturation, infinite without one."""
        return math.inf if self.saturation is None else self.saturation


class StiffnessChange(Following):
    """Part by which the elastic moduli of a layer change: gain times the stimulus, which the material follows with a
    first-order lag.
    """

    gain: Number
    """Change per unit of the stimulus, near `reference`, as a part: −60 % for a layer that keeps two fifths. It must
    leave the layer stiff: above −1 over the range of the channel."""


class Eigenstrain(Following):
    """Free strain of a layer: gain times the stimulus, which the material follows with a first-order lag."""

    model_config = ConfigDict(json_schema_extra=_gain_or_law)

    law: Literal[*LAWS] | None = Field(None, exclude=True)
    """Ready-made numbers for keys that are not given; see docs/stimuli.md."""
    gain: varying(Number)
    """Eigenstrain per unit of the stimulus, near `reference`; may be left out where `law` is given. The laws of
    a layer together must leave it a length: above −1 over the ranges of their channels. A profile takes no
    `saturation`."""
    interval: tuple[NonNegativeLength, PositiveLength] | None = None
    """From and to, as lengths along the path [m]; default: the whole layer."""

    @model_validator(mode="wrap")
    @classmethod
    def _resolve_law(cls, data: Any, handler: Callable[[Any], Eigenstrain]) -> Eigenstrain:
        """Put the numbers of a law in place of its name."""
        law = data.get("law") if isinstance(data, dict) else None
        if law is None:
            return handler(data)
        if law not in LAWS:
            refuse_all("Eigenstrain", [(("law",), law, one_of("laws", law, LAWS))])
        numbers = LAWS[law]
        if "time_constant" in data:
            numbers = {key: number for key, number in numbers.items() if not key.startswith("time_constant")}
        return handler({**numbers, **data, "law": None})

    def _faults(self) -> Iterator[Fault]:
        yield from super()._faults()
        if isinstance(self.gain, Profile) and self.saturation is not None:
            yield ("saturation",), self.saturation, "must be left out where `gain` is a profile"

    @property
    def bounds(self) -> tuple[Self, ...]:
        """Laws with a gain alike all along the rod, between which this one is everywhere."""
        if not isinstance(self.gain, Profile):
            return (self,)
        return tuple(self.model_copy(update={"gain": gain}) for gain in extremes(self.gain))

    def at_points(self, length: float) -> list[tuple[Self, Profile | None]]:
        """Return a law for each point of the gain's profile, where it acts on a path of a length [m], and the part of
        it that acts there: a hat from the point before to the point after. A gain that is a number has one law, which
        acts in full.
        """
        if not isinstance(self.gain, Profile) or len(self.gain.at) == 1:
            return [(self.bounds[0], None)]
        at: list[float] = self.gain.at
        laws: list[tuple[Self, Profile | None]] = []
        first, last = self.interval or (0.0, length)
        for k, gain in enumerate(self.gain.value):
            near = slice(max(k - 1, 0), k + 2)
            begin, end = (at[k - 1] if k else first), (at[k + 1] if k + 1 < len(at) else last)
            span = max(first, begin), min(last, end)
            if span[0] >= span[1]:
                continue
            hat = Profile.model_construct(at=at[near], value=[float(place == at[k]) for place in at[near]])
            laws.append((self.model_copy(update={"gain": gain, "interval": span}), hat))
        return laws
