"""Diagnoses of real measurements with default settings: one row a set, in validation/results/real.json.

    python -m validation.real.batch [SET ...] [--write]

Each set is written by `validation.real` as a user would write it, without knowing what is wrong, and asked about once; some with other
records held out, for a verdict that depends on the choice is worth little. Rows that are not run again are kept as they are.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import pliant

from validation import evidence
from validation.blind.batch import RESULTS
from validation.real import arms, cubes, deform_dlo

PAIRS = ((2, 4), (0, 1), (1, 2), (3, 4), (0, 3))  # held-out recordings of five


def cable(which: int, folder: Path, held_out: str = "eval") -> Path:
    """Cable DLO1 or DLO2 as a rod; `held_out` "train": trained on the evaluation records and judged on the training ones."""
    text = deform_dlo.scene(which, twist=True)
    if held_out == "train":
        skip = text[text.index("skip = ") :].partition("\n")[0]
        text = text.replace(skip + "\n", "").replace('array = "train"\nrole = "fit"', f'array = "train"\nrole = "held_out"\n{skip}')
        text = text.replace('array = "eval"\nrole = "held_out"', 'array = "eval"\nrole = "fit"')
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


# name -> writes scene and logs into a folder, from the folder of the measurements
SETS: dict[str, Callable[[Path, Path], Path]] = {
    "simple_pendulum": arms.simple_pendulum,
    **{
        f"double_pendulum, held out {a} and {b}": lambda data, folder, pair=(a, b): arms.double_pendulum(data, folder, held_out=pair)
        for a, b in PAIRS
    },
    "cube": cubes.write,
    "cube, every second toss": lambda data, folder: cubes.write(data, folder, half=0),
    "cube, the other tosses": lambda data, folder: cubes.write(data, folder, half=1),
    "silverbox": arms.silverbox,
    "DLO1": lambda _, folder: cable(1, folder),
    "DLO2": lambda _, folder: cable(2, folder),
    "DLO1, trained on the evaluation records": lambda _, folder: cable(1, folder, "train"),
    "DLO2, trained on the evaluation records": lambda _, folder: cable(2, folder, "train"),
}


def row(name: str, report: dict, seconds: float, data: Path) -> dict:
    """A row of the results; errors at the longest horizon, logs named from the folder of the measurements."""
    parameters = lambda found: [{key: p[key] for key in ("path", "unit", "estimate", "interval")} for p in found["parameters"]]
    causes = lambda found: [{"name": c["name"], "object": c["object"], "parameters": parameters(c)} for c in found]
    longest = max(report["gain"], key=lambda g: g["horizon_s"], default=None)
    kept = ("horizon_s", "unit", "rmse_before", "rmse_after", "mean_abs", "interval", "explained_fraction")
    return {
        "set": name,
        "verdict": report["verdict"],
        "reason": report["reason"].replace(f"{data}/", ""),
        "causes": causes(report["causes"]),
        "extension": causes(report["extension"]),
        "alternatives": report["alternatives"],
        "alternative_objects": report["alternative_objects"],
        "held_out": {key: longest[key] for key in kept} if longest else None,
        "over_scatter": report["remainder"]["over_scatter"],
        "processor_seconds": round(seconds, 1),
    }


def main() -> None:
    """Runs the sets that were asked for, all of them by default."""
    parser = argparse.ArgumentParser(prog="python -m validation.real.batch", description=__doc__.splitlines()[0])
    parser.add_argument("set", nargs="*", help="; ".join(SETS))
    parser.add_argument("--write", action="store_true", help="put the rows into validation/results/real.json")
    options = parser.parse_args()
    if unknown := [name for name in options.set if name not in SETS]:
        parser.error(f"no set {unknown[0]!r}: there are {'; '.join(SETS)}")
    data = deform_dlo.data_folder()
    if data is None:
        parser.error("the real measurements are absent: set PLIANT_DATA to their folder")
    path = RESULTS / "real.json"
    for name in options.set or SETS:
        run = evidence.Run()
        with tempfile.TemporaryDirectory() as folder:
            report = pliant.diagnose(str(SETS[name](data, Path(folder))))
        found = row(name, report, evidence.processor_seconds() - run.used, data) | {"commit": run.commit, "dirty": run.dirty}
        print(json.dumps(found), flush=True)
        if options.write:
            rows = json.loads(path.read_text(encoding="utf-8"))["rows"] if path.exists() else []
            rows = [r for r in rows if r["set"] != name] + [found]
            rows.sort(key=lambda r: list(SETS).index(r["set"]))
            path.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
