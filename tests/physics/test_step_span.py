"""Frames within steps: interpolated, of the order of the method, with gaps, and without an end of a step."""

import copy
import math

import numpy as np
import pytest
from support.moving_scenes import falling
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.simulation.capture import Capture, make_frame
from bilayer_core.simulation.step_span import StepSpan

LIKE_ENDS = ("positions", "velocities", "directors", "body_positions", "body_velocities", "body_angular_velocities")
MIXED = ("strain", "curvature", "contact_forces", "contact_wrenches", "clamp_wrenches", "section_curvature")


def span_of_a_step(simulator):
    """The last step of a simulator that makes one more, and the frames at both ends."""
    stepper, state = simulator._stepper, simulator._state
    begin, first = Capture(stepper, state), copy.copy(simulator.frame())
    simulator.step()
    return StepSpan(begin, Capture(stepper, state), stepper.surroundings), first, simulator.frame()


def frame_of(simulator, source):
    return make_frame(source, simulator.statistics, simulator.cpu_time)


@pytest.mark.parametrize("rates", [(10.0,), (100.0,), (1000.0, 33.0)])
@pytest.mark.parametrize("steps", [{}, {"dt": 1.3e-3}], ids=["adaptive", "fixed"])
def test_the_state_does_not_depend_on_rates_observers_or_logs(tmp_path, rates, steps):
    alone = Simulator(load_scene(everything()), **steps)
    alone.run(0.1)
    scene = load_scene(everything() | {"output": {"rate": rates[0], "marker_rate": 5.0}})
    watched = Simulator(scene, **steps)
    assert watched.steps == alone.steps
    recorders = [MemoryRecorder(rate=rate) for rate in rates]
    watched.run(0.1, observers=[McapRecorder(tmp_path / "run.mcap", rates[0], 5.0), *recorders])
    assert watched.save_state().tobytes() == alone.save_state().tobytes()
    for recorder in recorders:
        times = np.arange(1 + math.floor(watched.time * recorder.rate + 1e-9)) / recorder.rate
        np.testing.assert_allclose([frame.time for frame in recorder.frames][: len(times)], times, atol=1e-9)


@pytest.mark.parametrize("name", ["gripping", "crawling_inchworm"])
def test_at_the_ends_of_a_step_frames_are_those_of_the_states(name):
    simulator = Simulator(load_scene(name))
    simulator.run(0.3)
    span, first, last = span_of_a_step(simulator)
    h = last.time - first.time
    for time, end in ((first.time + 1e-9 * h, first), (last.time - 1e-9 * h, last)):
        near = frame_of(simulator, span.at(time))
        for attribute in (*LIKE_ENDS, *MIXED, "body_quaternions"):
            value = getattr(end, attribute)
            least = 1e-6 * max(1e-6, np.abs(value).max(initial=0))
            np.testing.assert_allclose(getattr(near, attribute), value, atol=least)
        assert near.energy == pytest.approx(end.energy, rel=1e-6, abs=1e-15)
    assert span.at(last.time).state.position is not None and frame_of(simulator, span.at(last.time)).time == last.time


def test_forces_strains_and_energies_are_mixed_and_frames_stay_orthonormal():
    simulator = Simulator(load_scene("gripping"))
    simulator.run(0.3)
    span, first, last = span_of_a_step(simulator)
    middle = frame_of(simulator, span.at(0.5 * (first.time + last.time)))
    for attribute in MIXED:
        mean = 0.5 * (getattr(first, attribute) + getattr(last, attribute))
        np.testing.assert_allclose(getattr(middle, attribute), mean, rtol=1e-12, atol=1e-15)
    assert middle.energy == pytest.approx({key: 0.5 * (of + last.energy[key]) for key, of in first.energy.items()})
    assert middle.min_gap == pytest.approx(0.5 * (first.min_gap + last.min_gap))
    assert middle.state[0] == first.time < middle.time and middle.step == first.step
    np.testing.assert_allclose(np.linalg.norm(middle.directors, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(middle.body_quaternions, axis=1), 1.0, rtol=1e-14)
    for strand in simulator.description.strands:
        edges = np.diff(middle.positions[strand.nodes], axis=0)
        along = np.einsum("ki,ki->k", edges, middle.directors[strand.edges])
        assert np.abs(along).max() < 1e-14 * np.linalg.norm(edges, axis=1).max()


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "tr_bdf2"])
def test_frames_are_as_near_to_the_motion_as_the_ends_of_steps(integrator):
    """Of a beam that swings in space while it twists: error of frames in the middle of steps, and at their ends."""
    exact = Simulator(load_scene("cantilever", ["solver.dimension=3", "gravity.1=-4"]), dt=5e-5, integrator="sdirk2")
    reference = MemoryRecorder(rate=2000.0)
    exact.run(0.1, observers=[reference])
    errors = []
    for h in (4e-3, 2e-3):
        coarse, frames = Simulator(exact.scene, dt=h, integrator=integrator), MemoryRecorder(rate=2.0 / h)
        coarse.run(0.1, observers=[frames])
        every = round(2000.0 / frames.rate)
        off = [
            np.abs(frame.positions - reference.frames[k * every].positions).max()
            for k, frame in enumerate(frames.frames)
        ]
        errors.append((max(off[1::2]), max(off[2::2])))
    for between, at_ends in errors:
        assert between < 1.2 * at_ends
    assert errors[1][0] < (0.6 if integrator == "implicit_euler" else 0.35) * errors[0][0]


@pytest.mark.parametrize("steps", [{"tolerance": 1e-2}, {"dt": 2e-3}], ids=["adaptive", "fixed"])
@pytest.mark.parametrize("distance", [1e-4, 2e-5])
def test_every_frame_of_an_impact_has_a_gap(distance, steps):
    """A ball that falls on the ground, in steps in which the cubic through the ends would pass the surface."""
    content = falling()
    content["contact"]["barrier_distance"] = distance
    simulator, seen = Simulator(load_scene(content), **steps), MemoryRecorder(rate=20000.0)
    simulator.run(0.3, observers=[seen])
    ball = next(k for k, body in enumerate(simulator.description.bodies) if body.name == "ball")
    radius = simulator.scene.bodies[ball].surface.radius
    heights = np.array([frame.body_positions[ball, 2] for frame in seen.frames]) - radius
    assert min(frame.min_gap for frame in seen.frames) > 0.0
    assert heights.min() > 0.0
