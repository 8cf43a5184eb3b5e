"""From the motions of `cables.py` to logs: noise, rounding, and the files that pliant reads.

    python -m validation.blind.cable_logs FOLDER [--effect joint_stiffness] [--seed 0]

The scene lacks what was hidden; the stiffness that all ball joints share is a guess of it, to be refitted.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from validation.blind.cable_forces import LINKS, Forces
from validation.blind.cables import (
    ACROSS,
    ALONG,
    AXES,
    BALLS,
    BODIES,
    BRAKE,
    CARRIAGE,
    DAMPING,
    DURATION,
    EVERY,
    FITTED,
    LINK,
    MARKED,
    MASS,
    RATE,
    RECORDS,
    SERVO,
    SLIDES,
    STIFFNESS,
    Effect,
    commands,
    motion,
    seen,
)
from validation.blind.measure import Noise, coloured

NOISE = Noise(0.5, 3e-4)
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


def record(
    effect: Effect, excitation: int, number: int, noise: Noise, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, readings (samples, markers, 3) [m] and commands of one record."""
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
    split: tuple[int, int] = (FITTED, RECORDS),
) -> Path:
    """Scene and logs in a folder. `guess`: the scene's stiffness over the true one; `split`: records to fit, and all."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    roles = {f"run{k + 1}.csv": "fit" if k < split[0] else "held_out" for k in range(split[1])}
    for k, name in enumerate(roles):
        t, y, u = record(effect, excitation, k, noise, rng)
        table = np.column_stack([t, y.reshape(len(t), -1), u])
        np.savetxt(folder / name, table, "%.7g", ",", header=",".join(columns()), comments="")
    path = folder / "scene.toml"
    path.write_text(scene(roles, guess * STIFFNESS), encoding="utf-8")
    return path


def links(stiffness: float) -> str:
    """The cable's bodies and joints."""
    return "".join(
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
'''
        for k in range(LINKS)
    )


def experiment(roles: dict[str, str]) -> str:
    """Markers, inputs and records."""
    seen = "".join(
        f'[[experiment.marker]]\nbody = "{BODIES[k]}"\npoint = [0, 0, {-LINK}]\n'
        f"columns = {[f'm{k}_{axis}' for axis in AXES]}\n"
        for k in MARKED
    )
    told = "".join(f'[[experiment.input]]\nactuator = "motor_{a}"\ncolumns = ["u_{a}"]\n' for a in AXES[:2])
    files = "".join(f'[[experiment.record]]\nfile = "{name}"\nrole = "{role}"\n' for name, role in roles.items())
    return f'[experiment]\ninitial = "rest"\ntime = {{ column = "t" }}\n{seen}{told}{files}'


def scene(roles: dict[str, str], stiffness: float) -> str:
    """What is believed of logs with these roles: everything but the effect; `stiffness` [N·m/rad] is its guess."""
    slides = "".join(
        f'[[body.joint]]\nname = "{name}"\nkind = "prismatic"\naxis = {axis}\n'
        for name, axis in zip(SLIDES, ([1, 0, 0], [0, 1, 0]), strict=True)
    )
    motors = "".join(
        f'[[actuator]]\nname = "motor_{a}"\njoint = "slide_{a}"\nkind = "position"\n'
        f"stiffness = {SERVO}\ndamping = {BRAKE}\n"
        for a in AXES[:2]
    )
    return f"""# A cable of capsules that a gantry swings; written by validation/blind/cable_logs.py with MuJoCo.
schema_version = 1
[time]
step = {1 / RATE / EVERY}
duration = {DURATION}
integrator = "midpoint"
[[body]]
name = "carriage"
mass = {CARRIAGE}
inertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]
{slides}{links(stiffness)}{motors}{experiment(roles)}[experiment.fit]
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
