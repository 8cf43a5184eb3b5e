"""Pendulums, carts and arms of two to seven joints as systems of the blind batch: what is drawn, what may be hidden, the scene.

Records begin `BEFORE` their first reading, in a state of the seed, with the first command held; commands grow from there. They are
linear between the samples that the log has, but where a null asks for smooth ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from validation.blind.chain import Chain, is_dry, zero
from validation.blind.system import Cause, Changes, Job, Knob, Setup

SYSTEMS = ("pendulum", "cart", "cart_pole", "arm2", "arm3", "arm5", "arm7")
BEFORE = 0.1  # s
LATEST = 0.025  # s, the longest delay
SEEN = ("bias", "scale", "delay", "play", "drift")  # changes of the sensors, not of the motion
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
SHOWN = {"arm2": "yy", "arm3": "yxy", "arm5": "zyyzy", "arm7": "zyzyzyz"}  # axes of the arms


@dataclass(frozen=True)
class Link:
    """A body and its joint as the scene has them; lengths in m, `spread` the roots of the second moments over the mass."""

    body: str
    joint: str
    kind: str
    axis: str
    place: tuple[float, float, float]
    mass: float
    com: tuple[float, float, float]
    spread: tuple[float, float, float]
    damping: float = 0.0
    stiffness: float = 0.0
    friction: float = 0.0
    cycles: int = 0
    size: float = 1.0  # of its motions [rad or m]


def bodies(system: str, rng: np.random.Generator) -> list[Link]:
    """Links of a system."""
    if system == "pendulum":
        long = rng.uniform(0.3, 0.6)
        across = long * rng.uniform(0.15, 0.3)
        com = (0.0, 0.0, -long * rng.uniform(0.5, 0.9))
        own = {"damping": rng.uniform(0.005, 0.02)} if rng.random() < 0.5 else {}
        own |= {"friction": rng.uniform(0.02, 0.06)} if rng.random() < 0.3 else {}
        own |= {"cycles": 6} if rng.random() < 0.3 else {}
        return [Link("bob", "hinge", "revolute", "y", (0.0, 0.0, 0.0), rng.uniform(0.5, 1.5), com, (across, across, 0.1 * across), **own)]
    if system in ("cart", "cart_pole"):
        spring = {"stiffness": rng.uniform(20.0, 60.0), "damping": rng.uniform(0.5, 2.0), "size": 0.1}
        cart = Link("cart", "rail", "prismatic", "x", (0.0, 0.0, 0.0), rng.uniform(1.0, 2.0), (0.0,) * 3, (0.05,) * 3, **spring)
        if system == "cart":
            return [cart]
        long = rng.uniform(0.3, 0.5)
        return [cart, Link("pole", "hinge", "revolute", "y", (0.0,) * 3, 0.4, (0.0, 0.0, -0.6 * long), (0.2 * long, 0.2 * long, 0.01), damping=2e-3)]
    axes, out = SHOWN[system], []
    for k, axis in enumerate(axes):
        long, mass = rng.uniform(0.2, 0.3), rng.uniform(0.8, 1.2) * 0.8**k
        across, place = 0.28 * long, (0.0, 0.0, -0.25 if k else 0.0)
        com = (0.0, 0.0, -long * rng.uniform(0.4, 0.6))
        damping = 0.02 if len(axes) > 2 else 0.0
        out.append(Link(f"link{k + 1}", f"joint{k + 1}", "revolute", axis, place, mass, com, (across, across, 0.03), damping=damping))
    if system == "arm2" and rng.random() < 0.25:
        out = [replace(link, friction=f) for link, f in zip(out, (0.05, 0.02), strict=True)]
    return out


class ChainSetup(Setup):
    """See `Setup`."""

    def __init__(
        self, system: str, rng: np.random.Generator, jitter: float = 0.0, smooth: bool = False, rate: float | None = None,
        duration: float | None = None, fitted: int | None = None,
    ) -> None:  # fmt: skip
        """`rate` [Hz], `duration` [s] and number of `fitted` records other than those of the batch."""
        self.system, self.links, self.smooth = system, bodies(system, rng), smooth
        n = len(self.links)
        self.servo = n >= 4
        self.chain = Chain(
            tuple(link.kind for link in self.links), tuple("xyz".index(link.axis) for link in self.links), self.servo
        )
        self.motors = [0] if n == 1 or system == "cart_pole" else list(range(n))
        self.rate = rate or (50.0 if smooth else 100.0)
        self.duration = duration or (2.0 if n > 1 else 3.0)
        self.roles = ("fit",) * (fitted or (3 if n > 3 else 4)) + ("held_out",)
        self.substeps = 8
        self.base = self.variant_of_scene()
        rest = rng.choice([-1.0, 1.0], n) * rng.uniform(0.4, 0.8, n) if self.servo else np.zeros(n)
        self.size = np.array([link.size for link in self.links])
        self.inertia = np.array([float(row[k]) for k, row in enumerate(self.chain.mass_matrix(self.base, rest))])
        if self.servo:
            self.base["kp"], self.base["kd"] = np.round(self.inertia * 400.0, 3), np.round(self.inertia * 12.0, 4)
        self.records(rng, rest, jitter)
        self.peak = np.array([np.abs(np.concatenate([u[:, i] for _, u in self.logged])).max() for i in range(n)])
        self.sigma = float(np.exp(rng.uniform(np.log(3e-4), np.log(1e-3))) * (0.1 if system == "cart" else 1.0))
        self.stribeck = 0.05 * self.size
        self.free = self.choose_free(rng)
        self.knobs, self.causes, self.outside, self.values = {}, {}, {}, {}
        for k in range(n):
            self.of_joint(k)
        for k in self.motors:
            self.of_motor(k)
        for k in range(n):
            self.of_body(k)
        self.of_all()
        self.causes = {key: cause for key, cause in self.causes.items() if not set(cause.knobs) & set(self.free)}
        self.values = {key: knobs for key, knobs in self.values.items() if not set(knobs) & set(self.free)}
        self.starts = 2 * n
        self.start_steps = tuple(1e-4 * self.size) + tuple(1e-3 * self.size)

    def variant_of_scene(self) -> dict[str, np.ndarray]:
        p = zero(len(self.links))
        for key in ("damping", "stiffness", "friction", "mass", "com", "spread"):
            p[key] = np.array([getattr(link, key) for link in self.links], float)
        p["places"] = np.array([link.place for link in self.links], float)
        p["cycles"] = np.array([float(link.cycles) for link in self.links])
        return p | {"gain": np.ones(len(self.links)), "ripples": np.full(len(self.links), 8.0)}

    # ---- Excitations ---------------------------------------------------------------------------------------------------

    def records(self, rng: np.random.Generator, rest: np.ndarray, jitter: float) -> None:
        """Waves of the commands, stamps, and states at the beginning of all records."""
        n = len(self.links)
        self.rest, self.waves, self.pace, self.logged, self.begun = rest, [], [], [], []
        for r in range(len(self.roles)):
            free_swing = r == 2 and not self.servo
            strong = 0.0 if free_swing else rng.uniform(0.7, 1.2)
            size = np.zeros((n, 4))
            each = 0.15 * self.size if self.servo else 3.5 * self.inertia * self.size
            size[self.motors] = strong * each[self.motors, None] * rng.uniform(0.6, 1.4, (len(self.motors), 4))
            self.waves.append((size, rng.uniform(0.3, 2.0, (n, 4)), rng.uniform(0.0, 2 * np.pi, (n, 4))))
            self.pace.append(1.0)
            self.log(rng, jitter)
            q = rest + self.size * (0.1 if self.servo else 0.9 if free_swing else 0.4) * rng.uniform(-1.0, 1.0, n)
            v = self.size * (0.2 if self.servo else 0.8) * rng.uniform(-1.0, 1.0, n)
            self.begun.append((q, v))

    def log(self, rng: np.random.Generator, jitter: float) -> None:
        """Stamps and commands of the next record."""
        t = np.arange(round(self.duration * self.rate) + 1) / self.rate
        shaken = np.round(t + jitter * np.clip(rng.standard_normal(len(t)), -3, 3) * (t > 0), 6)
        self.logged.append((shaken, np.round(self.command(len(self.logged), shaken), 7)))

    def repeat(self, record: int, commands: float, pace: float, start: float, rng: np.random.Generator, jitter: float) -> int:
        """A fitted record more: one again, with other commands, pace or start, as `pliant diagnose` proposes them."""
        size, frequency, phase = self.waves[record]
        self.waves.append((commands * size, frequency, phase))
        self.pace.append(self.pace[record] * pace)
        self.log(rng, jitter)
        q, v = self.begun[record]
        self.begun.append((self.rest + start * (q - self.rest), start * v))
        self.roles += ("fit",)
        return len(self.roles) - 1

    def command(self, record: int, t: np.ndarray) -> np.ndarray:
        """What is commanded (times, n): held before the record, and after the end of one that is faster."""
        size, frequency, phase = self.waves[record]
        t = np.maximum(self.pace[record] * t, 0.0)
        if self.pace[record] > 1.0:
            t = np.minimum(t, self.duration)
        wave = np.einsum("jk,tjk->tj", size, np.sin(2 * np.pi * frequency * t[:, None, None] + phase))
        held = (self.rest if self.servo else 0.0) + np.zeros(len(self.links))
        return held + wave * (1.0 - np.exp(-((t / 0.15) ** 2)))[:, None]

    def table(self, record: int, changes: Changes, times: np.ndarray, linear: bool) -> np.ndarray:
        """Commands as the motors get them (times, n)."""
        stamps, samples = self.logged[record]
        out = np.empty((len(times), len(self.links)))
        for k, link in enumerate(self.links):
            at = times - changes.get(f"late:{link.joint}", 0.0)
            out[:, k] = np.interp(at, stamps, samples[:, k]) if linear else self.command(record, at)[:, k]
            lag = changes.get(f"lag:{link.joint}", 0.0) + changes.get("lag", 0.0)
            if lag > 0.0:
                step = times[1] - times[0]
                decay = np.exp(-step / lag)
                rise = lag * (1.0 - decay) * np.diff(out[:, k], prepend=out[0, k]) / step
                out[:, k] -= lfilter([1.0], [1.0, -decay], rise)
        return out

    # ---- What may be hidden --------------------------------------------------------------------------------------------

    def add(self, name: str, at: str, knob: str, made: Knob, **more) -> None:
        """A knob and the cause that frees it alone."""
        self.knobs[knob] = made
        cause = Cause(name, at, (knob,), **more)
        self.causes[cause.key] = cause

    def of_joint(self, k: int) -> None:
        link, unit, size = self.links[k], self.inertia[k], self.size[k]
        j, force = link.joint, self.inertia[k] * self.size[k]
        self.add("viscous_friction", j, f"damping:{j}", Knob(0.01 * unit, 3.0 * unit, f"{j}.damping", link.damping, link.damping == 0.0, positive=True))
        self.add("quadratic_damping", j, f"quadratic:{j}", Knob(0.04 * unit / size, 4.0 * unit / size, f"{j}.quadratic_damping", one_sided=True))
        self.add("coulomb_friction", j, f"friction:{j}", Knob(0.05 * force, 4.0 * force, f"{j}.friction", link.friction, one_sided=True))
        speeds = [x * size for x in (0.05, 0.2, 0.6)]
        points = tuple({f"stiction:{j}": 0.1 * force, f"speed:{j}": x - self.stribeck[k]} for x in speeds)
        self.add("stribeck", j, f"stiction:{j}", Knob(0.05 * force, 4.0 * force, f"{j}.stiction", one_sided=True), points=points,
                 also={f"{j}.stribeck_velocity": float(self.stribeck[k])}, hidden=False)  # fmt: skip
        if link.friction > 0.0:
            largest = 0.8 * link.friction
            self.add("asymmetric_friction", j, f"backward:{j}", Knob(0.05 * largest, largest, f"{j}.friction_backward", link.friction))
        self.add("load_friction", j, f"load:{j}", Knob(0.01, 0.4, f"{j}.load_friction", one_sided=True))
        known = link.stiffness == 0.0
        self.add("joint_stiffness", j, f"stiffness:{j}", Knob(0.1 * unit, 20.0 * unit, f"{j}.stiffness", link.stiffness, known, positive=True))
        self.add("cubic_stiffness", j, f"cubic:{j}", Knob(0.1 * unit / size**2, 60.0 * unit / size**2, f"{j}.cubic_stiffness", one_sided=True))
        self.add("armature", j, f"armature:{j}", Knob(0.005 * unit, 0.5 * unit, f"{j}.armature", one_sided=True))
        if link.cycles:
            self.knobs |= {f"{x}:{j}": Knob(0.05 * force, 6.0 * force, f"{j}.cogging_{x}") for x in ("sine", "cosine")}
            self.causes[f"cogging_torque:{j}"] = Cause("cogging_torque", j, (f"sine:{j}", f"cosine:{j}"))
        self.add("encoder_bias", j, f"bias:{j}", Knob(1e-3 * size, 0.2 * size, f"{j}.position_bias"))
        self.add("encoder_scale", j, f"scale:{j}", Knob(1e-3, 0.2, f"{j}.position_scale", 1.0))
        self.add("encoder_drift", j, f"drift:{j}", Knob(1e-3 * size, 0.015 * size, f"{j}.position_drift"))
        if len(self.links) > 1:
            self.add("sensor_delay", j, f"delay:{j}", Knob(5e-4, LATEST, f"{j}.position_delay", one_sided=True))
        effects = {"magnet": 6.0 * force, "gust": 8.0 * force, "slack": 60.0 * unit}
        effects |= {"rough": 2.0 * force, "warm": 2.0 * force, "play": 0.05 * size}
        if not link.cycles:
            effects["ripple"] = 6.0 * force
        for name, largest in effects.items():
            self.knobs[f"{name}:{j}"] = Knob(0.01 * largest, largest, one_sided=name not in ("magnet", "gust", "ripple"))
            self.outside[f"{name}:{j}"] = (f"{name}:{j}",)

    def of_motor(self, k: int) -> None:
        link, force = self.links[k], self.inertia[k] * self.size[k]
        j, motor = link.joint, f"motor_{link.joint}"
        if not self.servo:
            self.add("torque_gain", motor, f"gain:{j}", Knob(0.01, 0.5, f"{motor}.gain", 1.0))
            cut = Knob(0.05, 0.6, f"{motor}.saturation", value=lambda x, peak=self.peak[k]: peak * (1.0 - x), one_sided=True)
            points = tuple({f"cut:{j}": x} for x in (0.1, 0.3, 0.5))
            self.add("saturation", motor, f"cut:{j}", cut, points=points)
        else:
            gain = float(self.base["kp"][k])
            self.add("drive_stiffness", motor, f"kp:{j}", Knob(0.01 * gain, 0.5 * gain, f"{motor}.stiffness", gain))
        self.add("torque_offset", motor, f"offset:{j}", Knob(0.05 * force, 5.0 * force, f"{motor}.offset"))
        self.add("actuator_delay", motor, f"late:{j}", Knob(5e-4, LATEST, f"{motor}.delay", one_sided=True))
        self.add("actuator_lag", motor, f"lag:{j}", Knob(5e-4, 0.04, f"{motor}.lag", one_sided=True))

    def of_body(self, k: int) -> None:
        link = self.links[k]
        b, last = link.body, k == len(self.links) - 1
        mass = Knob(0.01 * link.mass, 0.5 * link.mass, f"{b}.mass", link.mass)
        self.add("payload", b, f"mass:{b}", mass, hidden=last)
        if not last:
            self.values[f"mass:{b}"] = (f"mass:{b}",)
        if all(other.kind == "prismatic" for other in self.links[: k + 1]):
            return  # it does not turn
        long = abs(link.com[2])
        self.knobs |= {f"com{a}:{b}": Knob(5e-3 * long, 0.3 * long, f"{b}.center_of_mass[{a}]", link.com[a]) for a in range(3)}
        self.causes[f"center_of_mass:{b}"] = Cause("center_of_mass", b, tuple(f"com{a}:{b}" for a in range(3)))
        axis = "xyz".index(link.axis)
        widest = max((a for a in range(3) if a != axis), key=lambda a: (link.spread[a], -a))
        wide = Knob(0.01 * link.spread[widest], 0.6 * link.spread[widest], f"{b}.spread[{widest}]", link.spread[widest])
        self.add("link_inertia", b, f"spread{widest}:{b}", wide)

    def of_all(self) -> None:
        self.add("sensor_delay", "", "delay", Knob(5e-4, LATEST, "sensor.time_offset", one_sided=True))
        if len(self.motors) > 1:
            self.add("actuator_lag", "", "lag", Knob(5e-4, 0.04, "*.lag", one_sided=True), hidden=False)
        self.knobs |= {f"tilt{k}": Knob(1e-3, 0.2, f"gravity.tilt[{k}]") for k in range(2)}
        self.causes["gravity_tilt"] = Cause("gravity_tilt", "", ("tilt0", "tilt1"))

    def choose_free(self, rng: np.random.Generator) -> tuple[str, ...]:
        last = self.links[-1]
        options = [(f"mass:{last.body}",), ()] if len(self.links) < 4 else [(f"mass:{last.body}",)]
        options += [(f"damping:{link.joint}",) for link in self.links[:1] if link.damping]
        options += [(f"stiffness:{link.joint}",) for link in self.links[:1] if link.stiffness]
        return options[rng.integers(len(options))]

    # ---- Readings ------------------------------------------------------------------------------------------------------

    def variant(self, changes: Changes, record: int) -> dict[str, np.ndarray]:
        p = {key: np.array(value, float) for key, value in self.base.items()}
        p["speed"], p["gap"], p["place"] = self.stribeck.copy(), 0.3 * self.size, self.rest + 0.2 * self.size
        p["gust_at"] = np.full(len(self.links), 0.6 + 0.25 * record)
        joints, names = {link.joint: k for k, link in enumerate(self.links)}, {link.body: k for k, link in enumerate(self.links)}
        for key, x in changes.items():
            what, _, at = key.partition(":")
            if what == "cut":
                p["limit"][joints[at]] = self.peak[joints[at]] * (1.0 - x)
            elif what in ("tilt0", "tilt1"):
                p["tilt"][int(what[-1])] += x
            elif what[:-1] in ("com", "spread"):
                p[what[:-1]][names[at], int(what[-1])] += x
            elif what == "mass":
                p["mass"][names[at]] += x
            elif what in p and at in joints:
                p[what][joints[at]] += x
        return p

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        variants = [self.variant(changes, record) for record, changes in jobs]
        out: list[np.ndarray] = [np.empty(0)] * len(jobs)
        for rough in (False, True):  # dry friction needs shorter steps
            own = [i for i, p in enumerate(variants) if is_dry(p) == rough]
            if not own:
                continue
            substeps = self.substeps if rule == "scene" else round((2000.0 if rough else 500.0) / self.rate)
            some, kept = [jobs[i] for i in own], [variants[i] for i in own]
            for i, y in zip(own, self.simulated(some, kept, rule, 1.0 / self.rate / substeps), strict=True):
                out[i] = y
        return out

    def simulated(self, jobs: list[Job], variants: list[dict], rule: str, h: float) -> list[np.ndarray]:
        """Readings by steps of h."""
        before = round(BEFORE / h)
        times = np.arange(4 * (before + round((self.duration + 0.01) / h)) + 1) * (h / 4) - before * h
        n, linear = len(self.links), not self.smooth or rule == "scene"
        tables: dict[tuple, np.ndarray] = {}
        motions: dict[tuple, int] = {}  # simulated once, however many sensors look at them
        own_motion, kept, states, inputs = [], [], [], []
        for (record, changes), variant in zip(jobs, variants, strict=True):
            moving = (record, *sorted((k, x) for k, x in changes.items() if k.partition(":")[0] not in SEEN))
            own_motion.append(motions.setdefault(moving, len(motions)))
            if len(motions) == len(kept):
                continue
            own = tuple(sorted((k, x) for k, x in changes.items() if k.partition(":")[0] in ("late", "lag")))
            if (record, own) not in tables:
                tables[record, own] = self.table(record, changes, times, linear)
            kept.append(variant)
            inputs.append(tables[record, own])
            states.append(np.concatenate(self.begun[record]) + [changes.get(f"start:{k}", 0.0) for k in range(2 * n)])
        begun, by = np.array(states), "midpoint" if rule == "scene" else "strang"
        q, v = self.chain.simulate(kept, begun[:, :n], begun[:, n:], np.stack(inputs), h, times[0], by)
        return [self.seen(record, changes, times[::4], q[m], v[m]) for m, (record, changes) in zip(own_motion, jobs, strict=True)]

    def seen(self, record: int, changes: Changes, times: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What the encoders read."""
        stamps = self.logged[record][0]
        out = np.full((len(stamps), len(self.links)), np.nan)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return out  # a change so large that the motion runs away
        for k, link in enumerate(self.links):
            get = lambda key, j=link.joint: changes.get(f"{key}:{j}", 0.0)
            at = stamps - changes.get("delay", 0.0) - get("delay")
            if half := get("play"):
                out[:, k] = np.interp(at, times, with_play(q[:, k], half))
            else:
                out[:, k] = CubicHermiteSpline(times, q[:, k], v[:, k])(at)
            out[:, k] = (1.0 + get("scale")) * out[:, k] + get("bias") + get("drift") * stamps
        return out

    # ---- Scene ---------------------------------------------------------------------------------------------------------

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        names = [f"run{r + 1}.csv" for r in range(len(self.roles))]
        joints = [link.joint for link in self.links]
        header = ",".join(["t", *(f"q_{j}" for j in joints), *(f"u_{joints[k]}" for k in self.motors)])
        for name, y, (t, u) in zip(names, read, self.logged, strict=True):
            table = np.column_stack([t, y, u[:, self.motors]])
            np.savetxt(folder / name, table, "%.8g", ",", header=header, comments="")
        path = folder / "scene.toml"
        path.write_text(self.scene(names, guess, missing), encoding="utf-8")
        return path

    def scene(self, names: list[str], guess: dict[str, float], missing: bool) -> str:
        """What is believed: everything but the effect; `guess`: values by path."""
        out = ["# Written by validation/blind/chains.py, whose simulator is not pliant.", "schema_version = 1", "[time]"]
        out += [f"step = {1.0 / self.rate / self.substeps!r}", f"duration = {self.duration}", 'integrator = "midpoint"']
        for k, link in enumerate(self.links):
            mass = guess.get(f"{link.body}.mass", link.mass)
            s = np.array(link.spread) ** 2
            moments = [*(mass * (s.sum() - s)).tolist(), 0.0, 0.0, 0.0]
            out += ["[[body]]", f'name = "{link.body}"', *([f'parent = "{self.links[k - 1].body}"'] if k else [])]
            out += [f"position = {list(map(float, link.place))}", f"mass = {float(mass)!r}", f"center_of_mass = {list(map(float, link.com))}"]
            out += [f"inertia = {moments}", "[[body.joint]]", f'name = "{link.joint}"', f'kind = "{link.kind}"', f"axis = {list(AXES[link.axis])}"]
            for key in ("damping", "stiffness", "friction"):
                out.append(f"{key} = {float(guess.get(f'{link.joint}.{key}', getattr(link, key)))!r}")
            out += [f"start = [{float(self.rest[k])!r}]"]
            out += [f"cogging = {{ cycles = {link.cycles} }}"] if link.cycles else []
        for k in self.motors:
            j = self.links[k].joint
            out += ["[[actuator]]", f'name = "motor_{j}"', f'joint = "{j}"', f'kind = "{"position" if self.servo else "torque"}"']
            out += [f"stiffness = {float(self.base['kp'][k])!r}", f"damping = {float(self.base['kd'][k])!r}"] if self.servo else []
        out += ["[experiment]", 'time = { column = "t" }']
        for link in self.links:
            out += ["[[experiment.joint]]", f'joint = "{link.joint}"', f'column = "q_{link.joint}"', f"noise_floor = {0.1 * self.sigma!r}"]
            out += ["may_be_missing = true"] if missing else []
        for k in self.motors:
            j = self.links[k].joint
            out += ["[[experiment.input]]", f'actuator = "motor_{j}"', f'columns = ["u_{j}"]']
        for name, role in zip(names, self.roles, strict=True):
            out += ["[[experiment.record]]", f'file = "{name}"', f'role = "{role}"']
        free = [f'{{ path = "{path}", lower = {0.1 * x!r}, upper = {10.0 * x!r} }}' for path, x in guess.items()]
        return "\n".join([*out, "[experiment.fit]", f"free = [{', '.join(free)}]", ""])


def with_play(q: np.ndarray, half: float) -> np.ndarray:
    """What an encoder reads that follows the joint with play, `half` of it on either side."""
    out, at = np.empty_like(q), q[0]
    for k, x in enumerate(q):
        at = min(max(at, x - half), x + half)
        out[k] = at
    return out
