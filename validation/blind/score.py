"""Scores a batch of verdicts against the hidden truth and checks what `diagnose` must reach.

Outcome of a case: right (named, exactly the hidden cause), wrong (named otherwise), honest (ambiguous,
the hidden cause among the alternatives), astray (ambiguous without it), not_in_library, missed
(adequate), withheld, failed (no answer). Nulls: clean (adequate), false_alarm (named), flagged (ambiguous
or not_in_library), withheld, failed, void (generator-fitter mismatch of 1 or more along a candidate).
Bounds on rates are Clopper-Pearson, 95 %.
"""

from __future__ import annotations

from collections import Counter

from scipy.stats import beta

SYMMETRIC = 0.995  # cosine from which two causes count as exact symmetries


def clopper_pearson(k: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided interval of a rate of k in n."""
    a = 0.5 * (1.0 - level)
    low = float(beta.ppf(a, k, n - k + 1)) if k > 0 else 0.0
    high = float(beta.ppf(1.0 - a, k + 1, n - k)) if k < n else 1.0
    return low, high


def upper_bound(k: int, n: int, level: float = 0.95) -> float:
    """One-sided upper bound of a rate of k in n."""
    return float(beta.ppf(level, k + 1, n - k)) if k < n else 1.0


def outcome(case: dict, report: dict | None) -> str:
    """What a verdict is worth; see the head of the file."""
    verdict = report.get("verdict") if report else None
    if verdict not in ("named", "ambiguous", "not_in_library", "adequate", "withheld"):
        return "failed"
    if case["kind"] == "null":
        if case["mismatch_t2"] >= 1.0:
            return "void"
        if verdict == "named" and not told(case, report):
            return "clean"
        return {"adequate": "clean", "named": "false_alarm", "withheld": "withheld"}.get(verdict, "flagged")
    if verdict == "named" and not told(case, report):
        return "missed"
    if verdict == "named":
        return "right" if told(case, report) == [(case["name"], case.get("object", ""))] else "wrong"
    if verdict == "ambiguous":
        known = {name for group in report["alternatives"] for name in group}
        return "honest" if case["name"] in known else "astray"
    return {"adequate": "missed"}.get(verdict, verdict)


def told(case: dict, report: dict) -> list[tuple[str, str]]:
    """The causes named, with their objects: a cause at another gripper, joint or motor is another one.

    Of arms the simulation's own step is no answer to the question, and no mistake either: they go over the top, where the scene's
    step does show.
    """
    of_arm = case.get("family") == "arm"
    causes = [c for c in report["causes"] if not (of_arm and c["name"] == "discretisation")]
    return [(c["name"], c.get("object") or "") for c in causes]


def coverage(case: dict, report: dict) -> list[bool]:
    """Whether each interval of the rightly named cause holds the true value; parameters without an interval are left out."""
    hits = []
    for p in [p for cause in report["causes"] for p in cause["parameters"]]:
        if p["path"] in case["truth"] and p["interval"] is not None:
            low, high = p["interval"]
            hits.append(bool(low <= case["truth"][p["path"]] <= high))
    return hits


def gain_is_right(report: dict) -> bool | None:
    """Whether held-out errors fall at the longest horizon; None where no gain is reported."""
    if not report.get("gain"):
        return None
    longest = max(report["gain"], key=lambda g: g["horizon_s"])
    return longest["rmse_after"] < longest["rmse_before"]


def lost_to_symmetry(case: dict) -> bool:
    """Whether some other cause imitates this one (all but) exactly."""
    own = f"{case['name']}:{case['object']}" if case.get("object") else case["name"]
    others = {k: c for k, c in case["cosines"].items() if k != own}
    return case["kind"] == "effect" and max(others.values()) > SYMMETRIC


def rate(k: int, n: int) -> dict:
    low, high = clopper_pearson(k, n) if n else (0.0, 1.0)
    return {"k": k, "n": n, "rate": k / n if n else None, "low": low, "high": high}


def summarize(results: list[dict]) -> dict:
    """Summary of [{case, report, outcome}]: outcomes by λ, confusion matrix, requirements."""
    effects = [r for r in results if r["case"]["kind"] == "effect"]
    by_lambda: dict[str, Counter] = {}
    for r in results:
        by_lambda.setdefault(f"{r['case']['kind']} {r['case']['lam']:g}", Counter())[r["outcome"]] += 1
    confusion: dict[str, Counter] = {}
    for r in results:
        told = told_name(r["report"])
        confusion.setdefault(r["case"]["name"] or r["case"]["cause"] or "null", Counter())[told] += 1
    power: dict[str, dict] = {}
    for lam in sorted({r["case"]["lam"] for r in effects}):
        for allowed in (True, False):
            part = [r for r in effects if r["case"]["lam"] == lam and r["case"]["allowed"] == allowed]
            right = sum(r["outcome"] == "right" for r in part)
            power[f"{lam:g} {'nameable' if allowed else 'not nameable'}"] = rate(right, len(part))
    return {
        "cases": len(results),
        "by_lambda": {key: dict(value) for key, value in sorted(by_lambda.items(), key=_order)},
        "confusion": {key: dict(value) for key, value in sorted(confusion.items())},
        "power": power,
        "requirements": requirements(results),
    }


def _order(item: tuple) -> tuple[str, float]:
    kind, lam = item[0].split()
    return kind, float(lam)


def told_name(report: dict | None) -> str:
    if report and report.get("verdict") == "named":
        return "+".join(sorted(c["name"] for c in report["causes"]))
    return report.get("verdict", "failed") if report else "failed"


def requirements(results: list[dict]) -> list[dict]:
    """The list of "Blind tests, and what passes": name, counts, and passes / fails / too few cases."""
    null = [r for r in results if r["case"]["kind"] == "null" and r["outcome"] not in ("void", "failed")]
    alarms = sum(r["outcome"] == "false_alarm" for r in null)
    allowed = [r for r in results if r["case"]["kind"] == "effect" and r["case"]["allowed"]]
    named = [r for r in allowed if r["outcome"] in ("right", "wrong")]
    right = [r for r in allowed if r["outcome"] == "right"]
    outside = [r for r in results if r["case"]["kind"] == "outside" and r["case"]["lam"] >= 30.0]
    outside_named = sum(r["outcome"] == "wrong" for r in outside)
    twins = [r for r in results if lost_to_symmetry(r["case"])]
    twins_named = sum(r["outcome"] in ("right", "wrong") for r in twins)
    strong = [r for r in results if r["outcome"] == "right" and r["case"]["lam"] >= 100.0]
    hits = [hit for r in strong for hit in coverage(r["case"], r["report"])]
    gains = [g for r in strong if (g := gain_is_right(r["report"])) is not None]
    covered = sum(hits) / len(hits) if hits else 0.0
    failed = sum(r["outcome"] == "failed" for r in results)
    rows = [
        ("every case answered", rate(failed, len(results)), failed == 0, 1),
        ("false naming ≤ 5 % of nulls", rate(alarms, len(null)), alarms <= 0.05 * len(null), 200),
        ("right ≥ 95 % of nameable named", rate(len(right), len(named)), len(right) >= 0.95 * len(named), 20),
        ("named in ≥ 80 % of nameable", rate(len(named), len(allowed)), len(named) >= 0.8 * len(allowed), 20),
        ("outside effects never named", rate(outside_named, len(outside)), outside_named == 0, 20),
        ("exact symmetries never named", rate(twins_named, len(twins)), twins_named == 0, 10),
        ("90 % intervals cover 85-95 %", rate(sum(hits), len(hits)), 0.85 <= covered <= 0.95, 40),
        ("gain's sign right", rate(sum(gains), len(gains)), all(gains), 20),
    ]
    out = []
    for name, counts, ok, least in rows:
        state = "too few cases" if counts["n"] < least else "passes" if ok else "fails"
        out.append({"name": name, **counts, "least": least, "state": state})
    out[1]["upper_bound_95"] = upper_bound(alarms, len(null))
    return out


def table(summary: dict) -> str:
    """The summary as plain text."""
    columns = ("clean", "false_alarm", "flagged", "void", "right", "wrong", "honest", "astray")
    columns += ("not_in_library", "missed", "withheld", "failed")
    lines = [f"{'kind, λ':14s}" + "".join(f"{c[:9]:>10s}" for c in columns)]
    for key, row in summary["by_lambda"].items():
        lines.append(f"{key:14s}" + "".join(f"{row.get(c, 0) or '·':>10}" for c in columns))
    lines += ["", "right name against λ (95 % Clopper-Pearson)"]
    for key, row in summary["power"].items():
        if row["n"]:
            lines.append(f"  λ = {key:20s} {row['k']:4d}/{row['n']:<4d} [{row['low']:.2f}, {row['high']:.2f}]")
    lines += ["", "hidden -> told"]
    for key, row in summary["confusion"].items():
        told = ", ".join(f"{n} {name}" for name, n in sorted(row.items(), key=lambda kv: -kv[1]))
        lines.append(f"  {key:18s} {told}")
    lines.append("")
    for row in summary["requirements"]:
        extra = f"  upper bound {row['upper_bound_95']:.3f}" if "upper_bound_95" in row else ""
        lines.append(f"  {row['state']:14s} {row['name']:32s} {row['k']}/{row['n']}{extra}")
    return "\n".join(lines)
