"""The walker with another gait and its hind leg elsewhere, and how fast it goes."""

import math

import numpy as np

CYCLES = 6
"""Of a run; the first one, in which it gets going, is not measured."""


def change(content, parameters):
    """Set a schedule of humidity and the place of the hind leg.

    Parameters
    ----------
    content : dict
        In SI units.
    parameters : dict
        `period` [s] of the humidity; `rise`, the part of it in which humidity rises; `wettest`, its highest value;
        `hip`, how far behind the lowest point of the arc the hind leg is.
    """
    content["stimuli"]["humidity"]["schedule"] = _schedule(**{key: parameters[key] for key in KEYS})
    content["duration"] = CYCLES * parameters["period"]
    _move_hind_leg(content, parameters["hip"])
    return content


KEYS = ("period", "rise", "wettest")


def _schedule(period, rise, wettest):
    """Return half a sine wave up, from dry to wet, and one of another length down: with `rise` = 0.5 a sine."""
    parts = []
    for part, phase in ((rise, -0.5 * math.pi), (1.0 - rise, 0.5 * math.pi)):
        wave = {"mean": 0.5 * wettest, "amplitude": 0.5 * wettest, "period": 2.0 * part * period, "phase": phase}
        parts.append({"duration": part * period, "schedule": {"type": "sine", **wave}})
    return {"type": "sequence", "parts": parts, "repeat": True}


def _move_hind_leg(content, hip):
    """Move the joint of tail and trunk to an angle `hip` [rad] behind the lowest point of their arc, and the hind leg,
    its ankle and its foot with it: the leg keeps its slope and gets as long as it takes to stand.
    """
    rods = {rod["name"]: rod for rod in content["rods"]}
    bodies = {body["name"]: body for body in content["bodies"]}
    tail, trunk, leg, foot = (rods[name] for name in ("tail", "trunk", "hind_leg", "hind_foot"))
    radius, tail_start = tail["path"]["radius"], np.array(tail["path"]["start"])
    end_of_tail = math.atan2(-tail["path"]["direction"][2], tail["path"]["direction"][0])
    centre = tail_start + radius * np.array([math.sin(end_of_tail), 0.0, math.cos(end_of_tail)])
    old = end_of_tail - tail["path"]["angle"]
    shoulder = trunk["path"]["angle"] - old

    # The same ribbon in two parts: its layers stay where they are along it, its stations as far apart.
    for rod, angle in ((tail, end_of_tail - hip), (trunk, shoulder + hip)):
        rod["stations"] = 1 + round((rod["stations"] - 1) * angle / rod["path"]["angle"])
        rod["path"]["angle"] = angle
    active = tail["layers"][1]
    active["interval"][1] = radius * (end_of_tail - hip)
    trunk["path"]["start"] = list(centre + radius * np.array([-math.sin(hip), 0.0, -math.cos(hip)]))
    trunk["path"]["direction"] = [math.cos(hip), 0.0, -math.sin(hip)]
    trunk["normal"] = [math.sin(hip), 0.0, math.cos(hip)]

    # The leg begins as far below the hip, and ends as high above the ground as it did.
    slope = np.array(leg["path"]["direction"]) / np.linalg.norm(leg["path"]["direction"])
    begin, ankle = np.array(leg["path"]["start"]), bodies["hind_ankle"]["position"]
    end = begin + leg["path"]["length"] * slope
    gap = np.linalg.norm(begin - bodies["hip"]["position"])
    bodies["hip"]["position"] = list(trunk["path"]["start"])
    leg["path"]["start"] = list(np.array(bodies["hip"]["position"]) + gap * slope)
    length = (end[2] - leg["path"]["start"][2]) / slope[2]
    leg["stations"] = 1 + round((leg["stations"] - 1) * length / leg["path"]["length"])
    leg["path"]["length"] = length
    forward = leg["path"]["start"][0] + length * slope[0] - end[0]
    bodies["hind_ankle"]["position"] = [ankle[0] + forward, *ankle[1:]]
    foot["path"]["start"][0] += forward


def stride(run):
    """Return the mean way of the mass centre along x in one cycle, the first one left out [mm]."""
    period, com = run.parameters["period"], run.recording["com"]
    x = np.interp([period, CYCLES * period], run.recording.times, com.values[:, 0])
    return 1e3 * float(x[1] - x[0]) / (CYCLES - 1)


def speed(run):
    """Return the mean speed of the mass centre along x, the first cycle left out [mm/s]."""
    return stride(run) / run.parameters["period"]
