"""Schema of the description of a run: types, sizes, ranges and names as scenes have them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictBool, model_validator

from bilayer_core.names import NAME

MOST_NODES = 1_000_000
"""Of all strands and surfaces, and as many edges: more than scenes may have."""
MOST_PARTS = 10_000
"""Strands, bodies, obstacles, joints or channels."""
LARGEST_STATE = 10_000_000
"""Numbers in a state."""
LARGEST_NUMBER = 1e12
"""Of lengths and the like, in SI units."""
UNIT_TOLERANCE = 1e-3
"""By which the length of a quaternion may be another than 1."""


def _numbers(value: Any) -> np.ndarray:
    """Return a list of finite numbers as an array."""
    if not (isinstance(value, list) and all(type(number) in (float, int) for number in value)):
        raise ValueError("must be a list of numbers")
    try:
        found = np.array(value, float)
    except OverflowError:
        raise ValueError("must have finite numbers only") from None
    if not (np.abs(found) <= LARGEST_NUMBER).all():
        raise ValueError("must have finite numbers only")
    return found


Name = Annotated[str, Field(max_length=120, pattern=f"^{NAME}$")]
"""That of a scene, with the number of a copy."""
PathName = Annotated[str, Field(max_length=250, pattern=f"^{NAME}(/{NAME})+$")]
JointFigure = Annotated[str, Field(max_length=150, pattern=f"^(joint|body)/{NAME}/(wrench|angle|travel)$")]
Number = Annotated[float, Field(strict=True, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Size = Annotated[float, Field(strict=True, ge=0.0, le=LARGEST_NUMBER)]
Count = Annotated[int, Field(strict=True, ge=0, le=MOST_NODES)]
Numbers = Annotated[Any, BeforeValidator(_numbers)]
Bound = Annotated[float, Field(strict=True)]
Unit = Annotated[str, Field(max_length=50)]
Dimension = Annotated[int, Field(strict=True, ge=0, le=LARGEST_STATE)]
ShortText = Annotated[str, Field(max_length=1000)]


class Part(BaseModel):
    """Unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class ShapePart(Part):
    """A `ShapeInfo`."""

    kind: Literal["plane", "sphere", "box", "cylinder"]
    size: tuple[Size, Size, Size]
    rounding: Size
    position: tuple[Number, Number, Number]
    quaternion: tuple[Number, Number, Number, Number]

    @model_validator(mode="after")
    def _check_quaternion(self) -> Self:
        if abs(math.hypot(*self.quaternion) - 1.0) > UNIT_TOLERANCE:
            raise ValueError("the quaternion must have the length 1")
        return self


class StrandPart(Part):
    """A `Strand`; older logs have neither offset nor curvature nor layers nor closed ones, nor the first station."""

    name: PathName
    rod: Name
    layer: Name
    nodes: tuple[Count, Count]
    edges: tuple[Count, Count]
    width: Numbers
    thickness: Numbers
    offset: Numbers = None
    curvature: Numbers = None
    layers: Annotated[tuple[LayerPart, ...], Field(max_length=MOST_PARTS)] = ()
    closed: StrictBool = False
    round: StrictBool = False
    strip: StrictBool = False
    first_station: Count | None = None

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        count = self.nodes[1] - self.nodes[0]
        if count < 1 or self.edges[1] - self.edges[0] != count - 1:
            raise ValueError(f"{self.name} must have nodes, and one edge less than nodes")
        for key in ("width", "thickness", "offset", "curvature"):
            values = getattr(self, key)
            if values is not None and len(values) != count:
                raise ValueError(f"{self.name} must have {count} values of {key}, one for each node, has {len(values)}")
        return self


class LayerPart(StrandPart):
    """A layer of a strand, which has none itself."""

    layers: tuple[()] = ()


class BodyPart(Part):
    """A `BodyInfo`."""

    name: Name
    shape: ShapePart | None
    prescribed: StrictBool
    holds_rods: StrictBool = False


class ObstaclePart(Part):
    """An `ObstacleInfo`."""

    name: Name
    shape: ShapePart


class JointPart(Part):
    """A `JointInfo`."""

    name: PathName
    body: Annotated[int, Field(strict=True, ge=-1, lt=MOST_PARTS)]
    shape: ShapePart


class DescriptionPart(Part):
    """A `Description` without the text of its scene; joints, units, pairs and figures are not in older logs."""

    scene_name: Name
    title: str
    node_count: Count
    edge_count: Count
    strands: Annotated[tuple[StrandPart, ...], Field(min_length=1, max_length=MOST_PARTS)]
    bodies: Annotated[tuple[BodyPart, ...], Field(max_length=MOST_PARTS)]
    obstacles: Annotated[tuple[ObstaclePart, ...], Field(max_length=MOST_PARTS)]
    channels: Annotated[tuple[Name, ...], Field(max_length=MOST_PARTS)]
    channel_ranges: Annotated[tuple[tuple[Bound, Bound], ...], Field(max_length=MOST_PARTS)]
    state_layout: Annotated[
        tuple[tuple[Name, Annotated[tuple[Dimension, ...], Field(max_length=4)]], ...], Field(max_length=MOST_PARTS)
    ]
    settings: Annotated[dict[ShortText, ShortText], Field(max_length=1000)]
    joints: Annotated[tuple[JointPart, ...], Field(max_length=MOST_PARTS)] = ()
    channel_units: Annotated[tuple[Unit, ...], Field(max_length=MOST_PARTS)] | None = None
    contact_pairs: Annotated[tuple[tuple[Name, Name], ...], Field(max_length=MOST_PARTS)] = ()
    joint_figures: Annotated[tuple[JointFigure, ...], Field(max_length=MOST_PARTS)] = ()

    @model_validator(mode="after")
    def _check_references(self) -> Self:
        for key in ("strands", "bodies", "obstacles"):
            _refuse_repeated(key, (part.name for part in getattr(self, key)))
        for key in ("channels", "contact_pairs", "joint_figures"):
            _refuse_repeated(key, getattr(self, key))
        _refuse_repeated("state_layout", (name for name, _ in self.state_layout))
        for strand in self.strands:
            for of in (strand, *strand.layers):
                if of.nodes[1] > self.node_count or of.edges[1] > self.edge_count:
                    most = f"node_count ({self.node_count}) and edges below edge_count ({self.edge_count})"
                    raise ValueError(f"{of.name} must have nodes below {most}")
        if any(joint.body >= len(self.bodies) for joint in self.joints):
            raise ValueError(f"joints must be on one of {len(self.bodies)} bodies")
        units = self.channels if self.channel_units is None else self.channel_units
        if not len(self.channels) == len(self.channel_ranges) == len(units):
            raise ValueError("channel_ranges and channel_units must have an entry for each of the channels")
        if any(not lower <= upper for lower, upper in self.channel_ranges):
            raise ValueError("channel_ranges must go up")
        if sum(math.prod(shape) for _, shape in self.state_layout) > LARGEST_STATE:
            raise ValueError(f"state_layout must have at most {LARGEST_STATE:,} numbers")
        return self


def _refuse_repeated(key: str, names: Iterable[str]) -> None:
    names = list(names)
    if len(set(names)) != len(names):
        raise ValueError(f"{key} must have names of their own")
