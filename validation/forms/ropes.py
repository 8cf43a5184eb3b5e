"""Ropes round a turning drum (capstan) and over a pulley without friction."""

from __future__ import annotations

import functools
import math

import numpy as np

from validation.bodies.contact import Setting, Solid
from validation.forms.case import Case, States, control, parameter

RADIUS = 0.004  # of ropes [m]

# ---- A rope on a drum ------------------------------------------------------------------------------------------------

MU = 0.3
DRUM = Solid("cylinder", (0.05, 0.1), 1000.0)
TURN = 20.0  # rad/s
EDGES, LEG = 32, 6  # over half a turn, and on each side from there to the hand
TENSION, STIFFNESS = 2.0, 2000.0  # N, before the drum turns; N per strain
DENSITY = 0.05  # kg/m


def around(rest_gap: float) -> tuple[np.ndarray, float]:
    """Nodes of a rope laid over the drum's upper half, and its edges' length [m]; legs hang down straight on both sides."""
    ring = DRUM.sizes[0] + RADIUS
    mass = DENSITY * math.pi * ring / EDGES
    ring += rest_gap * 10.0 * mass / (TENSION * math.pi / EDGES)  # gap of a node under its load
    angles = math.pi * (1.0 - np.arange(EDGES + 1) / EDGES)
    arc = ring * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)
    edge = 2.0 * ring * math.sin(math.pi / EDGES / 2.0)
    down = np.stack([0.0 * np.arange(LEG), 0.0 * np.arange(LEG), -edge * np.arange(1, LEG + 1)], axis=1)
    return np.vstack([(arc[0] + down)[::-1], arc, arc[-1] + down]), edge


def capstan(step: float, rest_gap: float, integrator: str) -> str:
    """A taut rope whose ends are held, on a drum that turns under it at a constant speed, without weight."""
    points, edge = around(rest_gap)
    length = edge * (len(points) - 1) / (1.0 + TENSION / STIFFNESS)
    setting = Setting(step=step, duration=0.2, rest_gap=rest_gap, floor=None, integrator=integrator)
    # a cylinder's axis is its own z: turned to lie along y
    return setting.text().replace("[gravity]\n", "[gravity]\nmagnitude = 0.0\n") + f"""
[[rope]]
name = "rope"
nodes = {len(points)}
length = {length}
linear_density = {DENSITY}
stretch_stiffness = {STIFFNESS}
stretch_damping = 2.0
bend_stiffness = 0.0
radius = {RADIUS}
initial = {{ shape = "points", points = {points.tolist()} }}
[[gripper]]
name = "left"
rope = "rope"
nodes = [0]
[[gripper]]
name = "right"
rope = "rope"
nodes = [-1]
[[body]]
name = "drum"
mass = {DRUM.mass}
inertia = {[*DRUM.inertia, 0.0, 0.0, 0.0]}
quaternion = [{math.sqrt(0.5)}, {-math.sqrt(0.5)}, 0.0, 0.0]
[[body.joint]]
name = "axle"
kind = "revolute"
axis = [0, 0, 1]
velocity = [{TURN}]
[[body.shape]]
{DRUM.shape()}friction = {MU}
[[actuator]]
name = "motor"
joint = "axle"
kind = "velocity"
damping = 1000.0
command = {{ kind = "hold", value = {TURN} }}
"""


def tension_ratio(s: States):
    """Of the tight leg over the slack one, at the end, from how far their first edges are stretched."""
    nodes = s.nodes()[-1]
    rest = around(s.rest_gap)[1] / (1.0 + TENSION / STIFFNESS)
    tight, slack = (np.sqrt(((nodes[i] - nodes[i + 1]) ** 2).sum()) / rest - 1.0 for i in (0, -2))
    return tight / slack


def polygon(mu, edges=EDGES):
    """Ratio of tensions over half a turn of a polygon whose corners touch; e^{μπ} in the limit of many.

    At a corner that turns by φ the edges' tensions balance the corner's load N and its friction along the tangent:
    T₁ cos φ/2 = T₂ cos φ/2 + μ N, N = (T₁ + T₂) sin φ/2, so T₁/T₂ = (1 + μ tan φ/2)/(1 − μ tan φ/2). The corners at the ends, with a
    straight leg along their tangent, make one such factor together.
    """
    half = mu * math.tan(math.pi / edges / 2.0)
    return ((1.0 + half) / (1.0 - half)) ** edges


# ---- A catenary over a pulley ----------------------------------------------------------------------------------------

PULLEY = 0.05  # radius [m]
WEIGHT = 0.05  # kg/m
HANG = {"length": 1.25, "hand": 0.0, "radius": PULLEY}  # of the rope; height of the hand [m]
SPAN = 0.5  # from the hand to the pulley's axis, which is at height 0 [m]


def solve_catenary(length, hand, radius):
    """(a, ψ) of the rope that hangs from (−SPAN, hand) to the pulley, over it and down to its free end.

    It is z = c + a cosh((x − x₀)/a) up to where it leaves the pulley, at ψ from the top; T = w (z − c) along all of it, also over the
    pulley, so the free end is at c. Newton's method with differences as its matrix: their error only slows the end of it.
    """

    def off(y):
        a, psi = y
        ring = radius + RADIUS
        x, z = -ring * np.sin(psi), ring * np.cos(psi)
        right = np.arcsinh(np.tan(psi))
        left = (-SPAN - x) / a + right
        c = z - a / np.cos(psi)
        found = a * (np.sinh(right) - np.sinh(left)) + ring * (0.5 * math.pi + psi) - c
        return np.array([c + a * np.cosh(left) - hand, found - length])

    y = np.array([0.5, 0.4]) + 0.0 * (length + hand + radius)
    for _ in range(40):
        matrix = np.stack([(off(y + d) - off(y - d)) / 2e-6 for d in 1e-6 * np.eye(2)], axis=1)
        y = y - np.linalg.solve(matrix, off(y))
    return y


def free_end(length, hand, radius):
    """Height of the free end [m]: the catenary's directrix."""
    a, psi = solve_catenary(length, hand, radius)
    return (radius + RADIUS) * np.cos(psi) - a / np.cos(psi)


@functools.cache
def hanging(nodes: int, lift: float) -> np.ndarray:
    """Nodes along the closed form, so much farther out on the pulley [m]."""
    a, psi = solve_catenary(**HANG)
    ring = PULLEY + RADIUS
    right = math.asinh(math.tan(psi))
    left = (-SPAN + ring * math.sin(psi)) / a + right
    first, second = a * (math.sinh(right) - math.sinh(left)), ring * (0.5 * math.pi + psi)
    c = ring * math.cos(psi) - a / math.cos(psi)
    out = []
    for s in np.linspace(0.0, HANG["length"], nodes):
        if s < first:
            u = math.asinh(math.sinh(left) + s / a)
            out.append([-ring * math.sin(psi) + a * (u - right), 0.0, c + a * math.cosh(u)])
        elif s < first + second:
            angle = (s - first) / ring - psi
            out.append([(ring + lift) * math.sin(angle), 0.0, (ring + lift) * math.cos(angle)])
        else:
            out.append([ring + lift, 0.0, -(s - first - second)])
    return np.array(out)


def catenary(edges: int):
    """A rope over a fixed pulley without friction, from near the closed form to rest in air."""

    def text(step: float, rest_gap: float, integrator: str) -> str:
        points = hanging(edges + 1, rest_gap)
        setting = Setting(step=step, duration=2.0, rest_gap=rest_gap, floor=None, integrator=integrator)
        return setting.text() + f"""
[[capsule]]
name = "pulley"
a = [0.0, -0.2, 0.0]
b = [0.0, 0.2, 0.0]
radius = {PULLEY}
friction = 0.0
[[rope]]
name = "rope"
nodes = {edges + 1}
length = {HANG["length"]}
linear_density = {WEIGHT}
stretch_stiffness = 10000.0
stretch_damping = 1.0
bend_stiffness = 0.0
drag_linear = 0.5
radius = {RADIUS}
initial = {{ shape = "points", points = {points.tolist()} }}
[[gripper]]
name = "hand"
rope = "rope"
nodes = [0]
"""

    return text


CASES = [
    Case(
        "capstan", "capstan: T₁/T₂ of 32 edges over half a turn, e^{μπ} in the limit of many", "-", {"mu": MU}, polygon,
        capstan, tension_ratio, {"mu": parameter("drum.shape[0].friction")},
    ),
    *(
        Case(
            f"catenary_{edges}", f"a rope over a pulley without friction ends at its catenary's directrix; {edges} edges", "m", HANG,
            free_end, catenary(edges), lambda s: s.nodes()[-1, -1, 2],
            {"length": parameter("rope.length"), "hand": control("hand.node[0].z"), "radius": parameter("pulley.radius")},
            integrators=("euler",), refine=False,
        )
        for edges in (50, 100)
    ),
]  # fmt: skip
