"""Numbers of a scene: plain ones are SI, texts such as ``1 mm`` or ``-10 m/s^2`` are converted.

A `Quantity` is the validator of one kind of number. Usual units are converted by a table. All others, and all mistakes,
are for the units library, which is imported when the first of them occurs: that takes 0.3 s, a fifth of a start.
"""

from __future__ import annotations

import math
import numbers
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from bilayer_core.scene.faults import refuse

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT = r"(?:1?\s*/\s*)?[A-Za-zµμ°%][\w°%*/^ ().-]*?"
_TEXT = re.compile(rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>{_UNIT})?\s*")

SMALLEST, LARGEST = 1e-60, 1e30
"""Of what must be above 0, and of all numbers: products of several are numbers yet."""
LARGEST_COUNT = 2**53
"""Of all whole numbers: larger ones are no floating-point numbers."""
_DEGREE = Decimal("0.01745329251994329576923690768")
"""π/180, to as many digits as decimals are computed with."""
USUAL_UNITS = {
    "1": {"%": Decimal("1e-2")},
    "m": {"m": Decimal(1), "cm": Decimal("1e-2"), "mm": Decimal("1e-3"), "µm": Decimal("1e-6"), "um": Decimal("1e-6")},
    "m^2": {"m^2": Decimal(1), "cm^2": Decimal("1e-4"), "mm^2": Decimal("1e-6")},
    "s": {"s": Decimal(1), "ms": Decimal("1e-3"), "µs": Decimal("1e-6"), "us": Decimal("1e-6")},
    "kg": {"kg": Decimal(1), "g": Decimal("1e-3"), "mg": Decimal("1e-6")},
    "kg/m^3": {"kg/m^3": Decimal(1), "g/cm^3": Decimal(1000)},
    "N": {"N": Decimal(1), "mN": Decimal("1e-3"), "µN": Decimal("1e-6"), "uN": Decimal("1e-6")},
    "N*m": {"N*m": Decimal(1), "N*mm": Decimal("1e-3"), "mN*m": Decimal("1e-3"), "mN*mm": Decimal("1e-6")},
    "Pa": {"Pa": Decimal(1), "kPa": Decimal("1e3"), "MPa": Decimal("1e6"), "GPa": Decimal("1e9")},
    "m/s": {"m/s": Decimal(1), "cm/s": Decimal("1e-2"), "mm/s": Decimal("1e-3")},
    "m/s^2": {"m/s^2": Decimal(1), "mm/s^2": Decimal("1e-3")},
    "m^2/s": {"m^2/s": Decimal(1), "mm^2/s": Decimal("1e-6")},
    "rad": {"rad": Decimal(1), "deg": _DEGREE, "turn": 360 * _DEGREE, "turns": 360 * _DEGREE},
    "rad/s": {"rad/s": Decimal(1), "deg/s": _DEGREE, "rpm": 6 * _DEGREE},
    "rad/m": {"rad/m": Decimal(1), "rad/mm": Decimal(1000), "deg/mm": 1000 * _DEGREE},
    "1/m": {"1/m": Decimal(1), "/m": Decimal(1), "1/mm": Decimal(1000), "/mm": Decimal(1000)},
    "1/s": {"1/s": Decimal(1), "/s": Decimal(1)},
    "Hz": {"Hz": Decimal(1), "kHz": Decimal(1000)},
}
"""What is in an SI unit, by the unit as it is written."""


@cache
def _registry():
    """Return the units library. It calculates in decimals, so that ``53.9 mm`` equals ``0.0539`` exactly."""
    from pint import UnitRegistry

    return UnitRegistry(non_int_type=Decimal)


def parse_quantity(text: str, unit: str) -> float:
    """Return the value of a text such as ``1 mm`` in `unit` (``"1"``: dimensionless); a bare number is in `unit`
    already.

    Angles are a dimension of their own here: ``1 Hz`` is not ``1 rad/s`` and ``40 deg`` is not a plain number.

    Raises
    ------
    ValueError
        With a text that says what the quantity is instead.
    """
    match = _TEXT.fullmatch(text)
    if match is None:
        raise ValueError("not a number with a unit")
    if match["unit"] is None:
        return float(match["number"])
    if match["unit"].count("%") > 1:  # which the units library multiplies
        raise ValueError(f"whose unit {match['unit']!r} has more than one %")
    factor = USUAL_UNITS.get(unit, {}).get(match["unit"])
    try:
        number = Decimal(match["number"])
        if factor is not None:
            return float(number * factor)
        expected, found = _unit(unit), _registry().Quantity(number, _unit(match["unit"]))
        if found.to_root_units().units != (1 * expected).to_root_units().units:
            raise ValueError(_dimension(found))
        return float(found.to(expected).magnitude)
    except ArithmeticError:
        raise ValueError("too large a number") from None


def in_si(value: float, unit: str) -> float:
    """Return a value of a unit in SI units, and one without a unit as it is: 0.055 for 55 mm, π/4 for 45 deg.

    Raises ValueError if there is no such unit.
    """
    factor = next((units[unit] for units in USUAL_UNITS.values() if unit in units), None)
    if factor is None:
        found = _registry().Quantity(Decimal(repr(value)), _unit(unit)) if unit else value
        return float(found.to_base_units().magnitude) if unit else found
    return float(Decimal(repr(value)) * factor)


@cache
def _unit(text: str) -> Any:
    """Return the unit of a text such as ``m/s^2`` or ``/s``; refuse units with an offset zero or a logarithm."""
    try:
        unit = _registry().Unit(f"1{text}" if text.startswith("/") else text)
        _registry().Quantity(Decimal(1), unit).to_root_units()
        return unit
    except Exception:  # what the library raises on text that is no unit has no base in common
        raise ValueError(f"whose unit {text!r} is not known") from None


def _dimension(quantity: Any) -> str:
    base = quantity.to_base_units().units
    return f"a quantity in {base:~}" if f"{base:~}" else "a quantity without dimension"


@dataclass(frozen=True)
class Quantity:
    """Validator of a number with a unit and a range.

    Attributes
    ----------
    what : str
        What it is, with its article: "a length".
    unit : str
        SI unit of plain numbers; ``"1"`` for dimensionless ones, ``""`` where no unit may be written.
    example : str
        A text that is acceptable.
    above, at_least, at_most : float or None
        Range of the value in `unit`.
    """

    what: str
    unit: str
    example: str = ""
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None

    def describe(self) -> str:
        """Describe the allowed numbers, with the unit."""
        unit = f" [{self.unit}]" if self.unit not in ("", "1") else ""
        limits = [
            f"{word} {limit:g}"
            for word, limit in (("above", self.above), ("at least", self.at_least), ("at most", self.at_most))
            if limit is not None
        ]
        example = f", such as {self.example}" if self.example else ""
        return f"{self.what}{unit}" + (f" {' and '.join(limits)}" if limits else "") + example

    def __call__(self, value: Any) -> float:
        """Return the number in SI units, or raise a fault that says what is allowed."""
        number = self._number(value)
        tiny = 0.0 < abs(number) < SMALLEST
        inside = (
            abs(number) <= LARGEST
            and (self.above is None or number > self.above)
            and not (tiny and self.above == 0.0)
            and (self.at_least is None or number >= self.at_least)
            and (self.at_most is None or number <= self.at_most)
        )
        if not inside:
            raise refuse(f"must be {self.describe()}", f"which is below {SMALLEST:g}, as good as 0" if tiny else "")
        return number

    def _number(self, value: Any) -> float:
        if type(value) is float:
            return value
        if isinstance(value, str):
            try:
                return parse_quantity(value, self.unit) if self.unit else float(value)
            except ValueError as error:
                raise refuse(f"must be {self.describe()}", str(error) if self.unit else "") from None
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise refuse(f"must be {self.describe()}")
        try:
            return float(value)
        except OverflowError:
            return math.inf


@dataclass(frozen=True)
class Count:
    """Validator of a whole number from `at_least` to `at_most`."""

    at_least: int
    at_most: int = LARGEST_COUNT

    def describe(self) -> str:
        """Describe the allowed numbers."""
        text = f"a whole number of at least {self.at_least}"
        return text if self.at_most == LARGEST_COUNT else f"{text} and at most {self.at_most}"

    def __call__(self, value: Any) -> int:
        """Return the number, or raise a fault that says what is allowed."""
        whole_number = isinstance(value, numbers.Integral) and not isinstance(value, bool)
        if not (whole_number and self.at_least <= value <= self.at_most):
            raise refuse(f"must be {self.describe()}")
        return int(value)


def real(*arguments: Any, **limits: float) -> tuple[Any, ...]:
    """Return the metadata that makes ``Annotated[float, *real(...)]`` a real number with a unit.

    The arguments are those of `Quantity`.
    """
    quantity = Quantity(*arguments, **limits)
    written = float | str if quantity.unit else float
    return BeforeValidator(quantity, json_schema_input_type=written), Field(description=quantity.describe())


def whole(at_least: int, at_most: int = LARGEST_COUNT) -> tuple[Any, ...]:
    """Return the metadata that makes ``Annotated[int, *whole(...)]`` a whole number from `at_least` to `at_most`."""
    count = Count(at_least, at_most)
    return BeforeValidator(count, json_schema_input_type=int), Field(description=count.describe())


PlainNumber = Annotated[float, *real("a plain number", "")]
Number = Annotated[float, *real("a number", "1", "0.5")]
NonNegativeNumber = Annotated[float, *real("a number", "1", "0.5", at_least=0.0)]
PositiveNumber = Annotated[float, *real("a number", "1", "10", above=0.0)]
Length = Annotated[float, *real("a length", "m", "1 mm")]
NonNegativeLength = Annotated[float, *real("a length", "m", "1 mm", at_least=0.0)]
PositiveLength = Annotated[float, *real("a length", "m", "1 mm", above=0.0)]
PositiveArea = Annotated[float, *real("an area", "m^2", "3 cm^2", above=0.0)]
Time = Annotated[float, *real("a time", "s", "0.5 s")]
NonNegativeTime = Annotated[float, *real("a time", "s", "0.5 s", at_least=0.0)]
PositiveTime = Annotated[float, *real("a time", "s", "1 ms", above=0.0)]
Angle = Annotated[float, *real("an angle", "rad", "90 deg")]
DutyCycle = Annotated[float, *real("a part of the period", "1", "50 %", above=0.0, at_most=1.0)]
PositiveMass = Annotated[float, *real("a mass", "kg", "2.7 g", above=0.0)]
NonNegativeMass = Annotated[float, *real("a mass", "kg", "2.7 g", at_least=0.0)]
Force = Annotated[float, *real("a force", "N", "50 mN")]
Moment = Annotated[float, *real("a moment", "N*m", "2 N*mm")]
PositiveInertia = Annotated[float, *real("a moment of inertia", "kg*m^2", "7.2e-7", above=0.0)]
PositiveDensity = Annotated[float, *real("a density", "kg/m^3", "1000", above=0.0)]
PositivePressure = Annotated[float, *real("a pressure", "Pa", "100 MPa", above=0.0)]
PositiveSpeed = Annotated[float, *real("a speed", "m/s", "0.1 mm/s", above=0.0)]
Speed = Annotated[float, *real("a speed", "m/s", "1 m/s")]
PositiveAngularSpeed = Annotated[float, *real("an angular speed", "rad/s", "90 deg/s", above=0.0)]
AngularSpeed = Annotated[float, *real("an angular speed", "rad/s", "60 rpm")]
Acceleration = Annotated[float, *real("an acceleration", "m/s^2", "-9.81")]
PositiveRate = Annotated[float, *real("a rate", "Hz", "50", above=0.0)]
NonNegativeRate = Annotated[float, *real("a rate", "1/s", "2", at_least=0.0)]
Curvature = Annotated[float, *real("a curvature", "1/m", "20 1/m")]
Twist = Annotated[float, *real("a twist", "rad/m", "20 rad/m")]
PositiveAngle = Annotated[float, *real("an angle", "rad", "90 deg", above=0.0)]
