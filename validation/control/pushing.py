"""Planar pushing: a plan by exact gradients, and by gradients of smoothed contact, annealed.

    python -m validation.control.pushing [--json] [--iterations N]

The problem is box_pushing of irs_mpc (hjsuh94/irs_mpc): a hand, a ball of radius 0.1 m on position drives of 500 N/m, pushes a box of
1 m in a plane without gravity, from below its lower face by its middle; 60 quasi-dynamic steps of 0.1 s; the goal is the box's pose plus
(0.5 m, 0.5 m, -pi/4); the cost is the sum of 3 dx^2 + 3 dy^2 + 1.2 dtheta^2 at every step's end and 10 du^2 of the steps of the hand's
command, |du| <= 0.04 m. The first guess moves the command straight up, from y = -0.2 m to 0.2 m; in a second one, which is ours, the
hand rests away from the box, and no exact gradient leads to it.

What differs: the engine (there a convex contact model linearized once per step, here Coulomb's law solved to convergence); masses and
friction are not in what is published of the problem, here 1 kg, 1/6 kg m^2 and 0.5; smoothing there is an average over sampled inputs,
here a rest gap of the contact that is differentiated, lowered in decades while states stay those of hard contact; the step here is
Gauss-Newton's with a search along it, there an LQR pass. Published costs [irs_mpc, examples/box_pushing/analysis]: exact
gradients 112.036 -> 112.011, first-order smoothed 112.036 -> 49.17. The two columns are of different engines.

A row is {guess, gradients, rest_gap_m, status, cost, cost_by_iteration, rest_gap_by_iteration, pose, seconds, published}.
"""

import argparse
import json
import time

import numpy as np
import pliant

STEPS, STRIDE = 60, 0.04  # m, largest step of the command
GOAL = np.array([0.5, 1.0, -np.pi / 4])
Q, R = np.array([3.0, 3.0, 1.2]), 10.0
REST_GAP = 1e-4  # m, of the scene
FIRST_GAPS = (0.1, 0.3)  # m
PUBLISHED = {"exact": (112.036, 112.011), "annealed": (112.036, 49.17)}


def moving(name, axis, kind, start=0.0, parent=None, mass=1e-6, inertia=1e-9, shape="") -> str:
    """A body on one joint."""
    on = f'parent = "{parent}"\n' if parent else ""
    return f"""
[[body]]
name = "{name}"
{on}mass = {mass}
inertia = [{inertia}, {inertia}, {inertia}, 0, 0, 0]
[[body.joint]]
name = "{name}_joint"
kind = "{kind}"
axis = {axis}
start = [{start}]
{shape}"""


def drive(name) -> str:
    return f"""
[[actuator]]
name = "{name}_drive"
joint = "{name}_joint"
kind = "position"
stiffness = 500.0
delta_scale = {STRIDE}
"""


SCENE = (
    f"""schema_version = 1
[time]
step = 0.1
duration = {0.1 * STEPS}
integrator = "quasi_static"
[gravity]
magnitude = 0.0
[contact]
rest_gap = {REST_GAP}
"""
    + moving("hand_x", [1, 0, 0], "prismatic", mass=0.01, inertia=1e-5)
    + moving("hand_y", [0, 1, 0], "prismatic", -0.2, "hand_x", 0.01, 1e-5, '[[body.shape]]\nkind = "sphere"\nradius = 0.1\nfriction = 0.5\n')
    + moving("box_x", [1, 0, 0], "prismatic")
    + moving("box_y", [0, 1, 0], "prismatic", 0.5, "box_x")
    + moving("box", [0, 0, 1], "revolute", 0.0, "box_y", 1.0, 1 / 6, '[[body.shape]]\nkind = "box"\nhalf_extents = [0.5, 0.5, 0.5]\nfriction = 0.5\n')
    + drive("hand_x")
    + drive("hand_y")
)
BOX = slice(2, 5)  # of q: x, y, angle


def evaluate(k, n, x, u):
    """The cost's residuals; an input of 1 is a step of `STRIDE`."""
    rows = 3 * (k > 0) + 2 * (u is not None)
    r, by_x, by_u = np.zeros(rows), np.zeros((rows, len(x))), np.zeros((rows, 2))
    if k > 0:
        r[:3], by_x[:3, BOX] = np.sqrt(2 * Q) * (x[BOX] - GOAL), np.diag(np.sqrt(2 * Q))
    if u is not None:
        r[rows - 2 :], by_u[rows - 2 :] = np.sqrt(2 * R) * STRIDE * u, np.sqrt(2 * R) * STRIDE * np.eye(2)
    return {"residuals": r, "residuals_by_x": by_x, "residuals_by_u": by_u}


def guess(name: str) -> np.ndarray:
    """The command straight up, or at rest: then the hand stays 0.1 m from the box."""
    u = np.zeros((STEPS, 2))
    u[:, 1] = 0.4 / STEPS / STRIDE if name == "up" else 0.0
    return u


def row(first: str, rest_gap: float | None, iterations: int) -> dict:
    """A plan from a first guess; its cost before every step, and at the end."""
    model = pliant.loads(SCENE)
    begin = time.perf_counter()
    bounds = {"lower": -np.ones(2), "upper": np.ones(2)}
    plan = pliant.plan(model, evaluate, model.initial_state(), guess(first), iterations=iterations, tolerance=1e-6, rest_gap=rest_gap, **bounds)
    kind = "exact" if rest_gap is None else "annealed"
    # the cost that is reported is that of hard contact, simulated again
    x = model.rollout(model.initial_state(), plan.u, record=False).x
    again = float(np.sum(Q * (x[1:, BOX] - GOAL) ** 2) + R * np.sum((STRIDE * plan.u) ** 2))
    return {
        "guess": first,
        "gradients": kind,
        "rest_gap_m": rest_gap,
        "status": plan.status,
        "cost": again,
        "cost_by_iteration": [step["cost"] for step in plan.steps] + [again],
        "rest_gap_by_iteration": [step["rest_gap"] for step in plan.steps],
        "pose": x[-1, BOX].tolist(),
        "seconds": time.perf_counter() - begin,
        "published": PUBLISHED[kind] if first == "up" else None,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--iterations", type=int, default=100, help="Gauss-Newton steps at most")
    arguments = parser.parse_args()
    if arguments.iterations < 1:
        parser.error(f"--iterations is {arguments.iterations}, but at least one is needed")
    rows = [row(first, gap, arguments.iterations) for first in ("up", "rest") for gap in (None, *FIRST_GAPS)]
    if arguments.json:
        print(json.dumps(rows, indent=1))
        return
    for r in rows:
        costs = r["cost_by_iteration"]
        shown = ", ".join(f"{cost:.1f}" for cost in costs[:12])
        name = f"{r['guess']:4} {r['gradients']}" + (f" from {r['rest_gap_m']:g} m" if r["rest_gap_m"] else "")
        print(f"{name:25} {costs[0]:.2f} -> {r['cost']:.2f} in {len(costs) - 1} iterations ({r['status']}, {r['seconds']:.1f} s): {shown} ...")
        note = "; published, other engine: {} -> {}".format(*r["published"]) if r["published"] else ""
        print(f"{'':25} box at the end ({', '.join(f'{p:.3f}' for p in r['pose'])}){note}")


if __name__ == "__main__":
    main()
