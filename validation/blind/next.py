"""Whether the next experiment that a diagnosis proposes leads to the right name, and sooner than one by lot.

    python -m validation.blind.next --keep FOLDER [--jobs 2] [--json FILE]

FOLDER is that of a batch (`validation.blind.batch`). Its effects of pendulums, carts and arms that were answered `ambiguous`, with the truth
among the alternatives, are gone on with: the proposed record is made by the generator, with the effect in it, and added to the fitted
ones; then the diagnosis is asked again, up to `MOST` times. The same with records by lot from the same menu.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from validation.blind import batch, chains, draw, score

MOST = 3  # experiments
# factors on commands, pace and start; the menu of `pliant diagnose`
MENU = (
    (1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (0.5, 1.0, 1.0), (-1.0, 1.0, 1.0), (0.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 0.5, 1.0),
    (2.0, 2.0, 1.0), (1.0, 1.0, 2.0), (1.0, 1.0, -1.0), (0.0, 1.0, 2.0),
)  # fmt: skip
Choice = tuple[int, tuple[float, float, float]]  # record, factors


def proposed(report: dict) -> Choice | None:
    """The experiment that a report puts first."""
    if not report.get("next"):
        return None
    first = report["next"][0]
    return int(first["record"].removeprefix("run").removesuffix(".csv")) - 1, (first["commands"], first["pace"], first["start"])


def by_lot(rng: np.random.Generator, records: int) -> Callable[[dict], Choice]:
    """Experiments of the menu in a random order, on the first `records` records."""
    return lambda _: (int(rng.integers(records)), MENU[rng.integers(len(MENU))])


def led(folder: Path, truth: dict, report: dict, choose: Callable[[dict], Choice | None], pliant: str, timeout: float) -> list[str]:
    """Outcomes after each experiment, until the answer is no longer ambiguous."""
    drawn = draw.draw(truth["seed"], truth["index"], truth["system"], truth["kind"])
    setup, rng, out = drawn.setup, np.random.default_rng([truth["seed"], truth["index"], 11]), []
    if not isinstance(setup, chains.ChainSetup):
        raise TypeError(f"no records of {truth['system']} can be repeated")
    for number in range(MOST):
        choice = choose(report)
        if choice is None:
            break
        record = setup.repeat(choice[0], *choice[1], rng, drawn.noise.jitter)
        drawn.hidden.append(drawn.hidden[choice[0]])
        clean = setup.readings([(record, drawn.hidden[record])])
        drawn.readings.append(drawn.noise.read(clean[0], setup.sigma, rng))
        scene = drawn.write(folder / str(number))
        answer, error = batch.ask(pliant, scene, folder / str(number) / "out", timeout)
        out.append(score.outcome(truth, answer))
        if answer is None or answer["verdict"] != "ambiguous":
            break
        report = answer
    return out


def one(job: tuple[Path, str, float, str]) -> dict:
    """Both ways of going on with a case."""
    root, pliant, timeout, name = job
    truth, report = json.loads((root / f"{name}.truth.json").read_text()), json.loads((root / "answers" / f"{name}.json").read_text())["report"]
    lot = by_lot(np.random.default_rng([truth["seed"], truth["index"], 12]), report["records"]["fit"])
    row = {"case": name, "system": truth["system"], "lam": truth["lam"], "hidden": score.hidden_name(truth), "chance": [n["chance"] for n in report["next"]]}
    for way, choose in (("proposed", proposed), ("by_lot", lot)):
        folder = root / "next" / name / way
        kept = folder / "outcomes.json"
        if not kept.exists():
            folder.mkdir(parents=True, exist_ok=True)
            batch.stored(kept, {"outcomes": led(folder, truth, report, choose, pliant, timeout)})
        row[way] = json.loads(kept.read_text())["outcomes"]
    print(name, row["hidden"], row["proposed"], row["by_lot"], file=sys.stderr, flush=True)
    return row


def cases(root: Path) -> list[str]:
    """Names of the ambiguous ones that are gone on with."""
    out = []
    for path in sorted((root / "answers").glob("*.json")):
        truth, report = json.loads((root / f"{path.stem}.truth.json").read_text()), json.loads(path.read_text())["report"]
        if truth["system"] in chains.SYSTEMS and truth["kind"] == "effect" and score.outcome(truth, report) == "honest":
            out.append(path.stem)
    return out


def summary(rows: list[dict]) -> dict:
    """Of each way: cases that ended in the right name, and the experiments that it took."""
    out: dict = {"cases": len(rows), "offered": sum(bool(row["chance"]) and row["chance"][0] >= 0.5 for row in rows)}
    for way in ("proposed", "by_lot"):
        right = [row for row in rows if row[way] and row[way][-1] == "right"]
        wrong = sum(bool(row[way]) and row[way][-1] == "wrong" for row in rows)
        out[way] = {"right": len(right), "wrong": wrong, "experiments": sum(len(row[way]) for row in rows), "right_after_one": sum(len(row[way]) == 1 for row in right)}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--keep", type=Path, default=batch.KEPT)
    parser.add_argument("--pliant", default="target/release/pliant")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds of a processor for a diagnosis")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    jobs = [(options.keep, options.pliant, options.timeout, name) for name in cases(options.keep)]
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        rows = list(pool.map(one, jobs))
    print(json.dumps(summary(rows)))
    if options.json:
        batch.stored(options.json, {"summary": summary(rows), "cases": rows})


if __name__ == "__main__":
    main()
