"""MuJoCo 4: a one-dimensional flex with bending, edges kept at their length by constraints, integrator `discrete`."""

from __future__ import annotations

import time as clock

import mujoco
import numpy as np

from bilayer_core.verification.bench.peers.exchange import Answer, Cantilever, Case, serve

XML = """
<mujoco>
  <option integrator="discrete" timestep="{dt!r}" gravity="0 0 {gravity!r}"><flag contact="disable"/></option>
  <worldbody>
    <flexcomp name="rod" type="grid" dim="1" dof="full" count="{count} 1 1" spacing="{h!r} {h!r} {h!r}"
              pos="{middle!r} 0 0" radius="{radius!r}" mass="{mass!r}">
      <elasticity young="{young!r}" poisson="{poisson!r}"
                  section="box" sectionsize="{half_width!r} {half_thickness!r}"/>
      <edge equality="true" solref="{stiff!r} 1" solimp="0.999 0.9999 0.001"/>
      <pin id="0 1"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""
POISSON = 0.499
"""Less than one half, as it asks; of no account for bending."""


def simulate(beam: Cantilever, case: Case) -> Answer:
    """Simulate the cantilever; its first edge is pinned."""
    h = case.element_length(beam)
    xml = XML.format(
        dt=case.dt,
        gravity=-beam.gravity,
        count=case.elements + 1,
        h=h,
        middle=case.start(beam) + 0.5 * case.elements * h,
        radius=0.5 * beam.thickness,
        mass=beam.density * beam.area * h * (case.elements + 1),
        young=beam.youngs_modulus,
        poisson=POISSON,
        half_width=0.5 * beam.width,
        half_thickness=0.5 * beam.thickness,
        stiff=2.0 * case.dt,
    )
    model = mujoco.MjModel.from_xml_string(xml)
    tip = model.flex_vertbodyid[-1]
    model.body_mass[tip] *= 0.5  # the last node carries half an edge
    model.body_inertia[tip] *= 0.5
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    stride = case.stride(beam)
    times, ways = [], []
    begin = clock.process_time()
    for step in range(1, round(beam.duration / case.dt) + 1):
        mujoco.mj_step(model, data)
        if step % stride == 0 and data.time < beam.sampled_until + 0.5 * case.dt:
            times.append(step * case.dt)
            ways.append(_tip(model, data))
    cpu_time = clock.process_time() - begin
    x, _, z = np.array(ways).T.tolist()
    return Answer(cpu_time, times, x, z)


def _tip(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the position of the last node [m] at the end of the step; positions in `data` are those at its start."""
    body = model.flex_vertbodyid[-1]
    address = model.jnt_qposadr[model.body_jntadr[body]]
    return model.body_pos[body] + data.qpos[address : address + 3]


if __name__ == "__main__":
    serve(simulate)
