"""The timed work: one wavy rope, described once for pliant (TOML) and once for MuJoCo.

Every size has the same 1 m, 0.05 kg rope (EA 1e4 N, EI 1e-3 N·m²) and step 1/60 s, taken by
implicit Euler: MuJoCo's step is of first order too, and the midpoint rule is not made for the
axial waves of so stiff a rope without damping, whose periods are far shorter than the step.
Without contact ("hang") it is held at node 0 and swings. With contact it is free and every node
starts on the floor: "rest" lies there, friction 0.5; "slide" moves at (0.3, 1, 0) m/s, friction
0.1.
"""

import numpy as np

from validation.mujoco_rope import Options, Rope

STEP = 1 / 60  # s
STEPS = 60  # steps of one timed rollout
VELOCITY = {"hang": (0.0, 0.0, 0.0), "rest": (0.0, 0.0, 0.0), "slide": (0.3, 1.0, 0.0)}  # m/s
FRICTION = {"rest": 0.5, "slide": 0.1}


def rope(nodes: int) -> Rope:
    """The benchmark's rope with `nodes` nodes: above 1300 it is thinner, since pliant refuses edges shorter than a fifth of the radius."""
    return Rope(nodes=nodes, radius=min(Rope.radius, 4.0 * Rope.length / (nodes - 1)))


def points(nodes: int, kind: str) -> np.ndarray:
    """Initial node positions [m]: unstretched edges whose heading waves by 0.3 rad."""
    r = rope(nodes)
    heading = 0.3 * np.sin(2 * np.pi * (np.arange(nodes - 1) + 0.5) / (nodes - 1))
    edges = r.edge * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    nodes_at = np.vstack([np.zeros(3), np.cumsum(edges, axis=0)])
    nodes_at[:, 2] = 0.0 if kind == "hang" else r.radius
    return nodes_at


def scene_text(nodes: int, kind: str) -> str:
    """The TOML scene pliant times."""
    r = rope(nodes)
    listed = ", ".join(f"[{x:.17g}, {y:.17g}, {z:.17g}]" for x, y, z in points(nodes, kind))
    contact = kind in FRICTION
    held = '[[gripper]]\nname = "hand"\nrope = "cable"\nnodes = [0]\nmode = "prescribed"\n'
    floor = '[[plane]]\nname = "floor"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n'
    floor += f"friction = {FRICTION.get(kind)}\n"
    return f"""schema_version = 1
[time]
step = {STEP!r}
duration = {STEPS * STEP!r}
integrator = "euler"
[gravity]
magnitude = {r.gravity}
[[rope]]
name = "cable"
nodes = {nodes}
length = {r.length}
linear_density = {r.linear_density}
stretch_stiffness = {r.stretch_stiffness}
bend_stiffness = {r.bend_stiffness}
radius = {r.radius}
initial = {{ shape = "points", points = [{listed}] }}
start = "as_given"
velocity = {list(VELOCITY[kind])}
{floor if contact else held + 'motion = { kind = "hold" }'}
"""


def mujoco_options(kind: str, **changes) -> Options:
    """MuJoCo's side of the same scene: default solver tolerance, its own edge constraint."""
    return Options(
        **{
            "step": STEP,
            "fixed": () if kind in FRICTION else (0,),
            "stretch": "equality",
            "floor": 0.0 if kind in FRICTION else None,
            "friction": FRICTION.get(kind, 0.0),
            "tolerance": 1e-8,
        }
        | changes
    )
