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


EFFECTS = {
    "null": Effect("null"),
    "viscous_friction": Effect(
        "viscous_friction", "elbow", {"elbow": {"damping": 0.02}}
    ),
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
}


def model(effect: Effect) -> mujoco.MjModel:
    """The arm: links of 0.3 and 0.25 m, axes along y, hanging at zero."""

    def joint(name: str) -> str:
        more = " ".join(
            f'{key}="{value}"' for key, value in effect.joint.get(name, {}).items()
        )
        # friction as hard as MuJoCo makes it at this step
        return f'<joint name="{name}" axis="0 1 0" solreffriction="{2.5 * FINE} 1" solimpfriction="0.999 0.9999 0.001" {more}/>'

    gravity = f"{9.81 * np.sin(effect.tilt)} 0 {-9.81 * np.cos(effect.tilt)}"
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
  <option timestep="{FINE}" integrator="RK4" gravity="{gravity}" tolerance="1e-14"><flag contact="disable"/></option>
  <worldbody><body name="upper">{joint("shoulder")}
    <inertial pos="0 0 -0.15" mass="1" diaginertia="0.0085 0.0085 0.001"/>
    <body name="lower" pos="0 0 -0.3">{joint("elbow")}
      <inertial pos="0 0 -0.12" mass="{effect.lower_mass}" diaginertia="0.0045 0.0045 0.0006"/>
    </body></body></worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>""")


def torques(record: int, n: int, rng: np.random.Generator) -> np.ndarray:
    """Commands at the samples [N·m]; none in every third record, which is a free swing."""
    t = np.arange(n) / RATE
    u = np.zeros((n, 2))
    if record % 3 == 2:
        return u
    for j, size in enumerate((1.2, 0.35)):
        for _ in range(4):
            u[:, j] += (
                size
                / 2
                * np.sin(
                    2 * np.pi * rng.uniform(0.2, 2.0) * t + rng.uniform(0, 2 * np.pi)
                )
            )
    return u


def record(
    effect: Effect, number: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, readings and commands of one record. Commands are linear between samples."""
    arm = model(effect)
    data = mujoco.MjData(arm)
    n = round(DURATION * RATE) + 1
    late = effect.delay
    u = torques(number, n, rng)
    t = np.arange(n) / RATE
    data.qpos[:] = rng.uniform(-0.5, 0.5, 2) + (
        np.array([0.9, -0.6]) if number % 3 == 2 else 0.0
    )
    data.qvel[:] = rng.uniform(-0.5, 0.5, 2)
    steps = round(t[-1] / FINE)
    q = np.empty((steps + 1, 2))
    q[0] = data.qpos
    gain, offset = np.array(effect.gain), np.array(effect.offset)
    for k in range(steps):
        now = (k + 0.5) * FINE
        data.ctrl[:] = (
            gain * [np.interp(now, t, u[:, 0]), np.interp(now, t, u[:, 1])] + offset
        )
        mujoco.mj_step(arm, data)
        q[k + 1] = data.qpos
    fine = np.arange(steps + 1) * FINE
    keep = t >= late - 1e-12  # what is read at t was so `late` before
    read = np.stack(
        [np.interp(t[keep] - late, fine, q[:, j]) for j in range(2)], axis=1
    )
    read += np.array(effect.bias) + SIGMA * rng.standard_normal(read.shape)
    first = t[keep][0]
    return t[keep] - first, QUANTUM * np.round(read / QUANTUM), u[keep]


def scene(names: list[str], held_out: list[bool]) -> str:
    """What the scene believes: everything but the effect."""
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
step = {1 / RATE / 8}
duration = {DURATION}
integrator = "midpoint"
[[body]]
name = "upper"
mass = 1.0
center_of_mass = [0, 0, -0.15]
inertia = [0.0085, 0.0085, 0.001, 0, 0, 0]
[[body.joint]]
name = "shoulder"
{joint}[[body]]
name = "lower"
parent = "upper"
position = [0, 0, -0.3]
mass = {GUESS}
center_of_mass = [0, 0, -0.12]
inertia = [{0.0045 * GUESS / LOWER_MASS}, {0.0045 * GUESS / LOWER_MASS}, {0.0006 * GUESS / LOWER_MASS}, 0, 0, 0]
[[body.joint]]
name = "elbow"
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
        scene(names, [k >= n_records - 2 for k in range(n_records)]), encoding="utf-8"
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
