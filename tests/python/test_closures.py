"""Closed loops: a four-bar linkage against its motion with one degree of freedom, and two bodies welded into one."""

import math
from pathlib import Path

import numpy as np
import pliant
import pytest
from scipy.integrate import solve_ivp

SCENE = (Path(__file__).parents[1] / "scenes" / "four_bar.toml").read_text()
GRAVITY, DAMPING = 9.81, 0.002
# crank, coupler, rocker: mass [kg], centre from its hinge (x, z) [m], inertia about it and y [kg m2]
LINKS = ((0.4, (0.0, 0.075), 0.0008), (0.6, (0.15, 0.05), 0.0052), (0.5, (-0.05, 0.125), 0.0031))
CRANK, COUPLER, ROCKER = np.array([0.0, 0.15]), np.array([0.3, 0.1]), np.array([-0.1, 0.25])
BASE = np.array([0.4, 0.0])


def turned(angle, r):
    """A vector (x, z) turned about +y, which takes z towards x."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * r[0] + s * r[1], -s * r[0] + c * r[1]])


def swept(angle, r):
    """d(turned)/d(angle)."""
    return turned(angle + math.pi / 2, r)


def closed(crank, guess):
    """Angles of coupler and rocker that close the loop."""
    b, c = guess
    for _ in range(50):
        gap = turned(crank, CRANK) + turned(b, COUPLER) - BASE - turned(c, ROCKER)
        step = np.linalg.solve(np.column_stack([swept(b, COUPLER), -swept(c, ROCKER)]), -gap)
        b, c = b + step[0], c + step[1]
        if np.abs(step).max() < 1e-14:
            break
    return b, c


def reduced(crank, guess):
    """Effective inertia M(a) [kg m2] and weight V(a) [J] of the crank's angle, with the other two angles."""
    b, c = closed(crank, guess)
    by = np.linalg.solve(np.column_stack([swept(b, COUPLER), -swept(c, ROCKER)]), -swept(crank, CRANK))
    rates, angles = (1.0, by[0], by[1]), (crank, b, c)
    hinges = (np.zeros(2), turned(crank, CRANK), BASE)
    hinge_rates = (np.zeros(2), swept(crank, CRANK), np.zeros(2))
    inertia, weight = 0.0, 0.0
    for (m, r, j), angle, rate, hinge, hinge_rate in zip(LINKS, angles, rates, hinges, hinge_rates):
        speed = hinge_rate + rate * swept(angle, r)
        inertia += m * speed @ speed + j * rate**2
        weight += m * GRAVITY * (hinge + turned(angle, r))[1]
    return inertia, weight, (b, c)


def exact(duration):
    """Crank, coupler (absolute) and rocker angle at the end, from a start at 1 rad/s."""

    def rate(_, y):
        a, w = y
        eps = 1e-5
        here, _, _ = reduced(a, guess_at(a))
        up, down = reduced(a + eps, guess_at(a)), reduced(a - eps, guess_at(a))
        slope, force = (up[0] - down[0]) / (2 * eps), (up[1] - down[1]) / (2 * eps)
        return [w, (-0.5 * slope * w * w - force - DAMPING * w) / here]

    known = {"at": (0.0, 0.0)}

    def guess_at(a):
        known["at"] = closed(a, known["at"])
        return known["at"]

    run = solve_ivp(rate, (0.0, duration), [0.0, 1.0], method="DOP853", rtol=1e-11, atol=1e-12)
    a = run.y[0, -1]
    return np.array([a, *closed(a, known["at"])])


def final_angles(step):
    model = pliant.loads(SCENE.replace("step = 0.004166666666666667", f"step = {step!r}").replace("duration = 0.5", "duration = 0.4"))
    q = model.rollout(model.initial_state(), model.controls()).x[-1][:3]
    return np.array([q[0], q[0] + q[1], q[2]])


def test_a_four_bar_linkage_moves_as_one_degree_of_freedom():
    expected = exact(0.4)
    coarse, fine = (np.abs(final_angles(h) - expected).max() for h in (1 / 240, 1 / 480))
    assert fine < 2e-4
    # what holds at the end of each stage takes sdirk2 down towards first order
    assert 1.9 < coarse / fine, (coarse, fine)


def test_the_loop_stays_closed_to_rest_gaps():
    model = pliant.loads(SCENE)
    for x in model.rollout(model.initial_state(), model.controls()).x:
        a, b, c = x[0], x[0] + x[1], x[2]
        gap = turned(a, CRANK) + turned(b, COUPLER) - BASE - turned(c, ROCKER)
        # a rest gap under the lighter body's weight, and up to fifty times that load
        assert np.abs(gap).max() < 5e-8


def test_closures_that_cannot_be_are_refused():
    with pytest.raises(pliant.InputError, match=r"closure\[0\]\.to.*there is no body \"rockr\"(.|\n)*did you mean \"rocker\""):
        pliant.loads(SCENE.replace('to = "rocker"', 'to = "rockr"'))
    with pytest.raises(pliant.InputError, match=r"closure\[0\]\.to_point.* m apart as the scene begins"):
        pliant.loads(SCENE + "to_point = [0, 0, 0]\n")
    with pytest.raises(pliant.InputError, match=r"midpoint integrator cannot be used with closures"):
        pliant.loads(SCENE.replace('"sdirk2"', '"midpoint"'))
