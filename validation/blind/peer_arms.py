"""The blind arms given to `mujoco.sysid`, beside pliant's verdicts.

    python -m validation.blind.run --arms --cases 24 --seed 5 --keep KEPT --json batch.json
    python -m validation.blind.peer_arms batch.json --kept KEPT --cases 12

As for ropes (`validation.blind.peer`) the toolbox has no test of causes, so it is given the answer to try: the lower link's mass and,
for an effect, the number of the cause that was hidden; for a null, that of one cause in turn. What counts as its finding is that a 95 %
interval excludes the scene's value. It has the generator's own simulator (RK4, at pliant's step) and all fitted records, and every
record's initial state is free, from its first readings: a user who does that does all that the toolbox allows.
"""

from __future__ import annotations

import csv
import sys
import time
import tomllib
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout, sysid
from mujoco.sysid.report.sections.insights import AutomatedInsights

from validation.blind import arms
from validation.blind.arm_oracle import EVERY, JOINTS, STEP, changed, nothing, pair
from validation.blind.peer import compare

# cause -> (end of its parameter's path, the scene's value, bounds)
CAUSES = {
    "viscous_friction": ("damping", 0.0, 0.0, 0.5),
    "coulomb_friction": ("friction", 0.0, 0.0, 0.5),
    "joint_stiffness": ("stiffness", 0.0, 0.0, 2.0),
    "armature": ("armature", 0.0, 0.0, 0.1),
    "torque_gain": ("gain", 1.0, 0.5, 1.5),
    "torque_offset": ("offset", 0.0, -0.5, 0.5),
    "actuator_delay": ("delay", 0.0, 0.0, 0.05),
    "actuator_lag": ("lag", 0.0, 0.0, 0.1),
    "encoder_bias": ("position_bias", 0.0, -0.2, 0.2),
    "encoder_scale": ("position_scale", 1.0, 0.8, 1.2),
    "sensor_delay": ("time_offset", 0.0, -0.05, 0.05),
}
READ = 12  # samples that a first state is read from


@dataclass
class Record:
    """One log: times [s], readings and commands at the samples."""

    times: np.ndarray
    q: np.ndarray
    u: np.ndarray

    def start(self) -> np.ndarray:
        """(q, v) at the first sample, by a parabola through the first ones."""
        t = self.times[:READ]
        fits = [np.polyfit(t, column[:READ], 2) for column in self.q.T]
        return np.array([*(fit[2] for fit in fits), *(fit[1] for fit in fits)])


def read(folder: Path) -> tuple[float, list[Record]]:
    """The scene's mass of the lower link [kg], and its fitted records."""
    scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    out = []
    for entry in scene["experiment"]["record"]:
        if entry["role"] != "fit":
            continue
        with (folder / entry["file"]).open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        column = {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}
        both = {x: np.stack([column[f"{x}_{j}"] for j in JOINTS], axis=1) for x in "qu"}
        out.append(Record(column["t"], both["q"], both["u"]))
    return next(body["mass"] for body in scene["body"] if body["name"] == "lower"), out


def change(path: str, x: float) -> dict:
    """What a parameter changes of an `arms.Effect`; of readings nothing."""
    owner, _, end = path.partition(".")
    attributes = {
        "damping": "damping",
        "friction": "frictionloss",
        "stiffness": "stiffness",
        "armature": "armature",
    }
    if end in attributes:
        return {"joint": {owner: {attributes[end]: x}}}
    k = int(owner.endswith("elbow"))
    motors = {
        "gain": ("gain", 1.0),
        "offset": ("offset", 0.0),
        "delay": ("late", 0.0),
        "lag": ("lag", 0.0),
    }
    return {motors[end][0]: pair(k, x, motors[end][1])} if end in motors else {}


def simulate(
    record: Record, start: np.ndarray, values: dict[str, float], path: str | None
) -> np.ndarray:
    """Readings at the samples (T, 2) [rad]."""
    effect = nothing((0.0, 0.0))
    if path is not None:
        effect = changed(effect, change(path, values[path]))
    model = arms.model(effect)
    model.opt.timestep = STEP
    lower = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "lower")
    model.body_inertia[lower] *= values["lower.mass"] / model.body_mass[lower]
    model.body_mass[lower] = values["lower.mass"]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    steps = EVERY * (len(record.times) - 1)
    control = arms.motor_torque(effect, record.times, record.u, STEP, steps)
    state = np.array([0.0, *start])
    states, _ = rollout.rollout(
        model, mujoco.MjData(model), state[None, :], control[None, :, :]
    )
    q = np.vstack([start[:2], states[0, :, 1:3]])
    late = values.get("sensor.time_offset", 0.0)
    t = np.arange(steps + 1) * STEP
    q = np.stack([np.interp(record.times - late, t, column) for column in q.T], axis=1)
    scale = np.array([values.get(f"{j}.position_scale", 1.0) for j in JOINTS])
    return scale * q + np.array([values.get(f"{j}.position_bias", 0.0) for j in JOINTS])


def ask(folder: Path, case: dict, cause: str, iterations: int) -> dict:
    """The toolbox's fit with the cause's number free."""
    began = time.monotonic()
    guess, records = read(folder)
    end, nominal, low, high = CAUSES[cause]
    path = f"{case['object'] or JOINTS[case['index'] % 2]}.{end}"
    if cause == "sensor_delay":
        path = "sensor.time_offset"
    elif end in ("gain", "offset", "delay", "lag") and not path.startswith("motor_"):
        path = f"motor_{path}"
    params = sysid.ParameterDict()
    params.add(sysid.Parameter("lower.mass", guess, 0.1, 3.0))
    params.add(sysid.Parameter(path, nominal, low, high))
    for r, record in enumerate(records):
        for k, x in enumerate(record.start()):
            params.add(sysid.Parameter(f"start{r}[{k}]", x, x - 0.5, x + 0.5))
    with redirect_stdout(sys.stderr):  # the toolbox prints its iterations
        best, halves, insights, rms = fit(records, params, path, iterations)
    value = float(best[path].value[0])
    half = halves[path]
    return {
        "cause": cause,
        "found": half is not None and abs(value - nominal) > half,
        "covered": []
        if half is None
        else [abs(value - case["truth"].get(path, nominal)) <= half],
        "rms_rad": rms,
        "insights": insights,
        "value": [path, value, half],
        "seconds": time.monotonic() - began,
    }


def fit(records: list[Record], params: sysid.ParameterDict, path: str, iterations: int):
    """The best parameters, half-widths of their 95 % intervals by path, insights, and errors before and after [rad]."""
    spec = mujoco.MjSpec.from_string(arms.xml(nothing((0.0, 0.0))))
    model = spec.compile()
    signals = [(f"encoder_{j}", 1, sysid.SignalType.MjSensor) for j in JOINTS]
    sequences, numbers = [], {}
    for r, record in enumerate(records):
        measured = sysid.TimeSeries.from_custom_map(record.times, record.q, signals)
        control = sysid.TimeSeries(record.times, record.u, {})
        start = record.start()
        state = sysid.create_initial_state(model, start[:2], start[2:], np.zeros(0))
        sequences.append(
            sysid.ModelSequences(f"record{r}", spec, "log", state, control, measured)
        )
        numbers |= {id(control): r, id(measured): r}

    def rolled(models, control_signal, initial_states, param_dicts, **_):
        out = []
        for of, control, state, candidate in zip(
            models, control_signal, initial_states, param_dicts, strict=True
        ):
            r = numbers[id(control)]
            names = candidate.keys()  # a ParameterDict does not iterate over its names
            values = {name: float(candidate[name].value[0]) for name in names}
            start = np.array([values[f"start{r}[{k}]"] for k in range(4)])
            seen = simulate(
                records[r], start, values, path if change(path, 0.0) else None
            )
            series = sysid.TimeSeries(
                records[r].times, seen, sequences[r].sensordata[0].signal_mapping
            )
            clock = np.repeat(
                records[r].times[:, None], state.size, axis=1
            )  # only t is read
            out.append(
                sysid.SystemTrajectory(
                    of,
                    control,
                    series,
                    state,
                    sysid.TimeSeries(records[r].times, clock),
                )
            )
        return out

    def compared(_candidate, predicted, measured, *_args, **_kwargs):
        return predicted.data - records[numbers[id(measured)]].q, predicted, measured

    residual = sysid.build_residual_fn(
        models_sequences=sequences,
        build_model=lambda _candidate, _spec: model,
        custom_rollout=rolled,
        modify_residual=compared,
        resample_true=False,
        n_threads=1,
    )

    def error(at) -> float:
        return float(
            np.sqrt(
                np.mean(
                    np.concatenate([r.ravel() for r in residual(at.as_vector(), at)[0]])
                    ** 2
                )
            )
        )

    before = error(params)
    best, result = sysid.optimize(params, residual, verbose=False, max_iters=iterations)
    at_best = residual(best.as_vector(), best)[0]
    _, halves = sysid.calculate_intervals([r.ravel() for r in at_best], result.jac)
    listed = {
        name: float(h) if np.isfinite(h) else None
        for name, h in zip(best.keys(), halves, strict=True)
    }
    insights = [
        i.get("title", str(i))
        for i in AutomatedInsights("insights", best).get_context()["insights"]
    ]
    return best, listed, insights, [before, error(best)]


def main() -> None:
    compare(__doc__, ask, list(CAUSES), cases=12)


if __name__ == "__main__":
    main()
