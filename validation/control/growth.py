"""How the time of an update splits, and how it grows with the horizon, the nodes and the inputs.

    python -m validation.control.growth [--json] [--repeats N]

A rope of 0.3 m (LiftRope's material) hangs in the air, held at nodes by grippers with velocities as inputs; quasi-static steps of 20 ms;
it is to become a horizontal line 5 cm higher, |v| <= 0.2 m/s, every node below a plane that is 3 cm above the start, which binds. One
thing is changed at a time from a horizon of 20, 21 nodes and two grippers (6 inputs). Times are medians of processor time (other work on
the machine counts little) over the updates of a closed loop on the model, from outside:

rollout       of the horizon with records, times the rollouts of an update (its own and the trials)
derivatives   an update of the same problem without limits, less its rollouts: Jacobians' directions, condensing, a solve
limits        an update with limits, less that without: rows and the quadratic program
shared, exact an update with tubes of either kind, less that without

A row is {horizon, nodes, grippers, nx, inputs, update_s, rollout_s, derivatives_s, limits_s, shared_s, exact_s}. `exponents` fit
log time to log size over the three sizes of each series.
"""

import argparse
import json
import time

import numpy as np
import pliant

from validation.cord_tasks import head, listed, rope_text
from validation.control.tasks import quoted

BASE = {"horizon": 20, "nodes": 21, "grippers": 2}
SERIES = {"horizon": (10, 20, 40), "nodes": (11, 21, 41), "grippers": (1, 2, 4)}
RADIUS = 1e-4  # m, of the disturbance's ball
HEIGHT = 0.1  # m
PARTS = ("update_s", "rollout_s", "derivatives_s", "limits_s", "shared_s", "exact_s")


def problem(horizon: int, nodes: int, grippers: int, limits: bool) -> pliant.Task:
    """The task."""
    points = np.column_stack([np.linspace(0, 0.3, nodes), np.zeros(nodes), np.full(nodes, HEIGHT)])
    scene = head(100) + rope_text(points, 1e5, 100.0)
    held = np.round(np.linspace(0, nodes - 1, grippers)).astype(int)
    for k, node in enumerate(held):
        scene += f'\n[[gripper]]\nname = "hand{k}"\nrope = "rope"\nnodes = [{node}]\nmode = "velocity"\n'
    velocities = quoted(f"hand{k}.velocity.{axis}" for k in range(grippers) for axis in "xyz")
    text = f"""schema_version = 1
steps = {horizon}
horizon = {horizon}
[[cost]]
kind = "nodes"
object = "rope"
goal = {listed(points + [0, 0, 0.05])}
[[cost]]
kind = "inputs"
inputs = {velocities}
weight = 0.1
"""
    if limits:
        text += f"""[[limit]]
kind = "inputs"
inputs = {velocities}
lower = -0.2
upper = 0.2
[[limit]]
kind = "above"
object = "rope"
normal = [0, 0, -1]
offset = {-HEIGHT - 0.03}
"""
    return pliant.loads_task(text, scene=scene)


def updates(task: pliant.Task, repeats: int, **options) -> tuple[float, float]:
    """Median seconds of an update in closed loop, and mean rollouts of one."""
    mpc, x = task.mpc(np.zeros((task.horizon, task.model.nu)), **options), task.x0
    seconds, rollouts = [], []
    for _ in range(repeats):
        begin = time.process_time()
        u = mpc.update(x)
        seconds.append(time.process_time() - begin)
        rollouts.append(1 + sum(step["rollouts"] for step in mpc.steps))
        x = task.model.step(x, u)
    return float(np.median(seconds)), float(np.mean(rollouts))


def row(repeats: int, **size) -> dict:
    """A size's times."""
    free, task = problem(**size, limits=False), problem(**size, limits=True)
    u = np.zeros((task.horizon, task.model.nu))
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        task.model.rollout(task.x0, u)
        times.append(time.process_time() - begin)
    rollout = float(np.median(times))
    without, few = updates(free, repeats)
    with_limits, many = updates(task, repeats)
    tubes = {tube: updates(task, repeats, disturbance=RADIUS, tube=tube)[0] for tube in ("shared", "exact")}
    return {
        **size,
        "nx": task.model.nx,
        "inputs": task.model.nu,
        "update_s": with_limits,
        "rollout_s": many * rollout,
        "derivatives_s": without - few * rollout,
        "limits_s": with_limits - without - (many - few) * rollout,
        "shared_s": tubes["shared"] - with_limits,
        "exact_s": tubes["exact"] - with_limits,
    }


def exponents(rows: list[dict], key: str) -> dict:
    """Slopes of log time against log size."""
    series = [r for r in rows if all(r[other] == BASE[other] for other in BASE if other != key)]
    sizes = np.log([r[key] for r in series])
    return {part: float(np.polyfit(sizes, np.log(np.maximum([r[part] for r in series], 1e-9)), 1)[0]) for part in PARTS if min(r[part] for r in series) > 0}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--repeats", type=int, default=15, help="updates of each kind")
    arguments = parser.parse_args()
    if arguments.repeats < 3:
        parser.error(f"--repeats is {arguments.repeats}, but a median needs three or more")
    sizes = [BASE | {key: value} for key, values in SERIES.items() for value in values]
    rows = [row(arguments.repeats, **size) for size in {tuple(size.items()): size for size in sizes}.values()]
    slopes = {key: exponents(rows, key) for key in SERIES}
    if arguments.json:
        print(json.dumps({"rows": rows, "exponents": slopes}, indent=1))
        return
    for r in rows:
        parts = ", ".join(f"{part[:-2]} {1e3 * r[part]:.1f}" for part in PARTS)
        print(f"horizon {r['horizon']:2} nodes {r['nodes']:2} grippers {r['grippers']} (nx {r['nx']:3}, {r['inputs']:2} inputs): {parts} ms")
    for key, slope in slopes.items():
        print(f"exponents in {key}: " + ", ".join(f"{part[:-2]} {value:.1f}" for part, value in slope.items()))


if __name__ == "__main__":
    main()
