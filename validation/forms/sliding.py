"""Blocks and ropes that slide to rest, stick and slide on an incline."""

from __future__ import annotations

import math

import numpy as np

from validation.bodies.contact import Free, G, Setting, Solid, scene
from validation.forms.case import Case, States, parameter, start_speed

BLOCK = Solid("box", (0.05, 0.06, 0.04))
RADIUS = 0.01  # of the rope [m]


def hover(points: int, rest_gap: float) -> float:
    """Height above a floor at which a body rests on so many points [m]: each carries a part of the weight.

    A point's force is its smoothing over its gap, and the smoothing is that of a mass in 10 m/s² (docs/theory/contact.md).
    """
    return points * rest_gap * 10.0 / G


def block(mu: float, speed: float = 0.0, tilt: float = 0.0, duration: float = 1.0):
    """A block on a floor; downhill of a tilt is −x."""

    def text(step: float, rest_gap: float, integrator: str) -> str:
        setting = Setting(step=step, duration=duration, tilt=tilt, rest_gap=rest_gap, floor=mu, integrator=integrator)
        height = BLOCK.sizes[2] + hover(4, rest_gap)
        return scene(setting, Free("block", BLOCK, (0, 0, height), velocity=(speed, 0, 0, 0, 0, 0), friction=None))

    return text


def rope(mu: float, speed: float = 0.0, tilt: float = 0.0, duration: float = 1.0):
    """A straight rope of three nodes that lies across its motion on a floor."""

    def text(step: float, rest_gap: float, integrator: str) -> str:
        setting = Setting(step=step, duration=duration, tilt=tilt, rest_gap=rest_gap, floor=mu, integrator=integrator)
        return setting.text() + f"""
[[rope]]
name = "rope"
nodes = 3
length = 0.1
linear_density = 0.05
stretch_stiffness = 1000.0
stretch_damping = 0.0
bend_stiffness = 0.0
radius = {RADIUS}
velocity = [{speed}, 0.0, 0.0]
initial = {{ shape = "straight", from = [0.0, -0.05, {RADIUS + rest_gap}], direction = [0.0, 1.0, 0.0] }}
"""

    return text


def block_path(s: States):
    """Of the block along x [m]."""
    return s.position("block_free")[-1, 0]


def block_speed(s: States):
    """Downhill at the end [m/s]."""
    return -s.velocity("block_free")[-1, 0]


def node_path(s: States):
    """Of the middle node along x [m]."""
    return s.nodes()[-1, 1, 0]


def node_speed(s: States):
    """Downhill at the end [m/s]."""
    return -s.node_velocities()[-1, 1, 0]


def distance(v0, mu):
    """Of what slides to rest on a plane [m]."""
    return v0**2 / (2.0 * mu * G)


def incline(alpha, mu, time):
    """Speed of a block that slides down an incline, from rest [m/s]."""
    return G * (np.sin(alpha) - mu * np.cos(alpha)) * time


MU = 0.3
FRICTION, TILT = parameter("floor.friction"), parameter("gravity.tilt[1]")
CRITICAL = math.atan(MU)
# It stops a third of a step after the end of one at 4 ms, two thirds at 2 ms, a third at 1 ms and so on. The derivatives' error depends
# on where in a step that is (steps in which it slides count, and their number jumps), and here is h times the same number, up to sign.
TO_REST = {"v0": MU * G * 0.004 * (85 + 1 / 3), "mu": MU}
SLIDES = {"alpha": 1.2 * CRITICAL, "mu": MU, "time": 1.0}
STICKS = {"alpha": math.atan(0.9 * MU), "mu": MU}

CASES = [
    Case(
        "block_to_rest", "a block slides v₀²/(2 μ g)", "m", TO_REST, distance, block(MU, TO_REST["v0"]),
        block_path, {"mu": FRICTION, "v0": start_speed({"block_free.x": 1.0})},
    ),
    Case(
        "node_to_rest", "a node slides v₀²/(2 μ g)", "m", TO_REST, distance, rope(MU, TO_REST["v0"]),
        node_path, {"mu": FRICTION, "v0": start_speed(nodes=(1.0, 0.0, 0.0))},
    ),
    Case(
        "block_sticks", "tan α = 0.9 μ: a block has no speed (errors in m/s)", "m/s", STICKS, lambda alpha, mu: 0.0 * alpha * mu,
        block(MU, tilt=STICKS["alpha"]), block_speed, {"mu": FRICTION, "alpha": TILT}, scale=1.0,
    ),
    Case(
        "node_sticks", "a node has none", "m/s", STICKS, lambda alpha, mu: 0.0 * alpha * mu,
        rope(MU, tilt=STICKS["alpha"]), node_speed, {"mu": FRICTION, "alpha": TILT}, scale=1.0,
    ),
    Case(
        "block_slides", "α = 1.2 arctan μ: a block slides at g (sin α − μ cos α) t", "m/s", SLIDES, incline,
        block(MU, tilt=SLIDES["alpha"]), block_speed, {"mu": FRICTION, "alpha": TILT},
    ),
    Case(
        "node_slides", "a node does", "m/s", SLIDES, incline,
        rope(MU, tilt=SLIDES["alpha"]), node_speed, {"mu": FRICTION, "alpha": TILT},
    ),
]  # fmt: skip
