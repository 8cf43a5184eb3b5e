"""A strip of cloth that a hand swings and turns, as a system of the blind batch; motions by `cloth_ode.py`.

Sizes, commands and noise are of the seed. A record begins at rest in the equilibrium under its first command, so that nothing about its
beginning is unknown. Commands are linear between the samples that the log has, but where a null asks for smooth ones. The generator has
the mesh of the scene.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from validation.blind import cloth_ode
from validation.blind.cloth_ode import ASPECT, AT, BEYOND, FREE, GRID, HELD, NAMES, ROW, STEPS
from validation.blind.system import Cause, Changes, Job, Knob, Setup, sensor_causes, sensor_knobs, turned
from validation.reference.parameters import SHEET_ENTRIES

AXES = "xyz"
DURATION = 1.2  # s
SEEN = ("scale", "rotation", "bias", "delay", "drift")  # changes of the sensor, not of the motion
MARKED = (6, 8, 9, 11, 12, 13, 14)  # nodes: both long sides, and the lower end
TOP = 1.0  # m, height of the held side as the scene begins


class ClothSetup(Setup):
    """See `Setup`."""

    system = "cloth"

    def __init__(self, rng: np.random.Generator, jitter: float = 0.0, smooth: bool = False) -> None:
        self.smooth, self.rate, self.roles = smooth, 50.0 if smooth else 100.0, ("fit",) * 3 + ("held_out",)
        self.substeps, self.coarse = round(400.0 / self.rate), round(200.0 / self.rate)
        logarithmic = lambda low, high, digits: float(np.round(np.exp(rng.uniform(np.log(low), np.log(high))), digits))
        width, density, young = float(np.round(rng.uniform(0.13, 0.18), 3)), logarithmic(0.15, 0.3, 4), logarithmic(1.5e4, 4e4, 0)
        self.size, bend = (float(np.round(ASPECT * width, 4)), width), logarithmic(8e-4, 3e-3, 6)
        drag, square = (float(np.round(rng.uniform(*x) * density, 4)) for x in ((0.1, 0.4), (0.1, 0.5)))  # by mass: 1/s, 1/m
        self.numbers = {
            "area": self.size[0] * self.size[1], "area_density": density, "thickness": 1e-3, "youngs_modulus": young, "poisson_ratio": 0.2,
            "bend_stiffness": bend, "membrane_damping": float(np.round(1e-3 * young, 1)), "bend_damping": float(np.round(0.01 * bend, 8)),
            "drag_normal": drag, "drag_quadratic": square,
        }  # fmt: skip
        self.sigma = logarithmic(2e-4, 8e-4, 6)
        self.records(rng, jitter)
        self.free, self.values = ("D",), {}
        self.knobs, self.causes, self.outside = sensor_knobs(0.5 * self.size[0]), {}, {}
        self.may_be_hidden()

    def records(self, rng: np.random.Generator, jitter: float) -> None:
        """Waves, stamps and logged commands of all records."""
        self.waves, self.logged, self.gusts = [], [], []
        for _ in self.roles:
            size = rng.uniform(0.7, 1.3, 4) * (0.04, 0.03, 0.02, 0.25)  # m, and rad about the vertical
            self.waves.append((size, rng.uniform(5.0, 9.0, 4), rng.uniform(0.0, 2 * np.pi, 4)))
            self.gusts.append(float(rng.uniform(0.4, 0.9)))
            t = np.arange(round(DURATION * self.rate) + 1) / self.rate
            stamps = np.round(t + jitter * np.clip(rng.standard_normal(len(t)), -3, 3) * (t > 0), 6)
            self.logged.append((stamps, np.round(self.command(len(self.logged), stamps), 7)))

    def command(self, record: int, t: np.ndarray) -> np.ndarray:
        """Places of the held nodes (times, nodes, 3) [m]: the hand swings, and turns about the vertical, from rest."""
        size, frequency, phase = self.waves[record]
        wave = size * (1.0 - np.exp(-((t[:, None] / 0.15) ** 2))) * np.sin(frequency * t[:, None] + phase)
        across = np.linspace(-0.5, 0.5, GRID[1]) * self.size[1]
        arm = np.stack([-np.sin(wave[:, 3:]) * across, np.cos(wave[:, 3:]) * across, 0.0 * wave[:, 3:] * across], axis=2)
        return arm + wave[:, None, :3] + [0.0, 0.0, TOP]

    def tables(self, linear: bool) -> np.ndarray:
        """Commands (records, rows, nodes, 3) at the rows of `cloth_ode`."""
        t = np.arange(round(DURATION / ROW) + 1) * ROW
        told = lambda stamps, u: np.stack([np.interp(t, stamps, x) for x in u.reshape(len(stamps), -1).T], axis=1).reshape(len(t), -1, 3)
        return np.array([told(*own) if linear else self.command(r, t) for r, own in enumerate(self.logged)])

    # ---- What may be hidden --------------------------------------------------------------------------------------------

    def may_be_hidden(self) -> None:
        number = lambda key, part, largest: {f"sheet.{key}": self.number(key, part, largest)}
        several = lambda stem, path, count, step, most: {f"{stem}{k}": Knob(step, most, f"{path}[{k}]") for k in range(count)}
        made = {
            ("linear_drag", ""): number("drag_normal", 0.05, 4.0), ("quadratic_drag", ""): number("drag_quadratic", 0.05, 6.0),
            ("internal_damping", ""): number("bend_damping", 0.05, 6.0), ("membrane_damping", ""): number("membrane_damping", 0.1, 8.0),
            ("extensibility", ""): number("youngs_modulus", 0.01, 0.6), ("cloth_mass", ""): number("area_density", 0.01, 0.6),
            ("wind", ""): several("wind", "air.wind", 3, 0.05, 3.0), ("gravity_tilt", ""): several("tilt", "gravity.tilt", 2, 2e-3, 0.2),
            ("gravity_magnitude", ""): {"gravity": Knob(0.02, 2.0, "gravity.magnitude", 9.81)},
            ("gripper_offset", "hand"): several("offset", "hand.offset", 3, 2e-4, 0.02),
        }  # fmt: skip
        for (name, at), knobs in made.items():
            self.knobs |= knobs
            cause = Cause(name, at, tuple(knobs))
            self.causes[cause.key] = cause
        self.knobs["D"] = self.number("bend_stiffness", 0.02, 0.8)
        self.causes |= {cause.key: cause for cause in sensor_causes()}
        beyond = {"weave": 1.0, "magnet": 0.02, "gust": 8.0, "drift": 0.01}  # -, N·m, m/s², m
        self.knobs |= {key: Knob(0.02 * x, x) for key, x in beyond.items()}
        self.outside = {key: (key,) for key in beyond}

    def number(self, key: str, part: float, largest: float) -> Knob:
        """A knob of a positive number of the sheet, by parts of it."""
        x = self.numbers[key]
        return Knob(part * x, largest * x, f"sheet.{key}", x, positive=True)

    # ---- Motion --------------------------------------------------------------------------------------------------------

    def parameters(self, record: int, changes: Changes) -> np.ndarray:
        """The generator's numbers."""
        out = np.zeros(len(NAMES))
        for key, x in self.numbers.items():
            out[AT[key]] = x
        out[AT["gravity"]], out[AT["gust_at"]] = 9.81, self.gusts[record]
        for key, x in changes.items():
            out[AT["bend_stiffness" if key == "D" else key.removeprefix("sheet.")]] += x
        return out

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        moving = [(r, {key: x for key, x in c.items() if x and not key.startswith(SEEN)}) for r, c in jobs]
        keys = [repr((r, sorted(c.items()))) for r, c in moving]
        unique = dict(zip(keys, moving, strict=True))
        tables = self.tables(rule == "scene" or not self.smooth)
        p, record = np.array([self.parameters(r, c) for r, c in unique.values()]), np.array([r for r, _ in unique.values()])
        steps = STEPS if rule == "true" else max(round(ROW * self.rate * self.substeps), 1)
        x, v, last = cloth_ode.run(rule, p, record, tables, steps)
        calm = np.isfinite(v).all(axis=(1, 2, 3)) & (last < 1e-8)
        paths = {key: self.path(x[k], v[k]) if calm[k] else None for k, key in enumerate(unique)}
        return [self.seen(r, c, paths[key]) for key, (r, c) in zip(keys, jobs, strict=True)]

    def path(self, x: np.ndarray, v: np.ndarray) -> CubicHermiteSpline:
        """Markers' places over the time."""
        own = [node - FREE[0] for node in MARKED]
        return CubicHermiteSpline(np.arange(len(x)) * ROW, x[:, own], v[:, own], axis=0)

    def seen(self, record: int, changes: Changes, path: CubicHermiteSpline | None) -> np.ndarray:
        """Readings at the stamps of a record (samples, channels); NaN where there is no motion."""
        stamps = self.logged[record][0]
        if path is None:
            return np.full((len(stamps), 3 * len(MARKED)), np.nan)
        y = path(np.clip(stamps - changes.get("delay", 0.0), 0.0, DURATION))
        y = turned(y, changes) + changes.get("drift", 0.0) * (stamps / DURATION)[:, None, None]
        return y.reshape(len(stamps), -1)

    # ---- Scene ---------------------------------------------------------------------------------------------------------

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        columns = lambda stem, nodes: [f"{stem}{node}_{axis}" for node in nodes for axis in AXES]
        header = ",".join(["t", *columns("m", MARKED), *columns("g", HELD)])
        for r, (y, (t, u)) in enumerate(zip(read, self.logged, strict=True)):
            table = np.column_stack([t, y, u.reshape(len(t), -1)])
            np.savetxt(folder / f"run{r + 1}.csv", table, "%.8g", ",", header=header, comments="")
        out = [self.text(guess), "[experiment]", 'initial = "rest"', 'time = { column = "t" }']
        quoted = lambda names: str(names).replace("'", '"')
        for node in MARKED:
            out += ["[[experiment.marker]]", 'cloth = "sheet"', f"node = {node}", f"columns = {quoted(columns('m', [node]))}"]
            out += ["may_be_missing = true"] if missing else []
        out += ["[[experiment.input]]", 'gripper = "hand"', f"columns = {quoted(columns('g', HELD))}"]
        for r, role in enumerate(self.roles):
            out += ["[[experiment.record]]", f'file = "run{r + 1}.csv"', f'role = "{role}"']
        free = [f'{{ path = "{path}", lower = {0.1 * x!r}, upper = {10.0 * x!r} }}' for path, x in guess.items()]
        path = folder / "scene.toml"
        path.write_text("\n".join([*out, "[experiment.fit]", f"free = [{', '.join(free)}]", ""]), encoding="utf-8")
        return path

    def text(self, guess: dict[str, float]) -> str:
        """The sheet as it is believed to be."""
        numbers = {key: guess.get(f"sheet.{key}", self.numbers[key]) for key in SHEET_ENTRIES if key in self.numbers and key != "area"}
        out = ["schema_version = 1", "[time]", f"step = {1.0 / self.rate / self.substeps!r}", f"duration = {DURATION}", 'integrator = "midpoint"']
        out += ["[[cloth]]", 'name = "sheet"', f"grid = {{ nodes = {list(GRID)}, size = {list(self.size)} }}"]
        out += [f"origin = {[0.0, -0.5 * self.size[1], TOP]}", "u_axis = [0, 0, -1]", "v_axis = [0, 1, 0]"]
        out += [f"{key} = {x!r}" for key, x in numbers.items()]
        out += ["[[gripper]]", 'name = "hand"', 'cloth = "sheet"', f"nodes = {HELD.tolist()}"]
        return "\n".join([*out, ""])
