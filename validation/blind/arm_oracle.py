"""What could be known of an effect hidden in the arm of `arms.py`: its size against the noise, and what imitates it.

The records are cut into pieces of half a second, each from the true state at its beginning. With y(e) the readings of a piece
under an effect e, whitened, and the piece's initial state and the lower link's mass (both refitted by any tool) projected out,
    λ = |y(e) - y(none)|²,      ρ_k = cosine between that and the derivative of candidate k.
A tool that joins its pieces may see more than λ, never less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2, norm

from validation.blind import arm_ode, arms
from validation.blind.arms import Effect

PIECE = 0.5  # s
EVERY = 4  # steps per sample
STEP = 1.0 / arms.RATE / EVERY  # s
ALPHA = 0.05
JOINTS = ("shoulder", "elbow")
PEAK = (2.0, 0.6)  # N·m, of which a limit cuts a part


def pair(k: int, value: float, other: float = 0.0) -> tuple[float, float]:
    return (value, other) if k == 0 else (other, value)


def candidates(known_friction: tuple[float, float], size: float) -> dict[str, dict]:
    """Key -> what it changes: attributes of an `Effect`, and under "ode" of the equations alone. Sizes are for derivatives."""
    out: dict[str, dict] = {}
    for k, j in enumerate(JOINTS):
        out[f"viscous_friction:{j}"] = {"joint": {j: {"damping": 2e-3}}}
        out[f"coulomb_friction:{j}"] = {"joint": {j: {"frictionloss": known_friction[k] + 5e-3}}}
        out[f"stribeck:{j}"] = {"ode": {"stribeck": pair(k, 5e-3)}}
        out[f"joint_stiffness:{j}"] = {"joint": {j: {"stiffness": 1e-2}}}
        out[f"cubic_stiffness:{j}"] = {"cubic": pair(k, 1e-2)}
        out[f"armature:{j}"] = {"joint": {j: {"armature": 1e-3}}}
        out[f"load_friction:{j}"] = {"load": pair(k, 1e-2)}
        out[f"torque_gain:motor_{j}"] = {"gain": pair(k, 1.01, 1.0)}
        out[f"torque_offset:motor_{j}"] = {"offset": pair(k, 5e-3)}
        out[f"actuator_delay:motor_{j}"] = {"late": pair(k, 5e-4)}
        out[f"actuator_lag:motor_{j}"] = {"lag": pair(k, 5e-4)}
        for part in (0.9, 0.7, 0.5):
            out[f"saturation:motor_{j}:{part}"] = {"limit": pair(k, part * PEAK[k] * size, np.inf)}
        out[f"encoder_bias:{j}"] = {"bias": pair(k, 1e-3)}
        out[f"encoder_scale:{j}"] = {"scale": pair(k, 1.002, 1.0)}
        if known_friction[k] > 0.0:
            more = {"joint": {j: {"frictionloss": known_friction[k] + 2.5e-3}}, "push": pair(k, 2.5e-3)}
            out[f"asymmetric_friction:{j}"] = more
    out["sensor_delay"] = {"delay": 5e-4}
    out["actuator_delay"] = {"late": (5e-4, 5e-4)}
    out["actuator_lag"] = {"lag": (5e-4, 5e-4)}
    out["gravity_tilt"] = {"tilt": 1e-3}
    out["payload:upper"] = {"ode": {"upper_mass": arm_ode.M1 * 1.01}}
    out["center_of_mass:lower"] = {"ode": {"lower_com": 1e-3}}
    return out


def nothing(known_friction: tuple[float, float]) -> Effect:
    """What the scene believes."""
    own = {j: {"frictionloss": c} for j, c in zip(JOINTS, known_friction, strict=True) if c > 0.0}
    return Effect("", joint=own, known_friction=known_friction)


def changed(base: Effect, change: dict) -> Effect:
    """The effect with attributes replaced; those of joints are added."""
    keys = {key: value for key, value in change.items() if key not in ("ode", "joint")}
    joint = {j: dict(base.joint.get(j, {})) | change.get("joint", {}).get(j, {}) for j in JOINTS}
    return replace(base, joint={j: own for j, own in joint.items() if own}, **keys)


def equations(effect: Effect) -> dict:
    """The effect as parameters of `arm_ode`."""
    own = [effect.joint.get(j, {}) for j in JOINTS]
    of_joints = {
        name: tuple(joint.get(attribute, 0.0) for joint in own)
        for name, attribute in (
            ("damping", "damping"),
            ("friction", "frictionloss"),
            ("stiffness", "stiffness"),
            ("armature", "armature"),
        )
    }
    same = ("push", "load", "cubic", "ripple", "quadratic", "tilt")
    return of_joints | {key: getattr(effect, key) for key in same}


def seen(effect: Effect, y: np.ndarray) -> np.ndarray:
    """Readings of angles (samples, 2, n) at the log's rate."""
    t = np.arange(len(y)) / arms.RATE
    if effect.delay:
        y = CubicSpline(t, y, axis=0)(t - effect.delay)
    for j, half in enumerate(effect.play):
        if half:
            y = y.copy()
            y[:, j] = np.stack([arms.with_play(x, half) for x in y[:, j].T], axis=1)
    return np.array(effect.scale)[:, None] * y + np.array(effect.bias)[:, None]


@dataclass
class Pieces:
    """Pieces of the fitted records: states at their beginning (2, n), and each one's commands: (times, commands, beginning)."""

    q: np.ndarray
    v: np.ndarray
    commands: list[tuple[np.ndarray, np.ndarray, float]]

    def torque(self, effect: Effect) -> np.ndarray:
        """(steps, 2, n)."""
        before, steps = 0.3, round(PIECE / STEP)
        out = []
        for t, u, start in self.commands:
            first = round(max(start - before, 0.0) / STEP)
            skip = round(start / STEP) - first
            shifted = arms.motor_torque(effect, t - first * STEP, u, STEP, skip + steps)
            out.append(shifted[skip:])
        return np.stack(out, axis=2)


def cut(motions: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]) -> Pieces:
    """Pieces of motions (t, u, q, v) as `arms.motion` returns them."""
    q, v, commands = [], [], []
    for t, u, fine_q, fine_v in motions:
        for k in range(int((t[-1] + 1e-9) / PIECE)):
            at = round(k * PIECE / arms.FINE)
            q.append(fine_q[at])
            v.append(fine_v[at])
            commands.append((t, u, k * PIECE))
    return Pieces(np.array(q).T, np.array(v).T, commands)


MOTOR = ("late", "lag", "gain", "offset", "limit")


class Oracle:
    """Whitened, projected changes of the readings of a set of pieces."""

    def __init__(self, pieces: Pieces, base: Effect, sigma: float, colour: float) -> None:
        self.pieces, self.base, self.sigma, self.colour = pieces, base, sigma, colour
        self.torque = pieces.torque(base)
        eps = 1e-4
        shifts = [np.eye(4)[k] * eps for k in range(4)]
        heavier = {"ode": {"lower_mass": arm_ode.M2 * 1.001}}
        self.zero, *moved, mass = self.readings([{}] * 5 + [heavier], [np.zeros(4), *shifts, np.zeros(4)])
        # of every piece the span of its own initial state, (rows, 4)
        slopes = [self.white(y - self.zero) for y in moved]
        self.own = [
            np.linalg.qr(np.stack([m[:, i] for m in slopes], axis=1))[0] for i in range(pieces.q.shape[1])
        ]
        direction = self.inner(mass)
        self.mass = direction / np.linalg.norm(direction)
        (mid,) = self.readings([{}], midpoint=True)
        self.mismatch = self.project(mid)

    def readings(
        self, changes: list[dict], shifts: list[np.ndarray] | None = None, midpoint: bool = False
    ) -> list[np.ndarray]:
        """Readings (samples, 2, n) under each change, from states moved by `shifts` (q, v)."""
        n = self.pieces.q.shape[1]
        shifts = shifts or [np.zeros(4)] * len(changes)
        effects = [changed(self.base, change) for change in changes]
        variants = [
            equations(effect) | change.get("ode", {})
            for effect, change in zip(effects, changes, strict=True)
            for _ in range(n)
        ]
        torque = [
            self.torque
            if all(getattr(effect, key) == getattr(self.base, key) for key in MOTOR)
            else self.pieces.torque(effect)
            for effect in effects
        ]
        q = np.concatenate([self.pieces.q + shift[:2, None] for shift in shifts], axis=1)
        v = np.concatenate([self.pieces.v + shift[2:, None] for shift in shifts], axis=1)
        y = arm_ode.simulate(
            arm_ode.parameters(variants), q, v, np.concatenate(torque, axis=2), STEP, EVERY, midpoint
        )
        return [seen(effect, y[:, :, k * n : (k + 1) * n]) for k, effect in enumerate(effects)]

    def white(self, x: np.ndarray) -> np.ndarray:
        """(rows, n): readings whitened."""
        scale = self.sigma * np.sqrt(1.0 - self.colour**2)
        out = np.concatenate([x[:1] / self.sigma, (x[1:] - self.colour * x[:-1]) / scale])
        return out.reshape(-1, x.shape[2])

    def inner(self, y: np.ndarray) -> np.ndarray:
        """Whitened change of the readings with initial states projected out, all pieces in a row."""
        w = self.white(y - self.zero)
        return np.concatenate([w[:, i] - own @ (own.T @ w[:, i]) for i, own in enumerate(self.own)])

    def project(self, y: np.ndarray) -> np.ndarray:
        d = self.inner(y)
        return d - self.mass * (self.mass @ d)

    def changes(self, changes: list[dict]) -> list[np.ndarray]:
        """Projected changes of the readings by what candidates or effects change."""
        return [self.project(y) for y in self.readings(changes)]


def cosines(directions: dict[str, np.ndarray], u: np.ndarray) -> dict[str, float]:
    """|cosine| of a change with every candidate, the best of the grid of saturations."""
    out: dict[str, float] = {}
    for key, d in directions.items():
        size = np.linalg.norm(d) * max(np.linalg.norm(u), 1e-300)
        name = ":".join(key.split(":")[:2])
        out[name] = max(out.get(name, 0.0), float(abs(d @ u) / max(size, 1e-300)))
    return out


def allows_name(
    lam: float, rho: dict[str, float], own: str, dimensions: int = 1
) -> tuple[bool, float, list[str]]:
    """The naming rule in expectation: (allowed, margin of the worst rival [σ], rivals not beaten).

    `dimensions`: parameters of the cause.
    """
    rivals = {k: c for k, c in rho.items() if k != own}
    gate = norm.ppf(1.0 - ALPHA / len(rivals))
    margins = {k: float(np.sqrt(0.5 * lam * max(1.0 - c, 0.0)) - gate) for k, c in rivals.items()}
    significant = lam > chi2.ppf(1.0 - ALPHA / len(rho), dimensions)
    lost = sorted((k for k, m in margins.items() if m <= 0.0), key=lambda k: margins[k])
    return bool(significant and not lost), float(min(margins.values())), lost
