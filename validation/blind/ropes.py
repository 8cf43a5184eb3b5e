"""Ropes that grippers swing, as systems of the blind batch: the families of `families.py`, simulated by `rope_ode.py`.

Records begin at rest, so that nothing about their beginnings is unknown. Commands are smooth; a log of 200 Hz hides that, one of 50 Hz
does not. Derivatives are the same for all seeds, and cached.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from validation.blind import families, fitter_step, measure, rope_ode
from validation.blind.families import FAMILIES, Family, Motion
from validation.blind.oracle import CACHE, OUTSIDE_STEP, PHYSICAL
from validation.blind.system import (
    Cause,
    Changes,
    Job,
    Knob,
    Setup,
    sensor_causes,
    sensor_knobs,
    turned,
)

SYSTEMS = tuple(FAMILIES)
LARGEST = {"EI": 1e-3, "c1": 0.3, "c2": 0.1, "cb": 2e-4, "EA": 0.05, "tip": 5e-3, "wind0": 2.0, "wind1": 2.0, "wind2": 2.0, "tilt0": 0.2, "tilt1": 0.2}
LARGEST |= {"magnet": 0.05, "hardening": 5.0, "gradient": 0.8, "curvature": 1.0, "friction": 1e-3}
POSITIVE = ("EI", "c1", "c2", "cb")
ONE_SIDED = ("tip", "EA", "magnet", "hardening", "friction")
SINGLE = {"linear_drag": "c1", "quadratic_drag": "c2", "extensibility": "EA", "internal_damping": "cb", "tip_mass": "tip"}


def other(motion: Motion) -> Motion:
    """A motion of the same kind, for a further record."""
    waves = tuple((size, 1.13 * frequency, phase + 1.0) for size, frequency, phase in motion.waves)
    return Motion(waves, (motion.pitch[0], 0.9 * motion.pitch[1], motion.pitch[2] + 0.7))


def lengthened(family: Family, rate: float) -> Family:
    """The family with a record more, all but the last fitted, logged at a rate [Hz]."""
    records = (*family.records, tuple(other(motion) for motion in family.records[0]))
    roles = ("fit",) * (len(records) - 1) + ("held_out",)
    return replace(family, records=records, roles=roles, duration=2.0, rate=rate, step=min(family.step, 1.0 / rate))


class RopeSetup(Setup):
    """See `Setup`."""

    cache, sources = CACHE, (rope_ode, families)

    def __init__(self, system: str, rng: np.random.Generator, jitter: float = 0.0, smooth: bool = False) -> None:
        self.family = family = lengthened(FAMILIES[system], 50.0 if smooth else 200.0)
        self.system, self.roles = system, family.roles
        self.shape, self.y, self.y_dot = None, {}, {}
        self.jitter = [jitter * np.clip(rng.standard_normal(len(family.times)), -3, 3) for _ in self.roles]
        for own in self.jitter:
            own[0] = 0.0
        self.sigma, self.free, self.values = float(np.exp(rng.uniform(np.log(3e-4), np.log(1.5e-3)))), ("EI",), {}
        self.knobs, self.outside = sensor_knobs(family.length), {key: (key,) for key in OUTSIDE_STEP if key != "lag"}
        for key, (name, _, step, path) in PHYSICAL.items():
            nominal = family.nominal.get(name, 0.0)
            stiff = (lambda x, ea=nominal: 1.0 / (1.0 / ea + x)) if key == "EA" else None
            self.knobs[key] = Knob(step, LARGEST[key], path, nominal, key in ONE_SIDED, key in POSITIVE, stiff)
        for key in self.outside:
            self.knobs[key] = Knob(OUTSIDE_STEP[key], LARGEST[key], one_sided=key in ONE_SIDED)
        causes = [Cause(name, "", (key,)) for name, key in SINGLE.items() if key != "tip" or family.n - 1 not in family.driven]
        causes += [Cause("wind", "", ("wind0", "wind1", "wind2")), Cause("gravity_tilt", "", ("tilt0", "tilt1")), *sensor_causes()]
        for gripper in family.grippers:
            keys = tuple(f"{gripper.name}.offset{i}" for i in range(3))
            self.knobs |= {key: Knob(1e-4, 0.02, f"{gripper.name}.offset[{i}]") for i, key in enumerate(keys)}
            causes.append(Cause("gripper_offset", gripper.name, keys))
        self.causes = {cause.key: cause for cause in causes}

    @property
    def substeps(self) -> int:
        return round(1.0 / (self.family.rate * self.family.step))

    def refine(self) -> None:
        self.family = replace(self.family, step=0.5 * self.family.step)

    def coarsen(self) -> None:
        self.family = replace(self.family, step=1.0 / self.family.rate)

    @property
    def rest(self) -> np.ndarray:
        if self.shape is None:
            self.shape = rope_ode.relaxed_shape(self.family)
        return self.shape

    def parameters(self, changes: Changes) -> dict:
        """Numbers of the generator, whose vectors are lists."""
        nominal, out = self.family.nominal, {}
        places = {g.name: [k for k, node in enumerate(self.family.driven) if node in g.nodes] for g in self.family.grippers}
        for key, x in changes.items():
            if key == "EA":
                out["EA"] = self.knobs["EA"].true(x)
            elif key[:-1] in ("wind", "tilt"):
                out.setdefault(key[:-1], [0.0] * {"wind": 3, "tilt": 2}[key[:-1]])[int(key[-1])] += x
            elif ".offset" in key:
                name, axis = key.split(".offset")
                vector = out.setdefault("offset", [0.0] * (3 * len(self.family.driven)))
                for k in places[name]:
                    vector[3 * k + int(axis)] += x
            elif key in PHYSICAL or key in self.outside:
                out[key] = nominal.get(key, 0.0) + x
        return out

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        family = self.family
        wanted = [(r, self.parameters(c)) for r, c in jobs]
        alike: dict[str, int] = {}  # faults of the sensor alone need no new motion
        for r, c in wanted:
            alike.setdefault(repr((r, sorted(c.items()))), len(alike))
        unique = list({repr((r, sorted(c.items()))): (r, c) for r, c in wanted}.values())
        q, v = [], []
        for part in (unique[k : k + 90] for k in range(0, len(unique), 90)):
            p = rope_ode.parameters(family, [c for _, c in part])
            records = np.array([r for r, _ in part])
            if rule == "scene":
                x = fitter_step.midpoint_rollout(family, p, records, self.rest)
                w = np.gradient(x, 1.0 / family.rate, axis=0)
            else:
                x, w = rope_ode.simulate(family, p, records, self.rest)
            markers = list(family.markers)
            q += list(np.moveaxis(x[:, :, markers], -1, 0))
            v += list(np.moveaxis(w[:, :, markers], -1, 0))
        out = []
        for (r, c), (_, changes) in zip(wanted, jobs, strict=True):
            k = alike[repr((r, sorted(c.items())))]
            path = CubicHermiteSpline(family.times, q[k], v[k], axis=0)
            at = np.maximum(family.times + self.jitter[r] - changes.get("delay", 0.0), 0.0)
            y = path(np.minimum(at, family.times[-1])).transpose(0, 2, 1)
            out.append(turned(y, changes).reshape(len(y), -1))
        return out

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        told = [column for _, columns in measure.input_names(self.family) for column in columns]
        header = ",".join(["t", *(f"m{node}_{axis}" for node in self.family.markers for axis in measure.AXES), *told])
        logs = []
        for r, y in enumerate(read):
            logs.append((f"run{r + 1}.csv", self.roles[r]))
            t = np.round(self.family.times + self.jitter[r], 6)
            commands = families.driven_positions(self.family, r, t).transpose(2, 1, 0).reshape(len(t), -1)
            np.savetxt(folder / logs[-1][0], np.column_stack([t, y, commands]), "%.8g", ",", header=header, comments="")
        text = measure.scene_text(self.family, self.rest, logs, guess["cable.bend_stiffness"])
        if missing:
            text = text.replace('unit = "m"\n\n[[experiment.marker', 'unit = "m"\nmay_be_missing = true\n\n[[experiment.marker')
            text = text.replace('unit = "m"\n\n[[experiment.input', 'unit = "m"\nmay_be_missing = true\n\n[[experiment.input', 1)
        path = folder / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return path
