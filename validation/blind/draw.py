"""Draws the cases of a batch from its seed: system, noise, what is hidden and how large.

    null        nothing is hidden; in every fourth the scene's own numerics are wrong on purpose (`numerics`: "step" or "commands")
    effect      one cause of the library
    pair        two of them at once
    varies      one, of another size in every record
    some        one, in some of the records only
    value       a number of the scene is wrong that it does not declare free, and that no cause stands for
    outside     an effect that no candidate describes
    symmetric   a cause that another one imitates exactly

Sizes are such that λ of `judge.py` is one of `LAMBDAS` (of `outside` and `value`: what the best imitation leaves of it).
"""

from __future__ import annotations

import functools
import operator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from validation.blind import cable_setup, chains, ropes, toss
from validation.blind.judge import HIDDEN, Judge
from validation.blind.noise import KINDS as NOISES
from validation.blind.noise import Noise
from validation.blind.score import SYMMETRIC
from validation.blind.system import Cause, Changes, Setup

LAMBDAS = (10.0, 30.0, 100.0, 1e3, 1e5)
STRONG = (100.0, 1e3, 1e5)
SAME = 2.0  # λ (1 - ρ²) of two causes that count as exact symmetries, at most: what no test tells apart
SHARES = {"null": 0.34, "effect": 0.26, "pair": 0.07, "varies": 0.07, "some": 0.03, "value": 0.04, "outside": 0.12, "symmetric": 0.07}
# system -> share of the cases; many cheap ones and a few costly
SYSTEMS = {
    "pendulum": 0.20, "cart": 0.18, "cart_pole": 0.12, "arm2": 0.20, "toss": 0.12, "arm3": 0.10, "arm5": 0.05, "arm7": 0.03,
    "pendant": 0.06, "one_end": 0.03, "two_ends": 0.03, "cable": 0.04, "rod": 0.04,
}  # fmt: skip
# systems that are drawn only where they are asked for by name: the cases of a seed stay what they were
BY_NAME = {"cloth": 0.04}
# of these systems every number has its cause; a rod that two grippers hold has no exact symmetry
RULED_OUT = dict.fromkeys(("cart", "pendulum", "toss", "cable", *ropes.SYSTEMS), ("value",)) | dict.fromkeys(("rod", "cloth"), ("value", "symmetric"))
# causes that came later are hidden from these seeds on: the cases of earlier ones stay what they were
LATER = {"drive_stiffness": 1012, "encoder_drift": 1012}
FINEST = 64  # steps of a scene in a sample, at most
WRONG_NUMERICS = 30.0  # t² of the scene's own step or interpolation, at least


@dataclass(kw_only=True)
class Case:
    """A case and all that is known of it. `hidden`: causes with their true values by path, for each record where they differ."""

    seed: int
    index: int
    system: str
    kind: str
    noise: str
    numerics: str = ""
    hidden: list[dict] = field(default_factory=list)
    lam: float = 0.0  # the λ aimed at
    lam_exact: float = 0.0
    lam_varies: float = 0.0  # what one size for all records leaves
    allowed: bool = False
    margin: float = 0.0
    rivals: list[str] = field(default_factory=list)
    cosines: dict[str, float] = field(default_factory=dict)
    mismatch_t2: float = 0.0
    sigma: float = 0.0
    guess: dict[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"seed{self.seed}-case{self.index:04d}"

    def as_json(self) -> dict:
        return asdict(self)


@dataclass
class Drawn:
    """A case, and what it was made with."""

    case: Case
    setup: Setup
    hidden: list[Changes]  # of every record
    noise: Noise
    readings: list[np.ndarray]

    def write(self, folder: Path) -> Path:
        """Scene and logs in a folder."""
        return self.setup.write(folder, self.readings, self.case.guess, self.noise.gaps > 0.0)


def set_up(system: str, rng: np.random.Generator, jitter: float, numerics: str) -> Setup:
    """A setup of a system."""
    if system in chains.SYSTEMS:
        return chains.ChainSetup(system, rng, jitter, smooth=numerics == "commands")
    if system == "toss":
        return toss.TossSetup(rng, jitter)
    if system == "cable":
        return cable_setup.CableSetup(rng, jitter, smooth=numerics == "commands")
    if system == "rod":
        from validation.blind import rod_setup  # here, as JAX is slow to load

        return rod_setup.RodSetup(rng, jitter, smooth=numerics == "commands")
    if system == "cloth":
        from validation.blind import cloth_setup

        return cloth_setup.ClothSetup(rng, jitter, smooth=numerics == "commands")
    if system in ropes.SYSTEMS:
        return ropes.RopeSetup(system, rng, jitter, smooth=numerics == "commands")
    raise ValueError(f"no system {system}")


def plan(n: int, seed: int, systems: list[str] | None = None, kinds: list[str] | None = None) -> list[tuple[str, str]]:
    """System and kind of n cases, in shares, in a seeded order."""
    rng = np.random.default_rng([seed, 7])
    shares = {kind: share for kind, share in SHARES.items() if not kinds or kind in kinds}
    weights = {system: share for system, share in (SYSTEMS | BY_NAME).items() if system in (systems or SYSTEMS)}
    out = []
    for kind in dealt(n, shares, rng):
        allowed = {system: w for system, w in weights.items() if kind not in RULED_OUT.get(system, ())} or weights
        p = np.array(list(allowed.values()))
        out.append((str(rng.choice(list(allowed), p=p / p.sum())), kind))
    return out


def dealt(n: int, shares: dict[str, float], rng: np.random.Generator) -> list[str]:
    """n names in their shares, the remainders by lot, shuffled."""
    # not `sum`, which rounds otherwise from Python 3.12 on: another remainder, and the seed has other cases
    whole = functools.reduce(operator.add, shares.values())
    exact = {name: n * share / whole for name, share in shares.items()}
    out = [name for name, x in exact.items() for _ in range(int(x))]
    rest = np.array([x % 1.0 for x in exact.values()])
    if len(out) < n:
        out += [str(x) for x in rng.choice(list(exact), n - len(out), replace=False, p=rest / rest.sum())]
    return [str(x) for x in rng.permutation(out)]


def draw(seed: int, index: int, system: str, kind: str) -> Drawn:
    """A case with its readings; setups are drawn again until the effect exists in one, is of a sane size and can be hidden."""
    rng = np.random.default_rng([seed, index])
    for _ in range(40):
        noise = NOISES[str(rng.choice(list(NOISES)))]
        numerics = str(rng.choice(["step", "commands"])) if kind == "null" and system != "toss" and rng.random() < 0.25 else ""
        setup = set_up(system, rng, noise.jitter, numerics)
        late = {k: replace(c, hidden=False) for k, c in setup.causes.items() if seed < LATER.get(c.name, 0)}
        setup.causes |= late
        if numerics == "step":
            setup.coarsen()
        judge = Judge(setup, noise)
        while not numerics and judge.mismatch_t2() > 0.3 and setup.substeps < FINEST:
            setup.refine()
            judge.look_at_scene()
        case = Case(seed=seed, index=index, system=system, kind=kind, noise=noise.kind, numerics=numerics, sigma=setup.sigma,
                    mismatch_t2=judge.mismatch_t2())  # fmt: skip
        if bool(numerics) != (case.mismatch_t2 > WRONG_NUMERICS) or (not numerics and case.mismatch_t2 >= 1.0):
            continue
        by_record: list[Changes] | None = [{} for _ in setup.roles]
        if kind != "null":
            by_record = HIDE[kind](case, judge, rng)
        if by_record is not None:
            knobs = [setup.knobs[k] for k in setup.free]
            case.guess = {knob.path: float(knob.scene * np.exp(0.1 * np.clip(rng.standard_normal(), -2, 2))) for knob in knobs}
            clean = setup.readings(list(enumerate(by_record)))
            return Drawn(case, setup, by_record, noise, [noise.read(y, setup.sigma, rng) for y in clean])
    raise RuntimeError(f"nothing could be hidden: seed {seed}, case {index}, {system}, {kind}")


# ---- Ways to hide ------------------------------------------------------------------------------------------------------------


def choose(judge: Judge, rng: np.random.Generator, besides: str = "") -> Cause | None:
    """A cause that the readings feel; the names are drawn first, as some have many objects."""
    seen = [c for c in judge.setup.causes.values() if c.hidden and c.key in judge.basis and c.key != besides]
    if not seen:
        return None
    name = str(rng.choice(sorted({c.name for c in seen})))
    own = [c for c in seen if c.name == name]
    return own[rng.integers(len(own))]


def direction(cause: Cause, judge: Judge, rng: np.random.Generator) -> Changes:
    """Changes of a cause of unit size: the number it frees, or a direction of several that is felt."""
    knobs = judge.setup.knobs
    d = rng.standard_normal(len(cause.knobs))
    d = d / np.linalg.norm(d)
    out = {}
    for key, x in zip(cause.knobs, d, strict=True):
        out[key] = float(abs(x) * knobs[key].least if x < 0.0 and knobs[key].least < 0.0 else abs(x) * knobs[key].largest)
    return out


def scaled(unit: Changes, size: float) -> Changes:
    return {key: size * x for key, x in unit.items()}


def sized(judge: Judge, unit: Changes, factors: list[float], measure, choices: tuple[float, ...], rng: np.random.Generator):
    """(size, u, λ aimed at, λ) of a change whose λ, by `measure(u)`, is one of the choices within a quarter; None if none is within reach."""
    size, wanted = 0.03, 0.0
    for _ in range(8):
        u = judge.change([scaled(unit, size * f) for f in factors])
        lam = measure(u)
        if not np.isfinite(lam) or lam <= 0.0:
            return None
        if wanted == 0.0:
            reach = [x for x in choices if x <= 0.5 * lam / size**2]
            if not reach:
                return None
            wanted = float(rng.choice(reach))
        if 0.8 < lam / wanted < 1.25:
            return size, u, wanted, lam
        size *= float(np.clip(np.sqrt(wanted / lam), 0.1, 6.0))
        if size > 1.0:
            return None
    return None


def fitted(judge: Judge, by_record: list[float]) -> list[float]:
    return [by_record[r] for r in judge.records]


def told(cause: Cause, setup: Setup, unit: Changes, sizes: list[float]) -> dict:
    """What is hidden: true values by path; of each record where they differ."""
    true = lambda s: {setup.knobs[k].path: float(setup.knobs[k].true(s * unit[k])) for k in cause.knobs if setup.knobs[k].path}
    alone = sum(c.name == cause.name for c in setup.causes.values()) == 1
    out = {"name": cause.name, "object": cause.object, "alone": alone, "truth": true(sizes[0]) | cause.also}
    if len(set(sizes)) > 1:
        out |= {"truth": dict(cause.also), "by_record": [true(s) for s in sizes]}
    return out


def has_twin(rho: dict[str, float], cause: Cause, lam: float) -> bool:
    """Whether another candidate imitates the cause exactly, at its size λ."""
    nearest_of = max((c for k, c in rho.items() if k != cause.key), default=0.0)
    return nearest_of > SYMMETRIC and lam * (1.0 - nearest_of**2) < SAME


def square(u: np.ndarray) -> float:
    return float(u @ u)


def nearest(case: Case, rho: dict[str, float]) -> None:
    case.cosines = dict(sorted(((k, round(c, 5)) for k, c in rho.items()), key=lambda kv: -kv[1])[:8])


def one(case: Case, judge: Judge, rng: np.random.Generator) -> list[Changes] | None:
    cause = choose(judge, rng)
    if cause is None:
        return None
    unit, setup = direction(cause, judge, rng), judge.setup
    found = sized(judge, unit, [1.0] * len(judge.records), square, STRONG if case.kind == "symmetric" else LAMBDAS, rng)
    if found is None:
        return None
    size, u, case.lam, case.lam_exact = found
    rho = judge.matched(u, cause.key)
    nearest(case, rho)
    case.allowed, case.margin, case.rivals = judge.allows_name(u, cause.key, rho)
    if has_twin(rho, cause, case.lam_exact) != (case.kind == "symmetric"):
        return None
    case.allowed = case.allowed and case.kind != "symmetric"
    case.hidden = [told(cause, setup, unit, [size])]
    return [scaled(unit, size) for _ in setup.roles]


def two(case: Case, judge: Judge, rng: np.random.Generator) -> list[Changes] | None:
    """Both of a λ of their own beside the other, which is refitted."""
    first = choose(judge, rng)
    second = choose(judge, rng, first.key) if first else None
    if first is None or second is None or set(first.knobs) & set(second.knobs):
        return None
    setup, n, parts = judge.setup, len(judge.records), []
    for cause, other in ((first, second), (second, first)):
        beside, unit = judge.beside(other.key), direction(cause, judge, rng)
        known = judge.basis[other.key][0]
        off = lambda u, known=known: u - known @ (known.T @ u)
        found = sized(judge, unit, [1.0] * n, lambda u, off=off: square(off(u)), STRONG, rng)
        if found is None:
            return None
        size, u, wanted, lam = found
        allowed, margin, rivals = beside.allows_name(off(u), cause.key)
        allowed = allowed and not has_twin(judge.matched(u, cause.key), cause, square(u))
        parts.append((cause, unit, size, wanted, lam, allowed, margin, rivals, beside.cosines(off(u))))
    weaker = min(parts, key=lambda part: part[4])
    case.lam, case.lam_exact, case.margin = weaker[3], weaker[4], min(part[6] for part in parts)
    case.allowed, case.rivals = all(part[5] for part in parts), [r for part in parts for r in part[7]]
    nearest(case, weaker[8])
    case.hidden = [told(cause, setup, unit, [size]) for cause, unit, size, *_ in parts]
    both = scaled(parts[0][1], parts[0][2]) | scaled(parts[1][1], parts[1][2])
    return [both for _ in setup.roles]


def by_record(case: Case, judge: Judge, rng: np.random.Generator) -> list[Changes] | None:
    """One cause of several sizes; λ is what one size for all records leaves."""
    cause = choose(judge, rng)
    if cause is None:
        return None
    setup, unit = judge.setup, direction(cause, judge, rng)
    if case.kind == "some":
        factors = np.zeros(len(setup.roles))
        chosen = rng.permutation(judge.records)[: max(1, len(judge.records) // 2)]
        factors[[*chosen, len(setup.roles) - 1]] = 1.0
    else:
        factors = np.linspace(0.5, 1.5, len(setup.roles))[rng.permutation(len(setup.roles))]
    sizes = list(factors / factors.max())
    rest = lambda u: min(square(u - b @ (b.T @ u)) for b in judge.basis[cause.key])
    found = sized(judge, unit, fitted(judge, sizes), rest, STRONG, rng)
    if found is None:
        return None
    size, u, case.lam, case.lam_varies = found
    case.lam_exact = square(u)
    rho = judge.matched(u, cause.key, by_record=True)
    nearest(case, rho)
    case.allowed, case.margin, case.rivals = judge.allows_name(u, cause.key, rho)
    case.allowed = case.allowed and not has_twin(rho, cause, case.lam_exact)
    case.hidden = [told(cause, setup, unit, [size * s for s in sizes])]
    return [scaled(unit, size * s) for s in sizes]


def beyond(case: Case, judge: Judge, rng: np.random.Generator) -> list[Changes] | None:
    """An effect outside the library, or a value that no cause stands for; λ is what the best single imitation leaves."""
    setup = judge.setup
    pool = setup.outside if case.kind == "outside" else setup.values
    if not pool:
        return None
    names = sorted({key.partition(":")[0] for key in pool})
    name = str(rng.choice(names))
    key = str(rng.choice([k for k in pool if k.partition(":")[0] == name]))
    knobs, own = pool[key], {c.key for c in setup.causes.values() if set(c.knobs) == set(pool[key])}
    down = lambda knob: knob.least < 0.0 and rng.random() < 0.5
    unit = {k: knob.least if down(knob) else knob.largest for k in knobs for knob in [setup.knobs[k]]}
    others = lambda u: {k: c for k, c in judge.cosines(u).items() if k not in own}
    rest = lambda u: square(u) * (1.0 - max(others(u).values()) ** 2)
    found = sized(judge, unit, [1.0] * len(judge.records), rest, LAMBDAS[1:], rng)
    if found is None:
        return None
    size, u, case.lam, _ = found
    if max(others(u).values()) > np.sqrt(0.95):  # all but inside the library
        return None
    case.lam_exact = square(u)
    nearest(case, others(u))
    truth = {setup.knobs[k].path: float(setup.knobs[k].true(size * unit[k])) for k in knobs if setup.knobs[k].path}
    case.hidden = [{"name": "", "object": "", "effect": key, "size": float(size * unit[knobs[0]]), "truth": truth}]
    return [scaled(unit, size) for _ in setup.roles]


HIDE = {"effect": one, "symmetric": one, "pair": two, "varies": by_record, "some": by_record, "value": beyond, "outside": beyond}
assert 0.0 < HIDDEN < 1.0
