"""Feedback dynamics against MuJoCo on the lap of tests/oracles.py: time and error of both, in one run.

    python benchmarks/physics_mujoco.py [--period 400]

The cube, the tether (a tendon that only pulls) and the way of the hinge are the same; MuJoCo has Coulomb friction at
points: the four corners of a box, or a grid of 4 × 4 small spheres. Error is that of the cube's centre against a
solution by this package at a tight tolerance, which tests/physics/test_dynamics.py holds to the oracle. Times are CPU
times, the least of several runs; MuJoCo's include setting the hinge from Python, some 5 % of it.
"""

from __future__ import annotations

import argparse
import time

import mujoco
import numpy as np
from physics_lap import LENGTH, MASS, MU, PERIOD, SIDE, START, STIFFNESS, lemniscate, simulate
from physics_timing import least_cpu

from towval.types import Array


def mujoco_model(step: float, spheres: bool) -> mujoco.MjModel:
    half, thin = SIDE / 2, 0.02
    if spheres:
        radius = 0.005
        places = np.linspace(-half + radius, half - radius, 4)
        contacts = "".join(
            f'<geom type="sphere" size="{radius}" pos="{x} {y} {radius - thin}" mass="0" friction="{MU} 0 0"/>'
            for x in places
            for y in places
        )
    else:
        contacts = f'<geom type="box" size="{half} {half} {thin}" mass="0" friction="{MU} 0 0"/>'
    # The anchor is at the height of the floor, as in the plane model, so that the tow does not tilt the cube.
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="{step}" gravity="0 0 -9.81" cone="elliptic" impratio="10"/>
    <worldbody>
      <geom type="plane" size="5 5 1" friction="{MU} 0 0"/>
      <body name="hinge" mocap="true" pos="1 0 0"><site name="hinge"/></body>
      <body name="cube" pos="{START[0]} {START[1]} {thin}" euler="0 0 90"><freejoint/>
        <inertial pos="0 0 {-thin}" mass="{MASS}" diaginertia="0.1 0.1 {0.4 / 3}"/>{contacts}
        <site name="anchor" pos="{half} 0 {-thin}"/></body>
    </worldbody>
    <tendon><spatial stiffness="{STIFFNESS}" springlength="0 {LENGTH}">
      <site site="hinge"/><site site="anchor"/></spatial></tendon>
    </mujoco>""")


def simulate_mujoco(period: float, times: Array, step: float, spheres: bool) -> Array:
    model = mujoco_model(step, spheres)
    data = mujoco.MjData(model)
    hinge, count = lemniscate(period), round(period / step)
    moments = np.arange(count) * step
    way = np.column_stack([np.interp(moments, hinge.time_s, hinge.position[:, k]) for k in (0, 1)])
    places = np.empty((count + 1, 2))
    target = data.mocap_pos[0]
    for i in range(count):
        target[:2] = way[i]
        places[i] = data.qpos[:2]
        mujoco.mj_step(model, data)
    places[count] = data.qpos[:2]
    return places[np.round(times / step).astype(int)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--period", type=float, default=PERIOD, help="duration of the lap [s]")
    period = parser.parse_args().period
    times = np.linspace(0, period, 201)
    exact = simulate(period, times, 1e-11)
    rows = [
        (
            f"towval, {tolerance:.0e} m a step",
            least_cpu(lambda t=tolerance: simulate(period, times, t)),
            simulate(period, times, tolerance),
        )
        for tolerance in (1e-5, 1e-6, 1e-7, 1e-8)
    ]
    for step, spheres in ((0.002, False), (0.01, False), (0.002, True), (0.01, True)):
        name = f"MuJoCo, {'4 × 4 spheres' if spheres else 'box'}, {1000 * step:.0f} ms"
        start = time.process_time()
        places = simulate_mujoco(period, times, step, spheres)
        rows.append((name, time.process_time() - start, places))
    reference = next(cpu for name, cpu, _ in rows if name == "MuJoCo, box, 2 ms")
    print(f"{'':32s} {'CPU [ms]':>10s} {'faster':>8s} {'RMS [mm]':>10s} {'max [mm]':>10s} {'end [mm]':>10s}")
    for name, cpu, places in rows:
        error = 1000 * np.linalg.norm(places - exact, axis=1)
        rms = np.sqrt(np.mean(error**2))
        print(f"{name:32s} {1000 * cpu:10.1f} {reference / cpu:8.1f} {rms:10.4f} {error.max():10.4f} {error[-1]:10.4f}")


if __name__ == "__main__":
    main()
