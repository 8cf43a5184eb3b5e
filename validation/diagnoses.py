"""Diagnoses of chosen cases, simulated by others or measured, whose answers the tests check.

    python -m validation.diagnoses CASE ... [--write]
    python -m validation.diagnoses --all --write

Without --write the answers are printed; with it each goes to validation/evidence/diagnoses/CASE.json.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pliant

from validation import evidence
from validation.blind import arms, cable_logs, cases, rods, slider
from validation.real import arms as real_arms
from validation.real import cubes, torques
from validation.real.deform_dlo import data_folder

ROPE_SEED = 3
# of that seed: large enough to be named, by the oracle or by luck of the draw
ROPE_EFFECTS = {6: "internal_damping", 10: "time_offset", 21: "time_offset", 34: "length_scale"}
ROPE_NULLS = (1, 4, 5)
SILVERBOX = ((41_000, 300, "fit"), (52_000, 300, "fit"), (120_000, 500, "held_out"))
DRY = '{ path = "shoulder.friction", lower = 0.0, upper = 1.0 }, { path = "elbow.friction", lower = 0.0, upper = 1.0 }, '


def measured() -> Path:
    """Folder of the real measurements."""
    folder = data_folder()
    if folder is None:
        raise FileNotFoundError("the real measurements are absent: set PLIANT_DATA to their folder")
    return folder


@dataclass(frozen=True)
class Case:
    """A case. `run(folder)` writes its scene and logs there and answers; `seeds`: of its generator, None where it is measured."""

    run: Callable[[Path], dict]
    seeds: object = None


def told(report: dict) -> dict:
    """The part of a report that tests look at."""
    parameters = lambda found: [{key: p[key] for key in ("path", "estimate", "interval")} for p in found["parameters"]]
    return {
        "verdict": report["verdict"],
        "reason": report["reason"],
        "causes": [{"name": c["name"], "object": c["object"], "parameters": parameters(c)} for c in report["causes"]],
        "alternatives": report["alternatives"],
        "alternative_objects": report["alternative_objects"],
        "stages": [{"name": stage["name"], "parameters": parameters(stage)} for stage in report["stages"]],
        "gain": report["gain"],
        "candidates": [{key: c[key] for key in ("name", "object", "statistic")} for c in report["candidates"]],
    }


def diagnosed(write: Callable[[Path], Path], seeds: object = None) -> Case:
    """The case of a scene that `write(folder)` makes."""
    return Case(lambda folder: told(pliant.diagnose(str(write(folder)))), seeds)


def rope(index: int, kind: str) -> Case:
    """Case `index` of the blind batch of ropes."""

    def write(folder: Path) -> Path:
        case = cases.draw(ROPE_SEED, index, kind, None)
        assert kind == "null" or case.name == ROPE_EFFECTS[index]
        return cases.write(case, *cases.truths([case])[index], folder)

    return diagnosed(write, [ROPE_SEED, index])


def double_pendulum(folder: Path) -> dict:
    """Torque errors [N·m] on held-out recordings and m₂r₂ [kg·m] of rigid links, and of links with dry friction, both refitted."""
    data = measured()
    scene = real_arms.double_pendulum(data, folder)
    model, text, answer = pliant.load(scene), scene.read_text(encoding="utf-8"), {}
    for name, friction in (("rigid", ""), ("dry_friction", DRY)):
        scene.write_text(text.replace("free = [", f"free = [{friction}"), encoding="utf-8")
        values = {p["path"]: p["estimate"] for p in pliant.fit(str(scene))["parameters"]}
        torque, lever = torques.of_scene(model, values)
        answer[name] = {"torque_error": torques.error(torque, data), "lever": lever, "parameters": values}
    return answer


CASES = {
    **{
        f"arm_{name}": diagnosed(lambda folder, name=name: arms.write(arms.EFFECTS[name], folder, seed=0), 0)
        for name in ("null", "viscous_friction", "coulomb_friction", "saturation", "encoder_bias")
    },
    # three records in place of the six of the blind batch
    **{
        f"cable_{name}": diagnosed(
            lambda folder, name=name: cable_logs.write(cable_logs.EFFECTS[name], folder, [0], split=(2, 3)), [0]
        )
        for name in ("null", "joint_stiffness")
    },
    **{f"rope_effect_{index}": rope(index, "effect") for index in ROPE_EFFECTS},
    **{f"rope_null_{index}": rope(index, "null") for index in ROPE_NULLS},
    **{
        f"rod_{name}": diagnosed(lambda folder, name=name: rods.write(rods.EFFECTS[name], folder, [0]), [0])
        for name in ("null", "bend_friction")
    },
    "floor_friction": diagnosed(lambda folder: slider.write(folder, seed=1, friction=0.3), 1),
    "silverbox": diagnosed(lambda folder: real_arms.silverbox(measured(), folder, SILVERBOX)),
    "simple_pendulum": diagnosed(lambda folder: real_arms.simple_pendulum(measured(), folder)),
    "double_pendulum": Case(double_pendulum),
    "cube": diagnosed(lambda folder: cubes.write(measured(), folder, count=24)),
    "cube_flight": diagnosed(lambda folder: cubes.write(measured(), folder, flight_only=True, count=24)),
}


def main() -> None:
    """Runs the cases that were asked for."""
    parser = argparse.ArgumentParser(prog="python -m validation.diagnoses", description=__doc__.splitlines()[0])
    parser.add_argument("case", nargs="*", help=", ".join(CASES))
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the answers to validation/evidence/diagnoses/")
    options = parser.parse_args()
    if unknown := [name for name in options.case if name not in CASES]:
        parser.error(f"no case {unknown[0]}: there are {', '.join(CASES)}")
    for name in CASES if options.all else options.case:
        run = evidence.Run()
        with tempfile.TemporaryDirectory() as folder:
            answer = CASES[name].run(Path(folder))
        if options.write:
            print(run.write(f"diagnoses/{name}", CASES[name].seeds, answer), flush=True)
        else:
            print(name, json.dumps(answer, indent=1), flush=True)


if __name__ == "__main__":
    main()
