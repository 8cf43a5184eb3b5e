"""The four tasks and a rope over a bar in closed loop, beside MPPI in the same run and the published figures.

    python -m validation.control [--json] [--task NAME] [--runs N] [--method nominal tubes output_feedback …] [--write]

Methods: `nominal` and `tubes` know the state; `output_feedback` has tubes, and readings of the nodes with a noise of 1 mm, two steps late;
`nominal_readings` has the same readings without tubes; `mppi`, `mppi_scaled` sample.

A row is {task, method, goal_error_m, safety, runs, update_s, processor_s, threads, evaluations, published}: mean goal error at the end, share
of runs without a violation, mean time of an update by the wall clock and of the processor, dynamics evaluations (steps simulated, a step's Jacobian counted as one more) an update.
Each run has its own draw of goal and material, and disturbances in the release's ball after every step.
"""

import argparse
import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from validation import evidence
from validation.control.loops import Outcome, gradient, reading, run, sampling
from validation.control.tasks import HORIZON, PUBLISHED, STEPS, make

METHODS = ("nominal", "tubes", "output_feedback", "nominal_readings", "mppi", "mppi_scaled")
FRESH = 70_000  # first seed of the runs; seeds below were looked at while the planner was built
RESULTS = evidence.FOLDER.with_name("results")
LEAST = 1e-9  # m: a constraint that is touched to rounding is not violated


def outcome(name: str, method: str, seed: int) -> Outcome:
    """One run of a task by a method."""
    instance, horizon = make(name, seed), HORIZON[name]
    task = instance.load()
    theta = task.model.theta_with(instance.theta)
    if method in ("nominal", "tubes"):
        controller = gradient(task, theta, horizon, method == "tubes")
    elif method in ("output_feedback", "nominal_readings"):
        controller = reading(task, theta, horizon, seed, method == "output_feedback")
    else:
        controller = sampling(task, theta, horizon, name, seed, method == "mppi_scaled")
    return run(instance, controller, task, theta, STEPS[name], np.random.default_rng(seed))


def row(name: str, method: str, runs: int, jobs: int = 1) -> dict:
    """All runs of a task by a method, so many side by side."""
    seeds = range(FRESH, FRESH + runs)
    if jobs == 1:
        outcomes = [outcome(name, method, seed) for seed in seeds]
    else:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            outcomes = list(pool.map(outcome, [name] * runs, [method] * runs, seeds))
    clearance = float(min(outcome.clearance for outcome in outcomes))
    updates = [seconds for outcome in outcomes for seconds in outcome.updates]
    processor = [seconds for outcome in outcomes for seconds in outcome.processor]
    threads = int(os.environ.get("RAYON_NUM_THREADS", os.cpu_count()))
    return {
        "task": name,
        "method": method,
        "goal_error_m": float(np.mean([outcome.error for outcome in outcomes])),
        "goal_error_m_worst": float(np.max([outcome.error for outcome in outcomes])),
        "safety": float(np.mean([outcome.clearance >= -LEAST for outcome in outcomes])),
        "clearance_m": None if np.isinf(clearance) else clearance,  # of the least safe node; None where nothing can be violated
        "runs": runs,
        "update_s": float(np.mean(updates)),
        "update_s_95": float(np.quantile(updates, 0.95)),
        "processor_s": float(np.mean(processor)),
        "processor_s_95": float(np.quantile(processor, 0.95)),
        "side_by_side": jobs,  # runs at the same time: wall times are then upper bounds
        "threads": 1 if method.startswith("nominal") else threads,  # tubes and MPPI use all cores
        "evaluations": float(np.sum([o.evaluations for o in outcomes]) / len(updates)),
        "published": PUBLISHED[name],
    }


def merged(rows: list[dict], commit: str) -> list[dict]:
    """These rows beside those of the file that are of other tasks or methods, each with the commit that it was run at."""
    before = json.loads((RESULTS / "control.json").read_text(encoding="utf-8"))
    new = [row | {"commit": commit} for row in rows]
    taken = {(row["task"], row["method"]) for row in new}
    kept = [{"commit": before["commit"]} | row for row in before["figures"]["rows"] if (row["task"], row["method"]) not in taken]
    return sorted(kept + new, key=lambda row: (list(STEPS).index(row["task"]), METHODS.index(row["method"])))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--task", choices=STEPS, help="one task alone")
    parser.add_argument("--method", choices=METHODS, nargs="+", default=["nominal", "tubes", "output_feedback", "mppi"], help="these methods")
    parser.add_argument("--runs", type=int, default=3, help="runs of each row")
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side; with RAYON_NUM_THREADS=1 each has one thread")
    parser.add_argument("--write", action="store_true", help="write these rows into validation/results/control.json, with the commit; others stay")
    arguments = parser.parse_args()
    if arguments.runs < 1:
        parser.error(f"--runs is {arguments.runs}, but at least one run is needed")
    if arguments.jobs < 1:
        parser.error(f"--jobs is {arguments.jobs}, but at least one run at a time is needed")
    record, rows = evidence.Run(), []
    for name in [arguments.task] if arguments.task else STEPS:
        for method in arguments.method:
            # a run of MPPI takes as long as fifty of the others
            rows.append(row(name, method, max(1, arguments.runs // 10) if method.startswith("mppi") else arguments.runs, arguments.jobs))
            if not arguments.json:
                r, known = rows[-1], rows[-1]["published"]
                print(
                    f"{name:13} {method:16} error {1e3 * r['goal_error_m']:.1f} mm (worst {1e3 * r['goal_error_m_worst']:.1f}), safe "
                    f"{100 * r['safety']:.0f} % of {r['runs']}, clearance {r['clearance_m']}, update {1e3 * r['update_s']:.1f} ms (95 %: "
                    f"{1e3 * r['update_s_95']:.1f}), of processor {1e3 * r['processor_s']:.1f} ms (95 %: {1e3 * r['processor_s_95']:.1f}), {r['evaluations']:.0f} evaluations; published: {known}",
                    flush=True,
                )
    if arguments.json:
        print(json.dumps(rows, indent=1))
    if arguments.write:
        # the number of runs stands in each row
        record.write("control", {"first": FRESH}, {"rows": merged(rows, record.commit)}, RESULTS)


if __name__ == "__main__":
    main()
