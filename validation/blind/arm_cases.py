"""Draws effects hidden in the arm of `arms.py` from a seed, and writes the cases; the same interface as `cases.py`.

Kinds: `null`, `effect` (a cause of the library at a random joint, with noise and excitation of the seed, of the size that gives a λ of
`LAMBDAS` by `arm_oracle`), `outside` (what no candidate describes; its λ is what remains after the best imitation).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.blind import arm_oracle, arms
from validation.blind.arm_oracle import JOINTS, PEAK, changed, nothing, pair
from validation.blind.case import BodyCase

LAMBDAS = (10.0, 30.0, 100.0, 1e3, 1e4, 1e5, 1e6)
RECORDS, FITTED = 6, 4
DURATION = 2.0  # s
# effect -> sizes of both ends, drawn log-uniformly; None: with a random sign
EFFECTS = {
    "viscous_friction": (2e-3, 5e-2, 1),
    "coulomb_friction": (5e-3, 0.1, 1),
    "joint_stiffness": (0.02, 0.5, 1),
    "armature": (1e-3, 2e-2, 1),
    "torque_gain": (0.01, 0.2, 0),
    "torque_offset": (5e-3, 0.1, 0),
    "actuator_delay": (1e-3, 2e-2, 1),
    "actuator_lag": (1e-3, 3e-2, 1),
    "saturation": (0.4, 0.9, 1),
    "asymmetric_friction": (0.1, 1.0, 1),
    "load_friction": (0.02, 0.2, 1),
    "sensor_delay": (1e-3, 2e-2, 1),
    "encoder_bias": (3e-3, 5e-2, 0),
    "encoder_scale": (3e-3, 5e-2, 0),
    "gravity_tilt": (3e-3, 5e-2, 0),
}
OUTSIDE = {"ripple": (0.01, 0.1), "quadratic": (3e-3, 3e-2), "backlash": (3e-3, 2e-2)}


@dataclass(kw_only=True)
class Case(BodyCase):
    """One blind case of an arm."""

    effect: arms.Effect
    size: float  # of the excitation
    sigma: float
    colour: float
    guess: float  # the scene's number over the true one


def change_of(name: str, k: int, x: float, size: float) -> tuple[dict, str, dict[str, float]]:
    """What an effect changes, the object it is at, and its true parameters by pliant's paths; `k` is the joint."""
    j, motor = JOINTS[k], f"motor_{JOINTS[k]}"
    attributes = {"viscous_friction": "damping", "coulomb_friction": "frictionloss"}
    attributes |= {"joint_stiffness": "stiffness", "armature": "armature"}
    if name in attributes:
        path = {"frictionloss": "friction"}.get(attributes[name], attributes[name])
        return {"joint": {j: {attributes[name]: x}}}, j, {f"{j}.{path}": x}
    if name == "asymmetric_friction":
        c = 0.05 if k == 0 else 0.02
        push = 0.5 * c * x
        change = {"joint": {j: {"frictionloss": c + push}}, "push": pair(k, push)}
        return change, j, {f"{j}.friction_backward": c * (1.0 + x)}
    if name == "saturation":
        x *= PEAK[k] * size
    table = {
        "torque_gain": ({"gain": pair(k, 1.0 + x, 1.0)}, motor, {f"{motor}.gain": 1.0 + x}),
        "torque_offset": ({"offset": pair(k, x)}, motor, {f"{motor}.offset": x}),
        "actuator_delay": ({"late": pair(k, x)}, motor, {f"{motor}.delay": x}),
        "actuator_lag": ({"lag": pair(k, x)}, motor, {f"{motor}.lag": x}),
        "saturation": ({"limit": pair(k, x, np.inf)}, motor, {f"{motor}.saturation": x}),
        "load_friction": ({"load": pair(k, x)}, j, {f"{j}.load_friction": x}),
        "sensor_delay": ({"delay": x}, "", {"sensor.time_offset": x}),
        "encoder_bias": ({"bias": pair(k, x)}, j, {f"{j}.position_bias": x}),
        "encoder_scale": ({"scale": pair(k, 1.0 + x, 1.0)}, j, {f"{j}.position_scale": 1.0 + x}),
        "gravity_tilt": ({"tilt": x}, "", {}),
        "ripple": ({"ripple": pair(k, x)}, "", {}),
        "quadratic": ({"quadratic": pair(k, x)}, "", {}),
        "backlash": ({"play": pair(k, x)}, "", {}),
    }
    return table[name]


def draw(seed: int, index: int, kind: str, names: list[str] | None = None) -> Case:
    """The case `index` of a seed; `names` restricts the effects."""
    rng, data_seed = np.random.default_rng([seed, index, 2]), [seed, index, 1]
    sigma, colour = float(np.exp(rng.uniform(np.log(3e-4), np.log(1e-3)))), float(rng.uniform(0.0, 0.7))
    size = float(rng.uniform(0.6, 1.2))
    guess = float(arms.LOWER_MASS * np.exp(0.1 * np.clip(rng.standard_normal(), -2, 2)))
    k = int(rng.integers(2))
    name, x = "", 0.0
    if kind != "null":
        pool = list(OUTSIDE if kind == "outside" else EFFECTS)
        name = str(rng.choice([n for n in pool if not names or n in names] or pool))
        low, high, *sign = (OUTSIDE if kind == "outside" else EFFECTS)[name]
        x = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        x *= 1.0 if not sign or sign[0] else float(rng.choice([-1.0, 1.0]))
    known = pair(k, 0.05 if k == 0 else 0.02) if name == "asymmetric_friction" else (0.0, 0.0)
    case = Case(
        index=index, family="arm", kind=kind, cause=name, name="" if kind == "outside" else name, theta=x,
        truth={"lower.mass": arms.LOWER_MASS}, effect=nothing(known), size=size, sigma=sigma, colour=colour, guess=guess,
        data_seed=data_seed,
    )  # fmt: skip
    judge(case, k, rng)
    return case


def judge(case: Case, k: int, rng: np.random.Generator) -> None:
    """Gives the effect the size of a λ drawn from `LAMBDAS`, if that is within its ends; then λ, rivals, whether it is nameable."""
    seeds = np.random.default_rng(case.data_seed)
    known = case.effect.known_friction
    base = nothing(known)
    motions = [arms.motion(base, r, np.random.default_rng(seeds.integers(2**63)), case.size, DURATION) for r in range(FITTED)]
    spread = float(np.hypot(case.sigma, arms.QUANTUM / np.sqrt(12.0)))
    oracle = arm_oracle.Oracle(arm_oracle.cut(motions), base, spread, case.colour)
    table = arm_oracle.candidates(known, case.size)
    directions = dict(zip(table, oracle.changes(list(table.values())), strict=True))
    norms = {key: np.linalg.norm(d) for key, d in directions.items()}
    directions = {key: d for key, d in directions.items() if norms[key] > 1e-9}
    case.mismatch_t2 = max(float((d @ oracle.mismatch / norms[key]) ** 2) for key, d in directions.items())
    if case.kind == "null":
        return
    (_, high, *_) = (OUTSIDE if case.kind == "outside" else EFFECTS)[case.cause]
    wanted, lam = 0.0, 0.0
    for _ in range(6):  # sizes are not quite linear
        change, case.object, truth = change_of(case.cause, k, case.theta, case.size)
        (u,) = oracle.changes([change])
        case.cosines = arm_oracle.cosines(directions, u)
        lam = float(u @ u)
        if case.kind == "outside":
            lam *= 1.0 - max(case.cosines.values()) ** 2
        if case.cause == "saturation":  # a lower limit until it is reached
            if lam >= LAMBDAS[0]:
                break
            case.theta *= 0.8
            continue
        if wanted == 0.0:
            reach = lam * (high / abs(case.theta)) ** 2
            wanted = float(rng.choice([x for x in LAMBDAS[case.kind == "outside" :] if x <= reach]))
        if 0.8 < lam / wanted < 1.25:
            break
        case.theta *= float(np.sqrt(wanted / max(lam, 1e-6)))
    case.effect = changed(base, change)
    case.truth |= truth
    if case.kind == "effect":
        own = f"{case.name}:{case.object}" if case.object else case.name
        case.allowed, case.margin, case.rivals = arm_oracle.allows_name(lam, case.cosines, own)
    case.lam_exact = lam
    case.lam = max((x for x in LAMBDAS if x <= 1.25 * lam), default=0.0)


def truths(cases: list[Case]) -> dict[int, tuple]:
    """Nothing is shared between cases."""
    return {case.index: () for case in cases}


def write(case: Case, folder: Path) -> Path:
    """Scene and logs of a case; the truth is not among them. Returns the scene's path."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(case.data_seed)
    names = [f"run{k + 1}.csv" for k in range(RECORDS)]
    for k, name in enumerate(names):
        own = np.random.default_rng(rng.integers(2**63))
        t, q, u = arms.record(case.effect, k, own, case.size, case.sigma, case.colour, DURATION)
        header = "t,q_shoulder,q_elbow,u_shoulder,u_elbow"
        np.savetxt(folder / name, np.column_stack([t, q, u]), "%.7g", ",", header=header, comments="")
    held_out = [k >= FITTED for k in range(RECORDS)]
    scene = folder / "scene.toml"
    text = arms.scene(names, held_out, case.guess, case.effect.known_friction, arm_oracle.EVERY)
    scene.write_text(text, encoding="utf-8")
    return scene


