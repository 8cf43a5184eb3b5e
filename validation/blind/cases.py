"""Draws hidden effects from a seed, simulates them in one batch per family, and writes the cases.

Kinds: `null` (λ = 0), `effect` (a cause of the library at λ ∈ {10, 30, 100, 1000}), `outside` (an effect
no candidate describes, of the size that leaves λ (1 - ρ²) ∈ {30, 100, 1000} after the best imitation).
The truth's EI is the family's nominal one; the scene given to the tool holds a wrong guess of it
(log-normal, 20 %), to be refitted. An effect's size is θ = √λ/|U d| by the oracle, d a unit direction.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from validation.blind import measure, oracle, rope_ode
from validation.blind.case import BlindCase
from validation.blind.families import FAMILIES, Family

LAMBDAS = (10.0, 30.0, 100.0, 1000.0)
REST_LAMBDAS = (30.0, 100.0, 1000.0)
POSITIVE = ("c1", "c2", "cb", "EA", "tip", "delay")  # one admissible sign
LIMIT = {  # largest size that is still the physics meant (others: 1.0)
    "hardening": 5.0,
    "gradient": 0.8,
    "magnet": 0.05,
    "friction": 1.0e-3,
    "EA": 0.05,
}


@dataclass(kw_only=True)
class Case(BlindCase):
    """One blind case of a rope."""

    lam_beyond_all: float = 0.0  # `outside`: what remains after the best joint imitation by all candidates
    weights: dict[str, float] = field(default_factory=dict)
    noise: measure.Noise
    stiffness_guess: float


def draw(seed: int, index: int, kind: str, names: list[str] | None = None) -> Case:
    """The case `index` of a seed. Redraws until the effect exists in the family and is of a sane size."""
    rng = np.random.default_rng([seed, index])
    while True:
        family = FAMILIES[str(rng.choice(names or list(FAMILIES)))]
        noise = measure.Noise(phi=float(rng.uniform(0.5, 0.9)), sigma=float(rng.uniform(1e-3, 2e-3)))
        judge = oracle.Oracle(oracle.sensitivity(family), noise.phi, noise.sigma, noise.quantum)
        guess = float(family.nominal["EI"] * np.exp(0.2 * np.clip(rng.standard_normal(), -2, 2)))
        case = Case(
            index=index, family=family.name, kind=kind, truth={"cable.bend_stiffness": family.nominal["EI"]}, noise=noise,
            stiffness_guess=guess, data_seed=[seed, index, 1], mismatch_t2=max(judge.mismatch_t2().values()),
        )  # fmt: skip
        if kind == "null" or (hide(case, judge, rng) and plausible(case)):
            return case


def hide(case: Case, judge: oracle.Oracle, rng: np.random.Generator) -> bool:
    """Choose the effect, its direction and size. False where the family does not feel it."""
    family = judge.family
    if case.kind == "outside":
        key = str(rng.choice([k for k in oracle.OUTSIDE_STEP if k != "lag"]))
        u = judge.u[key]
        case.cosines = judge.cosines(u)
        rest = 1.0 - max(case.cosines.values()) ** 2
        if rest < 0.05:  # all but inside the library
            return False
        case.cause, case.lam, case.weights = key, float(rng.choice(REST_LAMBDAS)), {key: 1.0}
        case.theta = float(np.sqrt(case.lam / rest) / np.linalg.norm(u))
        everything = oracle.orthonormal(list(np.hstack(list(judge.basis.values())).T))
        case.lam_beyond_all = float(np.sum((u - everything @ (everything.T @ u)) ** 2) * case.theta**2)
        return True
    table = oracle.causes(family)
    case.cause = str(rng.choice(list(table)))
    case.name, keys = table[case.cause]
    case.object = case.cause.partition(":")[2]
    case.lam = float(rng.choice(LAMBDAS))
    d = rng.standard_normal(len(keys))
    if case.name == "wind" and rng.random() < 0.5:
        d[2] = 0.0  # level wind
    if keys[0] in POSITIVE:
        d = np.abs(d)
    case.weights = dict(zip(keys, (d / np.linalg.norm(d)).tolist(), strict=True))
    u = judge.direction(case.weights)
    if np.linalg.norm(u) < 1.0e-3 * sum(judge.raw[k] * abs(w) for k, w in case.weights.items()):
        return False
    case.theta = float(np.sqrt(case.lam) / np.linalg.norm(u))
    case.cosines = judge.cosines(u)
    case.allowed, case.margin, case.rivals = judge.allows_name(u, case.cause, case.theta)
    zero = {"sensor.scale": 1.0}
    for key, weight in case.weights.items():
        path = oracle.path_of(key)
        nominal = family.nominal.get(key, zero.get(path, 0.0))
        value = nominal + weight * case.theta
        case.truth[path] = 1.0 / (1.0 / nominal + weight * case.theta) if key == "EA" else value
    return True


def plausible(case: Case) -> bool:
    return all(case.theta * abs(w) <= LIMIT.get(key, 1.0) for key, w in case.weights.items())


def changes(family: Family, case: Case) -> dict:
    """Generator parameters of the hidden truth (sensor faults excluded)."""
    out: dict = {}
    for key, weight in case.weights.items():
        if key in oracle.SENSOR:
            continue
        for name, value in oracle.change(family, key, weight * case.theta).items():
            if name in out and isinstance(value, list):
                value = [a + b for a, b in zip(out[name], value, strict=True)]
            out[name] = value
    return out


def sensor(case: Case) -> measure.Sensor:
    """Faults of the marker sensor of the hidden truth."""
    size = {key: weight * case.theta for key, weight in case.weights.items()}
    return measure.Sensor(
        bias=np.array([size.get(f"bias{i}", 0.0) for i in range(3)]),
        rotation=np.array([size.get(f"rotation{i}", 0.0) for i in range(3)]),
        scale=1.0 + size.get("scale", 0.0),
        delay=size.get("delay", 0.0),
    )


def truths(cases: list[Case]) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Noise-free y, ẏ (record, T, 3, m) of every case; one ODE batch per family."""
    out = {}
    for name in dict.fromkeys(case.family for case in cases):
        family, known = FAMILIES[name], oracle.sensitivity(FAMILIES[name])
        own = [case for case in cases if case.family == name]
        physical = [(case, changes(family, case)) for case in own]
        out |= {case.index: (known.y, known.y_dot) for case, change in physical if not change}
        physical = [(case, change) for case, change in physical if change]
        physical.sort(key=lambda pair: rope_ode.stable_step(family, rope_ode.parameters(family, [pair[1]])))
        n_records = len(family.records)
        for start in range(0, len(physical), 30):  # variants of like stiffness share a step
            part = physical[start : start + 30]
            p = rope_ode.parameters(family, [change for _, change in part for _ in range(n_records)])
            records = np.tile(np.arange(n_records), len(part))
            q, v = rope_ode.simulate(family, p, records, known.shape)
            y, y_dot = (oracle.by_record(family, x, n_records) for x in (q, v))
            out |= {case.index: (y[i], y_dot[i]) for i, (case, _) in enumerate(part)}
    return out


def readings(case: Case, y: np.ndarray, y_dot: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Noisy records of a case: (reading, times) each."""
    family = FAMILIES[case.family]
    rng = np.random.default_rng(case.data_seed)
    return [
        measure.observe(family, y[r], y_dot[r], sensor(case), case.noise, rng)
        for r in range(len(family.records))
    ]


def write(case: Case, y: np.ndarray, y_dot: np.ndarray, folder: Path) -> Path:
    """Scene and logs of a case; the truth is not among them. Returns the scene's path."""
    family = FAMILIES[case.family]
    folder.mkdir(parents=True, exist_ok=True)
    logs = []
    for r, (reading, t) in enumerate(readings(case, y, y_dot)):
        logs.append((f"run{r + 1}.csv", family.roles[r]))
        measure.write_log(folder / logs[-1][0], family, r, reading, t)
    shape = oracle.sensitivity(family).shape
    scene = folder / "scene.toml"
    scene.write_text(measure.scene_text(family, shape, logs, case.stiffness_guess), encoding="utf-8")
    return scene
