"""Whether runs are the same bit for bit: their states, and what is told of them."""

import dataclasses

import numpy as np

COUNTED = {"cpu_time", "iterations", "rejected", "substeps"}
"""What a frame counts since the run began, or a state was loaded."""


def figures(simulator):
    """All that is told of the present state, by name."""
    frame = simulator.frame()
    told = {part.name: getattr(frame, part.name) for part in dataclasses.fields(frame) if part.name not in COUNTED}
    told |= {f"energy {name}": value for name, value in told.pop("energy").items()}
    told["curvatures"] = simulator.curvatures
    for name, clamp in simulator.clamps.items():
        told |= {f"{name} position": clamp.position, f"{name} wrench": clamp.wrench}
    for name, joint in simulator.joints.items():
        told |= {f"{name} wrench": joint.wrench, f"{name} gives way": [joint.distance, joint.angle]}
    for views in (simulator.joints, simulator.bodies):
        for name, view in views.items():
            told |= {f"{name} {of}": _numbers(getattr(view, of)) for of in ("turning", "sliding")}
    return told


def _numbers(motion):
    return [] if motion is None else [float(value) for value in dataclasses.astuple(motion) if value is not None]


def differences(simulator, state, told=None):
    """Parts of the state, and figures, in which a simulator is not what it should be."""
    found, own, begin = [], simulator.save_state(), 0
    for name, shape in simulator._state.layout():
        end = begin + int(np.prod(shape))
        if not np.array_equal(own[begin:end], state[begin:end], equal_nan=True):
            found.append(name)
        begin = end
    if told is not None:
        now = figures(simulator)
        assert now.keys() == told.keys()
        found += [name for name, value in told.items() if not _are_same(now[name], value)]
    return found


def _are_same(one, other):
    """Names as such, numbers bit for bit."""
    return one == other if isinstance(other, tuple) else np.array_equal(one, other, equal_nan=True)


def follow(simulator, until, act=lambda simulator, number: None):
    """Step to a time [s]; states before and after each step, and what is told after it. `act` acts before each."""
    before, after, told = [], [], []
    while simulator.time < until:
        act(simulator, len(before))
        before.append(simulator.save_state())
        simulator.step(until)
        after.append(simulator.save_state())
        told.append(figures(simulator))
    return before, after, told


def assert_goes_on(make, until, act=lambda simulator, number: None, every=3, fresh_every=9, steps=4):
    """Assert that a run goes on bit for bit from where it was saved, in a simulator that has run and in fresh ones, and
    that nobody's looking changes it.
    """
    used = make()
    before, after, told = follow(used, until, act)
    unseen = make()
    for number in range(len(before)):
        act(unseen, number)
        unseen.step(until)
    assert differences(unseen, after[-1], told[-1]) == []
    for begin in range(0, len(before), every):
        for simulator in [used, make()] if begin % fresh_every == 0 else [used]:
            simulator.load_state(before[begin])
            for number in range(begin, min(begin + steps, len(before))):
                if number > begin:
                    act(simulator, number)
                simulator.step(until)
                assert differences(simulator, after[number], told[number]) == [], (begin, number)
    used.reset()
    fresh = make()
    assert differences(used, fresh.save_state(), figures(fresh)) == []
    return used
