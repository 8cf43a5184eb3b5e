"""The four manipulation tasks of CORD-SLS as scenes of pliant, driven by simple hand-made motions.

    python -m validation.cord_tasks           # what happens, and seconds
    python -m validation.cord_tasks --write folder

Sizes, materials, steps, grippers and goals are those of the release (trustworthyrobotics/CORD-SLS):
h = 0.02 s, |v| <= 0.2 m/s, quasi-static steps. Where a range is drawn from there, its middle stands
here. What differs, and why:

- The release's initial shapes are files that are not at hand. Here: LiftRope a U on the floor with
  its ends under the grippers' start, DragRope straight, FoldCloth flat, FlattenCloth rippled.
- Where the grippers of FlattenCloth begin is not known; they stand at the middles of two sides.
- Rope of diameter d and modulus E: EA = E pi d^2/4, EI = E pi d^4/64. Its spring model of cloth is
  a plate and a membrane here. Friction of the cloth on its table is not given: 0.8 as for the rope.
- Reach is measured from the centreline here, there from the surface: half the thickness is added.
- There a gripper pulls in a tenth of its distance per step, here with the time constant
  -h/ln 0.9 = 0.19 s.
- The cylinder of DragRope is a constraint of the planner there, and a post that is touched here.
"""

import argparse
from itertools import pairwise
from math import log, pi, sin
from pathlib import Path

import numpy as np
import pliant

STEP = 0.02  # s
SPEED = 0.2  # m/s
TASKS = ("LiftRope", "DragRope", "FoldCloth", "FlattenCloth")
# Published seconds per step and per Jacobian (paper, GPU): rope of 20 nodes, cloth of 100.
# Text of the scene, goals of the nodes [m] (n, 3), and the object they belong to.
Task = tuple[str, np.ndarray, str]
PUBLISHED = {"Rope": (1.095e-3, 5.198e-3), "Cloth": (15.08e-3, 10.06e-3)}


def listed(rows) -> str:
    """Nested TOML lists."""
    return "[" + ", ".join("[" + ", ".join(f"{x:.9g}" for x in row) + "]" for row in rows) + "]"


def waypoints(*displacements, start=0.0):
    """Times and displacements of a motion from rest to rest: its largest speed is 1.5 times the mean."""
    t, here, rows = start, np.zeros(3), [(start, 0.0, 0.0, 0.0)]
    for to, pause in displacements:
        way = np.linalg.norm(np.asarray(to) - here)
        t += max(1.5 * way / SPEED, 1e-3)
        rows.append((t, *to))
        if pause:
            t += pause
            rows.append((t, *to))
        here = np.asarray(to)
    return rows


def gripper(name, held, at, radius, stiffness, smoothing, moves, closing) -> str:
    """A velocity-controlled gripper that grasps."""
    return f"""
[[gripper]]
name = "{name}"
{held}
mode = "velocity"
motion = {{ kind = "path", points = {listed(waypoints(*moves))} }}

[gripper.grasp]
at = {[float(x) for x in at]}
radius = {radius:.9g}
stiffness = {stiffness}
smoothing = {smoothing}
closing_time = {-STEP / log(0.9):.6g}
closing = {listed(closing)}
"""


def head(steps) -> str:
    return f"""schema_version = 1
[time]
step = {STEP}
duration = {steps * STEP:.6g}
integrator = "quasi_static"
[contact]
rest_gap = 1e-6
"""


def rope_text(points, modulus, density, diameter=0.004) -> str:
    area = pi * diameter**2 / 4
    return f"""
[[rope]]
name = "rope"
nodes = {len(points)}
length = 0.3
linear_density = {density * area:.9g}
stretch_stiffness = {modulus * area:.9g}
bend_stiffness = {modulus * area * diameter**2 / 16:.9g}
radius = {diameter / 2}
initial = {{ shape = "points", points = {listed(points)} }}
"""


def cloth_text(size, thickness, modulus, points=None) -> str:
    shape = f"points = {listed(points)}\n" if points is not None else ""
    return f"""
[[cloth]]
name = "cloth"
grid = {{ nodes = [10, 10], size = [{size}, {size}], diagonal = "alternating" }}
origin = [{-size / 2}, {-size / 2}, {0.5 * thickness + 1e-6}]
thickness = {thickness}
density = 20.0
youngs_modulus = {modulus}
poisson_ratio = 0.3
{shape}"""


FLOOR = '\n[[plane]]\nname = "floor"\nfriction = {}\n'


def u_shape(a, b, length, nodes, z):
    """Nodes at equal distances on a circular arc of that length from a to b, in the plane z."""
    a, b = np.asarray(a), np.asarray(b)
    chord = np.linalg.norm(b - a)
    low, high = 1e-6, 2 * pi - 1e-6
    for _ in range(80):  # chord/length = sin(t/2)/(t/2)
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sin(middle / 2) / (middle / 2) > chord / length else (low, middle)
    turn = 0.5 * (low + high)
    radius = length / turn
    along = (b - a) / chord
    across = np.array([-along[1], along[0]])
    centre = (a + b) / 2 + across * radius * np.cos(turn / 2)
    angles = np.linspace(-turn / 2, turn / 2, nodes)
    flat = centre + radius * (np.sin(angles)[:, None] * along - np.cos(angles)[:, None] * across)
    return np.column_stack([flat, np.full(nodes, z)])


def lift_rope(height=0.05) -> Task:
    """Two grippers come down on the ends of a U, close, and pull it straight at the goal's height."""
    z = 0.002 + 1e-6
    points = u_shape((0.01, 0.03), (0.14, 0.0), 0.3, 21, z)
    goal = np.column_stack([np.linspace(-0.075, 0.225, 21), np.full(21, 0.015), np.full(21, height)])
    hands = [("left", (0.01, 0.03, 0.05), goal[0]), ("right", (0.14, 0.0, 0.05), goal[-1])]
    text = head(200) + rope_text(points, 2e3, 100.0) + FLOOR.format(0.8)
    for name, at, to in hands:
        down = (0.0, 0.0, 0.004 - at[2])
        moves = ((down, 0.3), (tuple(np.asarray(to) - at), 0.0))
        closing = [(0.0, 0.0), (0.36, 0.0), (0.42, 1.0)]
        text += gripper(name, 'rope = "rope"', at, 0.017, 800.0, 1e-3, moves, closing)
    return text, goal, "rope"


def drag_rope(x=-0.18) -> Task:
    """A gripper takes the rope's end and drags it round the post to a line along y."""
    points = np.column_stack([np.linspace(0.02, 0.32, 21), np.zeros(21), np.full(21, 0.002 + 1e-6)])
    goal = np.column_stack([np.full(21, x), np.linspace(0.3, 0.0, 21), np.full(21, 0.002)])
    post = '\n[[capsule]]\nname = "post"\na = [-0.1, 0.1, -0.3]\nb = [-0.1, 0.1, 0.3]\nradius = 0.1\nfriction = 0.8\n'
    at = (0.02, 0.0, 0.01)
    moves = (((0, 0, -0.006), 0.3), ((-0.12, -0.04, 0), 0), ((-0.24, 0.0, 0), 0), ((x - 0.06, 0.1, 0), 0), ((x - 0.02, 0.3, 0), 0))
    text = head(500) + rope_text(points, 1e4, 300.0) + FLOOR.format(0.8) + post
    text += gripper("hand", 'rope = "rope"', at, 0.007, 800.0, 1e-3, moves, [(0.0, 0.0), (0.1, 0.0), (0.16, 1.0)])
    return text, goal, "rope"


def cloth_goal(size, z):
    line = np.linspace(-size / 2, size / 2, 10)
    return np.array([(x, y, z) for x in line for y in line])


def fold_cloth() -> Task:
    """Two grippers take the corners of one side and lay it on the other."""
    size, thickness = 0.2, 5e-4
    text = head(200) + cloth_text(size, thickness, 1.6e4) + FLOOR.format(0.8)
    for name, y in (("left", -0.08), ("right", 0.08)):
        at = (-0.09, y, 0.005)
        moves = (((0, 0, -0.004), 0.3), ((0.09, 0, 0.07), 0), ((0.18, 0, 0.005), 0.2))
        text += gripper(name, 'cloth = "cloth"', at, 0.01 + thickness / 2, 1000.0, 3e-3, moves, [(0.0, 0.0), (0.06, 0.0), (0.12, 1.0)])
    goal = cloth_goal(size, 0.0)
    goal[:, 2] = np.where(goal[:, 0] < 0, 0.02, 0.0)
    goal[:, 0] = np.abs(goal[:, 0])
    return text, goal, "cloth"


def flatten_cloth() -> Task:
    """Two grippers take a rippled cloth by two opposite sides and pull it flat."""
    size, thickness, ripples, height = 0.3, 1e-3, 2, 0.012
    line = np.linspace(0.0, 1.0, 10)

    def z(s):
        return height * (1 - np.cos(2 * pi * ripples * s)) + thickness / 2 + 1e-6

    # as long along x as at rest: each edge keeps its length
    x = [0.0]
    for a, b in pairwise(line):
        x.append(x[-1] + np.sqrt((size / 9) ** 2 - (z(b) - z(a)) ** 2))
    x = np.array(x) - x[-1] / 2
    points = [(px, py, z(s)) for px, s in zip(x, line) for py in np.linspace(-size / 2, size / 2, 10)]
    text = head(200) + cloth_text(size, thickness, 1.2e4, points) + FLOOR.format(0.55)
    for name, side in (("left", -1), ("right", 1)):
        at = (side * x[-1], 0.0, z(1.0) + 0.02)
        out = side * (size / 2 - x[-1])
        moves = (((0, 0, -0.018), 0.3), ((out, 0, -0.018), 0.3), ((out + side * 0.001, 0, -0.02), 0))
        text += gripper(name, 'cloth = "cloth"', at, 0.01 + thickness / 2, 1000.0, 3e-3, moves, [(0.0, 0.0), (0.16, 0.0), (0.22, 1.0)])
    return text, cloth_goal(size, thickness / 2), "cloth"


MAKE = {"LiftRope": lift_rope, "DragRope": drag_rope, "FoldCloth": fold_cloth, "FlattenCloth": flatten_cloth}


def error(model, x, goal, name) -> float:
    """Root mean square distance of the nodes from their goals [m]."""
    nodes = {**model.ropes, **model.cloths}[name]
    q = np.asarray(x)[3 * nodes.start : 3 * nodes.stop].reshape(-1, 3)
    return float(np.sqrt(np.mean(np.sum((q - goal) ** 2, axis=1))))


def outcome(task: str, repeats: int = 3) -> dict:
    """What a task's motion achieves, and seconds per step: forward, with A and B, and with a rollout's gradient."""
    text, goal, name = MAKE[task]()
    model = pliant.loads(text)
    u = model.controls()
    roll = model.rollout(model.initial_state(), u)
    steps = len(roll)
    held = [k for k, memory in enumerate(model.memory_names) if memory.endswith(".held")]
    z = roll.x[:, -len(model.memory_names) :]
    x_bar = np.zeros((steps + 1, model.ndx))
    nodes = {**model.ropes, **model.cloths}[name]
    q = roll.x[-1][3 * nodes.start : 3 * nodes.stop]
    x_bar[-1, 3 * nodes.start : 3 * nodes.stop] = 2 * (q - goal.ravel())
    _, u_bar, _ = roll.vjp(x_bar)
    times = {"step": [], "linearize": [], "rollout_vjp": []}
    for _ in range(repeats):
        for work, seconds in times.items():
            many = 1 if work == "rollout_vjp" else steps
            seconds.append(pliant.bench(text, work, many) / (steps if work == "rollout_vjp" else 1))
    return {
        "task": task,
        "nx": model.nx,
        "nu": model.nu,
        "steps": steps,
        "held": [bool(np.any(z[:, k] > 0)) for k in held],
        "error_before": error(model, roll.x[0], goal, name),
        "error_after": error(model, roll.x[-1], goal, name),
        "gradient": float(np.linalg.norm(u_bar)),
        "factorizations": float(np.mean(roll.trace["factorizations"])),
        "retries": int(np.sum(roll.trace["retries"])),
        "seconds": {work: min(values) for work, values in times.items()},
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, help="write the scenes into this folder instead")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.write:
        arguments.write.mkdir(parents=True, exist_ok=True)
        for task in TASKS:
            (arguments.write / f"{task}.toml").write_text(MAKE[task]()[0], encoding="utf-8")
        return
    for task in TASKS:
        row = outcome(task, arguments.repeats)
        ms = {work: 1e3 * seconds for work, seconds in row["seconds"].items()}
        print(
            f"{task:13} nx {row['nx']:3} nu {row['nu']} held {row['held']} error {1e3 * row['error_before']:.1f} -> "
            f"{1e3 * row['error_after']:.1f} mm, |gradient| {row['gradient']:.2e}, {row['factorizations']:.1f} "
            f"factorizations, {row['retries']} retries; per step {ms['step']:.3f} ms forward, {ms['linearize']:.3f} with A "
            f"and B, {ms['rollout_vjp']:.3f} with vjp (published {', '.join(f'{1e3 * s:.2f}' for s in PUBLISHED[task[-4:] if task.endswith('Rope') else 'Cloth'])} ms)"
        )


if __name__ == "__main__":
    main()
