"""Forces on the cable of `cables.py` that MuJoCo does not have, added to its passive ones in every stage of a step.

cubic at a ball         f = -k₃ |q|² q             q: rotation vector [rad], f: moment in the link's axes [N·m]
creep at a ball         f = -k Jᵀ e,  e = q - p,  ṗ = e/τ,  J: the rate of q by the link's angular velocity
slack at a ball         f = -k max(1 - s/|q|, 0) q
quadratic drag          f = -c |v| v               at the middle of each link, and with a c of its own on the carriage
cubic at a slide        f = -k₃ x³
damping by the square   f = -d |v| v               at a ball v is the angular velocity in the link's axes
friction at a slide     f = -(s exp(-(v/v_s)²) + μ |u|) tanh(v/0.3 mm/s),  u: force of the servo
gust                    f = a sin(2π 1.3 Hz t)     at the middle of each link, along x and y
pull                    f = P d/(|d|² + d₀²)       at the middle of the last link, d towards a magnet beside it
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import mujoco
import numpy as np

LINKS = 6
GUST = 1.3  # Hz
SHARP = 3e-4  # m/s, over which dry friction turns
MAGNET, SOFT = np.array([0.1, 0.05, -0.38]), 0.03  # m


def zeros(n: int = 3) -> tuple[float, ...]:
    return (0.0,) * n


@dataclass(frozen=True)
class Forces:
    """Sizes of the forces; those at balls by the ball's number."""

    cubic: dict[int, float] = field(default_factory=dict)  # N·m/rad³
    creep: dict[int, float] = field(default_factory=dict)  # 1/τ [1/s]
    slack: dict[int, float] = field(default_factory=dict)  # rad
    cubic_slide: dict[int, float] = field(default_factory=dict)  # N/m³
    square: dict[int, float] = field(default_factory=dict)  # N·m·s²/rad²
    square_slide: dict[int, float] = field(default_factory=dict)  # N·s²/m²
    stribeck: dict[int, tuple[float, float]] = field(default_factory=dict)  # N, m/s
    load: dict[int, float] = field(default_factory=dict)
    drag: float = 0.0  # N·s²/m² a link
    drag_carriage: float = 0.0  # N·s²/m²
    gust: tuple[float, float] = (0.0, 0.0)  # N a link
    pull: float = 0.0  # N·m

    def replaces_spring(self, ball: int) -> bool:
        """Whether the spring of that ball is made here."""
        return ball in self.creep or ball in self.slack

    @property
    def none(self) -> bool:
        at_balls = self.cubic or self.creep or self.slack or self.square
        at_slides = self.cubic_slide or self.square_slide or self.stribeck or self.load
        return not (at_balls or at_slides or self.drag or self.drag_carriage or any(self.gust) or self.pull)


class Acting:
    """Forces with what they remember: the parts p by which balls have crept."""

    def __init__(self, forces: Forces, stiffness: float, h: float) -> None:
        self.forces, self.stiffness, self.h = forces, stiffness, h
        self.crept = {k: np.zeros(3) for k in forces.creep}

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        own = self.forces
        for k, size in own.cubic.items():
            q = turn(data, k)
            add(data, k, -size * (q @ q) * q)
        for k, size in own.square.items():
            v = data.qvel[2 + 3 * k : 5 + 3 * k]
            add(data, k, -size * math.sqrt(v @ v) * v)
        for k, crept in self.crept.items():
            q = turn(data, k)
            add(data, k, -self.stiffness * rate(q).T @ (q - crept))
        for k, free in own.slack.items():
            q = turn(data, k)
            add(data, k, -self.stiffness * max(1.0 - free / max(math.sqrt(q @ q), 1e-12), 0.0) * q)
        self.at_slides(model, data)
        if own.drag or any(own.gust) or own.pull:
            self.at_links(model, data)

    def at_slides(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        own = self.forces
        if own.drag_carriage:
            v = data.qvel[:2]
            data.qfrc_passive[:2] -= own.drag_carriage * math.sqrt(v @ v) * v
        for j, size in own.cubic_slide.items():
            data.qfrc_passive[j] -= size * data.qpos[j] ** 3
        for j, size in own.square_slide.items():
            data.qfrc_passive[j] -= size * abs(data.qvel[j]) * data.qvel[j]
        for j, (size, speed) in own.stribeck.items():
            v = data.qvel[j]
            data.qfrc_passive[j] -= size * math.exp(-((v / speed) ** 2)) * math.tanh(v / SHARP)
        for j, size in own.load.items():
            gain, brake = model.actuator_gainprm[j, 0], model.actuator_biasprm[j, 2]
            servo = gain * (data.ctrl[j] - data.qpos[j]) + brake * data.qvel[j]
            data.qfrc_passive[j] -= size * abs(servo) * math.tanh(data.qvel[j] / SHARP)

    def at_links(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        own = self.forces
        jacobian = np.zeros((3, model.nv))
        gust = np.array([*own.gust, 0.0]) * math.sin(2 * math.pi * GUST * data.time)
        last = model.nbody - 3  # behind the world and the carriage
        for k in range(last + 1):
            at = data.xipos[2 + k]
            mujoco.mj_jac(model, data, jacobian, None, at, 2 + k)
            v = jacobian @ data.qvel
            force = gust - own.drag * math.sqrt(v @ v) * v
            if own.pull and k == last:
                d = MAGNET - at
                force = force + own.pull * d / (d @ d + SOFT**2)
            data.qfrc_passive[:] += jacobian.T @ force

    def advance(self, data: mujoco.MjData) -> None:
        """Creep over a step whose end is in `data`, exact at constant q."""
        for k, crept in self.crept.items():
            crept += (1.0 - math.exp(-self.h * self.forces.creep[k])) * (turn(data, k) - crept)


GLOBAL = threading.Lock()  # MuJoCo has one callback for all threads and models


@contextmanager
def alone() -> Iterator[None]:
    """No other thread simulates as long as it lasts, and no callback stays."""
    with GLOBAL:
        try:
            yield
        finally:
            mujoco.set_mjcb_passive(None)


def turn(data: mujoco.MjData, k: int) -> np.ndarray:
    """Rotation vector of a ball, turned by at most π [rad]."""
    w, x, y, z = data.qpos[2 + 4 * k : 6 + 4 * k]
    s = math.sqrt(x * x + y * y + z * z)
    angle = 2.0 * math.atan2(s, w)
    angle -= 2 * math.pi * (angle > math.pi)
    return (angle / s if s > 1e-12 else 2.0 / w) * np.array([x, y, z])


def rate(q: np.ndarray) -> np.ndarray:
    """J(q): q̇ = J ω, with ω in the axes of the body that is turned."""
    a = math.sqrt(q @ q)
    x = np.array([[0, -q[2], q[1]], [q[2], 0, -q[0]], [-q[1], q[0], 0]])
    more = 1.0 / 12.0 if a < 1e-3 else (1.0 - 0.5 * a * math.cos(0.5 * a) / math.sin(0.5 * a)) / a**2
    return np.eye(3) + 0.5 * x + more * x @ x


def add(data: mujoco.MjData, k: int, moment: np.ndarray) -> None:
    data.qfrc_passive[2 + 3 * k : 5 + 3 * k] += moment


def settle(model: mujoco.MjModel, data: mujoco.MjData, command: np.ndarray) -> None:
    """Brings the cable to rest under a command (2,) [m] of its two slides, by Newton's method on the forces at rest."""
    balls = (model.nv - 2) // 3

    def force(x: np.ndarray) -> np.ndarray:
        data.qpos[:] = np.concatenate([x[:2], np.tile([1.0, 0.0, 0.0, 0.0], balls)])
        mujoco.mj_integratePos(model, data.qpos, np.concatenate([[0.0, 0.0], x[2:]]), 1.0)
        data.qvel[:], data.ctrl[:] = 0.0, command
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        return data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias

    x = np.concatenate([command, np.zeros(3 * balls)])
    for _ in range(8):
        f = force(x)
        if np.abs(f).max() < 1e-12:
            break
        slope = np.stack([(force(x + d) - force(x - d)) / 2e-6 for d in 1e-6 * np.eye(len(x))], axis=1)
        x -= np.linalg.solve(slope, f)
    force(x)
    data.time = 0.0
