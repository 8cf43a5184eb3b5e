"""The timed work: one wavy rope, described once for pliant (TOML) and once for MuJoCo.

Every size has the same 1 m, 0.05 kg rope (EA 1e4 N, EI 1e-3 N·m²) and step 1/60 s. Without
contact it hangs from node 0 and swings; with contact it is free and slides over a floor of
friction 0.1 on which every node starts at rest height, at (0.3, 1, 0) m/s.
"""

import numpy as np

from validation.mujoco_rope import Options, Rope

STEP = 1 / 60  # s
STEPS = 60  # steps of one timed rollout
SLIDE = (0.3, 1.0, 0.0)  # m/s
FRICTION = 0.1


def rope(nodes: int) -> Rope:
    """The benchmark's rope with `nodes` nodes."""
    return Rope(nodes=nodes)


def points(nodes: int, contact: bool) -> np.ndarray:
    """Initial node positions [m]: unstretched edges whose heading waves by 0.3 rad."""
    r = rope(nodes)
    heading = 0.3 * np.sin(2 * np.pi * (np.arange(nodes - 1) + 0.5) / (nodes - 1))
    edges = r.edge * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    nodes_at = np.vstack([np.zeros(3), np.cumsum(edges, axis=0)])
    nodes_at[:, 2] = r.radius if contact else 0.0
    return nodes_at


def scene_text(nodes: int, contact: bool) -> str:
    """The TOML scene pliant times."""
    r = rope(nodes)
    listed = ", ".join(f"[{x:.17g}, {y:.17g}, {z:.17g}]" for x, y, z in points(nodes, contact))
    held = '[[gripper]]\nname = "hand"\nrope = "cable"\nnodes = [0]\nmode = "prescribed"\n'
    floor = (
        f'[[plane]]\nname = "floor"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\nfriction = {FRICTION}\n'
    )
    velocity = list(SLIDE) if contact else [0.0, 0.0, 0.0]
    return f"""schema_version = 1
[time]
step = {STEP!r}
duration = {STEPS * STEP!r}
integrator = "{"euler" if contact else "midpoint"}"
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
velocity = {velocity}
{floor if contact else held + 'motion = { kind = "hold" }'}
"""


def mujoco_options(contact: bool, **changes) -> Options:
    """MuJoCo's side of the same scene: default solver tolerance, its own edge constraint."""
    return Options(
        **{
            "step": STEP,
            "fixed": () if contact else (0,),
            "stretch": "equality",
            "floor": 0.0 if contact else None,
            "friction": FRICTION,
            "tolerance": 1e-8,
        }
        | changes
    )
