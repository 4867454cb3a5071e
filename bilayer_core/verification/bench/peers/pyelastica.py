"""PyElastica: a Cosserat rod, explicit in time (position Verlet)."""

from __future__ import annotations

import time as clock

import elastica
import numpy as np

from bilayer_core.verification.bench.peers.exchange import Answer, Cantilever, Case, serve


class _Simulator(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing):
    """A collection of rods that may be held and pushed."""


def simulate(beam: Cantilever, case: Case) -> Answer:
    """Simulate the cantilever; its rectangular section replaces the circle of the same area."""
    h = case.element_length(beam)
    rod = elastica.CosseratRod.straight_rod(
        case.elements,
        start=np.array([case.start(beam), 0.0, 0.0]),
        direction=np.array([1.0, 0.0, 0.0]),
        normal=np.array([0.0, 0.0, 1.0]),
        base_length=case.elements * h,
        base_radius=float(np.sqrt(beam.area / np.pi)),
        density=beam.density,
        youngs_modulus=beam.youngs_modulus,
        shear_modulus=beam.youngs_modulus / 3.0,
    )
    # Motion is in the plane of path and normal: only the weak axis of the section matters, and both take its value.
    rod.bend_matrix[0, 0, :] = rod.bend_matrix[1, 1, :] = beam.bending_stiffness
    inertia = beam.density * h * beam.width * beam.thickness**3 / 12.0
    for axis in (0, 1):
        rod.mass_second_moment_of_inertia[axis, axis, :] = inertia
        rod.inv_mass_second_moment_of_inertia[axis, axis, :] = 1.0 / inertia
    system = _Simulator()
    system.append(rod)
    fixed = elastica.OneEndFixedBC
    system.constrain(rod).using(fixed, constrained_position_idx=(0,), constrained_director_idx=(0,))
    system.add_forcing_to(rod).using(elastica.GravityForces, acc_gravity=np.array([0.0, 0.0, -beam.gravity]))
    system.finalize()
    stepper = elastica.PositionVerlet()
    dt = np.float64(case.dt)
    time, stride = np.float64(0.0), case.stride(beam)
    times, ways = [], []
    begin = clock.process_time()
    for step in range(1, round(beam.duration / case.dt) + 1):
        time = stepper.step(system, time, dt)
        if step % stride == 0 and time < beam.sampled_until + 0.5 * case.dt:
            times.append(step * case.dt)
            ways.append(rod.position_collection[:, -1].copy())
    cpu_time = clock.process_time() - begin
    x, _, z = np.array(ways).T.tolist()
    return Answer(cpu_time, times, x, z)


if __name__ == "__main__":
    serve(simulate)
