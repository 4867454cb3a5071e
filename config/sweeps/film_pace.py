"""The crawling film with another thickness and another wave of humidity, and how fast it goes."""

import math

import numpy as np

MEASURED = 8
"""Periods at the end of a run over which speed is taken."""
SLOWEST = 4.0 / math.pi**2
"""Time constant of the slowest mode over h²/D, of a layer with one wet face."""


def change(content, parameters):
    """Set the thickness of the film and the period of the humidity.

    The weight of the film grows as its thickness. So does its bending stiffness, if the modulus falls as 1/thickness²;
    and if the gain grows as the thickness, all films have the same curvature.

    Parameters
    ----------
    content : dict
    parameters : dict
        `thickness` of the swelling layer and `period` of the humidity.
    """
    rod, period, thickness = content["rods"][0], parameters["period"], parameters["thickness"]
    passive, active = rod["layers"]
    factor = thickness / active["thickness"]
    rod["path"]["start"][2] += (factor - 1.0) * passive["thickness"]  # as far above the ground
    for layer in (passive, active):
        layer["thickness"] *= factor
    active["eigenstrain"]["gain"] *= factor
    content["materials"]["film"]["youngs_modulus"] /= factor**2
    content["stimuli"]["humidity"]["schedule"] |= {"period": period, "rise_time": 0.05 * period}
    settling = 4.0 * SLOWEST * thickness**2 / rod["diffusion"]["diffusivity"]["active"]
    content["duration"] = period * (math.ceil(settling / period) + MEASURED)
    return content


def stride(run):
    """Return the mean way of the mass centre along x in one of the last periods [mm]."""
    period, com = run.parameters["period"], run.recording["com"]
    end = run.simulator.scene.duration
    x = np.interp([end - MEASURED * period, end], run.recording.times, com.values[:, 0])
    return 1e3 * float(x[1] - x[0]) / MEASURED


def speed(run):
    """Return the mean speed of the mass centre along x over the last periods [mm/s]."""
    return stride(run) / run.parameters["period"]
