"""Motions of a cable that a gantry swings, with one effect hidden, made by MuJoCo: RK4 at 0.1 ms, not pliant's step.

Six capsules on ball joints with the drives of SILO's cable (its Table 8) hang from a carriage that two servos
move along x and y by logged commands. A record begins at rest. Three markers are seen, in three coordinates each.
`cable_logs.py` adds noise and writes logs and a scene, which lacks what was hidden.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from validation.blind import cable_forces
from validation.blind.cable_forces import LINKS, Forces, zeros

LINK, RADIUS, MASS = 0.06, 0.008, 0.01  # m, m, kg
ACROSS = MASS * (LINK**2 / 12 + RADIUS**2 / 4)  # kg·m²
ALONG = 0.5 * MASS * RADIUS**2  # kg·m²
STIFFNESS, DAMPING = 1e-2, 1e-3  # N·m/rad, N·m·s/rad
CARRIAGE = 0.5  # kg
SERVO, BRAKE = 2000.0, 60.0  # N/m, N·s/m
MARKED = (1, 3, 5)  # links whose far ends are seen
RATE = 100.0  # Hz
FINE = 1e-4  # s
DURATION = 2.0  # s
EVERY = 4  # pliant's steps per sample
RECORDS, FITTED = 6, 4
BALLS = tuple(f"joint_{k}" for k in range(LINKS))
SLIDES = ("slide_x", "slide_y")
BODIES = tuple(f"link_{k}" for k in range(LINKS))
AXES = "xyz"


@dataclass(frozen=True)
class Effect:
    """What is hidden in MuJoCo's joints and bodies, by forces of our own, or in commands and readings."""

    joint: dict[str, dict[str, float]] = field(default_factory=dict)
    mass: dict[str, float] = field(default_factory=dict)  # factor; the inertia grows with it
    spread: dict[str, tuple[float, ...]] = field(default_factory=dict)  # kg·m², more of ∫ x², y², z² dm
    centre: dict[str, tuple[float, ...]] = field(default_factory=dict)  # m, shift of the centre of mass
    tilt: tuple[float, float] = (0.0, 0.0)  # rad, of gravity about x and then y
    gravity: float = 9.81  # m/s²
    stiffer: tuple[float, float] = (0.0, 0.0)  # N/m, of the servos
    offset: tuple[float, float] = (0.0, 0.0)  # N, of the servos
    late: tuple[float, float] = (0.0, 0.0)  # s, of the commands
    lag: tuple[float, float] = (0.0, 0.0)  # s, first order, behind them
    limit: tuple[float, float] = (math.inf, math.inf)  # N, of the servos
    forces: Forces = field(default_factory=Forces)
    bias: tuple[float, ...] = zeros()  # m, of the readings
    rotation: tuple[float, ...] = zeros()  # rad
    scale: float = 1.0
    delay: float = 0.0  # s


def gravity(effect: Effect) -> np.ndarray:
    """R_y(tilt₁) R_x(tilt₀) (0, 0, -g) [m/s²]."""
    turn = Rotation.from_euler("y", effect.tilt[1]) * Rotation.from_euler("x", effect.tilt[0])
    return turn.apply([0.0, 0.0, -effect.gravity])


def joint(effect: Effect, name: str, kind: str) -> str:
    own = dict(effect.joint.get(name, {}))
    if name in BALLS:
        own = {"stiffness": STIFFNESS, "damping": DAMPING} | own
        own["stiffness"] = 0.0 if effect.forces.replaces_spring(BALLS.index(name)) else own["stiffness"]
    more = " ".join(f'{key}="{value!r}"' for key, value in own.items())
    # friction as hard as MuJoCo makes it at this step
    return f'<joint name="{name}" {kind} solreffriction="{2.5 * FINE} 1" solimpfriction="0.999 0.9999 0.001" {more}/>'


def body(effect: Effect, k: int) -> str:
    """A link, left open for the next."""
    name, factor = BODIES[k], effect.mass.get(BODIES[k], 1.0)
    x, y, z = np.array([0.0, 0.0, -0.5 * LINK]) + effect.centre.get(name, zeros())
    a, b, c = effect.spread.get(name, zeros())
    moments = factor * np.array([ACROSS, ACROSS, ALONG]) + (b + c, a + c, a + b)
    return f"""<body name="{name}" pos="0 0 {-LINK if k else 0}">{joint(effect, BALLS[k], 'type="ball"')}
    <inertial pos="{x} {y} {z}" mass="{MASS * factor!r}" diaginertia="{" ".join(map(repr, moments.tolist()))}"/>"""


def xml(effect: Effect) -> str:
    """The cable hanging straight down from its carriage."""
    slides = "".join(
        joint(effect, name, f'type="slide" axis="{axis}"')
        for name, axis in zip(SLIDES, ("1 0 0", "0 1 0"), strict=True)
    )
    limits = ["" if math.isinf(x) else f'forcerange="{-x} {x}"' for x in effect.limit]
    servos = "".join(
        f'<position joint="{name}" kp="{SERVO + more}" kv="{BRAKE}" {limit}/>'
        for name, more, limit in zip(SLIDES, effect.stiffer, limits, strict=True)
    )
    g = " ".join(map(repr, map(float, gravity(effect))))
    return f"""<mujoco>
  <option timestep="{FINE}" integrator="RK4" gravity="{g}" tolerance="1e-14"><flag contact="disable"/></option>
  <worldbody><body name="carriage">{slides}<inertial pos="0 0 0" mass="{CARRIAGE}" diaginertia="1e-3 1e-3 1e-3"/>
  {"".join(body(effect, k) for k in range(LINKS))}{"</body>" * LINKS}</body></worldbody>
  <actuator>{servos}</actuator></mujoco>"""


def commands(excitation: int, record: int, duration: float = DURATION) -> tuple[np.ndarray, np.ndarray]:
    """Times and commanded places of the carriage (samples, 2) [m]: sums of sines that grow from rest."""
    rng = np.random.default_rng([excitation, record, 5])
    t = np.arange(round(duration * RATE) + 1) / RATE
    u = np.zeros((len(t), 2))
    for j in range(2):
        for _ in range(3):
            f = rng.uniform(0.4, 2.5)
            u[:, j] += 0.06 / (1.0 + f) * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi))
    u *= (1.0 - np.exp(-((t / 0.3) ** 2)))[:, None]
    return t, np.round(u, 7)


def motor_command(effect: Effect, t: np.ndarray, u: np.ndarray, h: float, steps: int) -> np.ndarray:
    """What the servos are told over each of `steps` steps of h [m]: linear between samples, the first held before.

    Readings that are late, of a motion that begins at rest, are those of a motion whose commands are all late.
    """
    out = np.empty((steps, 2))
    for j in range(2):
        command = np.interp((np.arange(steps) + 0.5) * h - effect.late[j] - effect.delay, t, u[:, j])
        if effect.lag[j] > 0.0:
            decay, tau = math.exp(-h / effect.lag[j]), effect.lag[j]
            y = u[0, j]
            for k, c in enumerate(command):
                command[k], y = c + (y - c) * (1.0 - decay) * tau / h, c + (y - c) * decay
        out[:, j] = command + effect.offset[j] / SERVO
    return out


def motion(effect: Effect, t: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the markers (samples, markers, 3) [m] from rest, and the largest forces of the servos (2,) [N]."""
    with cable_forces.alone():
        model = mujoco.MjModel.from_xml_string(xml(effect))
        data = mujoco.MjData(model)
        forces = cable_forces.Acting(effect.forces, STIFFNESS, FINE)
        if not effect.forces.none:
            mujoco.set_mjcb_passive(forces)
        every = round(1.0 / RATE / FINE)
        command = motor_command(effect, t, u, FINE, (len(t) - 1) * every)
        cable_forces.settle(model, data, u[0] + np.array(effect.offset) / SERVO)
        out, peak = [markers(data)], np.zeros(2)
        for k, own in enumerate(command):
            data.ctrl[:] = own
            mujoco.mj_step(model, data)
            peak = np.maximum(peak, np.abs(data.actuator_force))
            forces.advance(data)
            if (k + 1) % every == 0:
                mujoco.mj_kinematics(model, data)
                out.append(markers(data))
    return np.array(out), peak


def markers(data: mujoco.MjData) -> np.ndarray:
    """Ends of the marked links (markers, 3) [m]."""
    bodies = [2 + k for k in MARKED]
    return data.xpos[bodies] - LINK * data.xmat[bodies].reshape(-1, 3, 3)[:, :, 2]


def seen(effect: Effect, y: np.ndarray) -> np.ndarray:
    """What the sensor reads of markers, without noise and delay."""
    turned = Rotation.from_rotvec(effect.rotation).apply(y.reshape(-1, 3)).reshape(y.shape)
    return effect.scale * turned + effect.bias
