"""The swimmer with another beat, how fast it climbs, and how close its arms come to each other."""

import numpy as np

BEATS, MEASURED = 8, 4
"""Of a run, and at its end those over which the speed is measured."""


def change(content, parameters):
    """Set whole beats of `period` [s], with light during the part `lit` of each."""
    period = parameters["period"]
    content["stimuli"]["light"]["schedule"] |= {"period": period, "width": parameters["lit"] * period}
    content["duration"] = BEATS * period
    return content


def speed(run):
    """Return the mean speed of the mass centre upwards over the last beats [mm/s]."""
    period, com = run.parameters["period"], run.recording["com"]
    z = np.interp([(BEATS - MEASURED) * period, BEATS * period], run.recording.times, com.values[:, 2])
    return 1e3 * float(z[1] - z[0]) / (MEASURED * period)


def tip_distance(run):
    """Return the least distance of the end of an arm from the axis during the run [mm]."""
    tip = run.recording["rod/arm_0/position"].values[:, -1]
    return 1e3 * float(np.hypot(tip[:, 0], tip[:, 1]).min())
