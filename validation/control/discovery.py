"""Contact discovery: grippers begin away from a rope or a sheet, and nobody tells the controller to go there.

    python -m validation.control.discovery [--json] [--object rope|cloth] [--method holding|exact|smoothed|reach] [--steps N] [--seed N]

LiftRope (N = 20) from seven starts and FoldCloth (N = 10) from two, in closed loop on the model itself. Grippers are closed (1) and the
first plan is rest. Starts are displacements of both grippers from what they would take: the rope's ends, the sheet's corners on
the side that is folded. Methods:

holding    the planner's value of holding (its default), no tuned weight
exact      the same planner without it: exact gradients alone
smoothed   Gauss-Newton with derivatives of smoothed grasps through hard states (`validation.control.smoothed`), in the manner of CORD-SLS;
           rope alone
reach      a reach cost in the task's file, with the value of holding off; its weight was tuned on the start 5 cm above: of 0.01, 0.1, 1,
           10, 100 the one that holds first there (never, never, 37, 14, 10 steps with seed 60000)

A row is {object, start, method, seized, steps_to_hold, rms_m, steps, update_s}: how many grippers hold at the end, after how
many steps both held for the first time (null: never), and the root mean square distance of the nodes from their goals at the end.
"""

import argparse
import json
import re
import time

import numpy as np
import pliant

from validation.control.smoothed import SmoothedMpc
from validation.control.tasks import HORIZON, Instance, make, nodes

METHODS = ("holding", "exact", "smoothed", "reach")
# displacements of the left and the right gripper from the ends of LiftRope's rope, (0.01, 0.03) and (0.14, 0), on the floor [m]
ROPE_STARTS = {
    "5 cm above": ((0, 0, 0.05), (0, 0, 0.05)),
    "10 cm above": ((0, 0, 0.10), (0, 0, 0.10)),
    "5 cm beside": ((-0.03, 0.04, 0.002), (0.03, 0.04, 0.002)),  # outside of the U
    "10 cm beside": ((-0.06, 0.08, 0.002), (0.06, 0.08, 0.002)),
    "diagonal": ((-0.04, 0.03, 0.05), (0.04, 0.03, 0.05)),
    "inside the U": ((0.04, -0.05, 0.01), (-0.05, -0.03, 0.01)),
    "12 cm off": ((-0.07, 0.07, 0.07), (0.07, 0.07, 0.07)),
}
CLOTH_STARTS = {"5 cm": ((-0.03, 0, 0.04), (-0.03, 0, 0.04)), "10 cm": ((-0.06, 0, 0.08), (-0.06, 0, 0.08))}
ENDS = {"rope": ((0.01, 0.03, 0.002), (0.14, 0.0, 0.002)), "cloth": ((-0.1, -0.1, 0.0), (-0.1, 0.1, 0.0))}
STEPS = {"rope": 200, "cloth": 60}
TASK = {"rope": "LiftRope", "cloth": "FoldCloth"}
REACH = """
[[cost]]
kind = "reach"
gripper = "{}"
inside = {}
weight = {}
"""
REACH_WEIGHT = {"rope": 100.0, "cloth": 100.0}


def instance(kind: str, start: str, seed: int, reach: float | None = None) -> Instance:
    """The task with its grippers moved; with a reach cost of that weight."""
    task = make(TASK[kind], seed)
    moves = (ROPE_STARTS if kind == "rope" else CLOTH_STARTS)[start]
    places = iter(np.add(ENDS[kind], moves).tolist())
    task.scene = re.sub(r"(?m)^at = \[.*\]$", lambda _: f"at = {next(places)}", task.scene)
    if reach is not None:
        radius = float(re.search(r"(?m)^radius = ([\d.e-]+)$", task.scene.split("[gripper.grasp]")[1])[1])
        task.text += "".join(REACH.format(hand, 0.5 * radius, reach) for hand in ("left", "right"))
    return task


def held(model, x) -> int:
    """How many grippers hold something at x."""
    z = x[len(x) - len(model.memory_names) :]
    return sum(bool(z[k] > 0) for k, name in enumerate(model.memory_names) if name.endswith(".held"))


def controller(kind: str, method: str, task: pliant.Task, theta, goal):
    """A function from the state to the inputs."""
    horizon = HORIZON[TASK[kind]]
    if method == "smoothed":
        return SmoothedMpc(task.model, theta, goal, horizon, *task.bounds).update
    first = np.clip(np.zeros((horizon, task.model.nu)), *task.bounds)
    return task.mpc(first, theta, holding=method == "holding").update


def row(kind: str, start: str, method: str, steps: int, seed: int, weight: float | None = None) -> dict:
    """A closed loop from a start by a method."""
    reach = (weight or REACH_WEIGHT[kind]) if method == "reach" else None
    drawn = instance(kind, start, seed, reach)
    task = drawn.load()
    model, theta = task.model, task.model.theta_with(drawn.theta)
    update = controller(kind, method, task, theta, drawn.goal)
    x, first, seconds, failure = task.x0, None, [], None
    for k in range(steps):
        begin = time.perf_counter()
        try:
            u = update(x)
            seconds.append(time.perf_counter() - begin)
            x = model.step(x, u, theta)
        except pliant.NumericsError as error:
            failure = str(error)
            break
        if first is None and held(model, x) == 2:
            first = k + 1
    away = nodes(model, x) - drawn.goal
    return {
        "object": kind,
        "start": start,
        "method": method,
        "seized": held(model, x),
        "steps_to_hold": first,
        "rms_m": float(np.sqrt(np.mean(np.sum(away**2, axis=1)))),
        "steps": steps if failure is None else len(seconds),
        "update_s": float(np.mean(seconds)) if seconds else None,
        "failure": failure,
        "reach_weight": reach,
        "seed": seed,
    }


def said(r: dict) -> str:
    """A row in words."""
    when = f"both held after {r['steps_to_hold']:3} steps" if r["steps_to_hold"] else f"{r['seized']} of 2 hold, never both"
    end = f" FAILED: {r['failure']}" if r["failure"] else ""
    return f"{r['object']:5} {r['start']:13} {r['method']:9} {when}, {1e3 * r['rms_m']:6.1f} mm after {r['steps']} steps{end}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--object", choices=TASK, help="rope or cloth alone")
    parser.add_argument("--method", choices=METHODS, help="one method alone")
    parser.add_argument("--steps", type=int, help="steps of a run; by default 200 of the rope, 60 of the sheet")
    parser.add_argument("--seed", type=int, default=71_000, help="of the draw of goal and material")
    arguments = parser.parse_args()
    if arguments.steps is not None and arguments.steps < 1:
        parser.error(f"--steps is {arguments.steps}, but at least one step is needed")
    rows = []
    for kind, starts in (("rope", ROPE_STARTS), ("cloth", CLOTH_STARTS)):
        for start in starts:
            for method in METHODS:
                if arguments.object not in (None, kind) or arguments.method not in (None, method) or (kind, method) == ("cloth", "smoothed"):
                    continue
                rows.append(row(kind, start, method, arguments.steps or STEPS[kind], arguments.seed))
                if not arguments.json:
                    print(said(rows[-1]), flush=True)
    if arguments.json:
        print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
