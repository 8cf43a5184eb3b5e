"""The blind batch: hides effects, asks `pliant diagnose`, scores its verdicts.

    python -m validation.blind.batch --cases 200 --seed 1 [--systems arm2,rope] [--kinds null,effect] [--jobs 2] [--json FILE] [--write]
    python -m validation.blind.batch --cases 60 --seed 1 --keep FOLDER --draw        only writes the cases

The tool sees a scene and its logs, never the truth. Each case lies in FOLDER/NAME, with the truth in FOLDER/NAME.truth.json and
the answer in FOLDER/answers/NAME.json (`--answers` names another folder, for another binary); a batch that was interrupted goes on where it was (a case drawn, an answer given, is not made again).
`--write` puts the answers and their summary into validation/results/blind.json. A batch that one sitting cannot answer is given in parts: where
that file holds answers of the same commit, seed and number of cases, those stay, are not asked for again, and the summary is of all.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from validation import evidence
from validation.blind import draw, score

RESULTS = Path(__file__).resolve().parents[1] / "results"
TASKS = 40  # cases of each process, before others go on: after so many one had grown to 2.7 GB (the pool's own limit hung after them, Python 3.11)
KEPT = Path(__file__).resolve().parents[1] / "out" / "blind"  # not in the repository


def ask(pliant: str, scene: Path, out: Path, timeout: float) -> tuple[dict | None, str]:
    """The tool's JSON on one scene, or None and why; `timeout` in seconds of one processor, whatever else the machine does."""
    limited = ["sh", "-c", f'ulimit -t {round(timeout)}; exec "$0" "$@"']
    command = [*limited, pliant, "diagnose", str(scene), "--json", "--out", str(out)]
    environment = os.environ | {"RAYON_NUM_THREADS": "1"}
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=20.0 * timeout, env=environment)
    except subprocess.TimeoutExpired:
        return None, f"no answer within {20.0 * timeout} s"
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return None, f"no answer within {timeout} s of a processor"
    try:
        return json.loads(done.stdout), ""
    except json.JSONDecodeError:
        return None, (done.stderr or done.stdout)[-2000:]


def written(root: Path, seed: int, index: int, system: str, kind: str) -> dict:
    """The truth of a case, which is drawn and written where it does not lie there yet."""
    path = root / f"seed{seed}-case{index:04d}.truth.json"
    if not path.exists():
        began = time.monotonic()
        drawn = draw.draw(seed, index, system, kind)
        drawn.write(root / drawn.case.name)
        stored(path, drawn.case.as_json() | {"seconds": round(time.monotonic() - began, 1)})
    return json.loads(path.read_text(encoding="utf-8"))


def stored(path: Path, content: dict) -> None:
    """Writes a file that is there whole or not at all."""
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(content, indent=1), encoding="utf-8")
    partial.replace(path)


def answered(root: Path, answers: Path, case: dict, pliant: str, timeout: float) -> dict:
    """The tool's report on a case, asked for where it does not lie there yet."""
    name = f"seed{case['seed']}-case{case['index']:04d}"
    path = answers / f"{name}.json"
    if not path.exists():
        used = evidence.processor_seconds()
        answers.mkdir(parents=True, exist_ok=True)
        report, error = ask(pliant, root / name / "scene.toml", answers / name, timeout)
        stored(path, {"report": report, "error": error, "seconds": round(evidence.processor_seconds() - used, 1)})
    return json.loads(path.read_text(encoding="utf-8"))


def one(job: tuple) -> dict | None:
    """Draws a case and, if wanted, asks about it."""
    root, answers, seed, index, system, kind, pliant, timeout = job
    try:
        case = written(root, seed, index, system, kind)
    except RuntimeError as error:
        print(error, file=sys.stderr, flush=True)
        return None
    row = {"case": case}
    if pliant:
        row |= answered(root, answers, case, pliant, timeout)
        row["outcome"] = score.outcome(case, row["report"])
    told = score.told_name(row["report"]) if pliant else ""
    hidden = score.hidden_name(case) or "-"
    print(f"{index:4d} {case['system']:9s} {case['kind']:9s} {case['noise']:9s} λ {case['lam']:6g}  {hidden:44s} {told:44s} "
          f"{row.get('outcome', '')}", file=sys.stderr, flush=True)  # fmt: skip
    return row


def batched(all_of_them: list, size: int) -> list[list]:
    """A list in parts of a size, the last of which may be smaller."""
    return [all_of_them[k : k + size] for k in range(0, len(all_of_them), size)]


@contextmanager
def workers(jobs: int, scheduler: str | None) -> Iterator[Executor]:
    """Processes that answer cases: of this machine, or those of a cluster, which have to see the same folders."""
    if not scheduler:
        with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
            yield pool
        return
    from dask.distributed import Client

    with Client(scheduler) as client:
        yield client.get_executor(pure=False)


def earlier(path: Path, planned: dict) -> list[dict]:
    """Answers of the same batch that a file holds."""
    held = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return held["answers"] if all(held.get(key) == value for key, value in planned.items()) else []


def listed(root: Path) -> str:
    """All cases of a folder, in the file README beside them: what is hidden, how large, and whether the rule allows a name."""
    lines = ["case                system     kind       noise          λ  allowed  what is hidden (true values, SI)"]
    for path in sorted(root.glob("*.truth.json")):
        case = json.loads(path.read_text(encoding="utf-8"))
        values = [h.get("by_record") or h["truth"] or h.get("size") for h in case["hidden"]]
        allowed = {True: "yes", False: "no"}[case["allowed"]] if case["hidden"] and case["kind"] not in ("value", "outside") else "-"
        lines.append(f"{path.name.removesuffix('.truth.json'):19s} {case['system']:10s} {case['kind']:10s} {case['noise']:10s} {case['lam']:6g}  "
                     f"{allowed:7s}  {score.hidden_name(case) or 'nothing'}  {json.dumps(values) if values else ''}")  # fmt: skip
    text = "\n".join(lines) + "\n"
    (root / "README").write_text(text, encoding="utf-8")
    return text


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--first", type=int, help="only so many of the cases, which are in a random order: a part of a batch, to go on with later")
    parser.add_argument("--seed", type=int, default=score.DEVELOPMENT.start, help="development: 0 to 999; see docs/measured.md")
    parser.add_argument("--systems", type=lambda x: x.split(","), help=", ".join(draw.SYSTEMS | draw.BY_NAME))
    parser.add_argument("--kinds", type=lambda x: x.split(","), help=", ".join(draw.SHARES))
    parser.add_argument("--pliant", default="target/release/pliant")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scheduler", help="address of a dask cluster that answers in place of this machine, its processes of one thread each")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds of a processor for a diagnosis")
    parser.add_argument("--keep", type=Path, default=KEPT)
    parser.add_argument("--answers", type=Path)
    parser.add_argument("--draw", action="store_true", help="write the cases and ask nothing")
    parser.add_argument("--json", type=Path, help="summary and all reports")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args(arguments)
    record = evidence.Run()
    options.keep.mkdir(parents=True, exist_ok=True)
    pliant = "" if options.draw else options.pliant
    wanted = draw.plan(options.cases, options.seed, options.systems, options.kinds)
    answers = options.answers or options.keep / "answers"
    planned = {"commit": record.commit, "seeds": [options.seed], "planned": options.cases}
    given = earlier(RESULTS / "blind.json", planned) if options.write else []
    done = {row["index"] for row in given}
    jobs = [(options.keep, answers, options.seed, i, system, kind, pliant, options.timeout)
            for i, (system, kind) in enumerate(wanted[: options.first]) if i not in done]  # fmt: skip
    rows = []
    for part in batched(jobs, TASKS * options.jobs):
        with workers(options.jobs, options.scheduler) as pool:
            rows += [row for row in pool.map(one, part) if row]
    if options.draw:
        print(listed(options.keep))
        return 0
    answers_given = sorted([*given, *map(score.short, rows)], key=lambda row: row["index"])
    summary = score.summarize(answers_given)
    print(score.table(summary))
    if options.json:
        stored(options.json, {"summary": summary, "cases": rows})
    if options.write:
        stored(RESULTS / "blind.json", {**planned, **summary, "answers": answers_given})
    return int(any(row["state"] == "fails" for row in summary["requirements"]))


if __name__ == "__main__":
    sys.exit(main())
