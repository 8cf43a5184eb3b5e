"""Logs of a two-link arm with one effect hidden, made by MuJoCo (RK4 at 0.1 ms): not pliant's integrator, not its step.

    python -m validation.blind.arms FOLDER [--effect coulomb_friction] [--seed 0]

The arm swings in a vertical plane, both joints driven by torque. Each record has another excitation: sums of sines, and for the
last a swing let go. Encoders: white noise of `SIGMA` and steps of `QUANTUM`. The scene lacks what was hidden; the mass of the
lower link is a guess to be refitted.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

RATE = 200.0  # Hz
FINE = 1e-4  # s
DURATION = 3.0  # s
SIGMA = 5e-4  # rad
QUANTUM = 1e-4  # rad
LOWER_MASS = 0.7  # kg
GUESS = 0.63  # kg, what the scene says


@dataclass(frozen=True)
class Effect:
    """What is hidden: attributes of MuJoCo's joints and bodies, or what is done to torques and readings."""

    name: str
    object: str | None = None
    joint: dict[str, dict[str, float]] = field(default_factory=dict)
    lower_mass: float = LOWER_MASS
    gain: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    delay: float = 0.0  # s, of the readings
    bias: tuple[float, float] = (0.0, 0.0)  # rad
    tilt: float = 0.0  # rad, of gravity in the plane of motion
    scale: tuple[float, float] = (1.0, 1.0)  # of the readings
    play: tuple[float, float] = (0.0, 0.0)  # rad, half the play between joint and encoder
    late: tuple[float, float] = (0.0, 0.0)  # s, of the commands
    lag: tuple[float, float] = (0.0, 0.0)  # s, first order, behind them
    limit: tuple[float, float] = (np.inf, np.inf)  # N·m, of the motor
    push: tuple[float, float] = (0.0, 0.0)  # N·m, past the motor
    load: tuple[float, float] = (0.0, 0.0)  # friction per torque of the motor
    cubic: tuple[float, float] = (0.0, 0.0)  # N·m/rad³
    ripple: tuple[float, float] = (0.0, 0.0)  # N·m of sin(8 q)
    quadratic: tuple[float, float] = (0.0, 0.0)  # N·m·s²/rad²
    known_friction: tuple[float, float] = (0.0, 0.0)  # N·m, what the scene says of dry friction

    @property
    def acts_by_state(self) -> bool:
        """Whether a torque depends on the motion in a way that MuJoCo's joints do not have."""
        return any(self.cubic + self.ripple + self.quadratic)


EFFECTS = {
    "null": Effect("null"),
    "viscous_friction": Effect(
        "viscous_friction", "elbow", {"elbow": {"damping": 0.02}}
    ),
    "quadratic_damping": Effect("quadratic_damping", "shoulder", quadratic=(0.01, 0.0)),
    "coulomb_friction": Effect(
        "coulomb_friction", "shoulder", {"shoulder": {"frictionloss": 0.06}}
    ),
    "joint_stiffness": Effect(
        "joint_stiffness", "elbow", {"elbow": {"stiffness": 0.2}}
    ),
    "armature": Effect("armature", "shoulder", {"shoulder": {"armature": 0.01}}),
    "torque_gain": Effect("torque_gain", "motor_elbow", gain=(1.0, 0.9)),
    "torque_offset": Effect("torque_offset", "motor_shoulder", offset=(0.05, 0.0)),
    "sensor_delay": Effect("sensor_delay", delay=0.008),
    "encoder_bias": Effect("encoder_bias", "elbow", bias=(0.0, 0.02)),
    "gravity_tilt": Effect("gravity_tilt", tilt=0.02),
    "actuator_delay": Effect("actuator_delay", "motor_elbow", late=(0.0, 0.006)),
    "actuator_lag": Effect("actuator_lag", "motor_shoulder", lag=(0.02, 0.0)),
    "saturation": Effect("saturation", "motor_shoulder", limit=(1.0, np.inf)),
    "asymmetric_friction": Effect(
        "asymmetric_friction",
        "shoulder",
        {"shoulder": {"frictionloss": 0.075}},
        push=(0.025, 0.0),  # 0.05 N·m against positive velocities, 0.1 against negative ones
        known_friction=(0.05, 0.0),
    ),
    "load_friction": Effect("load_friction", "shoulder", load=(0.1, 0.0)),
    # outside the library
    "ripple": Effect("", ripple=(0.05, 0.0)),
    "backlash": Effect("", play=(0.0, 0.01)),
}


def model(effect: Effect) -> mujoco.MjModel:
    """The arm as MuJoCo simulates it."""
    return mujoco.MjModel.from_xml_string(xml(effect))


def xml(effect: Effect) -> str:
    """The arm: links of 0.3 and 0.25 m, axes along y, hanging at zero; its encoders are sensors."""

    def joint(name: str) -> str:
        own = dict(effect.joint.get(name, {}))
        if effect.load[name == "elbow"]:
            own.setdefault("frictionloss", 1e-6)  # set anew at every step
        more = " ".join(f'{key}="{value}"' for key, value in own.items())
        # friction as hard as MuJoCo makes it at this step
        return f'<joint name="{name}" axis="0 1 0" solreffriction="{2.5 * FINE} 1" solimpfriction="0.999 0.9999 0.001" {more}/>'

    gravity = f"{9.81 * np.sin(effect.tilt)} 0 {-9.81 * np.cos(effect.tilt)}"
    return f"""<mujoco>
  <option timestep="{FINE}" integrator="RK4" gravity="{gravity}" tolerance="1e-14"><flag contact="disable"/></option>
  <worldbody><body name="upper">{joint("shoulder")}
    <inertial pos="0 0 -0.15" mass="1" diaginertia="0.0085 0.0085 0.001"/>
    <body name="lower" pos="0 0 -0.3">{joint("elbow")}
      <inertial pos="0 0 -0.12" mass="{effect.lower_mass}" diaginertia="0.0045 0.0045 0.0006"/>
    </body></body></worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>
  <sensor><jointpos joint="shoulder"/><jointpos joint="elbow"/></sensor></mujoco>"""


def torques(
    record: int, n: int, rng: np.random.Generator, size: float = 1.0
) -> np.ndarray:
    """Commands at the samples [N·m]; none in every third record, which is a free swing."""
    t = np.arange(n) / RATE
    u = np.zeros((n, 2))
    if record % 3 == 2:
        return u
    for j, own in enumerate((1.2 * size, 0.35 * size)):
        for _ in range(4):
            u[:, j] += (
                own
                / 2
                * np.sin(
                    2 * np.pi * rng.uniform(0.2, 2.0) * t + rng.uniform(0, 2 * np.pi)
                )
            )
    return u


def motor_torque(
    effect: Effect, t: np.ndarray, u: np.ndarray, h: float, steps: int
) -> np.ndarray:
    """What the motors exert over each of `steps` steps of h [N·m]: commands linear between samples, the first held before."""
    out = np.empty((steps, 2))
    for j in range(2):
        command = np.interp((np.arange(steps) + 0.5) * h - effect.late[j], t, u[:, j])
        if effect.lag[j] > 0.0:
            decay = np.exp(-h / effect.lag[j])
            y, lagged = u[0, j], np.empty(steps)
            for k, c in enumerate(command):
                lagged[k] = c + (y - c) * (1.0 - decay) * effect.lag[j] / h
                y = c + (y - c) * decay
            command = lagged
        raw = effect.gain[j] * command + effect.offset[j]
        out[:, j] = np.clip(raw, -effect.limit[j], effect.limit[j])
    return out


def with_play(q: np.ndarray, half: float) -> np.ndarray:
    """What an encoder reads that follows the joint with play."""
    if half == 0.0:
        return q
    out, at = np.empty_like(q), q[0]
    for k, x in enumerate(q):
        at = min(max(at, x - half), x + half)
        out[k] = at
    return out


def motion(
    effect: Effect,
    number: int,
    rng: np.random.Generator,
    size: float = 1.0,
    duration: float = DURATION,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times and commands at the samples; angles and velocities at all steps of MuJoCo."""
    arm = model(effect)
    data = mujoco.MjData(arm)
    n = round(duration * RATE) + 1
    u = torques(number, n, rng, size)
    t = np.arange(n) / RATE
    data.qpos[:] = rng.uniform(-0.5, 0.5, 2) + (
        np.array([0.9, -0.6]) if number % 3 == 2 else 0.0
    )
    data.qvel[:] = rng.uniform(-0.5, 0.5, 2)
    steps = round(t[-1] / FINE)
    q, v = np.empty((steps + 1, 2)), np.empty((steps + 1, 2))
    q[0], v[0] = data.qpos, data.qvel
    torque = motor_torque(effect, t, u, FINE, steps)
    load, push = np.array(effect.load), np.array(effect.push)
    cubic, ripple, quadratic = (
        np.array(x) for x in (effect.cubic, effect.ripple, effect.quadratic)
    )
    data.qfrc_applied[:] = push
    for k in range(steps):
        data.ctrl[:] = torque[k]
        if load.any():
            arm.dof_frictionloss[:] = np.maximum(load * np.abs(torque[k]), 1e-6 * (load > 0))
        if effect.acts_by_state:
            # in the middle of the step
            x, w = q[k] + 0.5 * FINE * v[k], v[k] + 0.5 * FINE * data.qacc
            data.qfrc_applied[:] = (
                push - cubic * x**3 + ripple * np.sin(8 * x) - quadratic * w * np.abs(w)
            )
        mujoco.mj_step(arm, data)
        q[k + 1], v[k + 1] = data.qpos, data.qvel
    return t, u, q, v


def record(
    effect: Effect,
    number: int,
    rng: np.random.Generator,
    size: float = 1.0,
    sigma: float = SIGMA,
    colour: float = 0.0,
    duration: float = DURATION,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, readings and commands of one record; noise of `sigma` [rad], correlated by `colour` from sample to sample."""
    t, u, q, _ = motion(effect, number, rng, size, duration)
    late = effect.delay
    fine = np.arange(len(q)) * FINE
    keep = t >= late - 1e-12  # what is read at t was so `late` before
    seen = [with_play(q[:, j], effect.play[j]) for j in range(2)]
    read = np.stack([np.interp(t[keep] - late, fine, x) for x in seen], axis=1)
    noise = sigma * rng.standard_normal(read.shape)
    for k in range(1, len(noise)):
        noise[k] = colour * noise[k - 1] + np.sqrt(1 - colour**2) * noise[k]
    read = np.array(effect.scale) * read + np.array(effect.bias) + noise
    first = t[keep][0]
    return t[keep] - first, QUANTUM * np.round(read / QUANTUM), u[keep]


def scene(
    names: list[str],
    held_out: list[bool],
    guess: float = GUESS,
    friction: tuple[float, float] = (0.0, 0.0),
    substeps: int = 8,
) -> str:
    """What the scene believes: everything but the effect. `guess` [kg] is its mass of the lower link, `friction` [N·m] what it knows."""
    joint = 'kind = "revolute"\naxis = [0, 1, 0]\n'
    motors = "".join(
        f'[[actuator]]\nname = "motor_{j}"\njoint = "{j}"\nkind = "torque"\n'
        for j in ("shoulder", "elbow")
    )
    inputs = "".join(
        f'[[experiment.input]]\nactuator = "motor_{j}"\ncolumns = ["u_{j}"]\n'
        for j in ("shoulder", "elbow")
    )
    sensors = "".join(
        f'[[experiment.joint]]\njoint = "{j}"\ncolumn = "q_{j}"\nnoise_floor = 1e-4\n'
        for j in ("shoulder", "elbow")
    )
    records = "".join(
        f'[[experiment.record]]\nfile = "{name}"\nrole = "{"held_out" if out else "fit"}"\n'
        for name, out in zip(names, held_out, strict=True)
    )
    return f"""# A two-link arm; written by validation/blind/arms.py, whose simulator is not pliant.
schema_version = 1
[time]
step = {1 / RATE / substeps}
duration = {DURATION}
integrator = "midpoint"
[[body]]
name = "upper"
mass = 1.0
center_of_mass = [0, 0, -0.15]
inertia = [0.0085, 0.0085, 0.001, 0, 0, 0]
[[body.joint]]
name = "shoulder"
friction = {friction[0]}
{joint}[[body]]
name = "lower"
parent = "upper"
position = [0, 0, -0.3]
mass = {guess}
center_of_mass = [0, 0, -0.12]
inertia = [{0.0045 * guess / LOWER_MASS}, {0.0045 * guess / LOWER_MASS}, {0.0006 * guess / LOWER_MASS}, 0, 0, 0]
[[body.joint]]
name = "elbow"
friction = {friction[1]}
{joint}{motors}[experiment]
time = {{ column = "t" }}
{sensors}{inputs}{records}[experiment.fit]
free = [{{ path = "lower.mass", lower = 0.1, upper = 3.0 }}]
"""


def write(effect: Effect, folder: Path, seed: int, n_records: int = 6) -> Path:
    """Scene and logs in a folder; every third record is held out."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    names = [f"run{k + 1}.csv" for k in range(n_records)]
    for k, name in enumerate(names):
        t, q, u = record(effect, k, rng)
        table = np.column_stack([t, q, u])
        header = "t,q_shoulder,q_elbow,u_shoulder,u_elbow"
        np.savetxt(folder / name, table, "%.7g", ",", header=header, comments="")
    path = folder / "scene.toml"
    path.write_text(
        scene(
            names,
            [k >= n_records - 2 for k in range(n_records)],
            friction=effect.known_friction,
        ),
        encoding="utf-8",
    )
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--effect", choices=EFFECTS, default="coulomb_friction")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    print(write(EFFECTS[args.effect], args.folder, args.seed))


if __name__ == "__main__":
    main()
