import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from bilayer_sim_ros.node.run_status import Status
from bilayer_sim_ros.publishing.conversions import to_diagnostics, to_seconds, to_time
from bilayer_sim_ros.publishing.run_files import LogStatus

LEFT_OUT = "and 2 frames were left out of the log: the disk is too slow"


@pytest.mark.parametrize(
    ("seconds", "expected"), [(0.0, (0, 0)), (0.1, (0, 100_000_000)), (17.999999999, (17, 999_999_999)), (2.0, (2, 0))]
)
def test_simulated_time_becomes_a_stamp_to_the_nanosecond(seconds, expected):
    stamp = to_time(seconds)
    assert (stamp.sec, stamp.nanosec) == expected
    assert to_seconds(stamp) == pytest.approx(seconds, abs=1e-9)


@pytest.mark.parametrize(
    ("status", "asked", "level", "message"),
    [
        (Status(1.0, False, real_time_factor=0.99), 1.0, DiagnosticStatus.OK, "running"),
        (Status(1.0, False, real_time_factor=0.5), 1.0, DiagnosticStatus.WARN, "slower than asked for: 0.5 not 1"),
        (Status(1.0, False, real_time_factor=0.01), 0.0, DiagnosticStatus.OK, "running"),
        (Status(1.0, True), 1.0, DiagnosticStatus.OK, "paused"),
        (Status(1.0, False, waited=1.0), 1.0, DiagnosticStatus.OK, "waiting for a stimulus at t = 1 s"),
        (Status(1.0, False, waited=5.0), 1.0, DiagnosticStatus.WARN, "waiting for a stimulus at t = 1 s"),
        (Status(1.0, True, waited=1.0), 1.0, DiagnosticStatus.OK, "waiting for a stimulus at t = 1 s"),
        (Status(1.0, True, log=LogStatus(dropped=9)), 1.0, DiagnosticStatus.OK, "paused"),
        (Status(1.0, True, log=LogStatus(9), dropped=2), 1.0, DiagnosticStatus.WARN, f"paused, {LEFT_OUT}"),
        (Status(1.0, True, log=LogStatus(9, "full")), 1.0, DiagnosticStatus.ERROR, "paused, without its log"),
    ],
)
def test_diagnostics_warn_when_the_simulation_is_too_slow_or_its_log_lacks_something(status, asked, level, message):
    status.asked_factor = asked
    report = to_diagnostics(status, "/bilayer_sim", {}).status[0]
    assert (report.level, report.message) == (level, message)


def test_diagnostics_give_means_over_the_steps_since_the_last_ones():
    status = Status(1.5, False, real_time_factor=1.0, steps=4, substeps=5, iterations=10, residual=2e-7)
    status.rejected, status.rejected_in_all, status.log = 7, 12, LogStatus(waiting=5)
    status.numerical_energy, status.energy_through = -0.02, 0.4
    array = to_diagnostics(status, "/bilayer_sim", {"late": 3})
    values = {value.key: value.value for value in array.status[0].values}
    assert values["Newton iterations per step"] == "2.5"
    assert values["answers ignored that were late"] == "3"
    assert (values["rejected steps"], values["rejected steps since the start"]) == ("7", "12")
    assert (values["numerical energy [J]"], values["numerical energy, of what went through"]) == ("-0.02", "-0.05")
    assert (values["in the queue of the log"], values["frames left out of the log"]) == ("5", "0")
    assert values["largest residual [m/s]"] == "2e-07"
    assert to_seconds(array.header.stamp) == 1.5
