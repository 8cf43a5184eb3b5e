"""The blind cases given to `mujoco.sysid`, beside pliant's verdicts.

    python -m validation.blind.batch --cases 110 --seed 12 --systems pendant,one_end,two_ends --keep KEPT --json batch.json
    python -m validation.blind.peer batch.json --kept KEPT --cases 24

`mujoco.sysid` fits the parameters it is given; it has no test of causes and no verdict. So it is given the answer to try:
the bending stiffness and, for an effect, the parameters of the cause that was hidden; for a null, those of one cause in turn.
What counts as its finding is that a 95 % interval excludes the scene's value. Its automated insights are listed as they are.
It sees the first record (the toolbox holds none out), its rod has no bend damping and MuJoCo's discretization
(`validation.peer_sysid` has the list), which is part of what such a user meets.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

from validation import peer_sysid
from validation.blind import score

# cause -> its parameters in the peer (bounds), {gripper} standing for the first gripper
CAUSES = {
    "linear_drag": [("cable.drag_linear", 0.0, 1.0)],
    "extensibility": [("cable.stretch_stiffness", 10.0, 1e4)],
    "sensor_bias": [(f"sensor.bias[{k}]", -0.02, 0.02) for k in range(3)],
    "length_scale": [("sensor.scale", 0.9, 1.1)],
    "time_offset": [("sensor.time_offset", -0.05, 0.05)],
    "gripper_offset": [(f"{{gripper}}.offset[{k}]", -0.02, 0.02) for k in range(3)],
}


def chosen(rows: list[dict], n: int, names: list[str]) -> list[tuple[dict, str]]:
    """n/2 nulls, each with one of the causes `names` in turn, and n/2 representable effects of the largest λ, with theirs."""
    nulls = [row for row in rows if row["case"]["kind"] == "null"][: n // 2]
    effects = [row for row in rows if row["case"]["kind"] == "effect" and row["case"]["hidden"][0]["name"] in names]
    effects.sort(key=lambda row: (-row["case"]["lam"], row["case"]["index"]))
    tried = [(row, names[k % len(names)]) for k, row in enumerate(nulls)]
    return tried + [(row, row["case"]["hidden"][0]["name"]) for row in effects[: n - n // 2]]


def ask(folder: Path, case: dict, cause: str, iterations: int) -> dict:
    """The peer's fit of the first record with the cause's parameters free."""
    began = time.monotonic()
    experiment = peer_sysid.read(folder / "scene.toml", folder / "run1.csv", substeps=1)
    hidden = case["hidden"][0] if case["hidden"] else {"object": "", "truth": {}}
    gripper = hidden["object"] or next(iter(experiment.grippers))
    paths = [(path.format(gripper=gripper), low, high) for path, low, high in CAUSES[cause]]
    free = [*experiment.free, *({"path": p, "lower": low, "upper": high} for p, low, high in paths)]
    with redirect_stdout(sys.stderr):
        fitted = peer_sysid.fit(replace(experiment, free=free), max_iters=iterations)
    listed = {p["path"]: p for p in fitted["parameters"]}
    found, covered = [], []
    for path, _, _ in paths:
        p = listed[path]
        if p["half_width_95"] is None:
            continue
        found.append(abs(p["fitted"] - p["start"]) > p["half_width_95"])
        covered.append(abs(p["fitted"] - hidden["truth"].get(path, p["start"])) <= p["half_width_95"])
    return {
        "cause": cause,
        "found": any(found),
        "covered": covered,
        "rms_m": [fitted["rms_start_m"], fitted["rms_fitted_m"]],
        "insights": [i.get("title", str(i)) for i in fitted["insights"]],
        "parameters": fitted["parameters"],
        "seconds": time.monotonic() - began,
    }


def table(results: list[dict]) -> str:
    """Counts side by side."""
    out = []
    for kind, wanted in (("null", "cleared"), ("effect", "found")):
        rows = [r for r in results if r["case"]["kind"] == kind]
        found = sum(r["peer"]["found"] for r in rows)
        low, high = score.clopper_pearson(found, len(rows)) if rows else (0.0, 1.0)
        ours = Counter(r["outcome"] for r in rows)
        out.append(f"{kind:7s} {len(rows):3d}  mujoco.sysid: an interval excludes the scene's value in {found}"
                   f" [{low:.2f}, {high:.2f}]; pliant: {dict(ours)} ({wanted})")  # fmt: skip
    covered = [c for r in results for c in r["peer"]["covered"]]
    out.append(f"its 95 % intervals hold the truth: {sum(covered)}/{len(covered)}")
    insights = Counter(title for r in results for title in r["peer"]["insights"])
    out.append(f"its insights: {dict(insights)}")
    return "\n".join(out)


def compare(description: str, ask: Callable[[Path, dict, str, int], dict], names: list[str], cases: int) -> None:
    """The command line: `ask` about the chosen cases of a batch, beside pliant's verdicts on them."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("batch", type=Path)
    parser.add_argument("--kept", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--iterations", type=int, default=15)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = json.loads(options.batch.read_text(encoding="utf-8"))["cases"]
    pairs = chosen(rows, options.cases, names)
    folders = [options.kept / f"seed{row['case']['seed']}-case{row['case']['index']:04d}" for row, _ in pairs]
    with ProcessPoolExecutor(options.jobs) as pool:
        hidden, causes = [row["case"] for row, _ in pairs], [cause for _, cause in pairs]
        answers = list(pool.map(ask, folders, hidden, causes, [options.iterations] * len(pairs)))
    results = [
        {"case": row["case"], "outcome": row["outcome"], "peer": answer}
        for (row, _), answer in zip(pairs, answers, strict=True)
    ]
    for r in results:
        print(f"{r['case']['index']:4d} {r['case']['kind']:7s} {r['peer']['cause']:17s} λ {r['case']['lam']:6g}"
              f"  sysid {'found' if r['peer']['found'] else '-':6s} pliant {r['outcome']:10s}"
              f" {r['peer']['seconds']:.0f} s", file=sys.stderr)  # fmt: skip
    print(table(results))
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")


def main() -> None:
    compare(__doc__, ask, list(CAUSES), cases=24)


if __name__ == "__main__":
    main()
