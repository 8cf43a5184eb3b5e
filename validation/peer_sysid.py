"""One log given to MuJoCo's identification toolbox (`mujoco.sysid`), beside pliant's diagnosis.

    python -m validation.peer_sysid scene.toml --log run.csv [--ours diagnosis.json] > peer.json

What the toolbox offers: box-bounded least squares over rollouts by finite differences, on
whatever an `MjSpec` can be rebuilt with; gains, biases and delays of signals; 95 % intervals
from the Jacobian; and an "insights" section whose only check is whether a fitted value lies at
a bound. It does not test for causes outside the declared parameters, and holds no record out.

What it can represent of a pliant scene here (`REPRESENTED`): the rope's length, density, EA, EI
and linear drag, the gravity magnitude, one bias and scale of all markers, the time offset and
gripper offsets. What it cannot, and why, is listed in the output (`NOT_REPRESENTED`).

Three places need more than its default path, all through its public hooks: the gripper is a
mocap body, which its rollouts do not drive (`custom_rollout`); the start is a static shape that
depends on the parameters (settled in the same hook); its residual is divided by each column's
norm, which is 0/0 for a column that stays at zero, so it is replaced (`modify_residual`).
"""

import argparse
import csv
import itertools
import json
import re
import sys
import time
import tomllib
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from mujoco import sysid
from mujoco.sysid.report.sections.insights import AutomatedInsights

from validation import mujoco_rope as mj

ROPE = ("length", "linear_density", "stretch_stiffness", "bend_stiffness", "drag_linear")
REPRESENTED = [f"<rope>.{name}" for name in ROPE] + [
    "gravity.magnitude",
    "sensor.bias[k]",
    "sensor.scale",
    "sensor.time_offset",
    "<gripper>.offset[k]",
]
NOT_REPRESENTED = {
    "bend_damping": "MuJoCo refuses flex damping on a rod held by a mocap body",
    "stretch_damping": "edge damping is not supported by the discrete integrator",
    "drag_quadratic": "MuJoCo's fluid drag acts on a body's inertia box, not per length",
    "wind": "acts through the same fluid drag only",
    "node[i].mass": "possible one body at a time; not mapped here",
    "sensor.rotation": "signals take gains and biases, not a rotation",
    "contact": "possible, with MuJoCo's own contact law; not mapped here",
    "initial state": "every free node's start would be a parameter; it is settled at rest instead",
}
ENDS = {"first": 0, "last": -1}


@dataclass
class Experiment:
    """A scene and one log in the arrays the fit needs (SI units)."""

    rope: mj.Rope
    options: mj.Options
    rope_name: str
    grippers: dict[str, list[int]]  # name -> driven nodes
    nodes: list[int]  # observed node of each marker
    times: np.ndarray  # (T,) s
    driven: np.ndarray  # (T, nodes, 3) m, meaningful at driven nodes
    markers: np.ndarray  # (T, 3 * markers) m
    free: list[dict]


def read(scene_path: Path, log_path: Path, substeps: int) -> Experiment:
    """Read scene and CSV; refuses what the rod cannot stand for."""
    scene = tomllib.loads(scene_path.read_text(encoding="utf-8"))
    experiment = scene["experiment"]
    if len(scene["rope"]) != 1:
        raise ValueError("exactly one rope can be put to MuJoCo's rod here")
    entry = scene["rope"][0]
    if "edge_fractions" in entry or entry.get("tip_mass") or entry.get("node_mass"):
        raise ValueError("the rod here has equal edges and no extra masses")
    fields = {k: float(entry[k]) for k in (*ROPE, "radius") if k in entry}
    gravity = float(scene.get("gravity", {}).get("magnitude", 9.81))
    rope = mj.Rope(nodes=entry["nodes"], gravity=gravity, **fields)
    columns, times = _columns(log_path, experiment["time"]["column"])
    driven, grippers = np.zeros((len(times), rope.nodes, 3)), {}
    for one in experiment["input"]:
        gripper = next(g for g in scene["gripper"] if g["name"] == one["gripper"])
        if "end" in gripper:
            raise ValueError("clamped end edges change direction: not mapped; clamp two nodes")
        grippers[gripper["name"]] = [i % rope.nodes for i in gripper["nodes"]]
        positions = _stack(columns, one["columns"]).reshape(len(times), -1, 3)
        driven[:, grippers[gripper["name"]]] = positions
    fixed = tuple(sorted(i for nodes in grippers.values() for i in nodes))
    step = float(np.median(np.diff(times))) / substeps
    nodes = [
        m["node"] % rope.nodes if "node" in m else round(m["arc"] / rope.edge)
        for m in experiment["marker"]
    ]
    markers = np.hstack([_stack(columns, m["columns"]) for m in experiment["marker"]])
    options = mj.Options(step=step, fixed=fixed, sensors=tuple(nodes))
    free = experiment["fit"]["free"]
    return Experiment(rope, options, entry["name"], grippers, nodes, times, driven, markers, free)


def _columns(path, time_column):
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    return columns, columns[time_column] - columns[time_column][0]


def _stack(columns, names):
    return np.stack([columns[name] for name in names], axis=1)


def _start(experiment, path):
    """Starting value of a parameter path; None where the peer cannot represent it."""
    owner, _, quantity = path.partition(".")
    if owner == experiment.rope_name and quantity in ROPE:
        return getattr(experiment.rope, quantity)
    if path == "gravity.magnitude":
        return experiment.rope.gravity
    known = owner in (*experiment.grippers, "sensor")
    if known and re.fullmatch(r"(bias|offset)\[[0-2]\]|time_offset", quantity):
        return 0.0
    return 1.0 if path == "sensor.scale" else None


def parameters(experiment: Experiment) -> tuple[sysid.ParameterDict, list[str]]:
    """The declared free parameters the peer can take, and the paths it cannot."""
    taken, refused = sysid.ParameterDict(), []
    for free in experiment.free:
        start = _start(experiment, free["path"])
        if start is None:
            refused.append(free["path"])
            continue
        lower, upper = free["lower"], free["upper"]
        taken.add(sysid.Parameter(free["path"], np.clip(start, lower, upper), lower, upper))
    return taken, refused


def _values(params):
    names = params.keys()  # a ParameterDict does not iterate over its names
    return {name: float(params[name].value[0]) for name in names}


def _rope(experiment, values):
    changes = {
        q: values[f"{experiment.rope_name}.{q}"]
        for q in ROPE
        if f"{experiment.rope_name}.{q}" in values
    }
    gravity = values.get("gravity.magnitude", experiment.rope.gravity)
    return replace(experiment.rope, gravity=gravity, **changes)


def simulate(experiment: Experiment, values: dict) -> np.ndarray:
    """Observed nodes' positions (T, 3 * markers) [m] of the rod with `values`."""
    rope, driven = _rope(experiment, values), experiment.driven.copy()
    for name, nodes in experiment.grippers.items():
        driven[:, nodes] += [values.get(f"{name}.offset[{k}]", 0.0) for k in range(3)]
    rod = mj.Rod(rope, experiment.options)
    rod.reset(_at_rest(experiment, rope, driven[0]))
    substeps = round((experiment.times[1] - experiment.times[0]) / rod.options.step)
    records = [rod.positions()[experiment.nodes].ravel()]
    for before, after in itertools.pairwise(driven):
        for k in range(substeps):
            rod.place(before + (after - before) * (k + 1) / substeps)
            rod.advance()
        records.append(rod.positions()[experiment.nodes].ravel())
    return np.array(records)


def _at_rest(experiment, rope, held):
    """Static shape of the rope with the driven nodes where the log starts."""
    fixed, settling = experiment.options.fixed, replace(experiment.options, step=0.01)
    drag = 2 * np.sqrt(rope.gravity / rope.length) * rope.linear_density
    rod = mj.Rod(replace(rope, drag_linear=float(drag)), settling)
    first, last = held[fixed[0]], held[fixed[-1]]
    if fixed[0] == 0 and fixed[-1] == rope.nodes - 1:
        guess = mj.arch(rope, first, last)
    else:
        guess = mj.straight(rope, first - fixed[0] * rope.edge * np.array([0, 0, -1]), (0, 0, -1))
    guess[list(fixed)] = held[list(fixed)]
    rod.reset(guess)
    return mj.settle(rod, 1e-6, 20_000)


def fit(experiment: Experiment, max_iters: int = 30) -> dict:
    """Run `mujoco.sysid.optimize` and gather its verdict."""
    params, refused = parameters(experiment)
    signals = [(f"node{i}", 3, sysid.SignalType.MjSensor) for i in experiment.nodes]
    measured = sysid.TimeSeries.from_custom_map(experiment.times, experiment.markers, signals)
    rod = mj.Rod(experiment.rope, experiment.options)
    state = sysid.create_initial_state(rod.model, rod.data.qpos, rod.data.qvel, rod.data.act)
    control = sysid.TimeSeries(experiment.times, np.zeros((len(experiment.times), 0)), {})
    sequences = sysid.ModelSequences("rope", rod.spec, "log", state, control, measured)

    def rollout(models, control_signal, initial_states, param_dicts, **_):
        predicted = []
        for model, commands, initial, candidate in zip(
            models, control_signal, initial_states, param_dicts, strict=True
        ):
            data = simulate(experiment, _values(candidate))
            series = sysid.TimeSeries(experiment.times, data, measured.signal_mapping)
            clock = np.repeat(experiment.times[:, None], state.size, axis=1)  # only t is read
            states = sysid.TimeSeries(experiment.times, clock)
            predicted.append(sysid.SystemTrajectory(model, commands, series, initial, states))
        return predicted

    def observe(candidate, predicted, _measured, *_args, **_kwargs):
        values = _values(candidate)
        shift = values.get("sensor.time_offset", 0.0)
        bias = np.tile(
            [values.get(f"sensor.bias[{k}]", 0.0) for k in range(3)], len(experiment.nodes)
        )
        seen = np.stack(
            [
                np.interp(experiment.times + shift, predicted.times, column)
                for column in predicted.data.T
            ],
            axis=1,
        )
        seen = values.get("sensor.scale", 1.0) * seen + bias
        series = sysid.TimeSeries(experiment.times, seen, measured.signal_mapping)
        return seen - experiment.markers, series, measured

    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        build_model=lambda candidate, _: (
            mj.Rod(_rope(experiment, _values(candidate)), experiment.options).model
        ),
        custom_rollout=rollout,
        modify_residual=observe,
        resample_true=False,
        n_threads=1,
    )
    start, began = _rms(residual, params), time.perf_counter()
    best, result = sysid.optimize(params, residual, verbose=False, max_iters=max_iters)
    seconds = time.perf_counter() - began
    at_best = residual(best.as_vector(), best)[0]
    _, halfwidths = sysid.calculate_intervals([r.ravel() for r in at_best], result.jac)
    insights = AutomatedInsights("insights", best).get_context()["insights"]
    return {
        "peer": f"mujoco.sysid, MuJoCo {mujoco.__version__}",
        "parameters": _listed(experiment, best, halfwidths),
        "rms_start_m": start,
        "rms_fitted_m": _rms(residual, best),
        "insights": [{k: re.sub("<.*?>", "", v) for k, v in i.items()} for i in insights],
        "checks": "bounds only; intervals assume the model is right and the noise white",
        "refused": refused,
        "represented": REPRESENTED,
        "not_represented": NOT_REPRESENTED,
        "seconds": seconds,
    }


def _rms(residual, params):
    values = np.concatenate([r.ravel() for r in residual(params.as_vector(), params)[0]])
    return float(np.sqrt(np.mean(values**2)))


def _listed(experiment, best, halfwidths):
    return [
        {
            "path": name,
            "start": float(best[name].nominal[0]),
            "fitted": float(best[name].value[0]),
            "half_width_95": float(half) if np.isfinite(half) else None,
        }
        for name, half in zip(best.keys(), halfwidths, strict=True)
    ]


def main():
    """Fit one log and print JSON."""
    parser = argparse.ArgumentParser(prog="python -m validation.peer_sysid")
    parser.add_argument("scene", type=Path)
    parser.add_argument("--log", type=Path, required=True, help="CSV named as in the scene")
    parser.add_argument("--ours", type=Path, help="pliant's diagnosis (JSON) to print beside it")
    parser.add_argument("--substeps", type=int, default=2, help="MuJoCo steps per log row")
    options = parser.parse_args()
    verdict = {"schema_version": 1, "log": options.log.name}
    try:
        with redirect_stdout(sys.stderr):  # the toolbox prints its iterations
            verdict["peer"] = fit(read(options.scene, options.log, options.substeps))
    except ValueError as error:
        verdict["peer"] = {"refused": str(error), "represented": REPRESENTED}
    if options.ours:
        verdict["pliant"] = json.loads(options.ours.read_text(encoding="utf-8"))
    json.dump(verdict, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main()
