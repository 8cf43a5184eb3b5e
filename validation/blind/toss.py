"""A tossed rigid body watched by four markers, as a system of the blind batch.

    p̈ = g + f/m,    J ω̇ = (J ω) × ω + τ,    2 u̇ = u ∘ (0, ω)        ω in the body's axes, p the centre of mass

Classical Runge-Kutta at 2 ms, many variants at once; the implicit midpoint rule at the scene's step beside it. Nothing is commanded
and every record's beginning is unknown, so that gravity and the sensor alone can be wrong, and where the mass is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from validation.blind.system import (
    Cause,
    Changes,
    Job,
    Knob,
    Setup,
    sensor_causes,
    sensor_knobs,
    shown_area,
    stokes,
    turned,
)

G = 9.81  # m/s²
FINE = 2e-3  # s
POINTS = np.array([[0.05, 0.0, 0.0], [-0.03, 0.06, 0.0], [-0.03, -0.04, 0.05], [0.0, 0.0, -0.06]])  # m, of the markers in the body's frame
AXES = "xyz"
DRAGS = {"drag": 1.0, "quadratic": 0.4}  # largest sizes: 1/s, 1/m
BEYOND = {"magnus": 0.06, "spin": 1.0, "gust": 6.0}  # outside the library, largest sizes: -, 1/s, m/s²
FORCES = (*DRAGS, *BEYOND)


def quaternion_rate(u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """u̇ of quaternions (n, 4), scalar first."""
    s, x = u[:, :1], u[:, 1:]
    return 0.5 * np.concatenate([-np.sum(x * w, axis=1, keepdims=True), s * w + np.cross(x, w)], axis=1)


def rate(state: np.ndarray, p: dict[str, np.ndarray], t: float) -> np.ndarray:
    """Derivatives of (n, 13): place, quaternion, velocity, spin."""
    u, v, w = state[:, 3:7], state[:, 7:10], state[:, 10:]
    a = p["gravity"] - p["drag"] * v - p["quadratic"] * np.linalg.norm(v, axis=1, keepdims=True) * v
    if p["magnus"].any():
        a = a + p["magnus"] * np.cross(Rotation.from_quat(u, scalar_first=True).apply(w), v)
    a[:, 0] += p["gust"][:, 0] * np.exp(-0.5 * ((t - p["gust_at"][:, 0]) / 0.05) ** 2)
    spun = (np.cross(p["inertia"] * w, w)) / p["inertia"] - p["spin"] * w
    return np.concatenate([v, quaternion_rate(u, w), a, spun], axis=1)


def simulate(p: dict[str, np.ndarray], state: np.ndarray, h: float, steps: int, midpoint: bool) -> np.ndarray:
    """States (steps + 1, n, 13)."""
    out = np.empty((steps + 1, *state.shape))
    out[0] = state
    for k in range(steps):
        t = k * h
        if midpoint:
            d = rate(state, p, t)
            for _ in range(6):
                d = rate(state + 0.5 * h * d, p, t + 0.5 * h)
            state = state + h * d
        else:
            k1 = rate(state, p, t)
            k2 = rate(state + 0.5 * h * k1, p, t + 0.5 * h)
            k3 = rate(state + 0.5 * h * k2, p, t + 0.5 * h)
            k4 = rate(state + h * k3, p, t + h)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        out[k + 1] = state
    return out


class TossSetup(Setup):
    """See `Setup`."""

    system = "toss"
    rate, duration = 200.0, 0.6

    def __init__(self, rng: np.random.Generator, jitter: float = 0.0) -> None:
        self.roles, self.substeps = ("fit",) * 5 + ("held_out",), 4
        self.mass, self.com = float(rng.uniform(0.2, 0.6)), np.round(rng.uniform(-0.01, 0.01, 3), 4)
        self.spread = np.round(np.array([0.03, 0.024, 0.018])[rng.permutation(3)] * rng.uniform(0.8, 1.2), 5)
        self.sigma = float(np.exp(rng.uniform(np.log(2e-4), np.log(1e-3))))
        self.begun, self.stamps = [], []
        for _ in self.roles:
            place, v = rng.uniform(-0.3, 0.3, 3) + [0.0, 0.0, 1.0], [*rng.uniform(-1.0, 1.0, 2), rng.uniform(2.0, 3.0)]
            self.begun.append((place, rng.uniform(-2.0, 2.0, 3), np.array(v), rng.uniform(3.0, 7.0, 3) * rng.choice([-1, 1], 3)))
            t = np.arange(round(self.duration * self.rate) + 1) / self.rate
            self.stamps.append(np.round(t + jitter * np.clip(rng.standard_normal(len(t)), -3, 3) * (t > 0), 6))
        self.free, self.values, self.starts = (), {}, 12
        self.start_steps = (1e-4,) * 3 + (1e-3,) * 3 + (1e-3,) * 3 + (1e-2,) * 3
        three = lambda stem: tuple(f"{stem}{k}" for k in range(3))
        self.knobs = sensor_knobs(0.5) | {"gravity": Knob(0.02, 2.0, "gravity.magnitude", G)}
        self.knobs |= {f"tilt{k}": Knob(1e-3, 0.2, f"gravity.tilt[{k}]") for k in range(2)}
        self.knobs |= {f"com{k}": Knob(2e-4, 0.02, f"body.center_of_mass[{k}]", float(self.com[k])) for k in range(3)}
        self.knobs |= {f"spread{k}": Knob(1e-4, 8e-3, f"body.spread[{k}]", float(self.spread[k])) for k in range(3)}
        own = [Cause("gravity_magnitude", "", ("gravity",)), Cause("gravity_tilt", "", ("tilt0", "tilt1")), *sensor_causes(),
               Cause("center_of_mass", "body", three("com")), Cause("link_inertia", "body", three("spread"))]  # fmt: skip
        own += [Cause("linear_drag", "", ("drag",)), Cause("quadratic_drag", "", ("quadratic",))]
        self.causes = {cause.key: cause for cause in own}
        self.outside = {key: (key,) for key in BEYOND}
        self.knobs |= {key: Knob(0.02 * x, x, one_sided=key == "spin") for key, x in BEYOND.items()}
        medium = {"drag": ("air.viscosity", stokes(self.spread)), "quadratic": ("air.density", 0.5 * shown_area(self.spread))}
        for key, x in DRAGS.items():
            (path, per_unit), mass = medium[key], self.mass
            self.knobs[key] = Knob(0.02 * x, x, path, one_sided=True, value=lambda size, per_unit=per_unit: size * mass / per_unit)

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        h = 1.0 / self.rate / self.substeps if rule == "scene" else FINE
        steps = round((self.duration + 0.01) / h)
        states, p = [], {key: np.array([[c.get(key, 0.0)] for _, c in jobs]) for key in FORCES}
        p["gust_at"] = np.array([[0.2 + 0.03 * r] for r, _ in jobs])
        p["gravity"] = np.array([self.gravity(c) for _, c in jobs])
        s = np.array([self.vector(c, "spread") for _, c in jobs]) ** 2
        p["inertia"] = self.mass * (s.sum(axis=1, keepdims=True) - s)
        for r, c in jobs:
            x, angle, v, w = (a + self.vector(c, "start:", 3 * i) for i, a in enumerate(self.begun[r]))
            turn = Rotation.from_rotvec(angle)
            arm = turn.apply(self.vector(c, "com"))
            centre = [*(x + arm), *turn.as_quat(scalar_first=True), *(v + np.cross(turn.apply(w), arm)), *w]
            states.append(centre)
        path = simulate(p, np.array(states), h, steps, rule == "scene")
        return [self.seen(r, c, np.arange(steps + 1) * h, path[:, i]) for i, (r, c) in enumerate(jobs)]

    def vector(self, changes: Changes, stem: str, first: int = 0) -> np.ndarray:
        base = getattr(self, stem, np.zeros(3))
        return base + [changes.get(f"{stem}{first + k}", 0.0) for k in range(3)]

    def gravity(self, changes: Changes) -> np.ndarray:
        a, b = (changes.get(f"tilt{k}", 0.0) for k in range(2))
        down = Rotation.from_euler("y", b) * Rotation.from_euler("x", a)
        return down.apply([0.0, 0.0, -(G + changes.get("gravity", 0.0))])

    def seen(self, record: int, changes: Changes, times: np.ndarray, path: np.ndarray) -> np.ndarray:
        turn = Rotation.from_quat(path[:, 3:7], scalar_first=True)
        spin = turn.apply(path[:, 10:])
        at, out = self.stamps[record] - changes.get("delay", 0.0), []
        for point in POINTS:
            arm = turn.apply(point - self.vector(changes, "com"))
            out.append(CubicHermiteSpline(times, path[:, :3] + arm, path[:, 7:10] + np.cross(spin, arm))(at))
        return turned(np.stack(out, axis=1), changes).reshape(len(at), -1)

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        columns = [[f"m{k}_{axis}" for axis in AXES] for k in range(len(POINTS))]
        header = ",".join(["t", *(c for own in columns for c in own)])
        s = self.spread**2
        moments = [*(self.mass * (s.sum() - s)).tolist(), 0.0, 0.0, 0.0]
        out = ["# Written by validation/blind/toss.py, whose simulator is not pliant.", "schema_version = 1", "[time]"]
        out += [f"step = {1.0 / self.rate / self.substeps!r}", f"duration = {self.duration}", 'integrator = "midpoint"']
        out += ["[[body]]", 'name = "body"', f"mass = {self.mass!r}", f"center_of_mass = {self.com.tolist()}", f"inertia = {moments}"]
        out += ["position = [0.0, 0.0, 1.0]", "[[body.joint]]", 'name = "flight"', 'kind = "free"', "[experiment]", 'time = { column = "t" }']
        for own, point in zip(columns, POINTS, strict=True):
            quoted = str(own).replace("'", '"')
            out += ["[[experiment.marker]]", 'body = "body"', f"point = {point.tolist()}", f"columns = {quoted}"]
            out += ["may_be_missing = true"] if missing else []
        for r, (y, t) in enumerate(zip(read, self.stamps, strict=True)):
            np.savetxt(folder / f"run{r + 1}.csv", np.column_stack([t, y]), "%.8g", ",", header=header, comments="")
            out += ["[[experiment.record]]", f'file = "run{r + 1}.csv"', f'role = "{self.roles[r]}"']
        path = folder / "scene.toml"
        path.write_text("\n".join([*out, ""]), encoding="utf-8")
        return path
