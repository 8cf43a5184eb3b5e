"""A cable that is moved without end: 100 000 steps in a row.

    python -m validation.soak [--periods N] [--json] [--write]

A cable of 41 nodes lies on a floor with friction beside a post. A hand holds one end and moves it round a closed curve of 2 s that drags
the cable against the post and lifts its end, in steps of 2 ms. A long run must neither gain nor lose anything: the same motion in the last
periods as in the second, no memory, no time; and a derivative over its last period that is finite.
"""

import argparse
import json
import math
import resource
import sys
import time
from pathlib import Path

import numpy as np

import pliant
from validation import evidence

STEP, PERIOD = 0.002, 2.0  # s
LENGTH, NODES, RADIUS = 0.6, 41, 0.005  # m
STEPS = round(PERIOD / STEP)  # of a period

SCENE = f"""
schema_version = 1
[time]
step = {STEP}
duration = {PERIOD}
integrator = "euler"
[[plane]]
name = "floor"
friction = 0.3
[[capsule]]
name = "post"
a = [0.0, 0.0, -0.1]
b = [0.0, 0.0, 0.2]
radius = 0.03
friction = 0.3
[[rope]]
name = "cable"
nodes = {NODES}
length = {LENGTH}
linear_density = 0.05
stretch_stiffness = 300.0
stretch_damping = 0.1
bend_stiffness = 5e-5
bend_damping = 5e-6
radius = {RADIUS}
initial = {{ shape = "straight", from = [0.1, -0.08, {RADIUS}], direction = [-1.0, 0.0, 0.0] }}
[[gripper]]
name = "hand"
rope = "cable"
nodes = [0]
mode = "velocity"
"""


def controls() -> np.ndarray:
    """Velocities of the hand over a period (STEPS, 3) \\[m/s\\]; the displacements add up to nothing."""
    t = np.linspace(0.0, 2.0 * math.pi, STEPS + 1)
    place = np.stack([0.15 * np.sin(t), 0.12 * (1.0 - np.cos(t)), 0.03 * (1.0 - np.cos(2.0 * t))], axis=1)
    return np.diff(place, axis=0) / STEP


def resident_mb() -> float:
    """Memory of this process now (Linux); the largest that it ever had would hide what grows below it."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


def run(periods: int, report=None) -> dict:
    """Figures of `periods` periods in a row."""
    model, u = pliant.loads(SCENE), controls()
    stepper, x = model.stepper(), np.empty((STEPS + 1, model.nx))
    before, out = None, []
    for k in range(periods):
        begun, x[0] = time.perf_counter(), stepper.x[0]
        for j in range(STEPS):
            x[j + 1] = stepper.step(u[None, j])[0]
        nodes = x[:, : 3 * NODES].reshape(STEPS + 1, NODES, 3)
        edges = np.linalg.norm(np.diff(nodes, axis=1), axis=2)
        row = {
            "seconds": time.perf_counter() - begun,
            "memory_mb": resident_mb(),
            "largest_strain": float(np.abs(edges * (NODES - 1) / LENGTH - 1.0).max()),
            "depth_m": float(RADIUS - nodes[:, 1:, 2].min()),
            "fastest_m_s": float(np.abs(x[:, 3 * NODES : 6 * NODES]).max()),
            # of all nodes at all times, from the period before
            "change_m": None if before is None else float(np.linalg.norm(nodes - before, axis=2).max()),
        }
        before = nodes.copy()
        out.append(row)
        if report:
            report(k, row)
    roll = model.rollout(x[0], u)
    x_bar = np.zeros((STEPS + 1, model.ndx))
    x_bar[-1, 3 * (NODES - 1)] = 1.0
    gradient = np.concatenate([part.ravel() for part in roll.vjp(x_bar)])
    same = float(np.abs(roll.x - x).max())
    return {"steps": periods * STEPS, "periods": out, "replay_difference": same, "largest_gradient": float(np.abs(gradient).max())}


def main() -> int:
    """Runs and prints."""
    parser = argparse.ArgumentParser(prog="python -m validation.soak", description=__doc__.splitlines()[0])
    parser.add_argument("--periods", type=int, default=100, help="of 1000 steps each")
    parser.add_argument("--json", action="store_true", help="print figures as JSON")
    parser.add_argument("--write", action="store_true", help="write the record in validation/evidence/")
    options = parser.parse_args()
    record = evidence.Run()

    def show(k: int, row: dict) -> None:
        told = ", ".join(f"{name} {value:.3g}" for name, value in row.items() if value is not None)
        print(f"period {k}: {told}", flush=True)

    figures = run(options.periods, None if options.json else show)
    if options.json:
        print(json.dumps(figures, indent=1))
    else:
        print({name: value for name, value in figures.items() if name != "periods"})
    if options.write:
        print(record.write("soak", None, figures), file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
