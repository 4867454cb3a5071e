"""What /diagnostics say of steps and energy, provoked: rejected steps, and energy that an integrator takes."""

import pytest

from bilayer_core import Simulator, load_scene
from bilayer_sim_ros.control.pacing import Pacer
from bilayer_sim_ros.node import run_status as of_status
from bilayer_sim_ros.node.run_status import StatusReporter
from bilayer_sim_ros.publishing.conversions import to_diagnostics
from bilayer_sim_ros.publishing.run_files import Recording


class Reports:
    """Runs a simulator as the node's worker does, and keeps what would be published, one message each few steps."""

    def __init__(self, simulator, monkeypatch):
        monkeypatch.setattr(of_status, "STATUS_PERIOD", 0.0)
        self.simulator, self.found, self.nothing = simulator, [], Recording("", "", 50.0, 20.0, 0.0)
        self.reporter = StatusReporter(lambda status: self.found.append(self._values(status)), Pacer(0.0))

    def _values(self, status):
        return {value.key: value.value for value in to_diagnostics(status, "/sim", {}).status[0].values}

    def run(self, duration, steps_at_once=5):
        end = self.simulator.time + duration
        self.reporter.start(self.simulator.time)
        while self.simulator.time < end:
            for _ in range(steps_at_once):
                self.reporter.add(self.simulator.step())
            self.reporter.report_when_due(self.simulator, False, False, self.nothing)
        return self.found


def test_rejected_steps_are_told_since_the_last_message_and_since_the_start(monkeypatch):
    simulator = Simulator(load_scene("bending"))
    simulator.compile()
    reports = Reports(simulator, monkeypatch)
    simulator.set_stimulus("swelling", 1.0)  # a blow
    found = reports.run(0.1)
    each = [int(values["rejected steps"]) for values in found]
    assert sum(each) == simulator.statistics.rejected > 0
    assert [int(values["rejected steps since the start"]) for values in found] == [
        sum(each[: k + 1]) for k in range(len(each))
    ]
    simulator.reset()
    assert int(reports.run(1e-3, 1)[-1]["rejected steps since the start"]) <= max(each)


def test_energy_that_the_integrator_takes_is_told_in_joules_and_of_what_went_through(monkeypatch):
    simulator = Simulator(load_scene("cantilever"), integrator="implicit_euler", dt=5e-3)
    simulator.compile()
    found = Reports(simulator, monkeypatch).run(0.5)
    summary = simulator.summary()
    assert float(found[-1]["numerical energy [J]"]) == pytest.approx(summary["numerical_energy"], rel=1e-2)
    assert float(found[-1]["numerical energy [J]"]) < 0.0
    assert (
        -1.5 < float(found[-1]["numerical energy, of what went through"]) < -0.05
    )  # Euler's method damps fast vibrations
