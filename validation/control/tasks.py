"""The four tasks of CORD-SLS as tasks of pliant: scenes of `validation.cord_tasks` with the release's costs, goals and limits.

What the release has and is kept: the step of 20 ms, |v| <= 0.2 m/s, the cost sum |p - goal|^2 over the nodes + 0.1 |v|^2, the ranges of
goals and materials, the horizons, the cylinder and the plane of DragRope as constraints of every node, and 9 |node 0 - goal|^2 there.
What differs stands in `validation.cord_tasks`, and: the closing is held at 1 (there it is a fourth input per gripper, which the first
guess sets to 1), and the cost of DragRope counts all nodes and velocities (there a slice drops the last node and v_z).
"""

import re
from dataclasses import dataclass, field

import numpy as np
import pliant

from validation.cord_tasks import MAKE, Task, gripper, head, listed, rope_text

PUBLISHED = {  # seconds an update, goal error [m], runs without a violation [%]; tubes off, as released
    "LiftRope": {"update_s": 0.050, "goal_error_m": 0.0548, "safety": 1.0},
    "DragRope": {"update_s": 0.070, "goal_error_m": 0.0360, "safety": 0.999},
    "FoldCloth": {"update_s": 0.758, "goal_error_m": 0.0611, "safety": 1.0},
    "FlattenCloth": {"update_s": 0.711, "goal_error_m": 0.0234, "safety": 1.0},
    "RopeOver": None,  # a figure of tubes alone
}
MPPI_SAMPLES = {"LiftRope": 256, "DragRope": 256, "FoldCloth": 32, "FlattenCloth": 32, "RopeOver": 256}
STEPS = {"LiftRope": 200, "DragRope": 500, "FoldCloth": 200, "FlattenCloth": 200, "RopeOver": 150}
HORIZON = {"LiftRope": 20, "DragRope": 20, "FoldCloth": 10, "FlattenCloth": 10, "RopeOver": 20}
POST = {"centre": np.array([-0.1, 0.1]), "radius": 0.1, "floor": -0.05}
BAR = 0.04  # m, radius of the bar of RopeOver along y


@dataclass
class Instance:
    """A task with its draw of goals and materials."""

    name: str
    text: str
    scene: str
    goal: np.ndarray
    theta: dict = field(default_factory=dict)
    bar: float = 0.0  # height of RopeOver's bar [m]

    def load(self) -> pliant.Task:
        return pliant.loads_task(self.text, scene=self.scene)

    def error(self, model, x) -> float:
        """The release's goal error [m]: the norm over all nodes, of DragRope the distance of node 0."""
        away = nodes(model, x) - self.goal
        return float(np.linalg.norm(away[0] if self.name == "DragRope" else away))

    def clearance(self, model, x) -> float:
        """How far the least safe node is on the right side of the constraints [m]; infinite where there are none."""
        if self.name == "RopeOver":
            return float((np.hypot(nodes(model, x)[:, 0], nodes(model, x)[:, 2] - self.bar) - BAR).min())
        if self.name != "DragRope":
            return np.inf
        p = nodes(model, x)
        post = np.linalg.norm(p[:, :2] - POST["centre"], axis=1) - POST["radius"]
        return float(min(post.min(), (p[:, 2] - POST["floor"]).min()))


def nodes(model, x) -> np.ndarray:
    """Nodes of the only rope or cloth, (n, 3)."""
    (span,) = {**model.ropes, **model.cloths}.values()
    return np.asarray(x)[3 * span.start : 3 * span.stop].reshape(-1, 3)


def quoted(names) -> str:
    return "[" + ", ".join(f'"{name}"' for name in names) + "]"


def task_text(name: str, goal, hands, horizon: int, extra: str = "") -> str:
    """The task's file."""
    kind = "cloth" if name.endswith("Cloth") else "rope"
    velocities = quoted(f"{hand}.velocity.{axis}" for hand in hands for axis in "xyz")
    closings = quoted(f"{hand}.closing" for hand in hands)
    return f"""schema_version = 1
steps = {STEPS[name]}
horizon = {horizon}
[[cost]]
kind = "nodes"
object = "{kind}"
goal = {listed(goal)}
[[cost]]
kind = "inputs"
inputs = {velocities}
weight = 0.1
[[limit]]
kind = "inputs"
inputs = {velocities}
lower = -0.2
upper = 0.2
[[limit]]
kind = "inputs"
inputs = {closings}
lower = 1
upper = 1
{extra}"""


DRAG = """[[cost]]
kind = "nodes"
object = "rope"
nodes = [0]
goal = {first}
weight = 9
[[limit]]
kind = "outside"
object = "rope"
a = [-0.1, 0.1, -1]
b = [-0.1, 0.1, 1]
radius = {radius}
[[limit]]
kind = "above"
object = "rope"
normal = [0, 0, 1]
offset = {floor}
"""


OVER = """[[limit]]
kind = "outside"
object = "rope"
a = [0, -1, {bar}]
b = [0, 1, {bar}]
radius = {radius}
"""


def rope_over() -> Task:
    """A rope of 11 nodes along y between two grippers (39 coordinates, as the published example of output feedback), beside a bar along y
    that it is to be carried over; what else the example has is not published."""
    points = np.column_stack([np.full(11, -0.12), np.linspace(-0.15, 0.15, 11), np.full(11, 0.09)])
    text = head(STEPS["RopeOver"]) + rope_text(points, 1e4, 300.0)
    for hand, at in (("left", points[0]), ("right", points[-1])):
        text += gripper(hand, 'rope = "rope"', at, 0.005, 800.0, 1e-3, (((0.01, 0, 0), 0.0),), [(0.0, 1.0), (1.0, 1.0)])
    return text, points * [-1, 1, 1], "rope"


def make(name: str, seed: int, horizon: int | None = None, margin: float = 0.0) -> Instance:
    """A draw of a task. margin: added to the distances that are kept [m]."""
    rng = np.random.default_rng([seed, list(STEPS).index(name)])
    scene, goal, kind = (MAKE | {"RopeOver": rope_over})[name]()
    horizon = horizon or HORIZON[name]
    theta, extra, bar = {}, "", 0.0
    if name == "LiftRope":
        goal = np.column_stack([np.linspace(0, 0.3, 21), np.zeros(21), np.full(21, rng.uniform(0.03, 0.07))])
    elif name == "DragRope":
        goal[:, 0] = rng.uniform(-0.21, -0.15)
        scene = re.sub(r"\n\[\[capsule\]\].*?(?=\n\[\[)", "", scene, flags=re.DOTALL)  # there the post is no contact
        extra = DRAG.format(first=listed(goal[:1]), radius=POST["radius"] + margin, floor=POST["floor"] + margin)
    elif name == "RopeOver":
        goal[:, 0], bar = rng.uniform(0.1, 0.14), rng.uniform(0.04, 0.06)
        extra = OVER.format(bar=bar, radius=BAR + margin)
    elif name == "FoldCloth":
        goal[:, 2] = 0.02 + 5e-4 / 2
        theta["cloth.youngs_modulus"] = rng.uniform(0.8e4, 2.4e4)
    else:
        theta["cloth.youngs_modulus"] = rng.uniform(0.8e4, 1.6e4)
        theta["floor.friction"] = rng.uniform(0.3, 0.8)
    hands = re.findall(r'\[\[gripper\]\]\nname = "(\w+)"', scene)
    return Instance(name, task_text(name, goal, hands, horizon, extra), scene, goal, theta, bar)
