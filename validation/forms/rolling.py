"""Spheres that slide until they roll, and roll down an incline."""

from __future__ import annotations

import numpy as np

from validation.bodies.contact import Free, G, Setting, Solid, scene
from validation.forms.case import Case, States, parameter, start_speed
from validation.forms.sliding import FRICTION, TILT, hover

BALL = Solid("sphere", (0.05,))
RADIUS = BALL.sizes[0]


def ball(mu: float, speed: float = 0.0, tilt: float = 0.0, duration: float = 0.5):
    """A solid sphere on a floor; downhill of a tilt is −x."""

    def text(step: float, rest_gap: float, integrator: str) -> str:
        setting = Setting(step=step, duration=duration, tilt=tilt, rest_gap=rest_gap, floor=mu, integrator=integrator)
        height = RADIUS + hover(1, rest_gap)
        return scene(setting, Free("ball", BALL, (0, 0, height), velocity=(speed, 0, 0, 0, 0, 0), friction=None))

    return text


def speed(s: States):
    """Along x at the end [m/s]."""
    return s.velocity("ball_free")[-1, 0]


def slid(s: States):
    """How far the ball has gone when it begins to roll [m].

    Its speed falls linearly from v₀ to its last one v at a time t*. So it stays ahead of a ball that had v from the beginning by
    (v₀ − v) t*/2, which gives t*; the way is v t* and that lead.
    """
    last, v0 = speed(s), s.velocity("ball_free")[0, 0]
    x = s.position("ball_free")[:, 0]
    lead = x[-1] - x[0] - last * s.h * (len(x) - 1)
    return lead + last * 2.0 * lead / (v0 - last)


# it begins to roll a third of a step after the end of one at 4 ms (see sliding.py)
AT = {"v0": 3.5 * 0.2 * G * 0.004 * (36 + 1 / 3), "mu": 0.2}
MOVES = {"mu": FRICTION, "v0": start_speed({"ball_free.x": 1.0})}
DOWN = {"alpha": 0.2, "g": G, "time": 0.5}

CASES = [
    Case(
        "ball_rolls", "a sliding ball comes to roll at 5/7 v₀", "m/s", AT, lambda v0, mu: 5.0 / 7.0 * v0 + 0.0 * mu,
        ball(AT["mu"], AT["v0"]), speed, MOVES,
    ),
    Case(
        "ball_slides", "a sliding ball goes 12 v₀²/(49 μ g) until it rolls", "m", AT, lambda v0, mu: 12.0 * v0**2 / (49.0 * mu * G),
        ball(AT["mu"], AT["v0"]), slid, MOVES,
    ),
    Case(
        "ball_downhill", "a ball rolls down an incline at 5/7 g sin α t", "m/s", DOWN,
        lambda alpha, g, time: 5.0 / 7.0 * g * np.sin(alpha) * time, ball(0.5, tilt=DOWN["alpha"]), lambda s: -speed(s), {"alpha": TILT, "g": parameter("gravity.magnitude")},
    ),
]  # fmt: skip
