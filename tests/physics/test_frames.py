"""Frames: what is derived of them is that of their moment, whenever and wherever it is asked for."""

import copy
import pickle
import threading
from dataclasses import fields, replace

import numpy as np
import pytest
from support.acted_scenes import pushed
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.observed.frame import Frame

SCENES = {"gripping": "gripping", "pushed": pushed(), "everything": everything()}


def as_bytes(frame):
    """All attributes of a frame, to the last bit."""
    found = {}
    for part in fields(Frame):
        value = getattr(frame, part.name)
        found[part.name] = repr(value) if isinstance(value, dict) else np.asarray(value).tobytes()
    return found


@pytest.mark.parametrize("name", SCENES)
def test_a_frame_stays_that_of_its_moment_while_the_simulation_goes_on(name):
    simulator = Simulator(load_scene(SCENES[name]))
    simulator.run(0.02)
    early, late = simulator.frame(), simulator.frame()
    at_once = as_bytes(early)
    simulator.run(0.02)
    later, found = as_bytes(simulator.frame()), []
    thread = threading.Thread(target=lambda: found.append(as_bytes(late)))
    thread.start()
    thread.join()
    assert found == [at_once]
    assert later["positions"] != at_once["positions"] and later["energy"] != at_once["energy"]


def test_frames_are_copied_pickled_and_changed_like_any_others():
    simulator = Simulator(load_scene(SCENES["pushed"]))
    frame = simulator.frame()
    whole = as_bytes(frame)
    for other in (copy.copy(frame), copy.deepcopy(frame), pickle.loads(pickle.dumps(frame))):
        assert type(other) is Frame and as_bytes(other) == whole
    assert as_bytes(replace(frame, step=7)) == {**whole, "step": np.asarray(7).tobytes()}
    with pytest.raises(AttributeError, match="nothing"):
        frame.nothing  # noqa: B018
