"""Draws effects hidden in the cable of `cables.py` from a seed, and writes the cases; the same interface as `cases.py`.

Kinds: `null`, `effect` (a cause of the library at a random joint, link or servo, of the size that gives a λ of
`LAMBDAS` by `cable_oracle`), `outside` (what no candidate describes; its λ is what remains after the best
imitation). All cases have the same commands; noise, effect and the scene's guess are the seed's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.blind import arm_oracle, cable_logs, cable_oracle, cables
from validation.blind.cable_forces import Forces
from validation.blind.cable_oracle import MOTORS, pair
from validation.blind.cables import BALLS, BODIES, DAMPING, SLIDES, STIFFNESS, Effect
from validation.blind.case import BodyCase
from validation.blind.measure import Noise

LAMBDAS = (10.0, 30.0, 100.0, 1e3, 1e4, 1e5)
EXCITATION = 0
QUANTUM = 1e-4  # m
# an effect, the object it is at, and its true parameters by pliant's paths
Hidden = tuple[Effect, str, dict[str, float]]


@dataclass(kw_only=True)
class Case(BodyCase):
    """One blind case of a cable."""

    effect: Effect
    noise: Noise
    guess: float  # the scene's stiffness over the true one


def at_ball(attribute: str, base: float) -> Callable[[int, float, np.ndarray], Hidden]:
    def hidden(k: int, x: float, _: np.ndarray) -> Hidden:
        j = BALLS[k]
        return Effect(joint={j: {attribute: base + x}}), j, {f"{j}.{attribute}": base + x}

    return hidden


def at_slide(attribute: str, path: str) -> Callable[[int, float, np.ndarray], Hidden]:
    def hidden(k: int, x: float, _: np.ndarray) -> Hidden:
        j = SLIDES[k % 2]
        return Effect(joint={j: {attribute: x}}), j, {f"{j}.{path}": x}

    return hidden


def at_motor(attribute: str, path: str) -> Callable[[int, float, np.ndarray], Hidden]:
    def hidden(k: int, x: float, _: np.ndarray) -> Hidden:
        return Effect(**{attribute: pair(k % 2, x)}), MOTORS[k % 2], {f"{MOTORS[k % 2]}.{path}": x}

    return hidden


def of_vector(attribute: str, path: str, n: int) -> Callable[[int, float, np.ndarray], Hidden]:
    """A vector of size x in a direction of the seed."""

    def hidden(_: int, x: float, d: np.ndarray) -> Hidden:
        vector = tuple((x * d[:n] / np.linalg.norm(d[:n])).tolist())
        return Effect(**{attribute: vector}), "", {f"{path}[{a}]": value for a, value in enumerate(vector)}

    return hidden


def cubic(k: int, x: float, _: np.ndarray) -> Hidden:
    return Effect(forces=Forces(cubic={k: x})), BALLS[k], {f"{BALLS[k]}.cubic_stiffness": x}


def creep(k: int, x: float, _: np.ndarray) -> Hidden:
    return Effect(forces=Forces(creep={k: x})), BALLS[k], {f"{BALLS[k]}.plastic_time": 1.0 / x}


def inertia(k: int, x: float, _: np.ndarray) -> Hidden:
    """Mass further out along the link; pliant's spread is the root of the second moment over the mass."""
    second = cables.ACROSS - 0.5 * cables.ALONG + x
    truth = {f"{BODIES[k]}.spread[2]": float(np.sqrt(second / cables.MASS))}
    return Effect(spread={BODIES[k]: (0.0, 0.0, x)}), BODIES[k], truth


def centre(k: int, x: float, d: np.ndarray) -> Hidden:
    shift = x * d / np.linalg.norm(d)
    at = shift + (0.0, 0.0, -0.5 * cables.LINK)
    truth = {f"{BODIES[k]}.center_of_mass[{a}]": float(at[a]) for a in range(3)}
    return Effect(centre={BODIES[k]: tuple(shift.tolist())}), BODIES[k], truth


def payload(_: int, x: float, __: np.ndarray) -> Hidden:
    return Effect(mass={BODIES[-1]: 1.0 + x}), BODIES[-1], {f"{BODIES[-1]}.mass": cables.MASS * (1.0 + x)}


def gravity(_: int, x: float, __: np.ndarray) -> Hidden:
    return Effect(gravity=9.81 + x), "", {"gravity.magnitude": 9.81 + x}


def scale(_: int, x: float, __: np.ndarray) -> Hidden:
    return Effect(scale=1.0 + x), "", {"sensor.scale": 1.0 + x}


def late(_: int, x: float, __: np.ndarray) -> Hidden:
    return Effect(delay=x), "", {"sensor.time_offset": x}


# effect -> how it is hidden, its least and largest size, whether it has either sign
EFFECTS = {
    "joint_stiffness": (at_ball("stiffness", STIFFNESS), 5e-4, 8e-3, True),
    "viscous_friction": (at_ball("damping", DAMPING), 5e-5, 8e-4, True),
    "cubic_stiffness": (cubic, 2e-3, 1.0, False),
    "joint_plasticity": (creep, 0.05, 10.0, False),
    "armature": (at_ball("armature", 0.0), 1e-6, 1e-4, False),
    "link_inertia": (inertia, 3e-7, 6e-6, False),
    "center_of_mass": (centre, 1e-4, 1e-2, False),
    "payload": (payload, 0.01, 0.5, True),
    "viscous_friction (slide)": (at_slide("damping", "damping"), 0.3, 20.0, False),
    "coulomb_friction": (at_slide("frictionloss", "friction"), 0.05, 1.0, False),
    "torque_offset": (at_motor("offset", "offset"), 0.05, 5.0, True),
    "actuator_delay": (at_motor("late", "delay"), 1e-4, 2e-2, False),
    "actuator_lag": (at_motor("lag", "lag"), 1e-4, 2e-2, False),
    "gravity_tilt": (of_vector("tilt", "gravity.tilt", 2), 2e-4, 5e-2, False),
    "gravity_magnitude": (gravity, 0.01, 1.0, True),
    "sensor_bias": (of_vector("bias", "sensor.bias", 3), 1e-4, 1e-2, False),
    "frame_rotation": (of_vector("rotation", "sensor.rotation", 3), 2e-4, 5e-2, False),
    "length_scale": (scale, 2e-4, 5e-2, True),
    "time_offset": (late, 1e-4, 2e-2, False),
}
OUTSIDE = {
    "dry ball": (at_ball("frictionloss", 0.0), 1e-5, 2e-3, False),
    # where slack leaves a spring nothing, it is a spring that is missing: only the joint that turns most, and a little
    "slack": (lambda _, x, __: (Effect(forces=Forces(slack={0: x})), "", {}), 5e-3, 0.06, False),
    "drag": (lambda _, x, __: (Effect(forces=Forces(drag=x)), "", {}), 1e-4, 3e-2, False),
    "gust": (lambda _, x, d: (Effect(forces=Forces(gust=tuple(x * d[:2]))), "", {}), 1e-4, 2e-2, False),
    "magnet": (lambda _, x, __: (Effect(forces=Forces(pull=x)), "", {}), 1e-5, 5e-3, False),
}


def prepare() -> None:
    """Derivatives that every case needs, where they are not yet cached: minutes."""
    cable_oracle.known(EXCITATION)


def draw(seed: int, index: int, kind: str, names: list[str] | None = None) -> Case:
    """The case `index` of a seed; `names` restricts the effects."""
    rng = np.random.default_rng([seed, index, 3])
    sigma, colour = float(np.exp(rng.uniform(np.log(2e-4), np.log(6e-4)))), float(rng.uniform(0.0, 0.7))
    case = Case(
        index=index, family="cable", kind=kind, truth={}, effect=Effect(), noise=Noise(colour, sigma, QUANTUM),
        guess=float(np.exp(0.1 * np.clip(rng.standard_normal(), -2, 2))), data_seed=[seed, index, 1],
    )  # fmt: skip
    oracle = cable_oracle.Oracle(cable_oracle.known(EXCITATION), case.noise)
    case.mismatch_t2 = oracle.mismatch_t2()
    if kind != "null":
        table = OUTSIDE if kind == "outside" else EFFECTS
        case.cause = str(rng.choice([n for n in table if not names or n in names] or list(table)))
        case.name = "" if kind == "outside" else case.cause.split(" ")[0]
        hide(case, oracle, rng, *table[case.cause])
    return case


def hide(
    case: Case, oracle: cable_oracle.Oracle, rng: np.random.Generator,
    make: Callable[[int, float, np.ndarray], Hidden], low: float, high: float, either: bool,
) -> None:  # fmt: skip
    """Gives the effect the size of a λ of `LAMBDAS`, if that is within its ends; then λ, rivals, whether nameable."""
    k, d = int(rng.integers(len(BALLS))), rng.standard_normal(3)
    sign = float(rng.choice([-1.0, 1.0])) if either else 1.0
    size, wanted, lam = low, 0.0, 0.0
    for _ in range(6):  # sizes are not quite linear
        case.effect, case.object, case.truth = make(k, sign * size, d)
        u = oracle.change(case.effect)
        case.cosines, lam = oracle.cosines(u), float(u @ u)
        if case.kind == "outside":
            lam *= 1.0 - max(case.cosines.values()) ** 2
        if wanted == 0.0:
            reach = lam * (high / size) ** 2
            possible = [x for x in LAMBDAS[case.kind == "outside" :] if x <= reach]
            wanted = float(rng.choice(possible)) if possible else LAMBDAS[0]
        if 0.8 < lam / wanted < 1.25 or (size == high and lam < wanted):
            break
        size = float(np.clip(size * np.sqrt(wanted / max(lam, 1e-9)), 0.0, high))
    case.theta, case.lam_exact = sign * size, lam
    case.lam = max((x for x in LAMBDAS if x <= 1.25 * lam), default=0.0)
    if case.kind == "effect":
        own = f"{case.name}:{case.object}" if case.object else case.name
        dimensions = oracle.basis[own].shape[1]
        case.allowed, case.margin, case.rivals = arm_oracle.allows_name(lam, case.cosines, own, dimensions)


def truths(cases: list[Case]) -> dict[int, tuple]:
    """Nothing is shared between cases."""
    return {case.index: () for case in cases}


def write(case: Case, folder: Path) -> Path:
    """Scene and logs of a case; the truth is not among them. Returns the scene's path."""
    return cable_logs.write(case.effect, folder, case.data_seed, EXCITATION, case.noise, case.guess)
