import pytest
import yaml
from pydantic import TypeAdapter
from support.sample_scenes import everything

from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.scene.loader import parse_scene, scene_text
from bilayer_core.scene.schedule import Schedule


def schedule(**content):
    return TypeAdapter(Schedule).validate_python(content)


def test_a_held_value_holds_at_all_times():
    assert [schedule(type="hold", value=0.3).value(t) for t in (-1.0, 0.0, 1e9)] == [0.3] * 3


def test_a_ramp_is_linear_between_its_ends_and_constant_outside():
    ramp = schedule(type="ramp", start=1.0, end=3.0, **{"from": 0.2, "to": 1.0})
    assert [ramp.value(t) for t in (0.0, 1.0, 3.0, 9.0)] == [0.2, 0.2, 1.0, 1.0]
    assert ramp.value(1.5) == pytest.approx(0.4)


def test_a_ramp_reaches_its_last_value_exactly():
    ramp = schedule(type="ramp", start=0.1, end=0.7, **{"from": 0.1, "to": 0.3})
    assert ramp.value(0.7) == 0.3


def test_a_table_is_linear_between_points_and_constant_outside():
    table = schedule(type="table", times=[0.0, 1.0, 2.0], values=[0.0, 1.0, 0.5])
    assert [table.value(t) for t in (-1.0, 0.0, 1.0, 2.0, 5.0)] == [0.0, 0.0, 1.0, 0.5, 0.5]
    assert table.value(0.25) == pytest.approx(0.25)
    assert table.value(1.5) == pytest.approx(0.75)


def test_a_table_of_one_point_is_that_value():
    assert schedule(type="table", times=[2.0], values=[0.4]).value(7.0) == 0.4


def test_a_sine_starts_at_its_phase_and_comes_back_each_period():
    sine = schedule(type="sine", mean=0.5, amplitude=0.4, period=0.2, phase="30 deg", start=1.0)
    assert [sine.value(t) for t in (0.0, 1.0)] == pytest.approx([0.7, 0.7], abs=1e-12)
    assert sine.value(1.0 + 0.2 / 6) == pytest.approx(0.9)
    # The time itself is only known to 1e-16 of 1e6 s, that is 1e-9 of a period and 1e-8 rad.
    assert sine.value(1e6 + 1.0) == pytest.approx(0.7, abs=1e-7)


def test_a_square_wave_is_high_for_its_duty_and_low_before_its_start():
    square = schedule(type="square", low=0.1, high=0.9, period=2.0, duty=0.25, start=1.0)
    assert [square.value(t) for t in (0.0, 0.999, 1.0, 1.499, 1.5, 2.9, 3.0)] == [0.1, 0.1, 0.9, 0.9, 0.1, 0.1, 0.9]


@pytest.mark.parametrize(
    "content", [{"type": "square", "duty": 0.3}, {"type": "pulse_train", "width": 0.06, "count": 500}]
)
def test_every_period_has_the_same_steps_high_however_the_times_are_rounded(content):
    wave = schedule(low=0.0, high=1.0, period=0.2, **content)
    states = [[wave.value((200 * cycle + step) * 1e-3) for step in range(200)] for cycle in range(500)]
    assert all(state == [1.0] * 60 + [0.0] * 140 for state in states)


def test_a_square_wave_with_a_rise_time_is_a_trapezoid_that_stays_between_its_values():
    wave = schedule(type="square", low=0.2, high=1.0, period=1.0, duty=0.5, rise_time=0.1)
    # Waves are 1e-9 of a period early.
    assert [wave.value(t) for t in (0.05, 0.1, 0.4, 0.55, 0.7)] == pytest.approx([0.6, 1.0, 1.0, 0.6, 0.2], abs=1e-7)
    assert wave.value(3.0) == pytest.approx(0.2, abs=1e-7)
    assert all(0.2 <= wave.value(1e-3 * step) <= 1.0 for step in range(5000))


def test_a_pulse_train_ends_after_its_pulses():
    train = schedule(type="pulse_train", low=0.0, high=1.0, period=1.0, width=0.2, count=3, start=0.5)
    rises = [t for t in range(100) if train.value(0.1 * t) > train.value(0.1 * (t - 1))]
    assert rises == [5, 15, 25]
    assert train.value(2.65) == 1.0 and train.value(3.55) == 0.0


RAMP_UP = {"type": "ramp", "start": 0, "end": 1, "from": 0, "to": 1}
PARTS = [{"duration": 1, "schedule": RAMP_UP}, {"duration": 0.5, "schedule": {"type": "hold", "value": 0.3}}]


def test_the_time_of_a_part_of_a_sequence_begins_with_the_part():
    sequence = schedule(type="sequence", parts=[*PARTS, {"duration": 0.5, "schedule": RAMP_UP}])
    assert [sequence.value(t) for t in (0.0, 0.5, 1.0, 1.49)] == pytest.approx([0.0, 0.5, 0.3, 0.3], abs=1e-7)
    assert [sequence.value(t) for t in (1.75, 2.0, 9.0)] == pytest.approx([0.25, 0.5, 0.5], abs=1e-7)


def test_a_repeated_sequence_is_periodic():
    sequence = schedule(type="sequence", parts=PARTS, repeat=True)
    assert [sequence.value(1.5 * cycle + 0.5) for cycle in range(5)] == pytest.approx([0.5] * 5, abs=1e-7)
    assert [sequence.value(1.5 * cycle) for cycle in range(5)] == pytest.approx([0.0] * 5, abs=1e-7)


MEASURED = "time,humidity,note\n0,0.2,dry\n0.5,0.4,\n2.5,0.8,wet\n"
CSV = {"type": "csv", "file": "drive.csv", "value_column": "humidity"}


def driven_by(content):
    return {**everything(), "stimuli": {"humidity": {"schedule": content}}}


def test_a_csv_beside_the_scene_file_is_read_and_needed_no_more(tmp_path):
    (tmp_path / "drive.csv").write_text(MEASURED)
    (tmp_path / "robot.yaml").write_text(
        yaml.safe_dump(driven_by({"type": "sequence", "parts": [{"duration": 3, "schedule": CSV}]}))
    )
    config = load_scene(tmp_path / "robot.yaml")
    assert config.stimuli["humidity"].schedule.value(1.5) == pytest.approx(0.6)
    (tmp_path / "drive.csv").unlink()
    assert parse_scene(scene_text(config), "text") == config


def test_a_csv_of_a_scene_that_is_no_file_is_relative_to_the_working_directory(tmp_path, monkeypatch):
    (tmp_path / "drive.csv").write_text(MEASURED)
    monkeypatch.chdir(tmp_path)
    config = load_scene(driven_by(CSV), ["duration=2"])
    assert config.stimuli["humidity"].schedule.times == [0.0, 0.5, 2.5]


@pytest.mark.parametrize(
    ("text", "changes", "fault"),
    [
        (None, {}, '.file: found "drive.csv"; must be a readable csv file; it cannot be read'),
        (b"\xff\xfe\x00", {}, '.file: found "drive.csv"; must be a readable csv file; it is not UTF-8 text'),
        (
            MEASURED,
            {"value_column": "humidty"},
            '.value_column: found "humidty"; must be one of the columns of drive.csv',
        ),
        (MEASURED, {"time_column": "t"}, '.time_column: found "t"; must be one of the columns of drive.csv (time, hu'),
        ("time,humidity\n", {}, '.file: found "drive.csv"; must hold one line or more below'),
        ("", {}, '.time_column: found "time"; must be one of the columns of drive.csv (there are none)'),
        (
            MEASURED.replace("0.4", "wet"),
            {},
            '.file: found "drive.csv"; must have a number in each line of humidity, line 3',
        ),
        (MEASURED.replace("2.5,0.8,wet", "2.5"), {}, 'each line of humidity, line 4 has ""'),
        (MEASURED.replace("0.4", "nan"), {}, 'each line of humidity, line 3 has "nan"'),
        (
            MEASURED.replace("2.5", "0.5"),
            {},
            '.file: found "drive.csv"; must have increasing times, line 4 has 0.5 s after',
        ),
        (
            MEASURED.replace("0,0.2", "-1,0.2"),
            {},
            '.file: found "drive.csv"; must not begin before 0 s, line 2 has -1 s',
        ),
        (MEASURED.replace("0.8", "80"), {}, ".values[2]: found 80.0; must lie in the range of the channel, 0 to 1 [1]"),
        (MEASURED, {"file": 3}, ".file: found 3; must be text"),
    ],
)
def test_a_csv_that_is_no_table_is_refused_with_its_line(tmp_path, text, changes, fault):
    if text is not None:
        (tmp_path / "drive.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(driven_by({**CSV, **changes})))
    with pytest.raises(SceneError) as refused:
        load_scene(tmp_path / "robot.yaml")
    place = "stimuli.humidity.schedule" if fault.startswith(".") else ""
    assert f"{place}{fault}" in str(refused.value)
