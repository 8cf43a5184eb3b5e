"""Logs of a cable that a gantry swings, with one effect hidden, made by MuJoCo: RK4 at 0.1 ms, not pliant's step.

    python -m validation.blind.cables FOLDER [--effect joint_stiffness] [--seed 0]

Six capsules on ball joints with the drives of SILO's cable (its Table 8) hang from a carriage that two servos
move along x and y by logged commands. A record begins at rest. Three markers are seen, in three coordinates each.
The scene lacks what was hidden; the stiffness that all ball joints share is a guess to be refitted.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from validation.blind import cable_forces
from validation.blind.cable_forces import LINKS, Forces, zeros
from validation.blind.measure import Noise, coloured

LINK, RADIUS, MASS = 0.06, 0.008, 0.01  # m, m, kg
ACROSS = MASS * (LINK**2 / 12 + RADIUS**2 / 4)  # kg·m²
ALONG = 0.5 * MASS * RADIUS**2  # kg·m²
ELASTIC = 1e7  # s, in which a joint creeps that does not
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
NOISE = Noise(0.5, 3e-4)


@dataclass(frozen=True)
class Effect:
    """What is hidden in MuJoCo's joints and bodies, by forces of our own, or in commands and readings."""

    joint: dict[str, dict[str, float]] = field(default_factory=dict)
    mass: dict[str, float] = field(default_factory=dict)  # factor; the inertia grows with it
    spread: dict[str, tuple[float, ...]] = field(default_factory=dict)  # kg·m², more of ∫ x², y², z² dm
    centre: dict[str, tuple[float, ...]] = field(default_factory=dict)  # m, shift of the centre of mass
    tilt: tuple[float, float] = (0.0, 0.0)  # rad, of gravity about x and then y
    gravity: float = 9.81  # m/s²
    offset: tuple[float, float] = (0.0, 0.0)  # N, of the servos
    late: tuple[float, float] = (0.0, 0.0)  # s, of the commands
    lag: tuple[float, float] = (0.0, 0.0)  # s, first order, behind them
    limit: tuple[float, float] = (math.inf, math.inf)  # N, of the servos
    forces: Forces = field(default_factory=Forces)
    bias: tuple[float, ...] = zeros()  # m, of the readings
    rotation: tuple[float, ...] = zeros()  # rad
    scale: float = 1.0
    delay: float = 0.0  # s


EFFECTS = {
    "null": Effect(),
    "viscous_friction": Effect(joint={"joint_3": {"damping": 2 * DAMPING}}),
    "joint_stiffness": Effect(joint={"joint_2": {"stiffness": 2 * STIFFNESS}}),
    "payload": Effect(mass={"link_5": 1.2}),
    "gravity_tilt": Effect(tilt=(0.0, 0.03)),
    "actuator_delay": Effect(late=(0.01, 0.0)),
    "length_scale": Effect(scale=1.02),
    "time_offset": Effect(delay=0.01),
    # outside the library
    "drag": Effect(forces=Forces(drag=0.01)),
}


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
        f'<position joint="{name}" kp="{SERVO}" kv="{BRAKE}" {limit}/>'
        for name, limit in zip(SLIDES, limits, strict=True)
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
        forces = cable_forces.Acting(effect.forces, STIFFNESS, (SERVO, BRAKE), FINE)
        if not effect.forces.none:
            mujoco.set_mjcb_passive(forces)
        every = round(1.0 / RATE / FINE)
        command = motor_command(effect, t, u, FINE, (len(t) - 1) * every)
        settle(model, data, effect, u[0])
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


def settle(model: mujoco.MjModel, data: mujoco.MjData, effect: Effect, first: np.ndarray) -> None:
    """Brings the cable to rest under its first command, by Newton's method on the forces at rest."""
    data.ctrl[:] = first + np.array(effect.offset) / SERVO

    def force(x: np.ndarray) -> np.ndarray:
        data.qpos[:] = np.concatenate([x[:2], np.tile([1.0, 0, 0, 0], LINKS)])
        mujoco.mj_integratePos(model, data.qpos, np.concatenate([[0.0, 0.0], x[2:]]), 1.0)
        data.qvel[:] = 0.0
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        return data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias

    x = np.concatenate([data.ctrl, np.zeros(3 * LINKS)])
    for _ in range(5):
        f = force(x)
        if np.abs(f).max() < 1e-12:
            break
        slope = np.stack([(force(x + d) - force(x - d)) / 2e-6 for d in 1e-6 * np.eye(len(x))], axis=1)
        x -= np.linalg.solve(slope, f)
    force(x)
    data.time = 0.0


def markers(data: mujoco.MjData) -> np.ndarray:
    """Ends of the marked links (markers, 3) [m]."""
    bodies = [2 + k for k in MARKED]
    return data.xpos[bodies] - LINK * data.xmat[bodies].reshape(-1, 3, 3)[:, :, 2]


def seen(effect: Effect, y: np.ndarray) -> np.ndarray:
    """What the sensor reads of markers, without noise and delay."""
    turned = Rotation.from_rotvec(effect.rotation).apply(y.reshape(-1, 3)).reshape(y.shape)
    return effect.scale * turned + effect.bias


def record(
    effect: Effect, excitation: int, number: int, noise: Noise, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, readings (samples, markers, 3) and commands of one record."""
    t, u = commands(excitation, number)
    y = seen(effect, motion(effect, t, u)[0])
    y = y + coloured(noise, y.shape, rng)
    return t, noise.quantum * np.round(y / noise.quantum), u


def columns() -> list[str]:
    return ["t", *(f"m{k}_{axis}" for k in MARKED for axis in AXES), "u_x", "u_y"]


def write(
    effect: Effect,
    folder: Path,
    seed: list[int],
    excitation: int = 0,
    noise: Noise = NOISE,
    guess: float = 0.8,
) -> Path:
    """Scene and logs in a folder, the last records held out; `guess` is the scene's stiffness over the true one."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    names = [f"run{k + 1}.csv" for k in range(RECORDS)]
    for k, name in enumerate(names):
        t, y, u = record(effect, excitation, k, noise, rng)
        table = np.column_stack([t, y.reshape(len(t), -1), u])
        np.savetxt(folder / name, table, "%.7g", ",", header=",".join(columns()), comments="")
    path = folder / "scene.toml"
    path.write_text(scene(names, guess * STIFFNESS), encoding="utf-8")
    return path


def scene(names: list[str], stiffness: float) -> str:
    """What is believed: everything but the effect. `stiffness` [N·m/rad] is its guess for all ball joints."""
    slides = "".join(
        f'''[[body.joint]]
name = "{name}"
kind = "prismatic"
axis = {axis}
'''
        for name, axis in zip(SLIDES, ([1, 0, 0], [0, 1, 0]), strict=True)
    )
    motors = "".join(
        f'[[actuator]]\nname = "motor_{a}"\njoint = "slide_{a}"\nkind = "position"\nstiffness = {SERVO}\ndamping = {BRAKE}\n'
        for a in AXES[:2]
    )
    links = "".join(
        f'''[[body]]
name = "{BODIES[k]}"
parent = "{BODIES[k - 1] if k else "carriage"}"
position = [0, 0, {-LINK if k else 0.0}]
mass = {MASS}
center_of_mass = [0, 0, {-0.5 * LINK}]
inertia = [{ACROSS}, {ACROSS}, {ALONG}, 0, 0, 0]
[[body.joint]]
name = "{BALLS[k]}"
kind = "ball"
stiffness = {stiffness}
damping = {DAMPING}
plastic_time = {ELASTIC}
'''
        for k in range(LINKS)
    )
    seen = "".join(
        f'[[experiment.marker]]\nbody = "{BODIES[k]}"\npoint = [0, 0, {-LINK}]\n'
        f"columns = [{', '.join(f'{chr(34)}m{k}_{axis}{chr(34)}' for axis in AXES)}]\n"
        for k in MARKED
    )
    told = "".join(f'[[experiment.input]]\nactuator = "motor_{a}"\ncolumns = ["u_{a}"]\n' for a in AXES[:2])
    records = "".join(
        f'[[experiment.record]]\nfile = "{name}"\nrole = "{"fit" if k < FITTED else "held_out"}"\n'
        for k, name in enumerate(names)
    )
    return f"""# A cable of capsules that a gantry swings; written by validation/blind/cables.py with MuJoCo.
schema_version = 1
[time]
step = {1 / RATE / EVERY}
duration = {DURATION}
integrator = "midpoint"
[[body]]
name = "carriage"
mass = {CARRIAGE}
inertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]
{slides}{links}{motors}[experiment]
initial = "rest"
time = {{ column = "t" }}
{seen}{told}{records}[experiment.fit]
free = [{{ path = "joint_*.stiffness", lower = 1e-4, upper = 1.0 }}]
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--effect", choices=EFFECTS, default="joint_stiffness")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    print(write(EFFECTS[args.effect], args.folder, [args.seed]))


if __name__ == "__main__":
    main()
