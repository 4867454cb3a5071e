"""Every fault of a scene is refused with its key path, the value found and what is allowed."""

import pytest
import yaml
from support.faulty_scenes import DELETE, changed, faults_of
from support.sample_scenes import everything, layer, rod, scene

from bilayer_core import load_scene

RAMP = {"type": "ramp", "start": 0, "end": 1, "from": 0, "to": 1}
TABLE = {"type": "table", "times": [0, 1], "values": [0, 1]}
SINE = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 1}
SQUARE = {"type": "square", "low": 0, "high": 1, "period": 2}
TRAIN = {"type": "pulse_train", "low": 0, "high": 1, "period": 2, "width": 0.5, "count": 3}
MOVE = {"type": "prescribed", "times": [0], "displacements": [[0, 0, 0]]}


@pytest.mark.parametrize(
    ("path", "value", "fault"),
    [
        # keys
        ("foo", 1, "unknown key; allowed are schema, name, title"),
        ("rods.arm.widht", 0.01, "unknown key, did you mean width?; allowed are name, width, radius"),
        ("bodies.ball.motion.mas", 1, "unknown key, did you mean mass?; allowed are type, mass, inertia"),
        ("rods", DELETE, "is missing; must be a list"),
        ("schema", DELETE, "is missing; must be 1"),
        ("title", DELETE, "is missing; must be text"),
        ("rods.arm.path", DELETE, "is missing; must be a mapping of keys to values"),
        ("rods.arm.width", DELETE, "found null; must be given (a length [m], such as 2 mm), but for a round"),
        ("rods.arm.stations", DELETE, "is missing; must be a whole number of at least 3"),
        ("bodies.ball.motion.mass", DELETE, "found 0.0; must be a mass [kg] above 0 for a body that holds no rod"),
        ("contact.friction.speed_threshold", DELETE, "is missing; must be a speed [m/s] above 0, such as 0.1 mm/s"),
        # types
        ("title", 3, "found 3; must be text"),
        ("gravity", "down", 'found "down"; must be a list'),
        ("gravity", [0, 0, 0, 0], "found [0, 0, 0, 0]; must have at most 3 entries, has 4"),
        ("contact", 3, "found 3; must be a mapping of keys to values"),
        ("materials", [], "found []; must be a mapping of keys to values"),
        ("rods.arm.layers", {}, "found {}; must be a list"),
        ("rods.arm.layers", [], "found []; must have at least 1 entries, has 0"),
        ("rods.arm.stations", 2, "found 2; must be a whole number of at least 3"),
        ("rods.arm.stations", 10.5, "found 10.5; must be a whole number of at least 3"),
        ("bodies.ball.motion.shell", "perhaps", 'found "perhaps"; must be true or false'),
        ("fluid.added_mass", 3, "found 3; must be true, false, or a mapping of `through`, `sideways`, `turning`"),
        # numbers and units
        ("duration", float("nan"), "found NaN; must be a time [s] above 0"),
        ("gravity[2]", float("-inf"), "found -Infinity; must be an acceleration [m/s^2]"),
        ("rods.arm.layers.active.thickness", -1e-3, "found -0.001; must be a length [m] above 0"),
        ("rods.arm.layers.active.thickness", "-1 mm", 'found "-1 mm"; must be a length [m] above 0'),
        ("rods.arm.layers.active.thickness", "1 kg", 'found "1 kg", a quantity in kg; must be a length [m]'),
        ("rods.arm.layers.active.thickness", "1 mn", "found \"1 mn\", whose unit 'mn' is not known; must be a length"),
        ("materials.gel.poisson_ratio", 0.6, "found 0.6; must be Poisson's ratio above -1 and at most 0.5"),
        ("materials.gel.poisson_ratio", -1, "found -1; must be Poisson's ratio above -1 and at most 0.5"),
        ("materials.gel.youngs_modulus", 0, "found 0; must be a pressure [Pa] above 0, such as 100 MPa"),
        ("contact.friction.coefficient", -0.1, "found -0.1; must be a number at least 0"),
        # choices and names
        ("schema", 2, "found 2; must be 1"),
        ("rods.arm.torsion", "layer", "found \"layer\"; must be 'laminate' or 'layers'"),
        (
            "rods.arm.path",
            {"shape": "circle"},
            "found {\"shape\": \"circle\"}; `shape` must be one of 'straight', 'arc', 'spiral'",
        ),
        (
            "rods.arm.path",
            {
                "shape": "spiral",
                "start": [0, 0, 0],
                "direction": [1, 0, 0],
                "start_radius": 1,
                "end_radius": 1,
                "angle": 7,
            },
            "end_radius: found 1.0; must differ from `start_radius`; with equal radii it is an `arc`",
        ),
        ("contact.rods", "sometimes", "found \"sometimes\"; must be 'auto', "),
        (
            "stimuli.humidity.schedule",
            {"value": 1},
            "found {\"value\": 1}; the key 'type' is missing, which is one of 'hold', ",
        ),
        (
            "rods.arm.path",
            {"length": 1},
            "found {\"length\": 1}; the key 'shape' is missing, which is one of 'straight'",
        ),
        (
            "rods.arm.layers.active.material",
            "gell",
            'found "gell"; must be one of the materials (gel), did you mean gel?',
        ),
        ("rods.arm.clamp_end", "hubs", 'found "hubs"; must be one of the bodies (hub, ball), did you mean hub?'),
        # geometry
        ("rods.arm.normal", [1, 0, 1], "found [0.70710678"),
        ("rods.arm.normal", [0, 0, 0], "found [0, 0, 0]; must be a direction, with a length above 0"),
        ("rods.arm.layers.active.interval", [0.0, 0.2], "found [0.0, 0.2]; must be two increasing lengths [m] along"),
        (
            "rods.arm.layers.active.interval",
            [0.0, 0.0056],
            "found [0.0, 0.0056]; must be two increasing lengths [m] along",
        ),
        ("rods.arm.layers.active.interval", [0.004, 0.001], "found [0.004, 0.001]; must be two increasing lengths [m]"),
        (
            "rods.arm.layers.active.interval",
            [0.001, 0.0022],
            "found [0.001, 0.0022]; must span two edges or more; an edge",
        ),
        # profiles along the path
        ("rods.arm.width", "1 kg", 'found "1 kg", a quantity in kg; must be a length [m] above 0, such as 1 mm'),
        ("rods.arm.width", {"at": [0]}, "value: is missing; must be a list"),
        ("rods.arm.width", {"at": [0], "valu": [1]}, "valu: unknown key, did you mean value?; allowed are at, value"),
        ("rods.arm.width", {"at": [0], "value": [-1]}, "value[0]: found -1; must be a length [m] above 0, such as"),
        ("rods.arm.width", {"at": [0, 0], "value": [1, 1]}, "at[1]: found 0.0; must be further than the place before"),
        ("rods.arm.width", {"at": [0], "value": [1, 1]}, 'value: found "2 entries"; must be as many as `at`, 1'),
        ("rods.arm.width", {"at": [0, "6 mm"], "value": [1, 1]}, "at[1]: found 0.006; must be a length [m] along the"),
        ("rods.arm.layers.active.natural_twist", {"at": [1], "value": [0]}, "at[0]: found 1.0; must be a length [m]"),
        ("rods.arm.layers.active.stiffness", 0, "found 0; must be a number above 0, such as 10"),
        # light
        ("stimuli.humidity.light", {"from": [0, 0, 0]}, "from: found [0, 0, 0]; must be a direction, with a length"),
        ("stimuli.humidity.light", {}, "from: is missing; must be a list"),
        ("stimuli.humidity.light", {"from": [0, 0, 1], "shadows": True}, "shadows: unknown key, did you mean shadow?"),
        ("stimuli.humidity.light", True, "found true; must be a mapping of keys to values"),
        (
            "stimuli.humidity",
            {"minimum": -1, "light": {"from": [0, 0, 1]}, "schedule": RAMP},
            "minimum: found -1.0; must be 0 for a light: that is what layers in the dark see",
        ),
        # directions of friction
        ("contact.friction.axis", [0, 0, 0], "found [0, 0, 0]; must be a direction, with a length above 0"),
        ("contact.friction.axis", "rod", 'found "rod"; must be a list'),
        ("obstacles.ground.grain", [0, 0, 0], "found [0, 0, 0]; must be a direction, with a length above 0"),
        ("bodies.ball.surface", {"shape": "box", "size": [1, 1, 1], "grain": "x"}, 'grain: found "x"; must be a list'),
        # masses and loads
        ("masses.cargo.mass", 0, "found 0; must be a mass [kg] above 0, such as 2.7 g"),
        ("masses.cargo.rod", "arms", 'found "arms"; must be one of the rods or their copies (arm, arm_0, arm_1), did'),
        ("masses.cargo.position", 0.1, "found 0.1; must be a length [m] along the path, from 0 to 0.0055"),
        ("masses.cargo.position", "-1 mm", 'found "-1 mm"; must be a length [m] at least 0, such as 1 mm'),
        ("loads.tug.rod", "arm_2", 'found "arm_2"; must be one of the rods or their copies (arm, arm_0, arm_1), did'),
        ("loads.tug.position", "6 mm", "found 0.006; must be a length [m] along the path, from 0 to 0.0055"),
        ("loads.tug.position", DELETE, "found null; must be given for a load on a rod: a length along its path"),
        ("loads.tug.force[0]", "1 N*m", 'found "1 N*m", a quantity in kg * m ** 2 / s ** 2; must be a force [N], such'),
        ("loads.tug.force", [0, 0, 0], "found [0.0, 0.0, 0.0]; must not be zero"),
        ("loads.tug.moment", [0, 0, 1], "found [0.0, 0.0, 1.0]; must be left out: only bodies take moments"),
        ("loads.tug.frame", "body", "found \"body\"; must be 'world' or 'material'"),
        ("loads.crank.moment[2]", "1 N", 'found "1 N", a quantity in kg * m / s ** 2; must be a moment [N*m], such as'),
        ("loads.crank.body", "bal", 'found "bal"; must be one of the bodies (hub, ball), did you mean ball?'),
        ("loads.crank.body", "hub", 'found "hub"; must be a free or a guided body; the path of this one is given'),
        ("loads.crank.position", 0, "found 0.0; must be left out: a force on a body acts at its mass centre"),
        ("loads.crank.rod", "arm", 'found "arm, beside the body ball"; must be given, or `body` instead of it'),
        # parts that need another
        (
            "contact",
            None,
            "found null; must be given (barrier_distance, stiffness): there is something to touch, ground",
        ),
    ],
)
def test_a_fault_is_told_with_its_place_the_value_found_and_what_is_allowed(path, value, fault):
    lines = faults_of(changed(path, value))
    assert any(line.startswith((f"scene: {path}: {fault}", f"scene: {path}.{fault}")) for line in lines), lines


@pytest.mark.parametrize(
    ("path", "value", "fault"),
    [
        ("gravity", [0, 0], "gravity[2]: is missing; must be an acceleration [m/s^2], such as -9.81"),
        ("solver", {"model": "two_rods"}, "solver.model: found \"two_rods\"; must be 'auto', 'two_rod' or 'laminate'"),
        ("rods.arm.name", DELETE, "rods[0].name: is missing; must be text"),
        ("rods.arm.name", "a/b", 'rods.a/b.name: found "a/b"; must be a name: letters, digits and single underscores'),
        (
            "rods.arm.name",
            "a__b",
            'rods.a__b.name: found "a__b"; must be a name: letters, digits and single underscores',
        ),
        (
            "stimuli.2nd",
            {"schedule": {"type": "hold", "value": 0}},
            'stimuli.2nd: found "2nd"; must be a name: letters',
        ),
        (
            "bodies.ball.name",
            "ground",
            'obstacles.ground.name: found "ground"; must be a name of its own among the rods',
        ),
        ("bodies.hub.name", "arm_1", 'bodies.arm_1.name: found "arm_1"; must be a name of its own among the rods'),
        (
            "rods.arm.layers",
            [layer("a"), layer("a")],
            'layers.a.name: found "a"; must be a name of its own among the layers',
        ),
        ("rods.arm.layers", [layer("a"), layer("b"), layer("c")], "must have at most 2 entries, has 3"),
        ("rods.arm.normal", [1, 0, 1], "must be perpendicular to the path, is 45 deg off"),
        (
            "rods.arm.layers.passive.interval",
            [0.0, 0.0033],
            "rods.arm.layers: found [[0.0, 0.0033], [0.0011, 0.0044]]; one",
        ),
        (
            "bodies.ball.motion.inertia",
            [1, 1, 1],
            "motion.shell: found true; must be left out where `inertia` is given",
        ),
        (
            "bodies.ball.surface",
            None,
            "ball.motion.inertia: found null; must be given for a free body with a mass but without a surface",
        ),
        ("loads.crank.name", "tug", 'loads.tug.name: found "tug"; must be a name of its own among the loads'),
        ("loads.crank.body", DELETE, "loads.crank.rod: found null; must be given, or `body` instead of it: a"),
        (
            "bodies.ball.motion",
            {"type": "guided", "axis": [0, 0, 1], "mass": 1},
            "loads.crank.moment: found [2e-05, -1e-05, 3e-05]; must be left out: this guided body does not turn",
        ),
        ("loads.tug.schedule.period", 0, "loads.tug.schedule.period: found 0; must be a time [s] above 0, such as"),
        ("stimuli.humidity.maximum", -1, "stimuli.humidity.maximum: found -1.0; must be above `minimum` (0)"),
        (
            "rods.arm.layers.active.eigenstrain.stimulus",
            "humidty",
            'stimulus: found "humidty"; must be one of the stimuli (humidity), did you mean humidity?',
        ),
    ],
)
def test_a_fault_that_concerns_several_values_is_told_at_one_of_them(path, value, fault):
    lines = faults_of(changed(path, value))
    assert any(fault in line for line in lines), lines


@pytest.mark.parametrize(
    ("schedule", "fault"),
    [
        (
            {"type": "rampe"},
            ": found {\"type\": \"rampe\"}; `type` must be one of 'hold', 'ramp', 'table', 'sine', 'square', "
            "'pulse_train', 'sequence', 'csv', did you mean ramp?",
        ),
        ({"type": "hold", "value": 1.5}, ".value: found 1.5; must lie in the range of the channel, 0 to 1 [1]"),
        ({"type": "hold", "value": "50 %"}, '.value: found "50 %"; must be a plain number'),
        ({**RAMP, "to": 2}, ".to: found 2.0; must lie in the range of the channel, 0 to 1 [1]"),
        ({**RAMP, "end": 0}, ".end: found 0.0; must be later than `start` (0 s)"),
        ({key: RAMP[key] for key in RAMP if key != "to"}, ".to: is missing; must be a plain number"),
        ({**TABLE, "values": [0, 2]}, ".values[1]: found 2.0; must lie in the range of the channel, 0 to 1 [1]"),
        ({**TABLE, "values": [0]}, '.values: found "1 entries"; must be as many as `times`, 2'),
        ({**TABLE, "times": [1, 1]}, ".times[1]: found 1.0; must be later than the time before it (1 s)"),
        ({**TABLE, "times": [-1, 1]}, ".times[0]: found -1; must be a time [s] at least 0, such as 0.5 s"),
        ({"type": "table", "times": [], "values": []}, ".times: found []; must have at least 1 entries, has 0"),
        ({**SINE, "amplitude": 0.6}, ".mean + amplitude: found 1.1; must lie in the range of the channel, 0 to 1 [1]"),
        ({**SINE, "period": 0}, ".period: found 0; must be a time [s] above 0, such as 1 ms"),
        ({**SINE, "phase": "90 mm"}, '.phase: found "90 mm", a quantity in m; must be an angle [rad], such as 90 deg'),
        ({**SQUARE, "low": -1}, ".low: found -1.0; must lie in the range of the channel, 0 to 1 [1]"),
        ({**SQUARE, "duty": "120 %"}, '.duty: found "120 %"; must be a part of the period above 0 and at most 1, such'),
        (
            {**SQUARE, "duty": 0.9, "rise_time": 0.3},
            ".rise_time: found 0.3; must be at most 0.2 s: both flanks have to fit with `period` and `duty`",
        ),
        ({**TRAIN, "count": 0}, ".count: found 0; must be a whole number of at least 1"),
        ({**TRAIN, "width": 2}, ".width: found 2.0; must be below `period` (2 s)"),
        (
            {**TRAIN, "rise_time": 0.6},
            ".rise_time: found 0.6; must be at most 0.5 s: both flanks have to fit with `period` and `width`",
        ),
        ({"type": "sequence", "parts": []}, ".parts: found []; must have at least 1 entries, has 0"),
        (
            {"type": "sequence", "parts": [{"duration": 1, "schedule": {**RAMP, "to": 2}}]},
            ".parts[0].schedule.to: found 2.0; must lie in the range of the channel, 0 to 1 [1]",
        ),
        (
            {"type": "sequence", "parts": [{"duration": 1, "schedule": {**RAMP, "end": 0}}]},
            ".parts[0].schedule.end: found 0.0; must be later than `start` (0 s)",
        ),
        (
            {"type": "sequence", "parts": [{"schedule": RAMP}]},
            ".parts[0].duration: is missing; must be a time [s] above 0, such as 1 ms",
        ),
    ],
)
def test_a_fault_of_a_schedule_is_told_without_its_type_in_the_key_path(schedule, fault):
    assert faults_of(changed("stimuli.humidity.schedule", schedule))[0].startswith(
        f"scene: stimuli.humidity.schedule{fault}"
    )


@pytest.mark.parametrize(
    "schedule",
    [
        {**SINE, "amplitude": 0.5000000000000001},
        {**RAMP, "to": 1.0000000000000002},
        {**TABLE, "values": [-1e-17, 1.0000000000000002]},
    ],
    ids=str,
)
def test_a_schedule_that_passes_its_range_by_rounding_only_is_allowed(schedule):
    scene = load_scene(changed("stimuli.humidity.schedule", schedule))
    assert scene.stimuli["humidity"].schedule.type == schedule["type"]


@pytest.mark.parametrize("value", [1.00000001, -1e-8])
def test_a_schedule_that_passes_its_range_by_more_than_rounding_is_refused(value):
    (fault,) = faults_of(changed("stimuli.humidity.schedule", {"type": "hold", "value": value}))
    assert "must lie in the range of the channel, 0 to 1 [1]" in fault


@pytest.mark.parametrize(
    ("motion", "fault"),
    [
        ({**MOVE, "displacements": [[0, 0, 1]]}, ".displacements[0]: found [0.0, 0.0, 1.0]; must be [0, 0, 0]"),
        ({**MOVE, "displacements": []}, '.displacements: found "0 entries"; must be as many as `times`, 1'),
        (
            {**MOVE, "times": [0, 0], "displacements": [[0, 0, 0]] * 2},
            ".times[1]: found 0.0; must be later than the time",
        ),
        ({"type": "fre"}, ": found {\"type\": \"fre\"}; `type` must be one of 'free', 'guided', 'prescribed', did"),
    ],
)
def test_a_prescribed_motion_starts_at_the_position_and_goes_forward_in_time(motion, fault):
    assert faults_of(changed("bodies.hub.motion", motion))[0].startswith(f"scene: bodies.hub.motion{fault}")


def test_all_faults_are_told_at_once_each_on_a_line_that_begins_with_the_file(tmp_path):
    content = changed("rods.arm.widht", 1)
    content["duration"] = "1 kg"
    content["materials"]["gel"]["density"] = -1
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(content))
    lines = faults_of(str(path))
    assert len(lines) == 3
    assert all(line.startswith(f"{path}: ") for line in lines)


@pytest.mark.parametrize(
    ("path", "place", "radius"),
    [
        ({"shape": "arc", "radius": 0.001, "angle": 1.0}, "radius", 0.001),
        ({"shape": "spiral", "start_radius": 0.02, "end_radius": 0.001, "angle": 50.0}, "end_radius", 0.001),
        ({"shape": "spiral", "start_radius": 0.001, "end_radius": 0.02, "angle": 50.0}, "start_radius", 0.001),
    ],
)
def test_a_path_whose_inner_face_would_have_no_length_is_refused(path, place, radius):
    def bent(toward, **layers):
        curved = {"start": [0, 0, 0], "direction": [1, 0, 0], "toward": toward, **path}
        both = [layer(name, thickness=thickness) for name, thickness in layers.items()]
        return scene([rod(both, stations=401) | {"path": curved}])

    for toward, layers in (("normal", {"low": 5e-4, "high": 1.1e-3}), ("opposite", {"low": 1.1e-3, "high": 5e-4})):
        (told,) = faults_of(bent(toward, **layers))
        inner = "high" if toward == "normal" else "low"
        assert told.startswith(
            f"scene: rods.rod.path.{place}: found {radius}; must be larger: the path has a radius of "
        )
        assert f"the inner face of layer {inner}, 0.0011 m from it, would have no length" in told
    load_scene(bent("opposite", low=5e-4, high=1.1e-3))  # the thick layer lies outside
    assert "0.0011 m from it" in faults_of(bent("normal", only=2.2e-3))[0]
    load_scene(bent("normal", only=1.8e-3))


def test_two_layers_that_cover_the_path_only_together_are_refused():
    halves = [layer("near", interval=[0, 0.05]), layer("far", interval=[0.05, 0.1])]
    assert "one layer must cover the whole path" in faults_of(scene([rod(halves)]))[0]


def test_a_layer_covers_the_stations_nearest_to_its_interval():
    strip = rod([layer("passive"), layer("active", interval=[0.0129, 0.0871])], length=0.1, stations=21)
    config = load_scene(scene([strip]))
    assert config.rods[0].covered_stations(config.rods[0].layers[1]) == (3, 17)


@pytest.mark.parametrize("lags", [{}, {"time_constant_rising": 1}, {"time_constant": 0}])
def test_a_layer_that_follows_light_at_once_is_refused(lags):
    content = everything()
    content["stimuli"]["humidity"]["light"] = {"from": [0, 0, 1]}
    content["rods"][0]["layers"][1]["eigenstrain"] |= lags
    found = "0.0" if "time_constant" in lags else "null"
    assert faults_of(content) == [
        f"scene: rods.arm.layers.active.eigenstrain.time_constant: found {found}; must be a time [s] above 0, "
        "rising and falling: `humidity` is a light"
    ]


def test_a_copy_that_follows_light_at_once_is_refused():
    content = everything()
    lit = {"schedule": {"type": "hold", "value": 0.5}, "light": {"from": [0, 0, 1]}}
    content["stimuli"]["sun"] = lit
    content["rods"][0]["pattern"]["stimuli"] = {"humidity": ["humidity", "sun"]}
    assert "must be a time [s] above 0, rising and falling: `sun` is a light" in faults_of(content)[0]
