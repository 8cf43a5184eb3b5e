"""Trajectory optimization of an arm that carries a cable: exact derivatives beside MuJoCo's finite differences.

    python -m validation.control.arm_cable [--json] [--links N] [--steps N] [--iterations N]

An arm of seven joints with velocity drives holds a cable of capsules on ball joints with springs and dampers, which hangs from its last
link. In 200 steps of 10 ms it is to bring the hand, the middle of the cable and its tip to where they would hang 0.3 m farther on, and
to stand still: J = 10 sum |p - goal|^2 + 0.1 sum (arm's joint speeds)^2 at the end + 1e-4 sum u^2 over all 1400 inputs.

One MJCF file is read by both engines (pliant imports it). Both search by Gauss-Newton steps on all inputs with the same damping rule and
tolerance, from inputs of zero:

pliant       `Task.plan`: derivatives from the kept factorizations, its own dense subproblem
mujoco       rollout by mj_step (`implicit`), A and B of every step by mjd_transitionFD with forward differences of 1e-6, rows of the
             end's residuals carried backwards, subproblem by the Woodbury identity in NumPy. Its parts are timed apart.

Both are given one thread. The plan found by either is also simulated in the other: the engines integrate differently, so the costs differ.
A row is {engine, iterations, seconds, derivative_seconds, cost, cost_in_other, first_cost, status}; a last one has ratios.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
import pliant

STEP = 0.01  # s
AXES = ("0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
LENGTHS = (0.15, 0.2, 0.2, 0.2, 0.15, 0.1, 0.08)  # m
MASSES = (3.0, 2.5, 2.0, 1.5, 1.0, 0.6, 0.3)  # kg
START = np.array([0.0, 0.7, 0.0, 1.4, 0.0, np.pi - 2.1, 0.0])  # rad: the last link points down
CABLE = {"length": 0.4, "radius": 0.005, "mass": 0.08, "stiffness": 2e-2, "damping": 1e-3}
SHIFT = np.array([0.0, 0.3, 0.05])  # m, of the goal
PLACE, REST, EFFORT = 10.0, 0.1, 1e-4  # weights
TOLERANCE = 1e-6


def mjcf(links: int) -> str:
    """The arm with its cable."""
    text, end, at = "", "", "0 0 0"
    for k, (axis, length, mass) in enumerate(zip(AXES, LENGTHS, MASSES, strict=True)):
        across = mass * length**2 / 12 + 1e-3
        text += f'<body name="link{k}" pos="{at}"><inertial pos="0 0 {length / 2}" mass="{mass}" diaginertia="{across} {across} 1e-3"/>'
        text += f'<joint name="j{k}" type="hinge" axis="{axis}" armature="0.05" damping="1"/>'
        at, end = f"0 0 {length}", end + "</body>"
    edge, mass = CABLE["length"] / links, CABLE["mass"] / links
    across, along = mass * edge**2 / 12 + mass * CABLE["radius"] ** 2 / 4, mass * CABLE["radius"] ** 2 / 2
    for k in range(links):
        text += f'<body name="cable{k}" pos="{at}"><inertial pos="0 0 {edge / 2}" mass="{mass}" diaginertia="{across} {across} {along}"/>'
        text += f'<joint name="b{k}" type="ball" stiffness="{CABLE["stiffness"]}" damping="{CABLE["damping"]}" armature="1e-6"/>'
        at, end = f"0 0 {edge}", end + "</body>"
    drives = "".join(f'<velocity name="m{k}" joint="j{k}" kv="100"/>' for k in range(7))
    option = f'<option timestep="{STEP}" integrator="implicit"><flag contact="disable"/></option>'
    return f'<mujoco><compiler angle="radian"/>{option}<worldbody>{text}{end}</worldbody><actuator>{drives}</actuator></mujoco>'


def points(links: int) -> list[tuple[str, np.ndarray]]:
    """The hand, the middle and the tip: bodies and points in their axes."""
    edge = CABLE["length"] / links
    return [("link6", np.array([0, 0, LENGTHS[-1]])), (f"cable{links // 2}", np.zeros(3)), (f"cable{links - 1}", np.array([0, 0, edge]))]


class Mujoco:
    """The problem in MuJoCo, and its Gauss-Newton search."""

    def __init__(self, links: int, steps: int):
        self.model = mujoco.MjModel.from_xml_string(mjcf(links))
        self.data, self.steps = mujoco.MjData(self.model), steps
        self.points = [(self.model.body(name).id, at) for name, at in points(links)]
        self.q0 = self.model.qpos0.copy()
        self.q0[:7] = START
        self.derivative_seconds = 0.0
        self.reset()
        mujoco.mj_forward(self.model, self.data)
        self.goals = [self.place(body, at) + SHIFT for body, at in self.points]

    def reset(self):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.q0

    def place(self, body, at) -> np.ndarray:
        return self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ at

    def residuals(self) -> np.ndarray:
        """At the state of the data: half the sum of squares is the cost of the end."""
        mujoco.mj_kinematics(self.model, self.data)
        away = [self.place(body, at) - goal for (body, at), goal in zip(self.points, self.goals, strict=True)]
        return np.concatenate([np.sqrt(2 * PLACE) * np.ravel(away), np.sqrt(2 * REST) * self.data.qvel[:7]])

    def cost(self, u) -> float:
        self.reset()
        for row in u:
            self.data.ctrl[:] = row
            mujoco.mj_step(self.model, self.data)
        return 0.5 * float(np.sum(self.residuals() ** 2)) + EFFORT * float(np.sum(u**2))

    def jacobian(self, u) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the end and their derivative by all inputs, (m, N · 7)."""
        begin = time.perf_counter()
        nv, nu = self.model.nv, self.model.nu
        a, b = np.zeros((self.steps, 2 * nv, 2 * nv)), np.zeros((self.steps, 2 * nv, nu))
        self.reset()
        for k, row in enumerate(u):
            self.data.ctrl[:] = row
            mujoco.mjd_transitionFD(self.model, self.data, 1e-6, False, a[k], b[k], None, None)
            mujoco.mj_step(self.model, self.data)
        r = self.residuals()
        mujoco.mj_comPos(self.model, self.data)
        rows, jac = np.zeros((len(r), 2 * nv)), np.zeros((3, nv))
        for k, (body, at) in enumerate(self.points):
            mujoco.mj_jac(self.model, self.data, jac, None, self.place(body, at), body)
            rows[3 * k : 3 * k + 3, :nv] = np.sqrt(2 * PLACE) * jac
        rows[-7:, nv : nv + 7] = np.sqrt(2 * REST) * np.eye(7)
        out = np.zeros((len(r), self.steps, nu))
        for k in reversed(range(self.steps)):
            out[:, k] = rows @ b[k]
            rows = rows @ a[k]
        self.derivative_seconds += time.perf_counter() - begin
        return r, out.reshape(len(r), -1)

    def search(self, u, iterations: int) -> tuple[np.ndarray, float, int, str]:
        """Gauss-Newton steps with the damping rule of pliant's plans: 0, else 1e-3 times tens; accepted if 1e-4 of the prediction is met."""
        value, damping = self.cost(u), 0.0
        for iteration in range(iterations):
            r, j = self.jacobian(u)
            g = j.T @ r + 2 * EFFORT * u.ravel()
            diagonal = np.sum(j**2, axis=0) + 2 * EFFORT
            while True:
                d = 2 * EFFORT + damping * diagonal
                jd = j / d
                du = -(g / d - jd.T @ np.linalg.solve(np.eye(len(r)) + jd @ j.T, jd @ g))
                change = j @ du
                predicted = -(g @ du) - 0.5 * change @ change - EFFORT * du @ du
                if predicted < TOLERANCE * value:
                    return u, value, iteration + 1, "converged"
                trial = u + du.reshape(u.shape)
                after = self.cost(trial)
                if after <= value - 1e-4 * predicted:
                    u, value, damping = trial, after, damping / 10 if damping > 1e-3 else 0.0
                    break
                damping = max(1e-3, 10 * damping)
                if damping > 1e8:
                    return u, value, iteration + 1, "stalled"
        return u, value, iterations, "iterations"


def imported(links: int) -> str:
    """The scene, as pliant imports it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.xml"
        path.write_text(mjcf(links), encoding="utf-8")
        scene, report = pliant.import_model(path)
    lost = [entry for entry in report["entries"] if entry["verdict"] != "kept" and entry["element"] != "option"]
    if lost:
        raise ValueError(f"the import is not of the same model: {lost}")
    return scene


def task(links: int, steps: int, goals) -> pliant.Task:
    """The problem for pliant."""
    text = f"schema_version = 1\nsteps = {steps}\n"
    for (body, at), goal in zip(points(links), goals, strict=True):
        text += f'[[cost]]\nkind = "body"\nbody = "{body}"\npoint = {at.tolist()}\ngoal = {goal.tolist()}\nweight = {PLACE}\nwhen = "end"\n'
    for k in range(7):
        text += f'[[cost]]\nkind = "joint_speed"\njoint = "j{k}"\nweight = {REST}\nwhen = "end"\n'
    text += f'[[cost]]\nkind = "inputs"\ninputs = {json.dumps([f"m{k}" for k in range(7)])}\nweight = {EFFORT}\n'
    return pliant.loads_task(text, scene=imported(links))


def compare(links: int, steps: int, iterations: int) -> list[dict]:
    """Both searches from inputs of zero, and their ratios."""
    other = Mujoco(links, steps)
    problem = task(links, steps, other.goals)
    x0, u0 = problem.x0, np.zeros((steps, 7))
    x0[:7] = START

    begin = time.perf_counter()
    plan = problem.plan(x0, u0, iterations=iterations, tolerance=TOLERANCE)
    seconds = time.perf_counter() - begin
    begin = time.perf_counter()
    problem.model.rollout(x0, u0, record=False)
    ours = {
        "engine": "pliant",
        "iterations": len(plan.steps),
        "seconds": seconds,
        "derivative_seconds": None,
        "rollout_seconds": time.perf_counter() - begin,
        "cost": plan.cost,
        "cost_in_other": other.cost(plan.u),
        "first_cost": problem.evaluate(problem.model.rollout(x0, u0, record=False).x, u0)[0],
        "status": plan.status,
    }
    begin = time.perf_counter()
    u, value, taken, status = other.search(u0, iterations)
    seconds = time.perf_counter() - begin
    begin = time.perf_counter()
    first = other.cost(u0)
    theirs = {
        "engine": f"mujoco {mujoco.__version__}",
        "iterations": taken,
        "seconds": seconds,
        "derivative_seconds": other.derivative_seconds,
        "rollout_seconds": time.perf_counter() - begin,
        "cost": value,
        "cost_in_other": problem.evaluate(problem.model.rollout(x0, u, record=False).x, u)[0],
        "first_cost": first,
        "status": status,
    }
    per = [row["seconds"] / row["iterations"] for row in (ours, theirs)]
    ratios = {"engine": "mujoco / pliant", "seconds": theirs["seconds"] / ours["seconds"], "seconds_per_iteration": per[1] / per[0]}
    return [ours, theirs, ratios | {"cost": theirs["cost"] / ours["cost"], "links": links, "steps": steps}]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--links", type=int, default=10, help="links of the cable")
    parser.add_argument("--steps", type=int, default=200, help="steps of 10 ms")
    parser.add_argument("--iterations", type=int, default=50, help="Gauss-Newton steps at most")
    arguments = parser.parse_args()
    if min(arguments.links, arguments.steps, arguments.iterations) < 2:
        parser.error("--links, --steps and --iterations must be at least 2")
    rows = compare(arguments.links, arguments.steps, arguments.iterations)
    if arguments.json:
        print(json.dumps(rows, indent=1))
        return
    for r in rows[:2]:
        part = "" if r["derivative_seconds"] is None else f" ({r['derivative_seconds']:.1f} s in derivatives)"
        print(
            f"{r['engine']:13} {r['first_cost']:.4f} -> {r['cost']:.5f} ({r['cost_in_other']:.5f} in the other) in {r['iterations']} iterations, "
            f"{r['seconds']:.2f} s{part}, a rollout {1e3 * r['rollout_seconds']:.0f} ms, {r['status']}"
        )
    r = rows[2]
    print(f"{r['engine']}: time {r['seconds']:.1f}, time per iteration {r['seconds_per_iteration']:.1f}, cost {r['cost']:.3f}")


if __name__ == "__main__":
    main()
