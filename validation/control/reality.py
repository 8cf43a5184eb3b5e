"""A controller on another engine: MuJoCo's rope, seen by a camera at 15 Hz and 40 ms late, is lifted over a bar.

    python -m validation.control.reality [--json] [--runs N] [--moves N] [--first SEED] [--method nominal|tubes]

The plant is MuJoCo's discrete elastic rod (`validation.mujoco_rope`: its own bending, contact and integrator, steps of 1/300 s) with a mocap
hand at its first node and a bar that it can touch, softly. The controller knows neither: it has a mask and a depth image (noisy, rendered
by MuJoCo), from which `pliant.perception` makes nodes; a quasi-static pliant rope with steps of 1/15 s carries them over the delay of
40 ms, and `Task.mpc` looks 12 steps ahead. The bar is a constraint on every node, with no contact in the model.

Tubes have the radius of a split-conformal bound: scores are the largest one-step prediction error (norm over all free nodes, perceived
state against predicted state) of each of `--moves` random moves of 12 steps; the bound is the ceil((n + 1)(1 - delta))-th smallest,
delta = 0.1, and with too few moves there is none. Under the moves' law an error over a horizon is below it with 90 %; the
controller's motions are of another law, for which nothing is promised.

Success: nodes within 1 cm (root mean square) of where the rope would hang at the goal, after 10 s. Violation: a node nearer to
the bar's axis than the radii's sum at any of MuJoCo's steps. Not modelled: the hand's size, its own delay, what hides the rope.
A row is {method, runs, success, violations, clearance_m, error_m, radius_m, tightening_m, update_s, perception_s, lost_frames}.
"""

import argparse
import json
import time
from functools import cache
from math import ceil

import mujoco
import numpy as np
import pliant
from pliant.perception import Camera, rope

from validation import camera
from validation.cord_tasks import listed
from validation.mujoco_rope import Options, Rod, Rope

FRAME = 1 / 15  # s
SUBSTEPS = 20  # of MuJoCo in a frame
LATE = 12  # of them, 40 ms
SPEED, HORIZON, FRAMES = 0.15, 12, 150  # m/s
DELTA = 0.1
DRAG = 0.5  # kg/(m s): swinging is damped about critically
MODEL = Rope(nodes=16, length=0.3, linear_density=0.05, stretch_stiffness=1e3, bend_stiffness=1e-4, drag_linear=DRAG, radius=0.005)
BAR = 0.04  # m, radius
EYE = Camera.looking_at((0, 0, 0.35), (0, -0.9, 0.35), f=600, size=(camera.WIDTH, camera.HEIGHT))


class Plant:
    """The rope in MuJoCo, hanging from a hand at rest, over a bar along y at (x, z)."""

    def __init__(self, hand, bar=None):
        self.rod = Rod(MODEL, Options(step=FRAME / SUBSTEPS, fixed=(0,), ghost=False, floor=-10.0))
        if bar is not None:
            size, ends = [BAR, 0, 0], [bar[0], -1.0, bar[1], bar[0], 1.0, bar[1]]
            self.rod.spec.worldbody.add_geom(name="bar", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=size, fromto=ends, contype=1, conaffinity=1)
            damping = self.rod.model.dof_damping.copy()
            self.rod.model = self.rod.spec.compile()
            self.rod.model.dof_damping[:] = damping
            self.rod.data = mujoco.MjData(self.rod.model)
        self.bar, self.hand = bar, np.array(hand, float)
        self.rod.reset(hanging(self.hand))
        self.clearance = np.inf

    def nodes(self) -> np.ndarray:
        return self.rod.positions()

    def move(self, velocity, steps: int):
        """The hand with a velocity [m/s] for some of MuJoCo's steps."""
        for _ in range(steps):
            self.hand = self.hand + np.asarray(velocity) * FRAME / SUBSTEPS
            self.rod.data.mocap_pos[self.rod.model.body_mocapid[self.rod.bodies[0]]] = self.hand
            self.rod.advance(1)
            if self.bar is not None:
                away = np.hypot(*(self.nodes()[:, [0, 2]] - self.bar).T)
                self.clearance = min(self.clearance, float(away.min() - BAR - MODEL.radius))


class Renderer:
    """Masks and depths of the rope's nodes, as `validation.camera.render`; compiled once, its capsules are moved."""

    def __init__(self):
        straight = hanging((0.0, 0.0, 0.5))
        text = camera._mjcf(camera.Scene(rope=straight, radius=MODEL.radius, table=None), EYE, (camera.WIDTH, camera.HEIGHT))
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.renderer = mujoco.Renderer(self.model, camera.HEIGHT, camera.WIDTH)
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 0

    def __call__(self, nodes) -> tuple[np.ndarray, np.ndarray]:
        edges = np.diff(nodes, axis=0)
        lengths, quaternion, turn = np.linalg.norm(edges, axis=1), np.zeros(4), np.zeros(9)
        self.model.geom_size[:, 1] = 0.5 * lengths
        for k, edge in enumerate(edges):
            mujoco.mju_quatZ2Vec(quaternion, edge)
            mujoco.mju_quat2Mat(turn, quaternion)
            self.data.geom_xmat[k] = turn
        self.data.geom_xpos[:] = 0.5 * (nodes[1:] + nodes[:-1])
        self.renderer.update_scene(self.data, camera="eye")
        self.renderer.enable_depth_rendering()
        depth = self.renderer.render().astype(float)
        self.renderer.disable_depth_rendering()
        self.renderer.enable_segmentation_rendering()
        mask = self.renderer.render()[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)
        self.renderer.disable_segmentation_rendering()
        return mask, depth


@cache
def renderer() -> Renderer:
    return Renderer()


def hanging(hand) -> np.ndarray:
    """Nodes of the rope straight down from the hand."""
    return np.asarray(hand) - np.outer(np.arange(MODEL.nodes) * MODEL.edge, [0, 0, 1])


def scene(step: float, hand) -> str:
    return f"""schema_version = 1
[time]
step = {step!r}
duration = {FRAMES * FRAME}
integrator = "quasi_static"
[[rope]]
name = "rope"
nodes = {MODEL.nodes}
length = {MODEL.length}
linear_density = {MODEL.linear_density}
stretch_stiffness = {MODEL.stretch_stiffness}
bend_stiffness = {MODEL.bend_stiffness}
drag_linear = {DRAG}
initial = {{ shape = "points", points = {listed(hanging(hand))} }}
[[gripper]]
name = "hand"
rope = "rope"
nodes = [0]
mode = "velocity"
"""


def task(hand, goal, bar) -> pliant.Task:
    """The controller's problem."""
    velocities = '["hand.velocity.x", "hand.velocity.y", "hand.velocity.z"]'
    text = f"""schema_version = 1
steps = {HORIZON}
[[cost]]
kind = "nodes"
object = "rope"
goal = {listed(hanging(goal))}
[[cost]]
kind = "inputs"
inputs = {velocities}
weight = 0.05
[[limit]]
kind = "inputs"
inputs = {velocities}
lower = {-SPEED}
upper = {SPEED}
[[limit]]
kind = "outside"
object = "rope"
a = [{bar[0]}, -1, {bar[1]}]
b = [{bar[0]}, 1, {bar[1]}]
radius = {BAR + MODEL.radius}
"""
    return pliant.loads_task(text, scene=scene(FRAME, hand))


class Sight:
    """States of pliant's rope from images: perceived nodes, carried over the delay by the model."""

    def __init__(self, hand, rng):
        self.late = pliant.loads(scene(LATE * FRAME / SUBSTEPS, hand))
        self.x, self.rng = self.late.initial_state(), rng
        self.seconds, self.lost = [], 0

    def state(self, plant: Plant, velocity) -> np.ndarray:
        """At the time when the next command begins, of the image of now; `velocity` is the hand's until then."""
        images = camera.noisy(*renderer()(plant.nodes()), self.rng)
        begin, x = time.perf_counter(), self.x.copy()
        try:
            found = rope(*images, EYE, nodes=MODEL.nodes, radius=MODEL.radius, length=MODEL.length, start=plant.hand, reference=plant.hand)
            x[: 3 * MODEL.nodes] = found.nodes.ravel()
        except pliant.InputError:
            self.lost += 1  # the last estimate stands
        x[:3] = plant.hand  # known from the arm
        x[3 * MODEL.nodes :] = 0.0
        self.seconds.append(time.perf_counter() - begin)
        self.x = self.late.step(x, velocity)
        return self.x


def conformal(scores, delta: float) -> float:
    """The split-conformal bound of a new score; ValueError if there are too few."""
    n = len(scores)
    rank = ceil((n + 1) * (1 - delta))
    if rank > n:
        raise ValueError(f"{n} scores bound nothing at a risk of {delta}: at least {ceil(1 / delta) - 1} are needed")
    return float(np.sort(scores)[rank - 1])


def score(seed: int) -> float:
    """Largest one-step prediction error over a random move [m], norm over the free nodes."""
    rng = np.random.default_rng([seed, 1])
    hand = rng.uniform((-0.25, -0.05, 0.4), (0.25, 0.05, 0.55))
    plant, sight, model = Plant(hand), Sight(hand, rng), pliant.loads(scene(FRAME, hand))
    last, worst = np.zeros(3), 0.0
    x = sight.state(plant, last)
    for k in range(HORIZON):
        velocity = last if k % 3 else rng.uniform(-SPEED, SPEED, 3) * [1, 0.3, 1]
        predicted = model.step(x, velocity)
        plant.move(last, LATE)
        plant.move(velocity, SUBSTEPS - LATE)
        x, last = sight.state(plant, velocity), velocity
        worst = max(worst, float(np.linalg.norm((x - predicted)[3 : 3 * MODEL.nodes])))
    return worst


def run(seed: int, radius: float | None) -> dict:
    """A closed loop over the bar."""
    rng = np.random.default_rng([seed, 2])
    hand = np.array([rng.uniform(-0.25, -0.18), rng.uniform(-0.02, 0.02), 0.45])
    goal = np.array([rng.uniform(0.18, 0.25), 0.0, 0.45])
    bar = np.array([0.0, rng.uniform(0.13, 0.16)])
    plant, sight, problem = Plant(hand, bar), Sight(hand, rng), task(hand, goal, bar)
    mpc = problem.mpc(np.zeros((HORIZON, 3)), disturbance=radius)
    velocity, seconds, tightening = np.zeros(3), [], 0.0
    for _ in range(FRAMES):
        x = sight.state(plant, velocity)
        begin = time.perf_counter()
        command = mpc.update(x)
        seconds.append(time.perf_counter() - begin)
        tightening = max(tightening, mpc.tightening)
        plant.move(velocity, LATE)
        velocity = command
        plant.move(velocity, SUBSTEPS - LATE)
    error = float(np.sqrt(np.mean(np.sum((plant.nodes() - hanging(goal)) ** 2, axis=1))))
    return {"error": error, "clearance": plant.clearance, "updates": seconds, "frames": sight.seconds, "lost": sight.lost, "tightening": tightening}


def row(method: str, runs: int, first: int, radius: float | None) -> dict:
    """All runs by a method."""
    outcomes = [run(seed, radius) for seed in range(first, first + runs)]
    return {
        "method": method,
        "runs": runs,
        "success": sum(o["error"] < 0.01 for o in outcomes),
        "violations": sum(o["clearance"] < 0 for o in outcomes),
        "clearance_m": [o["clearance"] for o in outcomes],
        "error_m": [o["error"] for o in outcomes],
        "radius_m": radius,
        "tightening_m": max(o["tightening"] for o in outcomes),
        "update_s": float(np.mean([s for o in outcomes for s in o["updates"]])),
        "update_s_largest": float(np.max([s for o in outcomes for s in o["updates"]])),
        "perception_s": float(np.mean([s for o in outcomes for s in o["frames"]])),
        "lost_frames": sum(o["lost"] for o in outcomes),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--runs", type=int, default=2, help="closed loops of each method")
    parser.add_argument("--moves", type=int, default=100, help="random moves of the calibration")
    parser.add_argument("--first", type=int, default=72_000, help="first seed")
    parser.add_argument("--method", choices=("nominal", "tubes"), help="one method alone")
    arguments = parser.parse_args()
    if arguments.runs < 1:
        parser.error(f"--runs is {arguments.runs}, but at least one run is needed")
    if (why := camera.unavailable()) is not None:
        parser.error(f"MuJoCo cannot render here: {why}")
    rows = []
    for method in (arguments.method,) if arguments.method else ("nominal", "tubes"):
        radius = None
        if method == "tubes":
            try:
                radius = conformal([score(arguments.first + k) for k in range(arguments.moves)], DELTA)
            except ValueError as error:
                parser.error(str(error))
        rows.append(row(method, arguments.runs, arguments.first, radius))
        if not arguments.json:
            r = rows[-1]
            print(
                f"{method:8} success {r['success']} of {r['runs']}, violations {r['violations']}; errors {', '.join(f'{1e3 * e:.1f}' for e in r['error_m'])} mm, "
                f"least clearances {', '.join(f'{1e3 * c:.1f}' for c in r['clearance_m'])} mm; radius {1e3 * (radius or 0):.1f} mm, tightened by at most "
                f"{1e3 * r['tightening_m']:.1f} mm; update {1e3 * r['update_s']:.1f} ms (largest {1e3 * r['update_s_largest']:.0f}), perception "
                f"{1e3 * r['perception_s']:.0f} ms a frame, {r['lost_frames']} frames lost",
                flush=True,
            )
    if arguments.json:
        print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
