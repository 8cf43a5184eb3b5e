"""Blind test of `pliant diagnose`: hide effects, run the tool, score its verdicts.

    python -m validation.blind.run --cases 100 --seed 1 --pliant target/release/pliant --json out.json
    python -m validation.blind.run --arms --cases 50 --seed 1
    python -m validation.blind.run --cables --cases 50 --seed 1

Of the cases 40 % are nulls, 45 % effects of the library, 15 % outside it (--nulls, --outside). The tool
sees a scene and its logs, never the truth; `--keep DIR` leaves the folders. `--ideal` runs the oracle's
own linear test in place of the tool, as a yardstick. `--write NAME` puts the summary and the answers into
validation/evidence/NAME.json.

A null counts only where a fitter with exact derivatives and the true parameters would see nothing: the
implicit midpoint rule at the scene's step, on the generator's forces and with the logged (piecewise
linear) inputs, minus the ODE, whitened and with the nuisance projected out, is below 1 along every
candidate (`mismatch_t2`). That the tool's laws and its step are these is for the reference tests to say.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from validation import evidence
from validation.blind import arm_cases, cable_cases, cases, ideal, score
from validation.blind.families import FAMILIES


def ask(pliant: str, scene: Path, timeout: float) -> tuple[dict | None, str]:
    """The tool's JSON on one scene, or None and why."""
    command = [pliant, "diagnose", str(scene), "--json", "--out", str(scene.parent / "report")]
    environment = os.environ | {"RAYON_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, check=False, capture_output=True, text=True, timeout=timeout, env=environment
        )
    except subprocess.TimeoutExpired:
        return None, f"no answer within {timeout} s"
    try:
        return json.loads(done.stdout), ""
    except json.JSONDecodeError:
        return None, (done.stderr or done.stdout)[-2000:]


def kinds(n: int, nulls: float, outside: float, seed: int) -> list[str]:
    """Kinds of n cases in a seeded order."""
    n_null, n_outside = round(n * nulls), round(n * outside)
    order = ["null"] * n_null + ["outside"] * n_outside + ["effect"] * (n - n_null - n_outside)
    return np.random.default_rng([seed, 7]).permutation(order).tolist()


def answer(row: dict) -> dict:
    """A case and the answer to it, in short."""
    case, report = row["case"], row["report"] or {}
    found = {key: report.get(key) for key in ("verdict", "alternatives", "alternative_objects")}
    found["causes"] = [
        {"name": cause["name"], "object": cause["object"], "parameters": cause["parameters"]}
        for cause in report.get("causes", [])
    ]
    hidden = {key: case[key] for key in ("index", "family", "kind", "name", "cause", "lam", "allowed", "truth") if key in case}
    return {**hidden, "outcome": row["outcome"], "seconds": round(row["seconds"], 1), **found}


def _draw(job: tuple):
    draw, *arguments = job
    return draw(*arguments)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pliant", default="target/release/pliant")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--write", metavar="NAME")
    parser.add_argument("--nulls", type=float, default=0.40)
    parser.add_argument("--outside", type=float, default=0.15)
    parser.add_argument("--arms", action="store_true", help="two-link arms made by MuJoCo in place of ropes")
    parser.add_argument("--cables", action="store_true", help="cables of capsules made by MuJoCo in place of ropes")
    parser.add_argument("--effect", action="append", help="of arms and cables: these effects alone")
    parser.add_argument("--family", choices=list(FAMILIES), action="append")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--timeout", type=float, default=300.0)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--ideal", action="store_true")
    options = parser.parse_args(arguments)
    start, record = time.monotonic(), evidence.Run()
    wanted = kinds(options.cases, options.nulls, options.outside, options.seed)
    source = arm_cases if options.arms else cable_cases if options.cables else cases
    of_bodies = source is not cases
    among = options.effect if of_bodies else options.family
    if options.cables:
        cable_cases.prepare()
    jobs = [(source.draw, options.seed, i, kind, among) for i, kind in enumerate(wanted)]
    with ProcessPoolExecutor(options.jobs if of_bodies else 1) as pool:
        drawn = list(pool.map(_draw, jobs)) if of_bodies else [_draw(job) for job in jobs]
    truths = source.truths(drawn)
    made = time.monotonic() - start
    with tempfile.TemporaryDirectory() as scratch:
        root = options.keep or Path(scratch)

        def one(case: cases.Case | arm_cases.Case | cable_cases.Case) -> dict:
            began = time.monotonic()
            if options.ideal:
                report, error = ideal.diagnose(case, *truths[case.index]), ""
            else:
                scene = source.write(case, *truths[case.index], root / f"case{case.index:04d}")
                report, error = ask(options.pliant, scene, options.timeout)
            row = {"case": case.as_json(), "report": report, "error": error}
            row |= {"outcome": score.outcome(row["case"], report), "seconds": time.monotonic() - began}
            print(f"{case.index:4d} {case.family:9s} {case.kind:8s} {case.name or case.cause:17s} "
                  f"λ {case.lam:6g}  {score.told_name(report):22s} {row['outcome']}", file=sys.stderr)  # fmt: skip
            return row

        with ThreadPoolExecutor(options.jobs) as pool:  # the work is in the tool's processes
            results = list(pool.map(one, drawn))
    summary = score.summarize(results)
    summary["seconds"] = {"generation": made, "total": time.monotonic() - start}
    print(score.table(summary))
    print(f"\n  generation {made:.0f} s, total {summary['seconds']['total']:.0f} s")
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({"summary": summary, "cases": results}, indent=1), encoding="utf-8")
    if options.write:
        brief = [answer(row) for row in results]
        print(record.write(options.write, options.seed, {"summary": summary, "cases": brief}))
    return int(any(row["state"] == "fails" for row in summary["requirements"]))


if __name__ == "__main__":
    sys.exit(main())
