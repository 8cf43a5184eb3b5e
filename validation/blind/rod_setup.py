"""A rod that twists, held by two grippers that swing and turn, as a system of the blind batch; motions by `rod_ode.py`.

Sizes, commands and noise are of the seed. A record begins at rest in the equilibrium under its first command, so that nothing about its
beginning is unknown. Commands are linear between the samples that the log has, but where a null asks for smooth ones.
The generator has the mesh of the scene. Twice the edges would differ from it by what the mesh makes of a curved rod, which is no small part
of the noise (see docs/measured.md), so that no null would be one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from validation.blind import rod_ode
from validation.blind.rod_ode import ROW, STEPS
from validation.blind.system import Cause, Changes, Job, Knob, Setup, sensor_causes, sensor_knobs, turned
from validation.reference import rods

NODES = 9
HELD = {"left": (0, 1), "right": (NODES - 2, NODES - 1)}
AXES = "xyz"
DURATION = 1.2  # s
TURNS, CALM = 12, 0.3  # Newton's steps to an equilibrium; kg/(m·s) of the drag that brings a rod to rest
SEEN = ("scale", "rotation", "bias", "delay", "drift", "marker")  # changes of the sensor, not of the motion
LAWS = """[rope.stiffening]
coefficient = 0.0
[rope.plasticity]
yield_curvature = 1.0
time = 1e9
[rope.creep]
fraction = 0.0
time = 0.5
[rope.bend_friction]
moment = 0.0
curvature = 0.5"""


def rope(points: list, numbers: dict[str, float], open_all: bool) -> str:
    """A rod and its grippers; `open_all`: with all laws and entries that a scene may leave out, silent."""
    get = lambda key, usual: float(numbers.get(f"rod.{key}", usual))
    out = ["schema_version = 1", "[time]", "step = 1e-3", f"duration = {DURATION}", 'integrator = "midpoint"', "[[rope]]", 'name = "rod"']
    out += [f"nodes = {NODES}", f"initial = {{ shape = \"points\", points = {points} }}"]
    stiffnesses = ("stretch_stiffness", "stretch_damping", "bend_stiffness", "bend_damping")
    out += [f"{key} = {get(key, 0.5)!r}" for key in ("length", "linear_density", *stiffnesses, "drag_linear", "drag_quadratic")]
    out += [f"edge_rest_strains = {[0.0] * (NODES - 1)}"] if open_all else []
    out += ["[rope.twist]", f"stiffness = {get('twist_stiffness', 1.0)!r}", f"damping = {get('twist_damping', 0.0)!r}"]
    out += [f"inertia = {get('twist_inertia', 1.0)!r}", "director = [0, 1, 0]"]
    out += [f"bend_stiffness_2 = {get('bend_stiffness_2', 0.5)!r}"] if open_all else []
    out += [LAWS] if open_all else []
    for name in HELD:
        out += ["[[gripper]]", f'name = "{name}"', 'rope = "rod"', f"nodes = {list(HELD[name])}"]
    return "\n".join([*out, ""])


def arc(length: float, end: np.ndarray) -> np.ndarray:
    """Nodes (NODES, 3) [m] on a parabola of a length from the origin to an end in the plane of x and z."""
    s = np.linspace(0.0, 1.0, 400)
    shape = lambda sag: end * s[:, None] - np.array([0.0, 0.0, 4.0 * sag]) * (s * (1.0 - s))[:, None]
    along = lambda sag: np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(shape(sag), axis=0), axis=1))])
    low, high = 0.0, length
    for _ in range(60):
        sag = 0.5 * (low + high)
        low, high = (low, sag) if along(sag)[-1] > length else (sag, high)
    at = np.linspace(0.0, along(low)[-1], NODES)
    return np.stack([np.interp(at, along(low), x) for x in shape(low).T], axis=1)


# the scene that the reference reads: its numbers are replaced by those of a setup, its layout stays
LAYOUT = rope([[0.06 * k, 0.0, 0.0] for k in range(NODES)], {}, open_all=True)


class RodSetup(Setup):
    """See `Setup`."""

    system = "rod"

    def __init__(self, rng: np.random.Generator, jitter: float = 0.0, smooth: bool = False) -> None:
        self.smooth, self.rate, self.roles = smooth, 50.0 if smooth else 100.0, ("fit",) * 3 + ("held_out",)
        self.substeps, self.coarse = round(400.0 / self.rate), round(200.0 / self.rate)
        self.nodes = [node for held in HELD.values() for node in held]
        self.marked = tuple(range(2, NODES - 2))
        length, density = float(np.round(rng.uniform(0.5, 0.65), 3)), float(np.round(rng.uniform(0.025, 0.04), 4))
        stiffness = float(np.round(np.exp(rng.uniform(np.log(7e-4), np.log(2e-3))), 6))
        drag, square, twist = (float(np.round(rng.uniform(*x), 4)) for x in ((0.03, 0.06), (0.01, 0.02), (0.6, 1.2)))
        self.numbers = {
            "rod.length": length, "rod.linear_density": density, "rod.stretch_stiffness": 100.0, "rod.stretch_damping": 0.05,
            "rod.bend_stiffness": stiffness, "rod.bend_stiffness_2": stiffness, "rod.bend_damping": float(np.round(0.02 * stiffness, 8)),
            "rod.drag_linear": drag, "rod.drag_quadratic": square,
            "rod.twist_stiffness": float(np.round(twist * stiffness, 6)), "rod.twist_damping": 2e-6, "rod.twist_inertia": 2e-6,
        }  # fmt: skip
        span = rng.uniform(0.65, 0.8) * length
        end = np.array([span, 0.0, rng.uniform(-0.05, 0.05)])
        self.points = arc(length, end)
        self.sigma = float(np.exp(rng.uniform(np.log(2e-4), np.log(8e-4))))
        places = ((0.2, 0.8), (0.3, 1.0), (2.0, 4.0))  # s, 1/m, 1/m
        self.creep_time, self.rub_curvature, self.yields = (float(np.round(rng.uniform(*x), 3)) for x in places)
        self.records(rng, jitter)
        self.settle()
        self.free, self.values = ("EI",), {}
        self.knobs, self.causes, self.outside = sensor_knobs(0.5 * length), {}, {}
        self.may_be_hidden()

    # ---- Excitations ---------------------------------------------------------------------------------------------------

    def records(self, rng: np.random.Generator, jitter: float) -> None:
        """Waves, stamps and logged commands of all records."""
        self.waves, self.logged, self.gusts = [], [], []
        for _ in self.roles:
            own = []
            for _ in HELD:
                size = rng.uniform(0.7, 1.3, 4) * (0.05, 0.07, 0.04, 0.5)  # m, and rad about the vertical
                own.append((size, rng.uniform(4.0, 8.0, 4), rng.uniform(0.0, 2 * np.pi, 4)))
            self.waves.append(own)
            self.gusts.append(float(rng.uniform(0.4, 0.9)))
            t = np.arange(round(DURATION * self.rate) + 1) / self.rate
            self.logged.append([np.round(t + jitter * np.clip(rng.standard_normal(len(t)), -3, 3) * (t > 0), 6)])
        self.points[self.nodes] = np.round(self.points[self.nodes], 6)
        for record, own in enumerate(self.logged):
            own.append(np.round(self.command(record, own[0]), 7))

    def command(self, record: int, t: np.ndarray) -> np.ndarray:
        """Places of the held nodes (times, nodes, 3) [m]: grippers swing, and turn what they hold about the vertical, from rest."""
        out = []
        for name, (size, frequency, phase) in zip(HELD, self.waves[record], strict=True):
            wave = size * (1.0 - np.exp(-((t[:, None] / 0.15) ** 2))) * np.sin(frequency * t[:, None] + phase)
            first, second = self.points[list(HELD[name])]
            cos, sin, half = np.cos(wave[:, 3]), np.sin(wave[:, 3]), 0.5 * (second - first)
            arm = np.stack([half[0] * cos - half[1] * sin, half[0] * sin + half[1] * cos, half[2] + 0.0 * cos], axis=1)
            centre = 0.5 * (first + second) + wave[:, :3]
            out += [centre - arm, centre + arm]
        return np.stack(out, axis=1)

    def tables(self, linear: bool) -> np.ndarray:
        """Commands (records, rows, nodes, 3) at the rows of `rod_ode`."""
        t = np.arange(round(DURATION / ROW) + 1) * ROW
        out = []
        for record, (stamps, samples) in enumerate(self.logged):
            flat = samples.reshape(len(stamps), -1)
            told = np.stack([np.interp(t, stamps, x) for x in flat.T], axis=1).reshape(len(t), -1, 3)
            out.append(told if linear else self.command(record, t))
        return np.array(out)

    def settle(self) -> None:
        """Brings the rod to rest: where the scene begins, to rounding."""
        theta = self.theta({"rod.drag_linear": CALM})
        still = np.tile(self.points[self.nodes], (len(self.roles), round(DURATION / ROW) + 1, 1, 1))
        t, d, places = self.beginning()
        one, guess = (theta[None], np.zeros((1, 4)), np.zeros(1, int)), (self.points, d)
        x, *_ = rod_ode.run(LAYOUT, "true", *one, still, (t, d, places), guess, 0, STEPS)
        calm = self.points.copy()
        self.points = np.array(x[0, -1])
        self.points[self.nodes] = calm[self.nodes]
        self.points[:, 1] = 0.0
        self.points = np.round(self.points, 6)
        self.origin = self.beginning()

    def beginning(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Directions and first material axes of the edges, places of the held nodes as the scene begins."""
        t = np.diff(self.points, axis=0)
        t /= np.linalg.norm(t, axis=1, keepdims=True)
        d = [np.array([0.0, 1.0, 0.0]) - t[0] * t[0, 1]]
        d[0] /= np.linalg.norm(d[0])
        for a, b in zip(t[:-1], t[1:], strict=True):
            d.append(np.asarray(rods.carried(a, b, d[-1])))
        return t, np.array(d), self.points[self.nodes]

    # ---- What may be hidden --------------------------------------------------------------------------------------------

    def add(self, name: str, at: str, made: dict[str, Knob], **more) -> None:
        """Knobs and the cause that frees them."""
        self.knobs |= made
        cause = Cause(name, at, tuple(made), **more)
        self.causes[cause.key] = cause

    def number(self, path: str, part: float, largest: float, **more) -> dict[str, Knob]:
        """A knob of a positive number of the rod, by parts of it."""
        x = self.numbers[path]
        return {path: Knob(part * x, largest * x, path, x, positive=True, **more)}

    def entries(self, pattern: str, numbers: range | list[int], step: float, largest: float, scene: float = 0.0, **more) -> dict[str, Knob]:
        """Knobs of entries along the rod."""
        return {path: Knob(step, largest, path, scene, **more) for path in (pattern.format(k) for k in numbers)}

    def may_be_hidden(self) -> None:
        n, stiffness = self.numbers, self.numbers["rod.bend_stiffness"]
        weight, loose = n["rod.linear_density"] * n["rod.length"] / (NODES - 1), [k for k in range(1, NODES - 1) if k not in self.nodes]
        self.knobs["EI"] = Knob(0.02 * stiffness, 0.8 * stiffness, "rod.bend_stiffness", stiffness, positive=True)
        self.add("linear_drag", "", self.number("rod.drag_linear", 0.02, 3.0))
        self.add("quadratic_drag", "", self.number("rod.drag_quadratic", 0.05, 6.0))
        self.add("internal_damping", "", self.number("rod.bend_damping", 0.1, 6.0))
        self.add("twist_stiffness", "", self.number("rod.twist_stiffness", 0.02, 2.0))
        stretched = lambda x, ea=n["rod.stretch_stiffness"]: 1.0 / (1.0 / ea + x)  # by compliance [1/N]
        self.add("extensibility", "", {"EA": Knob(1e-4, 0.03, "rod.stretch_stiffness", one_sided=True, value=stretched)})
        self.add("intrinsic_curvature", "", self.entries("rod.rest_curvature[{}]", range(2), 0.02, 3.0))
        self.add("intrinsic_twist", "", self.entries("rod.rest_twist", [0], 0.02, 6.0))
        self.add("bend_stiffening", "", self.entries("rod.stiffening", [0], 2e-4, 0.03, one_sided=True))
        self.add("edge_lengths", "", self.entries("rod.edge[{}].rest_strain", range(1, NODES - 2), 1e-3, 0.04))
        self.add("mass_distribution", "", self.entries("rod.node[{}].mass", loose, 0.02 * weight, weight, one_sided=True))
        others = [k for k in range(1, NODES - 1) if k != NODES // 2]
        self.add("uneven_stiffness", "", self.entries("rod.node[{}].bend_factor", others, 0.02, 0.8, 1.0, positive=True))
        second = {"rod.bend_stiffness_2": Knob(0.02 * stiffness, 1.5 * stiffness, "rod.bend_stiffness_2", stiffness, positive=True)}
        turns = tuple({"rod.bend_stiffness_2": 0.05 * stiffness, "rod.section_roll": x} for x in (0.0, 0.25 * np.pi))
        self.add("anisotropic_bending", "", second, points=turns)
        largest = float(np.abs(np.diff(self.origin[0], axis=0)).max()) * (NODES - 1) / n["rod.length"]  # 1/m
        creep = tuple({"rod.creep_fraction": 0.1, "rod.creep_time": x} for x in (0.05, 0.5, 5.0))
        self.add("rod_creep", "", self.entries("rod.creep_fraction", [0], 0.02, 2.0, one_sided=True), points=creep,
                 also={"rod.creep_time": self.creep_time})  # fmt: skip
        rubs = tuple({"rod.friction_moment": 0.1 * stiffness, "rod.friction_curvature": x * largest} for x in (0.01, 0.1, 0.5))
        friction = self.entries("rod.friction_moment", [0], 0.02 * stiffness, 3.0 * stiffness, one_sided=True)
        self.add("bend_friction", "", friction, points=rubs, also={"rod.friction_curvature": self.rub_curvature})
        flow = Knob(0.02, 10.0, "rod.plastic_time", one_sided=True, value=lambda x: 1.0 / max(x, 1e-9))
        yields = tuple({"flow": 0.1, "rod.yield_curvature": x * largest} for x in (0.05, 0.3, 0.6))
        self.add("rod_plasticity", "", {"flow": flow}, points=yields, also={"rod.yield_curvature": self.yields})
        for number, name in enumerate(HELD):
            self.add("gripper_offset", name, self.entries(name + ".offset[{}]", range(3), 2e-4, 0.02))
            if number:
                self.add("clamp_roll", name, self.entries(name + ".roll", [0], 5e-3, 0.8))
            self.add("clamp_roll_by_direction", name, self.entries(name + ".roll_by_direction[{}]", range(3), 5e-3, 2.0))
            self.add("clamp_roll_by_position", name, self.entries(name + ".roll_by_position[{}]", range(3), 0.05, 10.0))
        beside = {}
        for k in range(len(self.marked)):
            beside |= self.entries(f"marker[{k}].offset[{{}}]", range(2), 5e-4, 0.01)
        self.add("marker_offset", "", beside)
        self.add("wind", "", self.entries("air.wind[{}]", range(3), 0.05, 3.0))
        self.add("gravity_tilt", "", self.entries("gravity.tilt[{}]", range(2), 2e-3, 0.2))
        self.causes |= {cause.key: cause for cause in sensor_causes()}
        beyond = {"magnet": 0.03, "gust": 0.6, "coupling": 0.7 * stiffness, "drift": 0.01}  # N·m, N/m, N·m², m
        self.knobs |= {key: Knob(0.02 * x, x) for key, x in beyond.items()}
        self.outside = {key: (key,) for key in beyond}

    # ---- Motion --------------------------------------------------------------------------------------------------------

    def theta(self, changes: Changes) -> np.ndarray:
        """The reference's numbers."""
        model = rod_ode.layout(LAYOUT).model
        values = dict(self.numbers)
        values |= {"rod.creep_time": self.creep_time, "rod.friction_curvature": self.rub_curvature, "rod.yield_curvature": self.yields}
        for key, x in changes.items():
            knob = self.knobs.get(key) if hasattr(self, "knobs") else None
            if key == "EI":
                values["rod.bend_stiffness"] += x
                values["rod.bend_stiffness_2"] += x
            elif key == "rod.bend_stiffness_2":
                values[key] += x
            elif knob is not None and knob.path:
                values[knob.path] = knob.true(x)
            else:  # of a point, or the drag that brings to rest
                values[key] = x
        out = np.array(model.theta)
        for path, x in values.items():
            out[model.index(path)] = x
        return out

    def motions(self, jobs: list[Job], rule: str) -> list[tuple[np.ndarray, ...]]:
        """Nodes, velocities (rows, n, 3) and first axes (rows, E, 3) of every job; none of one that runs away or has no equilibrium."""
        tables = self.tables(rule == "scene" or not self.smooth)
        steps = STEPS if rule == "true" else round(ROW * self.rate * self.substeps)
        theta = np.array([self.theta({key: x for key, x in c.items() if key not in rod_ode.EXTRA}) for _, c in jobs])
        extra = np.array([[*(c.get(key, 0.0) for key in rod_ode.EXTRA[:3]), self.gusts[r]] for r, c in jobs])
        record = np.array([r for r, _ in jobs])
        *paths, last = rod_ode.run(LAYOUT, rule, theta, extra, record, tables, self.origin, (self.points, self.origin[1]), TURNS, steps)
        calm = np.isfinite(paths[1]).all(axis=(1, 2, 3)) & (last < 1e-8)
        return [own if fine else () for own, fine in zip(zip(*paths, strict=True), calm, strict=True)]

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        moving = [(r, {key: x for key, x in c.items() if x and not key.startswith(SEEN)}) for r, c in jobs]
        keys = [repr((r, sorted(c.items()))) for r, c in moving]
        unique = {key: job for key, job in zip(keys, moving, strict=True)}
        motions = self.motions(list(unique.values()), rule)
        paths = {key: self.path(motion) if motion else None for key, motion in zip(unique, motions, strict=True)}
        return [self.seen(r, c, paths[key]) for key, (r, c) in zip(keys, jobs, strict=True)]

    def path(self, motion: tuple[np.ndarray, ...]) -> tuple[Callable, Callable]:
        """Markers' places (markers, 3) over the time, and the axes (markers, 2, 3) that they turn with."""
        x, v, d = motion
        t = np.arange(len(x)) * ROW
        edge = np.diff(x, axis=1)
        edge /= np.linalg.norm(edge, axis=2, keepdims=True)
        both = np.stack([d, np.cross(edge, d)], axis=2)
        at = [both[:, [k for k in (node - 1, node) if k < NODES - 1]].mean(axis=1) for node in self.marked]
        return CubicHermiteSpline(t, x[:, self.marked], v[:, self.marked], axis=0), CubicSpline(t, np.stack(at, axis=1), axis=0)

    def seen(self, record: int, changes: Changes, path: tuple[Callable, Callable] | None) -> np.ndarray:
        """What is read at the stamps of a record (samples, channels); NaN where there is no motion."""
        stamps = self.logged[record][0]
        if path is None:
            return np.full((len(stamps), 3 * len(self.marked)), np.nan)
        at = np.clip(stamps - changes.get("delay", 0.0), 0.0, DURATION)
        beside = np.array([[changes.get(f"marker[{k}].offset[{a}]", 0.0) for a in range(2)] for k in range(len(self.marked))])
        y = path[0](at)
        if beside.any():
            y = y + np.einsum("ka,tkai->tki", beside, path[1](at))
        y = turned(y, changes) + changes.get("drift", 0.0) * (stamps / DURATION)[:, None, None]
        return y.reshape(len(stamps), -1)

    # ---- Scene ---------------------------------------------------------------------------------------------------------

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        columns = lambda stem, nodes: [f"{stem}{node}_{axis}" for node in nodes for axis in AXES]
        header = ",".join(["t", *columns("m", self.marked), *columns("g", self.nodes)])
        for r, (y, (t, u)) in enumerate(zip(read, self.logged, strict=True)):
            table = np.column_stack([t, y, u.reshape(len(t), -1)])
            np.savetxt(folder / f"run{r + 1}.csv", table, "%.8g", ",", header=header, comments="")
        out = [self.text(guess), "[experiment]", 'initial = "rest"', 'time = { column = "t" }']
        quoted = lambda names: str(names).replace("'", '"')
        for node in self.marked:
            out += ["[[experiment.marker]]", 'rope = "rod"', f"node = {node}", f"columns = {quoted(columns('m', [node]))}"]
            out += ["may_be_missing = true"] if missing else []
        for name in HELD:
            out += ["[[experiment.input]]", f'gripper = "{name}"', f"columns = {quoted(columns('g', HELD[name]))}"]
        for r, role in enumerate(self.roles):
            out += ["[[experiment.record]]", f'file = "run{r + 1}.csv"', f'role = "{role}"']
        free = [f'{{ path = "{path}", lower = {0.1 * x!r}, upper = {10.0 * x!r} }}' for path, x in guess.items()]
        path = folder / "scene.toml"
        path.write_text("\n".join([*out, "[experiment.fit]", f"free = [{', '.join(free)}]", ""]), encoding="utf-8")
        return path

    def text(self, guess: dict[str, float], open_all: bool = False) -> str:
        """The rod as it is believed to be; `open_all` as in `rope`."""
        text = rope(self.points.tolist(), self.numbers | guess, open_all)
        return text.replace("step = 1e-3", f"step = {1.0 / self.rate / self.substeps!r}")
