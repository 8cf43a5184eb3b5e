"""The error of the linearization, which tubes leave out: rows of limits against exact simulation.

    python -m validation.control.linearization [--json] [--radius M …]

Along closed loops with tubes, about plans of the controller: the disturbances that the linearization says are the worst for the row nearest
to its limit at the plan's end (|w_j| = 1 in every step, without feedback), and random ones on the ball's surface, are simulated exactly. A row
is {task, update, radius_m, tightening_m, exact_m, error_m, beyond_m}: what the linearization says that the worst moves the row by, which is
its tightening without feedback; what it does; the largest amount by which any row at any step of the plan is further out than predicted; and
how far any is beyond its limit (negative: none is).
"""

import argparse
import json

import numpy as np

from validation.control import tasks
from validation.control.loops import DISTURBANCE, disturbed

UPDATES = {"RopeOver": (20, 40, 60), "DragRope": (50, 100, 150, 200)}
SEED, RANDOM = 60_000, 4


def limits(instance, model, x) -> tuple[np.ndarray, np.ndarray]:
    """How far each node is beyond the bar or the post (negative: outside of it) [m], and the derivatives by a change of state."""
    p, (span,) = tasks.nodes(model, x), model.ropes.values()
    if instance.name == "RopeOver":
        axes, centre, radius = (0, 2), np.array([0.0, instance.bar]), tasks.BAR
    else:
        axes, centre, radius = (0, 1), tasks.POST["centre"], tasks.POST["radius"]
    away = p[:, axes] - centre
    distance = np.linalg.norm(away, axis=1)
    rows = np.zeros((len(p), model.ndx))
    for k, axis in enumerate(axes):
        rows[np.arange(len(p)), 3 * np.arange(span.start, span.stop) + axis] = -away[:, k] / distance
    return radius - distance, rows


def compare(instance, model, x, u, radius: float, rng) -> dict:
    """Of the plan u (N, nu) from x, with disturbances of that radius."""
    roll, n = model.rollout(x, u), len(u)
    a = [roll.linearize(k)[0] for k in range(n)]
    free = np.flatnonzero(np.repeat(model.masses() > 0, 3))
    values, rows = zip(*(limits(instance, model, x) for x in roll.x), strict=True)
    back = [rows[n]]
    for k in reversed(range(n)):
        back.insert(0, back[0] @ a[k])
    tightening = radius * sum(np.linalg.norm(g[:, free], axis=1) for g in back[1:])
    worst = int(np.argmax(values[n] + tightening))
    toward = [g[worst, free] / np.linalg.norm(g[worst, free]) for g in back[1:]]
    random = rng.normal(size=(RANDOM, n, len(free)))
    draws = [toward, *(random / np.linalg.norm(random, axis=2, keepdims=True))]
    errors, moves, beyond = [], [], -np.inf
    for w in draws:
        here, linear, error = x, np.zeros(model.ndx), -np.inf
        for k in range(n):
            change = np.zeros(model.ndx)
            change[free] = radius * w[k]
            here = model.displaced(model.step(here, u[k]), change)
            linear = a[k] @ linear + change
            found = limits(instance, model, here)[0]
            beyond = max(beyond, float(found.max()))
            error = max(error, float((found - values[k + 1] - rows[k + 1] @ linear).max()))
        errors.append(error)
        moves.append(float(found[worst] - values[n][worst]))
    return {"radius_m": radius, "tightening_m": float(tightening[worst]), "exact_m": moves[0], "error_m": max(errors), "beyond_m": beyond}


def measure(name: str, radii, updates=None) -> list[dict]:
    """Rows of a task."""
    instance = tasks.make(name, SEED)
    task, updates = instance.load(), updates or UPDATES[name]
    model, x, rng = task.model, task.x0, np.random.default_rng(SEED)
    mpc, rows = task.mpc(np.zeros((task.horizon, task.model.nu)), disturbance=DISTURBANCE), []
    for k in range(max(updates) + 1):
        u = mpc.update(x)
        if k in updates:
            rows += [{"task": name, "update": k} | compare(instance, model, x, mpc.u, radius, rng) for radius in radii]
        x = disturbed(model, model.step(x, u), rng)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--radius", type=float, nargs="+", default=[DISTURBANCE, 1e-3], help="radii of a step's disturbance [m]")
    arguments = parser.parse_args()
    if min(arguments.radius) <= 0:
        parser.error(f"--radius is {min(arguments.radius)} m, but must be positive")
    rows = [row for name in UPDATES for row in measure(name, arguments.radius)]
    if arguments.json:
        print(json.dumps(rows, indent=1))
        return
    for row in rows:
        mm = {key: 1e3 * row[key] for key in ("radius_m", "tightening_m", "exact_m", "error_m", "beyond_m")}
        print(
            f"{row['task']:9} update {row['update']:3}, radius {mm['radius_m']:.2f} mm: the worst moves the row by {mm['tightening_m']:.3f} mm "
            f"linearized, {mm['exact_m']:.3f} mm exactly; rows out of their prediction by at most {mm['error_m']:.4f} mm, and of their limit by {mm['beyond_m']:.3f} mm"
        )


if __name__ == "__main__":
    main()
