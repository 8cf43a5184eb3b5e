"""Pendulums, carts and arms of a blind batch given to `mujoco.sysid`, beside pliant's verdicts.

    python -m validation.blind.peer_chains KEPT [--nulls 20] [--effects 30] [--outside 10] [--json FILE]

KEPT is the folder of a batch that has been answered. Two questions to the toolbox about every case:

    all     every number that the model and its signals have is free at once (`peer_model.numbers`), as by somebody who does not know
            what is wrong, but those that the ones before them imitate exactly, which would leave all others without an interval
    told    free are those that the scene declares, and those of the cause that was hidden: the most favourable use of it (of a null, and
            of an effect outside the library, those of one cause in turn)

The finding is the set of numbers, but those that the scene declares free, whose 95 % interval excludes the scene's value.
Scenes with dry friction are passed over: MuJoCo's is soft, and at a thirty-second of a sample still 0.3 of the noise off the generator's.

It sees all fitted records at once, the states at their first readings free as well. The held-out record is begun from its first 0.1 s,
as pliant does it, with the fitted numbers. Every joint's readings are weighted alike, over the scene's noise floor; missing ones are left out.
`half_width_all` are the intervals that hold all numbers together at 95 % (Bonferroni).

Its default path does less well in three places, which its hooks mend: sensors of a rollout are those before each step, under the time after
it, which would be a delay of one step (`custom_rollout` reads the states); commands are held from the beginning of a step, half a step
early (they are taken in its middle); its residual has no missing readings (`modify_residual`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import mujoco
import numpy as np
from mujoco import minimize, sysid
from mujoco.sysid.report.sections.insights import AutomatedInsights

from validation.blind import chains, peer, peer_model
from validation.blind.peer_model import Plant, Record

LEAD_IN = 0.1  # s of the held-out record, whence its start
SENSED = ("position_bias", "position_scale", "position_delay", "time_offset")
FELT = 30.0  # over the noise floor: what a number does to all readings together over its whole range, at least
SAME = 0.02  # what is left of a number that others imitate, over what it does
FAR = 1e6  # residual of a motion that runs away
# bounds of a start about its guess, in parts of the motion: for positions, and for velocities per second
NEAR = (0.2, 10.0)


class Fit:
    """Starts of some records free, and numbers of the plant.

    `values`: all numbers, of which those of `held` are the sensors' and stay what they are, like every one that is not in `free`.
    """

    def __init__(self, plant: Plant, records: Sequence[Record], values: dict[str, float], free: Sequence[str] = (), held: Sequence[str] = ()) -> None:
        self.plant, self.records, self.values, self.free, self.held = plant, records, values, free, held
        names = [(joint["name"], 1, sysid.SignalType.MjSensor) for joint in plant.joints]
        self.observed = [sysid.TimeSeries.from_custom_map(r.times, r.readings, names) for r in records]
        self.control = [self.commands(record, values) for record in records]
        self.floor = plant.scene["experiment"]["joint"][0]["noise_floor"]
        self.parameters = self.declared()

    def commands(self, record: Record, values: dict[str, float]) -> sysid.TimeSeries:
        """What motors get in each step, and one more, which its rollouts drop."""
        return sysid.TimeSeries(peer_model.grid(record, self.plant.step), peer_model.driven(self.plant, record, values))

    def declared(self) -> sysid.ParameterDict:
        """The toolbox's parameters: numbers, then starts."""
        out, known, declared = sysid.ParameterDict(), peer_model.numbers(self.plant), {one["path"]: one for one in self.plant.free}
        for path in self.free:
            number = known[path]
            lower, upper = (declared[path][key] for key in ("lower", "upper")) if path in declared else (number.lower, number.upper)
            out.add(sysid.Parameter(path, number.start, lower, upper))
        for path in self.held:
            out.add(sysid.Parameter(path, self.values[path], self.values[path], self.values[path], frozen=True))
        for k, record in enumerate(self.records):
            start, size = record.start(), np.nanmax(np.abs(record.readings), axis=0) + 1e-3
            off = np.concatenate([NEAR[0] * size, NEAR[1] * size])
            out.add(sysid.Parameter(f"start[{k}]", start, start - off, start + off))
        return out

    def read(self, parameters: sysid.ParameterDict) -> dict[str, float]:
        """All numbers of the plant."""
        return self.values | {path: float(parameters[path].value[0]) for path in self.free}

    def rollout(self, models, control_signal, initial_states, param_dicts, **_) -> list[sysid.SystemTrajectory]:
        """Motions of one record by all candidates; those that differ by the sensors alone are made once."""
        which = next(k for k, control in enumerate(self.control) if control is control_signal[0])
        record, made, out = self.records[which], {}, []
        for model, candidate, initial in zip(models, param_dicts, initial_states, strict=True):
            values, start = self.read(candidate), candidate[f"start[{which}]"].value
            key = (tuple(x for path, x in values.items() if not sensed(path)), tuple(start))
            if key not in made:
                control, begun = self.commands(record, values), sysid.create_initial_state(model, *np.split(start, 2), np.zeros(0))
                moved = sysid.sysid_rollout([model], [mujoco.MjData(model)], [control], [begun])[0]
                made[key] = control, np.vstack([begun, moved.state.data])
            control, states = made[key]
            seen = sysid.TimeSeries(states[:, 0], states[:, 1 : 1 + model.nq], self.observed[which].signal_mapping)
            out.append(sysid.SystemTrajectory(model, control, seen, initial, sysid.TimeSeries(states[:, 0], states)))
        return out

    def transform(self) -> sysid.SignalTransform:
        """What sensors make of the motion."""
        out = sysid.SignalTransform(normalize=False)
        for path in (*self.free, *self.held):
            at, _, what = path.rpartition(".")
            if what in ("time_offset", "position_delay"):
                out.delay("*" if what == "time_offset" else at, self.parameters[path])
            elif what == "position_scale":
                out.gain(at, self.parameters[path], "predicted")
            elif what == "position_bias":
                out.bias(at, self.parameters[path], "predicted")
        return out

    def residual(self) -> Callable:
        """What `optimize` takes."""
        spec, scene, sensors = peer_model.build(self.plant), self.plant.scene, self.transform()

        def observe(candidate, predicted, measured, model, every, **more):
            off, predicted, measured = sensors.apply(candidate, predicted, measured, model, every, **more)
            off = off[np.isfinite(measured.data)] / self.floor
            return np.clip(np.nan_to_num(off, nan=FAR), -FAR, FAR), predicted, measured

        model = peer_model.fill(spec, scene, self.values)
        begun = [sysid.create_initial_state(model, *np.split(r.start(), 2), np.zeros(0)) for r in self.records]
        names = [f"record {k}" for k in range(len(self.records))]
        return sysid.build_residual_fn(
            models_sequences=[sysid.ModelSequences("chain", spec, names, begun, self.control, self.observed)],
            build_model=lambda candidate, own: peer_model.fill(own, scene, self.read(candidate)),
            custom_rollout=self.rollout, modify_residual=observe, resample_true=False, n_threads=1,
        )  # fmt: skip

    def off(self, parameters: sysid.ParameterDict) -> np.ndarray:
        """Residuals over the noise floor."""
        return np.concatenate([r.ravel() for r in self.residual()(parameters.as_vector(), parameters)[0]])

    def rmse(self, parameters: sysid.ParameterDict) -> float:
        return float(self.floor * np.sqrt(np.mean(self.off(parameters) ** 2)))

    def run(self, iterations: int) -> tuple[sysid.ParameterDict, np.ndarray]:
        """The best parameters and the derivatives there."""
        with redirect_stdout(StringIO()):  # the toolbox prints its iterations
            best, result = sysid.optimize(self.parameters, self.residual(), verbose=False, max_iters=iterations, x_scale="jac")
        return best, result.jac


def sensed(path: str) -> bool:
    """Whether a number is one of the sensors."""
    return path.rpartition(".")[2] in SENSED


def told_apart(plant: Plant, free: list[str]) -> list[str]:
    """Those of the numbers that the ones before them and the starts do not imitate in all fitted records, at the scene's values."""
    values, known = peer_model.scene_values(plant.scene), peer_model.numbers(plant)
    cut = [path for path in free if path.endswith(".saturation")]  # no derivatives at the scene's values: a twentieth less than the peak
    fit = Fit(plant, plant.fitted(), values, [path for path in free if path not in cut])
    x, residual = fit.parameters.as_vector(), fit.residual()
    stacked = lambda at: np.concatenate(residual(at, fit.parameters)[0])
    base, bounds = stacked(x), [b.reshape(-1, 1) for b in fit.parameters.get_bounds()]
    jac, _ = minimize.jacobian_fd(stacked, x.reshape(-1, 1), base.reshape(-1, 1), np.float64(1e-6), 0, bounds)
    columns = dict(zip(fit.free, jac.T, strict=False))
    for path in cut:
        columns[path] = Fit(plant, plant.fitted(), values | {path: known[path].start}, fit.free).off(fit.parameters) - base
    basis, _ = np.linalg.qr(jac[:, len(fit.free) :])
    kept = []
    for path in free:
        rest, size = columns[path], np.linalg.norm(columns[path])
        for _ in range(2):  # once more, against rounding
            rest = rest - basis @ (basis.T @ rest)
        if size * (known[path].upper - known[path].lower) > FELT and np.linalg.norm(rest) > SAME * size:
            kept.append(path)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return kept


def intervals(off: np.ndarray, jac: np.ndarray, alpha: float) -> np.ndarray:
    """The toolbox's half widths, of columns of unit length: its limit for what counts as zero is one for all numbers."""
    long = np.maximum(np.linalg.norm(jac, axis=0), 1e-300)
    return sysid.calculate_intervals([off], jac / long, alpha)[1] / long


def fitted(plant: Plant, free: list[str], iterations: int) -> dict:
    """A fit of all fitted records, its intervals, and the error on the record held out."""
    began, known = time.process_time(), peer_model.numbers(plant)
    fit = Fit(plant, plant.fitted(), peer_model.scene_values(plant.scene), free)
    best, jac = fit.run(iterations)
    widths = [intervals(fit.off(best), jac, 0.05 / share) for share in (1, len(free))]
    listed = []
    for path, *each in zip(free, *(width[: len(free)] for width in widths), strict=True):
        half = [float(x) if np.isfinite(x) else None for x in each]
        value = float(best[path].value[0])
        listed.append({"path": path, "scene": known[path].scene, "fitted": value, "half_width_95": half[0], "half_width_all": half[1]})
    insights = AutomatedInsights("insights", best).get_context()["insights"]
    out = {"parameters": listed, "rmse": fit.rmse(best), "held_out": held_out(plant, fit.read(best), free, iterations)}
    return out | {"insights": sorted({i["title"] for i in insights}), "seconds": time.process_time() - began}


def held_out(plant: Plant, values: dict[str, float], free: list[str], iterations: int) -> float:
    """Root mean square error of the record held out, begun as its first readings say."""
    record, sensors = plant.held_out(), [path for path in free if sensed(path)]
    lead, _ = Fit(plant, [record.first(LEAD_IN)], values, held=sensors).run(iterations)
    whole = Fit(plant, [record], values, held=sensors)
    whole.parameters.update_from_vector(lead.as_vector())
    return whole.rmse(whole.parameters)


def cause_of_null(plant: Plant, number: int) -> tuple[str, list[str]]:
    """A cause in turn that frees nothing that the scene frees, at one of its objects."""
    declared, names = {one["path"] for one in plant.free}, list(peer_model.CAUSES)
    for k in range(len(names)):
        cause = names[(number + k) % len(names)]
        places = peer_model.objects(cause, plant)
        if places:
            paths = peer_model.paths(cause, places[number % len(places)], plant.scene)
            if not declared & set(paths):
                return cause, paths
    raise ValueError("the scene frees everything")


def ask(folder: Path, case: dict, number: int, iterations: int) -> dict[str, dict]:
    """Both questions about a case."""
    plant = peer_model.read(folder)
    declared, known = [one["path"] for one in plant.free], peer_model.numbers(plant)
    if case["kind"] == "effect":
        cause, tried = case["hidden"][0]["name"], list(case["hidden"][0]["truth"])
    else:
        cause, tried = cause_of_null(plant, number)
    others = [path for path in known if path not in declared and (path != "sensor.time_offset" or len(plant.joints) == 1)]
    fine = replace(plant, step=plant.step * peer_model.SMOOTH / peer_model.DRY) if cause == "coulomb_friction" else plant
    out = {}
    for question, own in (("told", fine), ("all", plant)):
        answer = fitted(own, declared + tried if question == "told" else told_apart(plant, declared + others), iterations)
        out[question] = answer | {"cause": cause if question == "told" else "-"}
        out[question] |= peer.excluded(case, answer["parameters"], declared, tried if question == "told" else [])
    return out


def smooth(case: dict, folder: Path) -> bool:
    """Whether a case is one of a chain without dry friction in the scene."""
    return case["system"] in chains.SYSTEMS and not peer_model.read(folder).is_dry()


def main() -> None:
    represented = lambda case: case["hidden"][0]["name"] in peer_model.CAUSES
    peer.compare(__doc__, ask, smooth, represented, {"null": 20, "effect": 30, "outside": 10})


if __name__ == "__main__":
    main()
