"""Logs of a ball that cannot turn, dropped on a floor where it slides to a stop: Newton's law in closed form, no simulator.

    flight    z̈ = -g, x constant in speed          impact (none bounces)    ẋ ← ẋ - sign(ẋ) min(μ |ż|, |ẋ|), ż ← 0
    sliding   ẍ = -μ g sign(ẋ) until it stops

Encoders read x and z of the ball's middle. The scene has the floor at height 0 and a friction of its own.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

RATE = 200.0  # Hz
DURATION = 1.2  # s
SIGMA = 3e-4  # m
RADIUS = 0.05  # m
GRAVITY = 9.81  # m/s²


def motion(t: np.ndarray, drop: float, speed: float, friction: float, height: float) -> np.ndarray:
    """(x, z) at times t of a ball let go `drop` [m] above the floor at `speed` [m/s]."""
    landed = np.sqrt(2.0 * drop / GRAVITY)
    z = height + RADIUS + np.maximum(drop - 0.5 * GRAVITY * t**2, 0.0) * (t < landed)
    after = np.sign(speed) * max(abs(speed) - friction * GRAVITY * landed, 0.0)
    s = np.clip(t - landed, 0.0, abs(after) / (friction * GRAVITY))
    slid = after * s - 0.5 * np.sign(after) * friction * GRAVITY * s**2
    return np.stack([speed * np.minimum(t, landed) + slid, z], axis=1)


def scene(names: list[str], held_out: list[bool], friction: float) -> str:
    """What is believed: a floor at height 0 of this friction."""
    records = "".join(
        f'[[experiment.record]]\nfile = "{name}"\nrole = "{"held_out" if out else "fit"}"\n'
        for name, out in zip(names, held_out, strict=True)
    )
    return f"""# A ball on two slides; written by validation/blind/slider.py, in closed form.
schema_version = 1
[time]
step = {1 / RATE / 8}
duration = {DURATION}
integrator = "euler"
[[plane]]
name = "floor"
friction = {friction}
[[body]]
name = "ball"
mass = 1.0
inertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]
[[body.joint]]
name = "x"
kind = "prismatic"
axis = [1, 0, 0]
[[body.joint]]
name = "z"
kind = "prismatic"
axis = [0, 0, 1]
start = [0.3]
[[body.shape]]
kind = "sphere"
radius = {RADIUS}
[experiment]
time = {{ column = "t" }}
[[experiment.joint]]
joint = "x"
column = "x"
noise_floor = 1e-4
[[experiment.joint]]
joint = "z"
column = "z"
noise_floor = 1e-4
{records}"""


def write(folder: Path, seed: int, *, friction: float = 0.2, height: float = 0.0, believed: float = 0.2) -> Path:
    """Scene and logs of six throws in a folder, the last two held out."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    names = [f"run{k + 1}.csv" for k in range(6)]
    for name in names:
        y = motion(t, rng.uniform(0.05, 0.2), rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.5), friction, height)
        table = np.column_stack([t, y + SIGMA * rng.standard_normal(y.shape)])
        np.savetxt(folder / name, table, "%.7g", ",", header="t,x,z", comments="")
    path = folder / "scene.toml"
    path.write_text(scene(names, [k >= 4 for k in range(6)], believed), encoding="utf-8")
    return path
