"""Torques of the real double pendulum by inverse dynamics, against those measured, on the recordings that were held out.

    python -m validation.real.arms double_pendulum FOLDER
    pliant diagnose FOLDER/scene.toml --json > FOLDER/diagnosis.json
    python -m validation.real.torques FOLDER

Angles are smoothed and differentiated by a local cubic (Savitzky–Golay, 0.1 s), torques smoothed by the same filter. For every stage
of the diagnosis and for the published parameter sets: root mean square error of both joints' torques, and m₂r₂, the lever that the
data determine.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pliant
from scipy.signal import savgol_filter

from validation.real.arms import HELD_OUT, recordings
from validation.real.deform_dlo import data_folder

RATE = 500.0  # Hz
WINDOW = 51  # samples
SLOW = 0.05  # rad/s: below it dry friction is between its two values


def motion(columns: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Angles, velocities, accelerations and torques, smoothed; (samples, 2) each."""

    def smooth(name: str, order: int = 0) -> np.ndarray:
        both = [savgol_filter(columns[f"{name}{j}"], WINDOW, 3, order, delta=1 / RATE) for j in (1, 2)]
        return np.stack(both, axis=1)[WINDOW:-WINDOW]

    return smooth("pos_meas"), smooth("pos_meas", 1), smooth("pos_meas", 2), smooth("tau_meas")


def of_scene(model: pliant.Model, values: dict[str, float]):
    """Torques that a scene with some parameters replaced needs for a motion."""
    theta = model.theta_with(values)
    at = {path: theta[model.param_index(path)] for path in model.param_paths}
    damping, friction = (np.array([at[f"{j}.{what}"] for j in ("shoulder", "elbow")]) for what in ("damping", "friction"))

    def torque(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        rows = zip(q, v, a, strict=True)
        rigid = np.array([model.mass_matrix(x, theta) @ z + model.bias_forces(x, y, theta) for x, y, z in rows])
        return rigid + damping * v + friction * np.tanh(v / SLOW)

    return torque, at["lower.mass"] * -at["lower.center_of_mass[2]"]


def of_published(p: dict[str, float]):
    """The same for a published parameter set; its inertias are about the joints."""
    rotor = p["gr"] ** 2 * p["Ir"]
    lever = p["m2"] * p["r2"]
    damping, friction = np.array([p["b1"], p["b2"]]), np.array([p["cf1"], p["cf2"]])

    def torque(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        (q1, q2), (v1, v2), (a1, a2) = q.T, v.T, a.T
        cross, bend = lever * p["l1"] * np.cos(q2), lever * p["l1"] * np.sin(q2)
        down = lever * p["g"] * np.sin(q1 + q2)
        first = (p["I1"] + p["I2"] + p["m2"] * p["l1"] ** 2 + 2 * cross + rotor) * a1 + (p["I2"] + cross) * a2
        first += -bend * (2 * v1 * v2 + v2**2) + (p["m1"] * p["r1"] + p["m2"] * p["l1"]) * p["g"] * np.sin(q1) + down
        second = (p["I2"] + cross) * a1 + (p["I2"] + rotor) * a2 + bend * v1**2 + down
        return np.stack([first, second], axis=1) + damping * v + friction * np.tanh(v / SLOW)

    return torque, lever


def error(torque, data: Path) -> float:
    """Root mean square error over the recordings held out [N·m]."""
    squares = []
    for n, columns in enumerate(recordings(data, RATE)):
        if n in HELD_OUT:
            q, v, a, measured = motion(columns)
            squares.append(np.mean((torque(q, v, a) - measured) ** 2))
    return float(np.sqrt(np.mean(squares)))


def rows(data: Path, folder: Path) -> list[tuple[str, float, float]]:
    """What, m₂r₂ [kg·m], error [N·m]."""
    diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    model, out = pliant.load(folder / "scene.toml"), []
    for stage in diagnosis["stages"]:
        values = {p["path"]: p["estimate"] for p in stage["parameters"] if p["path"] in model.param_paths}
        torque, lever = of_scene(model, values)
        out.append((f"pliant, {stage['name']}", lever, error(torque, data)))
    for path in sorted((data / "dfki_double_pendulum").glob("published_*.yml")):
        lines = (line.split(":") for line in path.read_text(encoding="utf-8").splitlines() if ":" in line)
        torque, lever = of_published({name.strip(): float(value) for name, value in lines})
        out.append((path.stem.replace("published_C1_", ""), lever, error(torque, data)))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    data = data_folder()
    if data is None:
        raise SystemExit("the measurements are absent: set PLIANT_DATA to their folder")
    for name, lever, off in rows(data, folder):
        print(f"{name:28}  m2 r2 = {lever:.4f} kg m   torque error {off:.4f} N m")


if __name__ == "__main__":
    main()
