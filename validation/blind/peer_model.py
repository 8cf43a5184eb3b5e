"""A chain of the blind batch as a model of MuJoCo: its scene and logs read, an `MjSpec` built, and the numbers of it that can be freed.

Numbers have pliant's paths. `CAUSES` says which of them each cause of the library frees, `NOT_REPRESENTED` which causes have none here.
Laws as in the scene: a joint's stiffness and damping are MuJoCo's polynomials, so that a cubic spring and quadratic damping are
numbers of it; dry friction is its soft constraint, as stiff as its steps allow.
"""

from __future__ import annotations

import csv
import tomllib
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.signal import lfilter

G = 9.81  # m/s²
LATEST = 0.03  # s, of a delay
SMOOTH, DRY = 4, 32  # steps in a sample, by Runge-Kutta: within 0.01 and 0.3 of the noise of the generator's readings
# cause -> what it is at, and the numbers it frees there
CAUSES = {
    "viscous_friction": ("joint", ("damping",)),
    "quadratic_damping": ("joint", ("quadratic_damping",)),
    "coulomb_friction": ("joint", ("friction",)),
    "joint_stiffness": ("joint", ("stiffness",)),
    "cubic_stiffness": ("joint", ("cubic_stiffness",)),
    "armature": ("joint", ("armature",)),
    "encoder_bias": ("joint", ("position_bias",)),
    "encoder_scale": ("joint", ("position_scale",)),
    "torque_gain": ("torque motor", ("gain",)),
    "drive_stiffness": ("position drive", ("stiffness",)),
    "torque_offset": ("motor", ("offset",)),
    "saturation": ("torque motor", ("saturation",)),
    "actuator_delay": ("motor", ("delay",)),
    "actuator_lag": ("motor", ("lag",)),
    "payload": ("body", ("mass",)),
    "center_of_mass": ("turning body", tuple(f"center_of_mass[{k}]" for k in range(3))),
    "link_inertia": ("turning body", ("spread",)),
    "sensor_delay": ("", ("sensor.time_offset",)),
    "gravity_tilt": ("", ("gravity.tilt[0]", "gravity.tilt[1]")),
}
NOT_REPRESENTED = {
    "load_friction": "MuJoCo's frictionloss is a number; it does not grow with the load",
    "stribeck": "frictionloss does not depend on the speed",
    "asymmetric_friction": "frictionloss is the same both ways",
    "cogging_torque": "no torque of a joint repeats with its position",
    "encoder_drift": "a signal has a gain, a bias and a delay; its zero does not move",
    "outside": "a magnet, ripple, slack, friction by place or by time are no numbers of a model; a gust and play none of a signal",
    "records": "a number has one value for all records; no record is left out of the fit",
}


@dataclass(frozen=True)
class Number:
    """A number that can be freed: its value in the scene, its bounds, and where a fit begins."""

    scene: float
    lower: float
    upper: float
    start: float


@dataclass(frozen=True)
class Record:
    """One log: times of the readings [s], readings (T, joints) with NaN where they are missing, times and values of commands."""

    role: str
    times: np.ndarray
    readings: np.ndarray
    stamps: np.ndarray
    commands: np.ndarray

    def first(self, seconds: float) -> Record:
        """The beginning of it."""
        keep = self.times <= seconds + 1e-9
        return Record(self.role, self.times[keep], self.readings[keep], self.stamps, self.commands)

    def start(self) -> np.ndarray:
        """Positions and velocities at the first reading, by a parabola through the first tenth of a second."""
        near, out = self.times <= 0.1 + 1e-9, np.zeros((2, self.readings.shape[1]))
        for k, q in enumerate(self.readings[near].T):
            seen = np.isfinite(q)
            out[:, k] = np.polyfit(self.times[near][seen], q[seen], 2)[::-1][:2]
        return out.ravel()


@dataclass(frozen=True)
class Plant:
    """A scene, its logs, and `step` [s] of the model."""

    scene: dict
    records: tuple[Record, ...]
    step: float

    @property
    def joints(self) -> list[dict]:
        return [body["joint"][0] for body in self.scene["body"]]

    @property
    def motors(self) -> list[dict]:
        return self.scene.get("actuator", [])

    @property
    def free(self) -> list[dict]:
        return self.scene["experiment"]["fit"]["free"]

    def is_dry(self) -> bool:
        return any(joint["friction"] > 0.0 for joint in self.joints)

    def fitted(self) -> list[Record]:
        return [r for r in self.records if r.role == "fit"]

    def held_out(self) -> Record:
        return next(r for r in self.records if r.role == "held_out")


def read(folder: Path) -> Plant:
    """A case's scene and logs."""
    scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    experiment = scene["experiment"]
    records = []
    for entry in experiment["record"]:
        with (folder / entry["file"]).open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        column = lambda name, rows=rows: np.array([float(row[name]) for row in rows])
        readings = np.stack([column(one["column"]) for one in experiment["joint"]], axis=1)
        commands = np.stack([column(one["columns"][0]) for one in experiment["input"]], axis=1)
        times = column(experiment["time"]["column"])
        records.append(Record(entry["role"], times, readings, times, commands))
    sample = round(float(np.mean(np.diff(records[0].times))), 4)
    dry = any(body["joint"][0]["friction"] > 0.0 for body in scene["body"])
    return Plant(scene, tuple(records), sample / (DRY if dry else SMOOTH))


# ---- The model -----------------------------------------------------------------------------------------------------------------


def scene_values(scene: dict) -> dict[str, float]:
    """Everything that can be freed, as the scene has it; `spread` are the roots of a body's second moments over its mass."""
    out = {"gravity.tilt[0]": 0.0, "gravity.tilt[1]": 0.0, "sensor.time_offset": 0.0}
    for body in scene["body"]:
        name, joint, moments = body["name"], body["joint"][0], np.array(body["inertia"][:3])
        out[f"{name}.mass"] = body["mass"]
        out |= {f"{name}.center_of_mass[{k}]": x for k, x in enumerate(body["center_of_mass"])}
        spread = np.sqrt(np.maximum(moments.sum() / 2 - moments, 0.0) / body["mass"])
        out |= {f"{name}.spread[{k}]": float(x) for k, x in enumerate(spread)}
        own = {"quadratic_damping": 0.0, "cubic_stiffness": 0.0, "armature": 0.0, "position_bias": 0.0, "position_scale": 1.0, "position_delay": 0.0}
        own |= {key: joint[key] for key in ("damping", "stiffness", "friction")}
        out |= {f"{joint['name']}.{key}": float(x) for key, x in own.items()}
    for motor in scene.get("actuator", []):
        own = {"gain": 1.0, "stiffness": motor.get("stiffness", 0.0), "offset": 0.0, "saturation": np.inf, "delay": 0.0, "lag": 0.0}
        out |= {f"{motor['name']}.{key}": x for key, x in own.items()}
    return out


def build(plant: Plant) -> mujoco.MjSpec:
    """The scene's chain without its numbers."""
    spec, bodies = mujoco.MjSpec(), {}
    spec.option.timestep, spec.option.integrator = plant.step, mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for body in plant.scene["body"]:
        parent, joint = bodies.get(body.get("parent"), spec.worldbody), body["joint"][0]
        bodies[body["name"]] = made = parent.add_body(name=body["name"], pos=body["position"], explicitinertial=True)
        kind = {"revolute": mujoco.mjtJoint.mjJNT_HINGE, "prismatic": mujoco.mjtJoint.mjJNT_SLIDE}[joint["kind"]]
        turned = made.add_joint(name=joint["name"], type=kind, axis=joint["axis"])
        turned.solref_friction, turned.solimp_friction = [2 * plant.step, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2.0]
        sensor = spec.add_sensor(name=joint["name"], type=mujoco.mjtSensor.mjSENS_JOINTPOS)
        sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_JOINT, joint["name"]
    for motor in plant.motors:
        made = spec.add_actuator(name=motor["name"], target=motor["joint"], trntype=mujoco.mjtTrn.mjTRN_JOINT)
        made.gaintype, made.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    return spec


def fill(spec: mujoco.MjSpec, scene: dict, values: dict[str, float]) -> mujoco.MjModel:
    """The model with all numbers; what is written does not depend on what the spec held before."""
    tilt = [values[f"gravity.tilt[{k}]"] for k in range(2)]
    y, z = G * np.sin(tilt[0]), -G * np.cos(tilt[0])
    spec.option.gravity = [np.sin(tilt[1]) * z, y, np.cos(tilt[1]) * z]
    for body in scene["body"]:
        name, joint = body["name"], body["joint"][0]["name"]
        made, turned, mass = spec.body(name), spec.joint(joint), values[f"{name}.mass"]
        made.mass, made.ipos = mass, [values[f"{name}.center_of_mass[{k}]"] for k in range(3)]
        s = np.array([values[f"{name}.spread[{k}]"] for k in range(3)]) ** 2
        made.inertia = mass * (s.sum() - s)
        turned.damping = [values[f"{joint}.damping"], values[f"{joint}.quadratic_damping"], 0.0]
        turned.stiffness = [values[f"{joint}.stiffness"], 0.0, values[f"{joint}.cubic_stiffness"]]
        turned.frictionloss, turned.armature = values[f"{joint}.friction"], values[f"{joint}.armature"]
    for motor in scene.get("actuator", []):
        name, made = motor["name"], spec.actuator(motor["name"])
        servo = motor["kind"] == "position"
        gain, stiffness, offset, limit = (values[f"{name}.{key}"] for key in ("gain", "stiffness", "offset", "saturation"))
        made.gainprm[0] = stiffness if servo else gain
        made.biasprm[:3] = [offset, -stiffness, -motor["damping"]] if servo else [offset, 0.0, 0.0]
        made.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE if np.isfinite(limit) else mujoco.mjtLimited.mjLIMITED_FALSE
        made.forcerange = [-limit, limit] if np.isfinite(limit) else [0.0, 0.0]
    return spec.compile()


def grid(record: Record, step: float) -> np.ndarray:
    """Times of the model's steps over a record [s]; all of them up to the last reading."""
    return np.arange(int(np.ceil(record.times[-1] / step - 1e-9)) + 2) * step


def driven(plant: Plant, record: Record, values: dict[str, float]) -> np.ndarray:
    """What the motors get in every step (steps, motors): the command in its middle, late and lagged; held before and after the log."""
    times, out = grid(record, plant.step) + 0.5 * plant.step, []
    for motor, samples in zip(plant.motors, record.commands.T, strict=True):
        late, lag = values[f"{motor['name']}.delay"], values[f"{motor['name']}.lag"]
        u = np.interp(times - late, record.stamps, samples)
        if lag > 0.0:  # the filter's exact steps of a command that is linear in each
            decay = np.exp(-plant.step / lag)
            u = u - lfilter([1.0], [1.0, -decay], lag * (1.0 - decay) * np.diff(u, prepend=u[0]) / plant.step)
        out.append(u)
    return np.stack(out, axis=1)


# ---- What can be freed ---------------------------------------------------------------------------------------------------------


def numbers(plant: Plant) -> dict[str, Number]:
    """Every number of the scene that the model or the signals have, by path."""
    values, scene, out = scene_values(plant.scene), plant.scene, {}
    model = fill(build(plant), scene, values)
    data = mujoco.MjData(model)
    data.qpos[:] = [joint["start"][0] for joint in plant.joints]
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    seen = np.nanmax(np.abs(np.concatenate([r.readings for r in plant.fitted()])), axis=0)
    peaks = np.abs(np.concatenate([r.commands for r in plant.fitted()])).max(axis=0)

    def add(path: str, lower: float, upper: float, start: float | None = None) -> None:
        x = float(values[path] if np.isfinite(values[path]) else upper)
        out[path] = Number(x, float(lower), float(upper), float(np.clip(x if start is None else start, lower, upper)))

    for j, (body, unit, size) in enumerate(zip(scene["body"], np.diag(full), seen, strict=True)):
        name, joint = body["name"], body["joint"][0]["name"]
        bounds = {"damping": 10 * unit, "quadratic_damping": 10 * unit / size, "friction": 10 * unit * size, "stiffness": 50 * unit}
        bounds |= {"cubic_stiffness": 200 * unit / size**2, "armature": 2 * unit}
        for key, largest in bounds.items():
            add(f"{joint}.{key}", 0.0, 10 * values[f"{joint}.{key}"] + largest)
        add(f"{joint}.position_bias", -0.5 * size, 0.5 * size)
        add(f"{joint}.position_scale", 0.5, 1.5)
        if len(seen) > 1:
            add(f"{joint}.position_delay", -LATEST, LATEST)
        add(f"{name}.mass", 0.1 * body["mass"], 10 * body["mass"])
        if any(other["joint"][0]["kind"] == "revolute" for other in scene["body"][: j + 1]):
            for k, x in enumerate(body["center_of_mass"]):
                add(f"{name}.center_of_mass[{k}]", x - 0.2, x + 0.2)
            path = f"{name}.spread[{widest(body)}]"
            add(path, 0.2 * values[path], 5 * values[path])
    units = {joint["name"]: unit * size for joint, unit, size in zip(plant.joints, np.diag(full), seen, strict=True)}
    for motor, peak in zip(plant.motors, peaks, strict=True):
        name, force = motor["name"], 10 * units[motor["joint"]]
        if motor["kind"] == "torque":
            add(f"{name}.gain", 0.2, 2.0)
            add(f"{name}.saturation", 0.2 * peak, peak, 0.95 * peak)  # at the peak nothing depends on it
        else:
            add(f"{name}.stiffness", 0.2 * motor["stiffness"], 2.0 * motor["stiffness"])
        add(f"{name}.offset", -force, force)
        add(f"{name}.delay", -LATEST, LATEST)
        add(f"{name}.lag", 0.0, 2 * LATEST)
    add("sensor.time_offset", -LATEST, LATEST)
    add("gravity.tilt[0]", -0.5, 0.5)
    add("gravity.tilt[1]", -0.5, 0.5)
    return out


def widest(body: dict) -> int:
    """The axis across the joint's along which a body's spread is largest."""
    axis, moments = int(np.argmax(np.abs(body["joint"][0]["axis"]))), np.array(body["inertia"][:3])
    spread = moments.sum() / 2 - moments
    return max((a for a in range(3) if a != axis), key=lambda a: (round(spread[a], 12), -a))


def paths(cause: str, at: str, scene: dict) -> list[str]:
    """What a cause frees at an object."""
    place, names = CAUSES[cause]
    if not place:
        return list(names)
    if names == ("spread",):
        names = (f"spread[{widest(next(body for body in scene['body'] if body['name'] == at))}]",)
    return [f"{at}.{name}" for name in names]


def objects(cause: str, plant: Plant) -> list[str]:
    """Where a cause can be in a scene, "" if it is of the whole."""
    turning = [k for k, body in enumerate(plant.scene["body"]) if body["joint"][0]["kind"] == "revolute"]
    bodies = [body["name"] for body in plant.scene["body"]]
    return {
        "": [""],
        "joint": [joint["name"] for joint in plant.joints],
        "motor": [motor["name"] for motor in plant.motors],
        "torque motor": [motor["name"] for motor in plant.motors if motor["kind"] == "torque"],
        "position drive": [motor["name"] for motor in plant.motors if motor["kind"] == "position"],
        "body": bodies[-1:],
        "turning body": bodies[turning[0] :] if turning else [],
    }[CAUSES[cause][0]]
