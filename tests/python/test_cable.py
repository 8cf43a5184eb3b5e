"""Cables of capsules against the elastica, the beam's frequencies and the nodal rope of the same EI; and laid through a clip."""

import itertools
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pliant
import pytest
from scipy.integrate import solve_bvp

SCENES = Path(__file__).parents[1] / "scenes"
LENGTH, DENSITY, STIFFNESS, GRAVITY = 0.375, 0.034, 2e-3, 9.81
ROPE = f"""
schema_version = 1
[time]
step = {{step}}
integrator = "euler"
[gravity]
magnitude = {{gravity}}
[[rope]]
name = "rod"
nodes = {{nodes}}
length = {LENGTH}
linear_density = {DENSITY}
stretch_stiffness = 1e5
bend_stiffness = {STIFFNESS}
initial = {{{{ shape = "straight", from = [0, 0, 0.1], direction = [1, 0, 0] }}}}
[[gripper]]
name = "clamp"
rope = "rod"
end = "first"
mode = "prescribed"
motion = {{{{ kind = "hold" }}}}
"""


def cantilever(links, gravity=GRAVITY, step=1 / 240, **options):
    text = pliant.cable(
        links=links,
        length=LENGTH,
        linear_density=DENSITY,
        bend_stiffness=STIFFNESS,
        bend_damping=0.0,
        plasticity=0.0,
        clamped=True,
        **options,
    )
    # equilibria know no contact
    text = re.sub(r"\n\[\[body.shape\]\]\n(\w.*\n)+", "\n", text)
    text = text.replace(f"magnitude = {GRAVITY}", f"magnitude = {gravity}").replace(
        f"step = {1 / 240!r}", f"step = {step!r}"
    )
    return pliant.loads(text), tomllib.loads(text)


def rope(links, gravity=GRAVITY, step=1 / 240):
    return pliant.loads(ROPE.format(nodes=links + 1, gravity=gravity, step=step))


def tip(model, scene, q):
    positions, quaternions = model.body_poses(q)
    w, x, y, z = quaternions[-1]
    axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return positions[-1] + 2 * scene["body"][-1]["center_of_mass"][2] * axis


def elastica():
    """Height and reach of the tip under its own weight: EI t'' = rho A g (L - s) cos t, t(0) = 0, t'(L) = 0, t downwards."""
    weight = DENSITY * GRAVITY

    def slope(s, y):
        return np.vstack(
            [y[1], -weight * (LENGTH - s) * np.cos(y[0]) / STIFFNESS, np.cos(y[0]), np.sin(y[0])]
        )

    def ends(a, b):
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0, LENGTH, 50)
    found = solve_bvp(slope, ends, s, np.zeros((4, 50)), tol=1e-10, max_nodes=100000)
    assert found.success
    return np.array([found.y[2, -1], 0.0, 0.1 - found.y[3, -1]])


def test_a_cantilever_sags_as_the_elastica():
    """Second order in the length of links, as the nodal rope."""
    exact = elastica()
    errors, of_rope = [], []
    for links in (8, 16, 32):
        model, scene = cantilever(links)
        found = model.equilibrium(model.controls(1)[0])
        errors.append(np.linalg.norm(tip(model, scene, found.q) - exact))
        nodal = rope(links)
        end = nodal.equilibrium(nodal.controls(1)[0]).q.reshape(-1, 3)[nodal.ropes["rod"]][-1]
        of_rope.append(np.linalg.norm(end - exact))
    print(
        "sag: tip off by, of the length:",
        [f"{e / LENGTH:.1e}" for e in errors],
        "rope:",
        [f"{e / LENGTH:.1e}" for e in of_rope],
    )
    assert exact[2] < 0.1 - 0.3 * LENGTH  # it sags far
    assert errors[2] < 1e-3 * LENGTH
    for coarse, fine in itertools.pairwise(errors):
        assert 3.3 < coarse / fine < 4.7
    assert errors[2] < 3 * of_rope[2]


def frequencies(model):
    """Angular frequencies of small motion about the start, in ascending order: Euler's step has 1/(1 - i h w) as eigenvalues."""
    a, _, _ = model.rollout(model.initial_state(), model.controls(1)).linearize(0)
    values = np.linalg.eigvals(a)
    values = values[np.abs(values.imag) > 1e-6]
    return np.unique(np.round(np.abs(1 / values - 1) / model.step_length, 6))


def test_it_swings_as_a_beam():
    first = 1.8751040687**2 * math.sqrt(STIFFNESS / DENSITY) / LENGTH**2
    errors, of_rope = [], []
    for links in (8, 16, 32):
        model, _ = cantilever(links, gravity=0.0, step=1e-4)
        errors.append(frequencies(model)[0] / first - 1)
        of_rope.append(frequencies(rope(links, gravity=0.0, step=1e-4))[0] / first - 1)
    print(
        "first frequency off by:",
        [f"{e:.1e}" for e in errors],
        "rope:",
        [f"{e:.1e}" for e in of_rope],
    )
    assert abs(errors[2]) < 1e-3
    assert 3.0 < errors[0] / errors[1] < 5.0
    assert abs(errors[2]) < 2.5 * abs(of_rope[2])


def test_twist_has_a_stiffness_of_its_own():
    """The first torsion of a clamped rod, pi/2 sqrt(GJ/(rho J))/L with rho J = rho A r^2/2."""
    torsion = 1e-4
    model, scene = cantilever(24, gravity=0.0, step=1e-6, twist_stiffness=torsion)
    kinds = [[j["kind"] for j in b["joint"]] for b in scene["body"]]
    assert kinds == [["universal", "revolute"]] * 24
    wanted = math.pi / 2 * math.sqrt(torsion / (DENSITY * 0.003**2 / 2)) / LENGTH
    nearest = frequencies(model)[np.abs(frequencies(model) - wanted).argmin()]
    assert nearest == pytest.approx(wanted, rel=2e-3)
    # bending is as it was
    first = 1.8751040687**2 * math.sqrt(STIFFNESS / DENSITY) / LENGTH**2
    assert frequencies(cantilever(24, 0.0, 1e-4, twist_stiffness=torsion)[0])[0] == pytest.approx(
        first, rel=2e-3
    )


def test_the_defaults_are_silos():
    scene = tomllib.loads(pliant.cable())
    assert len(scene["body"]) == 18
    assert scene["body"][0]["joint"] == [{"name": "cable_free", "kind": "free"}]
    joint = scene["body"][5]["joint"][0]
    assert (joint["kind"], joint["stiffness"], joint["damping"]) == (
        "ball",
        pytest.approx(1e-2),
        pytest.approx(1e-3),
    )
    assert joint["plastic_time"] == pytest.approx(1 / 240 / 0.7)
    shape = scene["body"][5]["shape"][0]
    assert (shape["kind"], shape["radius"]) == ("capsule", 0.003)
    mass = sum(b["mass"] for b in scene["body"])
    assert mass == pytest.approx(1200 * math.pi * 0.003**2 * 0.375)
    # EI does not change with the number of links, so the drives do
    finer = tomllib.loads(pliant.cable(links=36))
    assert finer["body"][5]["joint"][0]["stiffness"] == pytest.approx(2e-2)


CLIPPED = {
    "position": [-0.1875, 0.001, 0.02],
    "floor": -0.003,
    "clips": [
        {"position": [0.0, 0.0, 0.0], "opening": 0.01, "depth": 0.03},
        {"position": [0.12, 0.0, 0.0], "opening": 0.01},
    ],
}


def test_it_is_laid_through_clips():
    text = pliant.cable(**CLIPPED)
    assert text == (SCENES / "cable_clip.toml").read_text()
    model = pliant.loads(text)
    # pressed sideways by a tenth of its weight, it stays between the walls and comes to rest on their floors
    text = text.replace(f"magnitude = {GRAVITY}\n", f"magnitude = {GRAVITY}\ntilt = [0.1, 0.0]\n")
    model = pliant.loads(text)
    roll = model.rollout(model.initial_state(), model.controls(), record=False)
    positions, quaternions = model.body_poses(roll.x[-1][: 7 + 17 * 4])
    w, x, y, z = quaternions.T
    axes = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    middles = positions + 0.375 / 36 * axes
    within = np.abs(middles[:, 0]) < 0.015
    assert within.sum() >= 1
    assert np.abs(middles[within, 1]).max() < 0.005 - 0.003 + 1e-5
    assert (middles[within, 2] > 0.003 - 1e-5).all() and (middles[within, 2] < 0.004).all()
    # outside it lies on the floor
    assert middles[:, 2].min() < 0.0005 and middles[:, 2].min() > -1e-5
    # its links stay where they are
    before, _ = model.body_poses(roll.x[-25][: 7 + 17 * 4])
    assert np.abs(positions - before).max() < 1e-3


def test_cables_that_cannot_be_are_refused():
    for options, words in [
        (
            {"links": 100},
            r"cable.links: 100 links are 0.00375 m long each, no longer than they are thick \(0.006 m\)",
        ),
        ({"plasticity": 1.5}, r"cable.plasticity: is 1.5, but must lie between 0 and 1"),
        ({"length": -1.0}, r"cable.length: is -1 m, but must be positive"),
        ({"direction": [0, 0, 0]}, r"cable.direction: has length zero"),
        ({"clips": [{"wall": 0.0}]}, r"clip\[0\].wall: is 0 m, but must be positive"),
        ({"clips": [{"with": 1.0}]}, r"clips\[0\]: unknown key `with`"),
        ({"name": "my cable"}, r"the name \"my cable_0\" cannot be part of a parameter path"),
    ]:
        with pytest.raises(pliant.InputError, match=words):
            pliant.cable(**options)
