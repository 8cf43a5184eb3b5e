"""From the ODE to a log: the sensor with its hidden faults, its noise, and the files pliant reads.

    reading(t_k) = scale · exp([rotation]×) p(t_k + δ_k - delay) + bias + n_k,   rounded to `quantum`
    n_k = φ n_{k-1} + σ √(1-φ²) w_k, w_k ~ N(0, 1): standard deviation σ [m], colour φ [-] per sample

δ_k ~ N(0, jitter²) [s] is the jitter of the marker clock and is reported: the log's time column reads
t_k + δ_k. The grippers' columns are the commanded positions at t_k, exact to 1e-7 m.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from validation.blind.families import Family, driven_positions

AXES = "xyz"


@dataclass(frozen=True)
class Noise:
    """phi [-] and sigma [m] of the AR(1) noise, quantum [m] of the readings, jitter [s] of the clock."""

    phi: float = 0.7
    sigma: float = 1.0e-3
    quantum: float = 1.0e-4
    jitter: float = 5.0e-5


@dataclass(frozen=True)
class Sensor:
    """Faults of the marker sensor: bias [m], rotation vector [rad], scale [-], delay [s]."""

    bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rotation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0
    delay: float = 0.0


def observe(
    family: Family, y: np.ndarray, y_dot: np.ndarray, sensor: Sensor, noise: Noise, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Readings (T, 3, m) [m] of one record and their reported times (T,) [s].

    y, y_dot (T, 3, m): true markers and velocities at the log's times; before t = 0 the rope rests.
    """
    times = family.times
    jitter = noise.jitter * rng.standard_normal(len(times))
    jitter[0] = 0.0
    path = CubicHermiteSpline(times, y, y_dot, axis=0)
    at = np.maximum(times + jitter - sensor.delay, 0.0)
    turned = np.einsum("ij,tjm->tim", Rotation.from_rotvec(sensor.rotation).as_matrix(), path(at))
    reading = sensor.scale * turned + sensor.bias[:, None] + coloured(noise, y.shape, rng)
    if noise.quantum > 0.0:
        reading = noise.quantum * np.round(reading / noise.quantum)
    return reading, times + jitter


def coloured(noise: Noise, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Stationary AR(1) noise along axis 0 [m]."""
    white = rng.standard_normal(shape)
    out = np.empty(shape)
    out[0] = white[0]
    for k in range(1, shape[0]):
        out[k] = noise.phi * out[k - 1] + np.sqrt(1.0 - noise.phi**2) * white[k]
    return noise.sigma * out


def input_names(family: Family) -> list[tuple[str, list[str]]]:
    """Per gripper: its name and its columns, in the order of its inputs."""
    return [
        (g.name, [f"{g.name}{node}_{axis}" for node in g.nodes for axis in AXES]) for g in family.grippers
    ]


def write_log(path: Path, family: Family, record: int, reading: np.ndarray, t: np.ndarray) -> None:
    """One record as CSV: t [s], markers m<node>_<axis> [m], gripper nodes [m]."""
    commands = driven_positions(family, record, family.times).transpose(2, 1, 0).reshape(len(t), -1)
    markers = reading.transpose(0, 2, 1).reshape(len(t), -1)
    names = ["t"] + [f"m{node}_{axis}" for node in family.markers for axis in AXES]
    names += [column for _, columns in input_names(family) for column in columns]
    formats = ["%.5f"] + ["%.4f"] * markers.shape[1] + ["%.7f"] * commands.shape[1]
    table = np.column_stack([t, markers, np.round(commands, 7) + 0.0])
    np.savetxt(path, table, fmt=formats, delimiter=",", header=",".join(names), comments="")


def scene_text(
    family: Family, shape: np.ndarray, logs: list[tuple[str, str]], stiffness: float, comment: str = ""
) -> str:
    """The nominal scene with its experiment; `stiffness` is the scene's own guess of EI [N·m²].

    `shape` (3, n): the points from which the starting equilibrium is solved; `logs`: (file, role).
    """
    nominal = family.nominal
    points = ", ".join(f"[{x:.5f}, {y:.5f}, {z:.5f}]" for x, y, z in shape.T)
    lines = [f"# {line}" if line else "#" for line in comment.splitlines()]
    lines += [
        "schema_version = 1",
        "",
        "[time]",
        f"step = {family.step}                # s",
        f"duration = {family.duration}",
        'integrator = "midpoint"',
        "",
        "[gravity]",
        "magnitude = 9.81",
        "",
        "[[rope]]",
        'name = "cable"',
        f"nodes = {family.n}",
        f"length = {family.length}                # m",
        f"linear_density = {nominal['rho']}       # kg/m",
        f"stretch_stiffness = {nominal['EA']}    # N",
        f"stretch_damping = {nominal['cs']}      # N·s",
        f"bend_stiffness = {stiffness:.4e}  # N·m²",
        f"bend_damping = {nominal['cb']:.4e}    # N·m²·s",
        f"drag_linear = {nominal['c1']}          # kg/(m·s)",
        f"drag_quadratic = {nominal['c2']}       # kg/m²",
        f"tip_mass = {nominal['tip']}",
        f'initial = {{ shape = "points", points = [{points}] }}',
        'start = "equilibrium"',
    ]
    for gripper in family.grippers:
        lines += ["", "[[gripper]]", f'name = "{gripper.name}"', 'rope = "cable"']
        lines += [f"nodes = {list(gripper.nodes)}", 'mode = "prescribed"']
    lines += ["", "[experiment]", 'initial = "rest"', 'time = { column = "t", unit = "s" }']
    for node in family.markers:
        columns = ", ".join(f'"m{node}_{axis}"' for axis in AXES)
        lines += ["", "[[experiment.marker]]", 'rope = "cable"', f"node = {node}"]
        lines += [f"columns = [{columns}]", 'unit = "m"']
    for name, columns in input_names(family):
        quoted = ", ".join(f'"{column}"' for column in columns)
        lines += ["", "[[experiment.input]]", f'gripper = "{name}"', f"columns = [{quoted}]", 'unit = "m"']
    for file, role in logs:
        lines += ["", "[[experiment.record]]", f'file = "{file}"', f'role = "{role}"']
    lines += ["", "[experiment.fit]"]
    lines += ['free = [{ path = "cable.bend_stiffness", lower = 1.0e-5, upper = 1.0e-1 }]', ""]
    return "\n".join(lines)
