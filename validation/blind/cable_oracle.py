"""What could be known of an effect hidden in the cable of `cables.py`: its size against the noise, its imitations.

    s_k = ∂y/∂θ_k              differences of MuJoCo's own motions, initial equilibria included
    u_k = w(s_k)               whitened, and the shared stiffness, which is refitted, projected out
    λ = |u|²,  ρ_j = |P_j u|/|u|        of the whole change u by an effect; P_j projects on the span of cause j

y stacks the fitted records. They begin at rest, so that nothing else is unknown. Derivatives are cached by
excitation under /validation/out (not in the repository).
"""

from __future__ import annotations

import functools
import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.blind import cable_forces, cable_midpoint, cables
from validation.blind.cable_forces import Forces
from validation.blind.cables import BALLS, BODIES, FITTED, SLIDES, Effect
from validation.blind.measure import Noise
from validation.blind.oracle import orthonormal, whiten

CACHE = Path(__file__).resolve().parents[1] / "out" / "blind_cache"
MOTORS = ("motor_x", "motor_y")
SPEEDS = (0.005, 0.03)  # m/s, at which friction at rest may fade
PARTS = (0.9, 0.6)  # of the largest force, where a servo's limit may be


@dataclass(frozen=True)
class Direction:
    """The effect of a size, the size to take differences with, and how: on both sides, on one, the whole change."""

    effect: Callable[[float], Effect]
    size: float
    how: str = "both"


def pair(k: int, value: float, other: float = 0.0) -> tuple[float, float]:
    return (value, other) if k == 0 else (other, value)


def unit(k: int, value: float) -> tuple[float, ...]:
    return tuple((value * np.eye(3)[k]).tolist())


def at_joint(name: str, attribute: str, base: float = 0.0) -> Callable[[float], Effect]:
    return lambda x: Effect(joint={name: {attribute: base + x}})


def force(name: str, k: int, *more: float) -> Callable[[float], Effect]:
    return lambda x: Effect(forces=Forces(**{name: {k: (x, *more) if more else x}}))


def of_servo(name: str, k: int) -> Callable[[float], Effect]:
    return lambda x: Effect(**{name: pair(k, x)})


def of_sensor(name: str, k: int) -> Callable[[float], Effect]:
    return lambda x: Effect(**{name: unit(k, x)})


def of_body(name: str, body: str, k: int) -> Callable[[float], Effect]:
    return lambda x: Effect(**{name: {body: unit(k, x)}})


def limited(k: int, limit: float) -> Callable[[float], Effect]:
    return lambda _: Effect(limit=pair(k, limit, np.inf))


def candidates(peaks: np.ndarray) -> dict[str, list[Direction]]:
    """Cause:object -> its directions, one a parameter; `peaks` are the largest forces of the servos [N]."""
    return of_cable() | of_carriage(peaks) | of_all()


def of_cable() -> dict[str, list[Direction]]:
    out = {}
    for k, j in enumerate(BALLS):
        out[f"joint_stiffness:{j}"] = [Direction(at_joint(j, "stiffness", cables.STIFFNESS), 2e-4)]
        out[f"viscous_friction:{j}"] = [Direction(at_joint(j, "damping", cables.DAMPING), 2e-5)]
        out[f"quadratic_damping:{j}"] = [Direction(force("square", k), 2e-6)]
        out[f"armature:{j}"] = [Direction(at_joint(j, "armature"), 2e-7, "one")]
        out[f"cubic_stiffness:{j}"] = [Direction(force("cubic", k), 1e-3)]
        out[f"joint_plasticity:{j}"] = [Direction(force("creep", k), 0.05)]
    for b in BODIES:
        out[f"link_inertia:{b}"] = [Direction(of_body("spread", b, a), 2e-8) for a in range(3)]
        out[f"center_of_mass:{b}"] = [Direction(of_body("centre", b, a), 1e-4) for a in range(3)]
    out[f"payload:{BODIES[-1]}"] = [Direction(lambda x: Effect(mass={BODIES[-1]: 1.0 + x}), 0.01)]
    return out


def of_carriage(peaks: np.ndarray) -> dict[str, list[Direction]]:
    out = {}
    for k, (s, m) in enumerate(zip(SLIDES, MOTORS, strict=True)):
        out[f"viscous_friction:{s}"] = [Direction(at_joint(s, "damping"), 0.2, "one")]
        out[f"quadratic_damping:{s}"] = [Direction(force("square_slide", k), 0.5)]
        out[f"joint_stiffness:{s}"] = [Direction(at_joint(s, "stiffness"), 2.0, "one")]
        out[f"armature:{s}"] = [Direction(at_joint(s, "armature"), 2e-3, "one")]
        out[f"cubic_stiffness:{s}"] = [Direction(force("cubic_slide", k), 500.0)]
        out[f"coulomb_friction:{s}"] = [Direction(force("stribeck", k, 1e6), 5e-3)]  # it does not fade
        out[f"load_friction:{s}"] = [Direction(force("load", k), 5e-3)]
        out |= {f"stribeck:{s}:{v}": [Direction(force("stribeck", k, v), 5e-3)] for v in SPEEDS}
        out[f"drive_stiffness:{m}"] = [Direction(of_servo("stiffer", k), 10.0)]
        out[f"torque_offset:{m}"] = [Direction(of_servo("offset", k), 0.02)]
        out[f"actuator_delay:{m}"] = [Direction(of_servo("late", k), 5e-4)]
        out[f"actuator_lag:{m}"] = [Direction(of_servo("lag", k), 5e-4, "one")]
        out |= {f"saturation:{m}:{p}": [Direction(limited(k, p * peaks[k]), 1.0, "whole")] for p in PARTS}
    return out


def of_all() -> dict[str, list[Direction]]:
    """Gravity and the sensor."""
    return {
        "gravity_tilt": [Direction(of_servo("tilt", k), 1e-3) for k in range(2)],
        "gravity_magnitude": [Direction(lambda x: Effect(gravity=9.81 + x), 0.02)],
        "sensor_bias": [Direction(of_sensor("bias", a), 1e-3) for a in range(3)],
        "frame_rotation": [Direction(of_sensor("rotation", a), 1e-3) for a in range(3)],
        "length_scale": [Direction(lambda x: Effect(scale=1.0 + x), 1e-3)],
        "time_offset": [Direction(lambda x: Effect(delay=x), 5e-4)],
    }


def shared_stiffness(x: float) -> Effect:
    """What the scene refits."""
    return Effect(joint={j: {"stiffness": cables.STIFFNESS + x} for j in BALLS})


def readings(effect: Effect, excitation: int) -> np.ndarray:
    """What the sensor reads in the fitted records without noise (record, sample, marker, 3) [m]."""
    out = []
    for r in range(FITTED):
        t, u = cables.commands(excitation, r)
        out.append(cables.seen(effect, cables.motion(effect, t, u)[0]))
    return np.array(out)


@dataclass
class Known:
    """Noise-free readings of an excitation, their derivatives by all causes, the midpoint rule minus MuJoCo."""

    excitation: int
    y: np.ndarray
    slopes: dict[str, list[np.ndarray]]
    stiffness: np.ndarray
    mismatch: np.ndarray
    peaks: np.ndarray


def cached(excitation: int) -> Path:
    """Where the derivatives are kept as long as the generator's source is unchanged."""
    source = "".join(inspect.getsource(m) for m in (cables, cable_forces, cable_midpoint))
    source += "".join(inspect.getsource(f) for f in (of_cable, of_carriage, of_all, difference))
    return CACHE / f"cable{excitation}-{hashlib.sha256(source.encode()).hexdigest()[:12]}.npz"


@functools.cache
def known(excitation: int) -> Known:
    """From the cache, or computed in minutes."""
    path = cached(excitation)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **compute(excitation))
    data = dict(np.load(path))
    core = [data.pop(key) for key in ("y", "stiffness", "mismatch", "peaks")]
    slopes = {key: list(value) for key, value in data.items()}
    return Known(excitation, core[0], slopes, *core[1:])


def compute(excitation: int) -> dict[str, np.ndarray]:
    records = [cables.commands(excitation, r) for r in range(FITTED)]
    runs = [cables.motion(Effect(), t, u) for t, u in records]
    y, peaks = np.array([run[0] for run in runs]), np.max([run[1] for run in runs], axis=0)
    out = {"y": y, "peaks": peaks}
    out["mismatch"] = np.array([cable_midpoint.motion(t, u) for t, u in records]) - y
    out["stiffness"] = difference(Direction(shared_stiffness, 2e-4), y, excitation)
    for key, directions in candidates(peaks).items():
        out[key] = np.array([difference(d, y, excitation) for d in directions])
    return out


def difference(d: Direction, y: np.ndarray, excitation: int) -> np.ndarray:
    ahead = readings(d.effect(d.size), excitation)
    if d.how == "whole":
        return ahead - y
    if d.how == "one":  # of second order
        return (4.0 * readings(d.effect(0.5 * d.size), excitation) - ahead - 3.0 * y) / d.size
    return (ahead - readings(d.effect(-d.size), excitation)) / (2.0 * d.size)


class Oracle:
    """Whitened, projected directions of one excitation under one noise."""

    def __init__(self, data: Known, noise: Noise) -> None:
        self.data, self.phi = data, noise.phi
        self.sigma = float(np.hypot(noise.sigma, noise.quantum / np.sqrt(12.0)))
        w = self.whitened(data.stiffness)
        self.nuisance = w / np.linalg.norm(w)
        self.basis = {}
        for key, slopes in data.slopes.items():
            u = [self.project(s) for s in slopes]
            if max(np.linalg.norm(x) for x in u) > 1e-9:
                self.basis[key] = orthonormal(u)
        self.mismatch = self.project(data.mismatch)

    def whitened(self, x: np.ndarray) -> np.ndarray:
        return whiten(x, self.phi, self.sigma)

    def project(self, x: np.ndarray) -> np.ndarray:
        w = self.whitened(x)
        return w - self.nuisance * (self.nuisance @ w)

    def change(self, effect: Effect) -> np.ndarray:
        """Projected change of the readings by an effect."""
        return self.project(readings(effect, self.data.excitation) - self.data.y)

    def mismatch_t2(self) -> float:
        """The largest |P_j m|² of the mismatch; a null needs it below 1."""
        return max(float(np.sum((b.T @ self.mismatch) ** 2)) for b in self.basis.values())

    def cosines(self, u: np.ndarray) -> dict[str, float]:
        """ρ of a change with every cause, the best point of its nuisance grid where it has one."""
        out: dict[str, float] = {}
        size = max(float(np.linalg.norm(u)), 1e-300)
        for key, basis in self.basis.items():
            name = ":".join(key.split(":")[:2])
            out[name] = max(out.get(name, 0.0), float(np.linalg.norm(basis.T @ u)) / size)
        return out
