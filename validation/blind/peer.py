"""The blind cases given to `mujoco.sysid`, beside pliant's verdicts: the ropes here, pendulums, carts and arms in `peer_chains`.

    python -m validation.blind.batch --cases 110 --seed 12 --systems pendant,one_end,two_ends --keep KEPT
    python -m validation.blind.peer KEPT --nulls 12 --effects 12

`mujoco.sysid` fits the parameters it is given; it has no test of causes and no verdict. So it is given the answer to try:
the bending stiffness and, for an effect, the parameters of the cause that was hidden; for a null, those of one cause in turn.
What counts as its finding is that a 95 % interval excludes the scene's value. Its automated insights are listed as they are.
Of a rope it sees the first record (the toolbox holds none out), its rod has no bend damping and MuJoCo's discretization
(`validation.peer_sysid` has the list), which is part of what such a user meets.

Cases are taken in the order of their index from a folder that a batch kept: nulls whose numerics are right, effects that the peer can
represent, effects outside the library.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

from scipy.stats import norm

from validation import peer_sysid
from validation.blind import batch, ropes, score

# cause -> its parameters in the peer (bounds), {gripper} standing for the first gripper
CAUSES = {
    "linear_drag": [("cable.drag_linear", 0.0, 1.0)],
    "extensibility": [("cable.stretch_stiffness", 10.0, 1e4)],
    "sensor_bias": [(f"sensor.bias[{k}]", -0.02, 0.02) for k in range(3)],
    "length_scale": [("sensor.scale", 0.9, 1.1)],
    "time_offset": [("sensor.time_offset", -0.05, 0.05)],
    "gripper_offset": [(f"{{gripper}}.offset[{k}]", -0.02, 0.02) for k in range(3)],
}
KINDS = ("null", "effect", "outside")
# (folder, case, number among the chosen of its kind, iterations) -> question -> what the peer found
Ask = Callable[[Path, dict, int, int], dict[str, dict]]
Taken = Callable[[dict, Path], bool]  # (case, folder)


def kept(root: Path) -> list[dict]:
    """Cases and answers of a folder that a batch kept, in the order of their seeds and indices."""
    rows = []
    for path in sorted(root.glob("*.truth.json")):
        case, answer = json.loads(path.read_text(encoding="utf-8")), root / "answers" / f"{path.name.removesuffix('.truth.json')}.json"
        if answer.exists():
            row = json.loads(answer.read_text(encoding="utf-8"))
            rows.append({"case": case, "folder": root / answer.stem, "outcome": score.outcome(case, row["report"])} | row)
    return rows


def chosen(rows: list[dict], counts: dict[str, int], taken: Taken, represented: Callable[[dict], bool]) -> list[tuple[dict, int]]:
    """The first cases of each kind that are taken, each with its number among those."""
    out = []
    for kind, count in counts.items():
        own = [row for row in rows if row["case"]["kind"] == kind and not row["case"]["numerics"] and taken(row["case"], row["folder"])]
        own = [row for row in own if kind != "effect" or represented(row["case"])]
        out += [(row, k) for k, row in enumerate(own[:count])]
    return out


def judged(case: dict, found: list[str], tried: list[str]) -> str:
    """What a set of numbers that are said to be off is worth; `tried`: those of the cause that was given, where one was."""
    hidden = {path for h in case["hidden"] for path in h["truth"]}
    if not found:
        return "missed" if case["kind"] == "effect" else "clean"
    if case["kind"] != "effect":
        return "false"
    own = set(found) & (hidden or set(tried))
    return "right" if own == set(found) else "too many" if own else "wrong"


def excluded(case: dict, parameters: list[dict], free: list[str], tried: list[str]) -> dict:
    """What intervals say: numbers not declared free whose scene's value lies outside, and whether each of a hidden number holds the truth.

    `error` of a hidden number: its distance from the truth over that of the scene's value.
    """
    truth = {path: x for h in case["hidden"] for path, x in h["truth"].items()}
    listed = {p["path"]: p for p in parameters if p["half_width_95"] is not None and p["path"] not in free}
    found = [path for path, p in listed.items() if abs(p["fitted"] - p["scene"]) > p["half_width_95"]]
    surely = [path for path, p in listed.items() if abs(p["fitted"] - p["scene"]) > p["half_width_all"]]
    true = {path: truth.get(path, p["scene"]) for path, p in listed.items() if path in (tried or listed)}
    return {
        "found": found,
        "surely": surely,
        "worth": judged(case, found, tried),
        "surely_worth": judged(case, surely, tried),
        "covered": [bool(abs(listed[path]["fitted"] - x) <= listed[path]["half_width_95"]) for path, x in true.items()],
        "error": [
            abs(p["fitted"] - truth[p["path"]]) / abs(truth[p["path"]] - p["scene"])
            for p in parameters
            if p["path"] in truth and truth[p["path"]] != p["scene"]
        ],
        "undetermined": sum(p["half_width_95"] is None for p in parameters),
    }  # fmt: skip


def ours(row: dict) -> dict:
    """The same of pliant's answer: its outcome, error of hidden numbers where a cause is named, held-out error at the longest horizon."""
    case, report = row["case"], row["report"] or {"causes": [], "gain": []}
    truth = {path: x for h in case["hidden"] for path, x in h["truth"].items()}
    listed = [p for cause in report["causes"] for p in cause["parameters"] if p["path"] in truth and truth[p["path"]] != p["scene_value"]]
    gain = max(report["gain"], key=lambda g: g["horizon_s"]) if report["gain"] else None
    return {
        "outcome": row["outcome"],
        "told": score.told_name(row["report"]),
        "error": [abs(p["estimate"] - truth[p["path"]]) / abs(truth[p["path"]] - p["scene_value"]) for p in listed],
        "covered": score.coverage(case, report) if row["outcome"] == "right" else [],
        "held_out": gain["rmse_after"] if gain else None,
        "seconds": row["seconds"],
    }


def ask(folder: Path, case: dict, number: int, iterations: int) -> dict[str, dict]:
    """The peer's fit of the first record of a rope with a cause's parameters free."""
    began = time.process_time()
    experiment = peer_sysid.read(folder / "scene.toml", folder / "run1.csv", substeps=1)
    hidden = case["hidden"][0] if case["hidden"] else {"name": list(CAUSES)[number % len(CAUSES)], "object": ""}
    gripper = hidden["object"] or next(iter(experiment.grippers))
    tried = [(path.format(gripper=gripper), low, high) for path, low, high in CAUSES[hidden["name"]]]
    declared = [one["path"] for one in experiment.free]
    free = [*experiment.free, *({"path": p, "lower": low, "upper": high} for p, low, high in tried)]
    with redirect_stdout(sys.stderr):
        fitted = peer_sysid.fit(replace(experiment, free=free), max_iters=iterations)
    wider = float(norm.isf(0.025 / len(fitted["parameters"])) / norm.isf(0.025))
    parameters = [p | {"scene": p["start"], "half_width_all": p["half_width_95"] and wider * p["half_width_95"]} for p in fitted["parameters"]]
    told = excluded(case, parameters, declared, [path for path, _, _ in tried])
    told |= {"cause": hidden["name"], "insights": [i["title"] for i in fitted["insights"]], "parameters": parameters, "held_out": None}
    return {"told": told | {"seconds": time.process_time() - began}}


# ---- Side by side --------------------------------------------------------------------------------------------------------------


def rate(found: int, n: int) -> str:
    low, high = score.clopper_pearson(found, n) if n else (0.0, 1.0)
    return f"{found} of {n} [{low:.2f}, {high:.2f}]"


def median(values: list[float]) -> str:
    return f"{statistics.median(values):.3g} (of {len(values)})" if values else "-"


def table(results: list[dict]) -> str:
    """Counts side by side."""
    out = []
    for kind in KINDS:
        rows = [r for r in results if r["case"]["kind"] == kind]
        if rows:
            out.append(f"{kind:8s} {len(rows):3d}  pliant: {dict(Counter(r['ours']['outcome'] for r in rows))}")
        for question in rows[0]["peer"] if rows else []:
            asked = [r["peer"][question] for r in rows]
            out.append(f"    mujoco.sysid, {question}: {dict(Counter(a['worth'] for a in asked))}, something in "
                       f"{rate(sum(bool(a['found']) for a in asked), len(asked))}; all intervals together at 95 %: "
                       f"{dict(Counter(a['surely_worth'] for a in asked))}")  # fmt: skip
    questions = results[0]["peer"] if results else []
    groups = [("pliant", [r["ours"] for r in results])] + [(f"mujoco.sysid, {q}", [r["peer"][q] for r in results]) for q in questions]
    for name, given in groups:
        covered = [c for a in given for c in a["covered"]]
        ratios = [a["held_out"] / r["case"]["sigma"] for a, r in zip(given, results, strict=True) if a["held_out"] is not None]
        seconds = [a["seconds"] for a in given]
        out.append(f"{name}: intervals hold the truth {sum(covered)}/{len(covered)}; error over the effect's size, median "
                   f"{median([e for a in given for e in a['error']])}; held-out error over the noise, median {median(ratios)}; seconds, median "
                   f"{median(seconds)}, sum {sum(seconds):.0f}")  # fmt: skip
    insights = {q: dict(Counter(title for r in results for title in r["peer"][q]["insights"])) for q in questions}
    out.append(f"its insights: {insights}")
    return "\n".join(out)


def compare(description: str | None, ask: Ask, taken: Taken, represented: Callable[[dict], bool], counts: dict[str, int]) -> None:
    """The command line: `ask` about the chosen cases of a batch, beside pliant's verdicts on them."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kept", type=Path, help="the folder that a batch kept")
    for kind, count in counts.items():
        parser.add_argument(f"--{kind}{'' if kind == 'outside' else 's'}", dest=kind, type=int, default=count)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--iterations", type=int, default=40)
    parser.add_argument("--json", type=Path, help="all results; those that it holds already are not asked for again")
    options = parser.parse_args()
    pairs = chosen(kept(options.kept), {kind: getattr(options, kind) for kind in counts}, taken, represented)
    name = lambda case: f"seed{case['seed']}-case{case['index']:04d}"
    held = json.loads(options.json.read_text(encoding="utf-8")) if options.json and options.json.exists() else []
    results = {name(r["case"]): r for r in held}
    todo = [(row, number) for row, number in pairs if name(row["case"]) not in results]
    with ProcessPoolExecutor(options.jobs) as pool:
        cases = [row["case"] for row, _ in todo]
        folders, numbers = [row["folder"] for row, _ in todo], [number for _, number in todo]
        for (row, _), peer in zip(todo, pool.map(ask, folders, cases, numbers, [options.iterations] * len(todo)), strict=True):
            results[name(row["case"])] = {"case": row["case"], "ours": ours(row), "peer": peer}
            said = "  ".join(f"{q}: {a['cause']} {a['worth']} {' '.join(a['found'])} {a['seconds']:.0f} s" for q, a in peer.items())
            print(f"{name(row['case'])} {row['case']['system']:9s} {row['case']['kind']:7s} {score.hidden_name(row['case']) or '-':32s} "
                  f"λ {row['case']['lam']:6g}  pliant {row['outcome']:10s} {said}", file=sys.stderr, flush=True)  # fmt: skip
            if options.json:
                batch.stored(options.json, list(results.values()))
    print(table([results[name(row["case"])] for row, _ in pairs]))


def main() -> None:
    represented = lambda case: case["hidden"][0]["name"] in CAUSES
    compare(__doc__, ask, lambda case, _: case["system"] in ropes.SYSTEMS, represented, {"null": 12, "effect": 12})


if __name__ == "__main__":
    main()
