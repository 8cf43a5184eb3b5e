"""Blocks on blocks: loads under a stack, a block over an edge, a block pulled out from under another."""

from __future__ import annotations

import math

import numpy as np

from validation.bodies.contact import Free, G, Setting, Solid, scene
from validation.forms.case import Case, States, parameter, start_position
from validation.forms.sliding import hover

# ---- Loads under a stack ---------------------------------------------------------------------------------------------

COMPLIANCE = 1e-6  # m/N of each of the four corners of a face, so that every joint of the stack is a load cell
MASSES = (1.0, 2.0, 0.5)  # kg, from below
SIDES = (0.06, 0.05, 0.04)  # half the edges [m]: a face stands on the next larger one by its four corners


def stack(step: float, rest_gap: float, integrator: str) -> str:
    """Three cubes on a floor; the joints between them give by their compliance."""
    cubes, rules, height, under = "", "", 0.0, "floor"
    for k, (mass, side) in enumerate(zip(MASSES, SIDES, strict=True)):
        height += side + hover(4, rest_gap)  # shapes may not overlap as a scene begins: the joints give within the first steps
        cubes += Free(f"cube_{k}", Solid("box", (side,) * 3, mass), (0, 0, height), friction=0.5).text()
        rules += f'[[contact.pair]]\nbetween = ["{under}", "cube_{k}"]\ncompliance = {COMPLIANCE}\n'
        height, under = height + side, f"cube_{k}"
    return Setting(step=step, duration=1.0, rest_gap=rest_gap, floor=0.5, integrator=integrator).text() + cubes + rules


def load(k: int, s: States):
    """On the joint below cube k [N], from how far its four corners have sunk in.

    With the load L a corner gives by C L/4 and hovers at κ/(L/4): C L²/4 − sunk L − 4 κ = 0.
    """
    z = [s.position(f"cube_{i}_free")[-1, 2] for i in range(len(MASSES))]
    sunk = (z[k - 1] + SIDES[k - 1] if k else 0.0) + SIDES[k] - z[k]
    kappa = s.rest_gap * 10.0 * (min(MASSES[k - 1], MASSES[k]) if k else MASSES[0])
    return 2.0 * (sunk + np.sqrt(sunk**2 + 4.0 * COMPLIANCE * kappa)) / COMPLIANCE


def above(k: int):
    """Weight that joint k carries [N]."""
    return lambda **masses: sum(masses[f"m{i}"] for i in range(k, len(MASSES))) * G + 0.0 * masses["m0"]


# ---- A block over an edge --------------------------------------------------------------------------------------------

HALF = 0.05  # of the block's edges [m]
GRIP = 2.0  # friction of the table: the cube does not slip while it tips
BEYOND, WITHIN = {"d": 0.004, "time": 0.1}, {"d": -0.004}  # m by which its centre is beyond the table's edge; s
LEAN = 0.05  # rad by which the cube that tips leans as it starts, so that its far corners have left the table


def overhang(d: float, duration: float, lean: float = 0.0):
    """A cube whose centre, as it stands flat, is so far beyond the edge of a table."""

    def text(step: float, rest_gap: float, integrator: str) -> str:
        setting = Setting(step=step, duration=duration, rest_gap=rest_gap, floor=None, integrator=integrator)
        table = f'[[box]]\nname = "table"\nposition = [-0.2, 0.0, -0.1]\nhalf_extents = [0.2, 0.2, 0.1]\nfriction = {GRIP}\n'
        up = HALF + hover(2 if lean else 4, rest_gap)
        center = (d * math.cos(lean) + up * math.sin(lean), 0.0, up * math.cos(lean) - d * math.sin(lean))
        turned = (math.cos(0.5 * lean), 0.0, math.sin(0.5 * lean), 0.0)
        cube = Free("cube", Solid("box", (HALF,) * 3), center, turned, friction=None)
        return scene(setting, cube).replace("[[body]]", table + "[[body]]", 1)

    return text


def tipping(d, time):
    """Angular velocity of a cube that tips about an edge after some time [rad/s]: I θ″ = m g (d cos θ + a sin θ), θ(0) = LEAN.

    a is half its edge, I = m (2/3 a² + a² + d²); solved by RK4 in 1000 steps.
    """
    inertia = 5.0 / 3.0 * HALF**2 + d**2
    h, y = time / 1000.0, np.array([LEAN + 0.0 * d, 0.0 * d])

    def rate(y):
        return np.array([y[1], G * (d * np.cos(y[0]) + HALF * np.sin(y[0])) / inertia])

    for _ in range(1000):
        a = rate(y)
        b = rate(y + 0.5 * h * a)
        c = rate(y + 0.5 * h * b)
        y = y + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(y + h * c))
    return y[1]


# ---- A block pulled out from under another ---------------------------------------------------------------------------

LOWER, UPPER = 2.0, 1.0  # kg
PULL = {"force": 20.0, "below": 0.3, "between": 0.2, "time": 0.3}  # N, friction under and on the lower block, s


def pulled(step: float, rest_gap: float, integrator: str) -> str:
    """A block on another, which a motor pulls along x over the floor; both slide."""
    setting = Setting(step=step, duration=PULL["time"], rest_gap=rest_gap, floor=PULL["below"], integrator=integrator)
    plate, cube = Solid("box", (0.3, 0.1, 0.02), LOWER), Solid("box", (0.04, 0.04, 0.04), UPPER)
    height = plate.sizes[2] + hover(4, rest_gap)
    top = height + plate.sizes[2] + cube.sizes[2] + hover(4, rest_gap)
    axes = {"x": [1, 0, 0], "z": [0, 0, 1]}
    slides = [f'[[body.joint]]\nname = "plate_{name}"\nkind = "prismatic"\naxis = {axis}\n' for name, axis in axes.items()]
    return f"""{setting.text()}
[[actuator]]
name = "rope"
joint = "plate_x"
kind = "torque"
command = {{ kind = "hold", value = {PULL["force"]} }}
[[contact.pair]]
between = ["plate", "cube"]
friction = {PULL["between"]}
[[body]]
name = "plate"
position = [0.0, 0.0, {height}]
mass = {LOWER}
inertia = {[*plate.inertia, 0.0, 0.0, 0.0]}
{"".join(slides)}[[body.shape]]
{plate.shape()}{Free("cube", cube, (0, 0, top), friction=None).text()}"""


def plate_speed(force, below, between, time):
    """Of the lower block [m/s]."""
    return (force - below * (LOWER + UPPER) * G - between * UPPER * G) / LOWER * time


MASS_MOVES = {f"m{k}": parameter(f"cube_{k}.mass") for k in (0, 2)}
PULL_MOVES = {
    "below": parameter("floor.friction"),
    "between": parameter("contact.pair[0].friction"),
}

CASES = [
    *(
        Case(
            f"stack_load_{k}", f"the joint under block {k + 1} of 3 carries the weight above it", "N",
            {f"m{i}": m for i, m in enumerate(MASSES)}, above(k), stack, lambda s, k=k: load(k, s), MASS_MOVES,
            integrators=("euler",), refine=False,
        )
        for k in range(len(MASSES))
    ),
    Case(
        "block_within_edge", "a block with its centre 4 mm within an edge has no spin (errors in rad/s)", "rad/s", WITHIN,
        lambda d: 0.0 * d, overhang(WITHIN["d"], 0.5), lambda s: s.velocity("cube_free")[-1, 4], {"d": start_position({"cube_free.x": 1.0})}, scale=1.0,
    ),
    Case(
        "block_beyond_edge", "4 mm beyond it, it tips like a pendulum", "rad/s", BEYOND, tipping,
        overhang(BEYOND["d"], BEYOND["time"], LEAN), lambda s: s.velocity("cube_free")[-1, 4],
        {"d": start_position({"cube_free.x": math.cos(LEAN), "cube_free.z": -math.sin(LEAN)})},
    ),
    Case(
        "pulled_block", "a block under another: (F − μ₁ (m₁ + m₂) g − μ₂ m₂ g)/m₁ t", "m/s", PULL, plate_speed,
        pulled, lambda s: s.velocity("plate_x")[-1, 0], PULL_MOVES,
    ),
    Case(
        "carried_block", "the upper one: μ₂ g t", "m/s", PULL,
        lambda force, below, between, time: between * G * time + 0.0 * (force + below), pulled, lambda s: s.velocity("cube_free")[-1, 0], PULL_MOVES,
    ),
]  # fmt: skip
