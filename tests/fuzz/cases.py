"""Random mutations of scenes: of values, keys, the text of a file, and overrides."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import yaml
from hypothesis import strategies as st
from support import sample_scenes as samples

from bilayer_core.scene.bundled import bundled_scenes
from bilayer_core.scene.text import read_yaml
from fuzz.schema_values import Drawer, models_of

MUTATIONS = (1, 1, 2, 2, 3, 4, 6)
"""Of one scene."""
NUMBERS = (
    *(0, -0.0, 1, -1, 2, 3, 0.5, 1e-3, 1e3, 7, 1e-12, 1e12, -1e-9, 90.0, 1e-5),
    *(1e-320, 1e-99, 1e-31, 1e-29, 1e-20, 1e20, 9e29, -9e29, 1e31, 1e99, 1e150, 1e308),
    *(math.nan, math.inf, -math.inf, 2**31, 2**53, 2**64, -(2**63), 10**400),
)
TEXTS = (
    *"|0|1e-3|nan|-inf|1 mm|-3 mm|1e99 km|1e-99 nm|90 deg|1 turn|50 %|1e3000 m|5 furlong|1 mm mm|1 /m|m".split("|"),
    *"1/0 m|1 m**1e9|1 m^99999|3 kg*m^2/s|1 degC|1 dB|1e999999999 m|1_0|0x1F|1:30".split("|"),
    *"é|a b|a_0|../x|{demand}|%s|on|~|+".split("|"),
    *"auto|laminate|two_rod|prescribed|free|guided|plane|sphere|spline|csv|hold|all".split("|"),
    *(" ", "\0", "\t", "x" * 3000, "\U0001f600", "name\nname"),
)
ODD: tuple[Any, ...] = (*NUMBERS, *TEXTS, None, True, False, [], {}, [[]], [None], [0, 0, 0], {"at": [0], "value": [0]})
ODD += ([1e29] * 3, [1, 0], [0, 1, 2, 3], {"type": "hold", "value": 0.5}, {"name": "x"}, [{}], [{"at": 1}])
COUNTED = ("stations", "count", "counts", "rim_points", "max_newton_iterations", "max_halvings", "rate", "marker_rate")
TAGS = {
    "type": (
        "hold ramp table sine square pulse_train sequence csv free guided prescribed plane sphere box cylinder pin "
        "hinge weld slide universal rotation translation grid mirror list"
    ).split(),
    "shape": "straight arc spiral helix polyline spline plane sphere box cylinder bow random".split(),
}
LINES = "\tx: 1|  - |? [a]|<<: *a|a: &a [*a]|---|...|%YAML 1.1|!!python/name:os.system|- - - 1|{|]".split("|")
PIECES = (
    *': , - ,#,\',",|,>,&a ,*a,!!float ,!!set ,!!int ,@,`,"\\uD800",{,[,~,e9,0x1F,1:30,  '.split(","),
    *"\0\t\x07\ufeff\u2028\x85\r\n",
)
"""Of text, put anywhere."""
Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Case:
    """What is tried: the text of a scene file, overrides, and how `check` is to answer."""

    text: str
    overrides: tuple[str, ...] = ()
    as_json: bool = False


def bases() -> dict[str, dict[str, Any]]:
    """Scenes to start from, small ones first: hypothesis shrinks to the first."""
    strip = samples.rod([samples.layer()], stations=5)
    driven = samples.rod(
        [samples.layer("a"), samples.layer("b", eigenstrain={"stimulus": "heat", "gain": 0.1})], stations=6
    )
    heat = {"heat": {"schedule": {"type": "ramp", "start": 0, "end": 1, "from": 0, "to": 1}}}
    ground = {"contact": samples.contact(coefficient=0.3), "obstacles": [samples.GROUND]}
    above = samples.rod([samples.layer()], stations=5, start=(0, 0, 0.01))
    small = {
        "strip": samples.scene([strip]),
        "held": samples.scene([{**strip, "clamp_start": "wall"}], bodies=[samples.fixed()], solver={"model": "auto"}),
        "driven": samples.scene([driven], stimuli=heat, solver={"model": "auto", "dimension": "auto"}),
        "ball": samples.scene([above], bodies=[samples.ball((0, 0, 0.06))], **ground),
        "everything": samples.everything(),
    }
    return small | {name: read_yaml(path.read_text("utf-8"), name) for name, path in bundled_scenes().items()}


BASES = bases()


def paths_in(data: Any, path: Path = ()) -> Iterator[Path]:
    """Key paths of everything inside a scene."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from paths_in(value, (*path, key))


def at(data: Any, path: Path) -> Any:
    """What stands at a path."""
    for key in path:
        data = data[key]
    return data


class Mutator(Drawer):
    """Mutates a scene in place, one thing at a time."""

    def path(self) -> Path | None:
        """Any path of the scene."""
        paths = list(paths_in(self.scene))
        return self.one(paths) if paths else None

    def odd_value(self) -> None:
        """Put a hostile or odd value somewhere."""
        if path := self.path():
            at(self.scene, path[:-1])[path[-1]] = copy.deepcopy(self.one(ODD))

    def other_size(self) -> None:
        """Multiply a number by a power of ten, or change its sign."""
        paths = [path for path in paths_in(self.scene) if type(at(self.scene, path)) in (int, float)]
        if paths:
            path = self.one(paths)
            factor = self.one(
                (-1, 0.1, 10, 0.5, 2, 1.000001, 1e3, 1e-3, 1e-6, 1e6, 1e-12, 1e12, 1e40, 1e-40, -1e6, 1e90, 1e-90)
            )
            holder, number = at(self.scene, path[:-1]), at(self.scene, path)
            holder[path[-1]] = number * factor if abs(number) < 1e300 else factor

    def multiplied_count(self) -> None:
        """Change how many of something there are."""
        paths = [path for path in paths_in(self.scene) if set(path[-2:]) & set(COUNTED)]
        if paths:
            path = self.one(paths)
            at(self.scene, path[:-1])[path[-1]] = self.one(
                (0, 1, 2, 3, 4, 5, 50, 999, 1000, 1001, 20_000, 10**5, 10**6, 2**53)
            )

    def deleted(self) -> None:
        """Delete a key or an item."""
        if path := self.path():
            del at(self.scene, path[:-1])[path[-1]]

    def repeated_item(self) -> None:
        """Repeat an item of a list, perhaps with another name."""
        paths = [path for path in paths_in(self.scene) if isinstance(path[-1], int)]
        if paths:
            path = self.one(paths)
            item = copy.deepcopy(at(self.scene, path))
            if isinstance(item, dict) and "name" in item and not self.chance(3):
                item["name"] = self.one(("twin", "other"))
            at(self.scene, path[:-1]).insert(path[-1], item)

    def renamed_key(self) -> None:
        """Give a key another name, often one near to its own."""
        paths = [path for path in paths_in(self.scene) if isinstance(path[-1], str)]
        if paths:
            path = self.one(paths)
            holder, key = at(self.scene, path[:-1]), path[-1]
            name = self.one(
                (key[:-1], f"{key}s", key.upper(), key.replace("_", ""), "type", "name", "1", "", "a.b", "x" * 300)
            )
            holder[name] = holder.pop(key)

    def swapped(self) -> None:
        """Swap two values."""
        first, second = self.path(), self.path()
        if first and second and first[: len(second)] != second and second[: len(first)] != first:
            one, other = at(self.scene, first), at(self.scene, second)
            at(self.scene, first[:-1])[first[-1]] = other
            at(self.scene, second[:-1])[second[-1]] = one

    def from_elsewhere(self) -> None:
        """Take a part of another scene, to the same place or instead of something else."""
        other = BASES[self.one(BASES)]
        path = self.one(list(paths_in(other)))
        part = copy.deepcopy(at(other, path))
        if len(path) == 1 or self.chance(3):
            self.scene[path[0]] = copy.deepcopy(other[path[0]])
        elif here := [own for own in paths_in(self.scene) if own[-1] == path[-1]]:
            own = self.one(here)
            at(self.scene, own[:-1])[own[-1]] = part

    def other_tag(self) -> None:
        """Change the key that says which of several mappings this is."""
        paths = [path for path in paths_in(self.scene) if path[-1] in TAGS]
        if paths:
            path = self.one(paths)
            at(self.scene, path[:-1])[path[-1]] = self.one(TAGS[path[-1]])

    def valid_key(self, absent: bool = True) -> None:
        """Give a key that the schema knows, as a rule one that is not given, a value that it allows."""
        places = models_of(self.scene)
        weighted = [place for place in places for _ in range(3 if len(place[0]) < 3 else 1)]
        if not weighted:
            return
        path, model = self.one(weighted)
        holder = at(self.scene, path)
        keys = {field.alias or name: field for name, field in model.model_fields.items()}
        chosen = [key for key in keys if (key not in holder) == absent] or list(keys)
        key = self.one(chosen)
        holder[key] = self.field(keys[key], key)

    def other_valid_value(self) -> None:
        """Give a key that is there another value that the schema allows."""
        self.valid_key(absent=False)

    def more_items(self) -> None:
        """Add an item to a list of parts of the robot."""
        key = self.one(("rods", "bodies", "joints", "masses", "loads", "obstacles"))
        drawn = self.field(models_of(self.scene)[0][1].model_fields[key], key) if isinstance(self.scene, dict) else []
        here = self.scene.get(key)
        self.scene[key] = [*(here if isinstance(here, list) else []), *drawn[:1]]
        if key in ("bodies", "obstacles"):
            self.scene.setdefault("contact", samples.contact())

    def unknown_key(self) -> None:
        """Put a key of one class into another."""
        places = models_of(self.scene)
        if places:
            path, _ = self.one(places)
            _, other = self.one(places)
            name = self.one(other.model_fields)
            field = other.model_fields[name]
            at(self.scene, path)[field.alias or name] = self.field(field, field.alias or name)


HOSTILE = ("odd_value", "odd_value", "other_size", "other_size", "multiplied_count", "deleted", "repeated_item")
HOSTILE += ("renamed_key", "swapped", "from_elsewhere", "other_tag", "unknown_key")
VALID = ("valid_key", "valid_key", "valid_key", "other_valid_value", "other_valid_value", "more_items", "repeated_item")
VALID += ("from_elsewhere", "other_size")


def written(scene: Any, in_line: bool = False) -> str:
    """A scene, or a part of one, as YAML text; what YAML cannot hold is escaped."""
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    if not in_line:
        return yaml.dump(scene, Dumper=dumper, sort_keys=False)
    return (
        yaml.dump(scene, Dumper=dumper, default_flow_style=True, width=10**9).removesuffix("\n").removesuffix("\n...")
    )


def _mutated(draw: Callable, kinds: tuple[str, ...]) -> Any:
    mutator = Mutator(draw, None)
    mutator.scene = copy.deepcopy(BASES[mutator.one(BASES)])
    for _ in range(mutator.one(MUTATIONS)):
        if isinstance(mutator.scene, dict):
            getattr(mutator, mutator.one(kinds))()
    return mutator.scene


@st.composite
def hostile(draw) -> Case:
    """Scenes with values and keys that mean nothing, or too much."""
    return Case(written(_mutated(draw, HOSTILE)), as_json=draw(st.booleans()))


@st.composite
def valid_keys(draw) -> Case:
    """Scenes with values that each key allows by itself."""
    return Case(written(_mutated(draw, VALID)), as_json=draw(st.booleans()))


@st.composite
def texts(draw) -> Case:
    """Scene files whose text is damaged."""
    mutator = Mutator(draw, None)
    text = written(BASES[mutator.one(BASES)])
    for _ in range(mutator.one(MUTATIONS)):
        lines = text.split("\n")
        line = draw(st.integers(0, len(lines) - 1))
        place = draw(st.integers(0, len(lines[line])))
        kind = mutator.one(("insert", "cut", "repeat", "delete", "line", "odd", "end", "join", "indent"))
        own = lines[line]
        if kind == "insert":
            lines[line] = own[:place] + mutator.one(PIECES) + own[place:]
        elif kind == "cut":
            lines[line] = own[:place]
        elif kind == "repeat":
            lines.insert(draw(st.integers(0, len(lines))), own)
        elif kind == "delete":
            del lines[line]
        elif kind == "line":
            lines.insert(line, mutator.one(LINES))
        elif kind == "odd":
            lines[line] = f"{own.partition(':')[0]}: {draw(st.text(max_size=8))}"
        elif kind == "end":
            lines = lines[: line + 1]
        elif kind == "join":
            lines[line] = own.strip()
        else:
            lines[line] = mutator.one((" ", "  ", "   ")) + own
        text = "\n".join(lines) or "\n"
    return Case(text, as_json=draw(st.booleans()))


@st.composite
def overrides(draw) -> Case:
    """Sound scenes, with values changed as ``--set`` does it."""
    mutator = Mutator(draw, None)
    name = mutator.one(BASES)
    mutator.scene = BASES[name]
    given = []
    for _ in range(draw(st.integers(1, 3))):
        path = mutator.path()
        keys = [str(key) for key in path]
        if mutator.chance(2):  # items of lists by their names
            items = [at(mutator.scene, path[: depth + 1]) for depth in range(len(path))]
            keys = [
                i.get("name", key) if isinstance(i, dict) and isinstance(k, int) else key
                for k, key, i in zip(path, keys, items, strict=True)
            ]
        if valid := mutator.chance(2):
            places = models_of(mutator.scene)
            where, model = mutator.one(places)
            of_model = mutator.one(model.model_fields)
            field = model.model_fields[of_model]
            keys, value = [*map(str, where), field.alias or of_model], mutator.field(field, field.alias or of_model)
        else:
            value = mutator.one(ODD)
        text = value if isinstance(value, str) else written(value, in_line=True)
        if not valid:
            odd = "[" + text, "{a: " + text + "}", f"!!int {text}", f"{text}\udcff"
            text = mutator.one((text, text, text, *odd))
        dot, equals = mutator.one((".",) * 8 + ("..", "/")), mutator.one(("=",) * 9 + ("",))
        given.append(f"{dot.join(keys)}{equals}{text}")
    return Case(written(mutator.scene), tuple(given), draw(st.booleans()))


FAMILIES = {"values": (hostile, 0.3), "keys": (valid_keys, 0.35), "texts": (texts, 0.2), "overrides": (overrides, 0.15)}
"""Strategies, each with its share of the scenes."""
