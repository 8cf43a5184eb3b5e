"""Scores verdicts against the hidden truth, and checks what a diagnosis must reach.

Outcomes of effects: right (named, exactly the hidden causes), part (all that is named is hidden, and something else is, too), wrong
(named otherwise, or said to vary with another law), honest
(ambiguous, all that is hidden among the alternatives or accepted beside them), half (ambiguous, some of it there, and nothing told
without it), astray (ambiguous otherwise), not_in_library, missed (adequate), numerics,
withheld, failed (no answer), varied (the right law, said to vary where it does not), one_size (the right law, named with one size
where it does vary). Of nulls: clean (adequate, or `numerics` where they are wrong on purpose), false_alarm (named, or said to vary),
flagged (anything else that is claimed). Of effects outside the library: not_in_library is what is wanted, wrong is any name.

Bounds on rates are Clopper-Pearson, 95 %.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from math import inf

from scipy.stats import beta

DEVELOPMENT = range(1000)  # seeds that rules may be made on
FRESH = range(1000, 10_000)  # seeds to be drawn once, for figures that are reported
SYMMETRIC = 0.9995  # cosine from which two causes count as exact symmetries
VERDICTS = ("named", "ambiguous", "varies", "numerics", "not_in_library", "adequate", "withheld")
OUTCOMES = ("clean", "false_alarm", "flagged", "right", "part", "wrong", "honest", "half", "astray", "varied", "one_size", "not_in_library", "missed",
            "numerics", "withheld", "failed")  # fmt: skip


def clopper_pearson(k: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided interval of a rate of k in n."""
    a = 0.5 * (1.0 - level)
    low = float(beta.ppf(a, k, n - k + 1)) if k > 0 else 0.0
    high = float(beta.ppf(1.0 - a, k + 1, n - k)) if k < n else 1.0
    return low, high


def upper_bound(k: int, n: int, level: float = 0.95) -> float:
    """One-sided upper bound of a rate of k in n."""
    return float(beta.ppf(level, k + 1, n - k)) if k < n else 1.0


# ---- One case --------------------------------------------------------------------------------------------------------------


def verdict(report: dict | None) -> str:
    """The verdict, "failed" without an answer."""
    found = report.get("verdict") if report else None
    return found if found in VERDICTS else "failed"


def told(report: dict) -> list[tuple[str, str]]:
    """Causes named, with their objects: a cause at another gripper, joint or motor is another one."""
    return [(c["name"], c.get("object") or "") for c in report.get("causes", [])]


def claims(report: dict) -> list[list[tuple[str, str]]]:
    """What an ambiguous answer claims: its sets of alternatives, and each cause accepted beside them."""
    groups, objects = report.get("alternatives", []), report.get("alternative_objects") or []
    out = [[cause] for cause in told(report)]
    for g, names in enumerate(groups):
        at = objects[g] if g < len(objects) else [None] * len(names)
        out.append([(name, obj or "") for name, obj in zip(names, at, strict=True)])
    return out


def considered(report: dict) -> set[tuple[str, str]]:
    """Every cause among the alternatives of an ambiguous answer, those accepted besides them included."""
    return {cause for claim in claims(report) for cause in claim}


def is_cause(hidden: dict, name: tuple[str, str]) -> bool:
    """Whether a told cause is the hidden one."""
    alone = hidden.get("alone", False)
    return same(hidden["name"], hidden["object"], alone) == same(*name, alone) or (hidden["name"] == name[0] and alone and not name[1])


def same(name: str, at: str, alone: bool) -> tuple[str, str]:
    """Commands that are late for all motors, or for the only one, are readings that are late."""
    return ("sensor_delay", "") if name == "actuator_delay" and (alone or not at) else (name, at)


def by_path(case: dict, report: dict) -> bool:
    """Whether what was named is the wrong number of the scene, whatever the cause is called."""
    paths = {path for h in case["hidden"] for path in h["truth"]}
    causes = report["causes"]
    return bool(paths) and len(causes) == 1 and paths <= {p["path"] for p in causes[0]["parameters"]}


def exactly(case: dict, report: dict) -> bool:
    """Whether the causes told are those hidden."""
    if case["kind"] in ("outside", "value"):
        return by_path(case, report)
    names, hidden = told(report), case["hidden"]
    return len(names) == len(hidden) and all(any(is_cause(h, name) for name in names) for h in hidden)


def partly(case: dict, report: dict) -> bool:
    """Whether every cause told is hidden, and more is hidden."""
    names, hidden = told(report), case["hidden"]
    return len(names) < len(hidden) and all(any(is_cause(h, name) for h in hidden) for name in names)


def outcome(case: dict, report: dict | None) -> str:
    """What an answer is worth; see the head of the file."""
    found, kind = verdict(report), case["kind"]
    if found == "failed":
        return "failed"
    if kind == "null":
        wanted = found == "adequate" or (found == "numerics" and case["numerics"])
        return "clean" if wanted else {"named": "false_alarm", "varies": "false_alarm", "withheld": "withheld"}.get(found, "flagged")
    if found == "ambiguous":
        true = lambda claim: any(is_cause(h, name) for h in case["hidden"] for name in claim)
        if all(any(is_cause(h, name) for name in considered(report)) for h in case["hidden"]):
            return "honest"
        return "half" if case["kind"] == "pair" and all(true(claim) for claim in claims(report)) else "astray"
    if found in ("named", "varies"):
        if not exactly(case, report):
            return "part" if found == "named" and partly(case, report) else "wrong"
        changing = kind in ("varies", "some")
        return "right" if changing == (found == "varies") else "one_size" if changing else "varied"
    return {"adequate": "missed"}.get(found, found)


def coverage(case: dict, report: dict) -> list[bool]:
    """Whether each interval of rightly named causes holds the true value; parameters without an interval are left out."""
    truth = {path: x for h in case["hidden"] for path, x in h["truth"].items()}
    hits = []
    for p in [p for cause in report["causes"] for p in cause["parameters"]]:
        if p["path"] in truth and p["interval"] is not None:
            low, high = (infinity if end is None else end for end, infinity in zip(p["interval"], (-inf, inf), strict=True))
            hits.append(bool(low <= truth[p["path"]] <= high))
    return hits


def gain_is_right(report: dict) -> bool | None:
    """Whether held-out errors fall at the longest horizon; None where no gain is reported."""
    if not report.get("gain"):
        return None
    longest = max(report["gain"], key=lambda g: g["horizon_s"])
    return longest["rmse_after"] < longest["rmse_before"]


def hidden_name(case: dict) -> str:
    """What is hidden, in short."""
    names = [h.get("effect") or titled(h["name"], h["object"]) for h in case["hidden"]]
    return " + ".join(names) or (f"numerics: {case['numerics']}" if case["numerics"] else "")


def titled(name: str, at: str | None) -> str:
    return f"{name} ({at})" if at else name


def told_name(report: dict | None) -> str:
    """An answer in short."""
    found = verdict(report)
    if found in ("named", "varies"):
        names = " + ".join(sorted(titled(*c) for c in told(report)))
        return names if found == "named" else f"varies: {names}"
    if found == "ambiguous":
        names = sorted(titled(*c) for c in considered(report))
        return f"ambiguous: {' | '.join(names[:3])}{' …' if len(names) > 3 else ''}"
    return found


def short(row: dict) -> dict:
    """A case and the answer to it, all that a summary needs: `holds` of each interval of a right name, whether the gain's sign is right."""
    case, report = row["case"], row["report"]
    kept = {key: case[key] for key in ("seed", "index", "system", "kind", "noise", "numerics", "lam", "allowed")}
    kept |= {"hidden": hidden_name(case), "told": told_name(report), "verdict": verdict(report), "outcome": row["outcome"]}
    right = row["outcome"] == "right" and case["kind"] in ("effect", "pair")
    kept |= {"holds": coverage(case, report) if right else [], "gain": gain_is_right(report) if right else None}
    return kept | {"seconds": row["seconds"]}


# ---- A batch ---------------------------------------------------------------------------------------------------------------


def counted(rows: list[dict], what: Callable[[dict], str]) -> dict[str, dict[str, int]]:
    """Outcomes by a key of the rows."""
    out: dict[str, Counter] = {}
    for row in rows:
        out.setdefault(what(row), Counter())[row["outcome"]] += 1
    return {key: dict(value) for key, value in sorted(out.items())}


def named(rows: Iterable[dict]) -> int:
    return sum(row["outcome"] in ("right", "part", "wrong", "varied", "one_size") for row in rows)


def summarize(rows: list[dict]) -> dict:
    """Counts of a batch of rows as `short` makes them, and the requirements."""
    of = lambda *kinds: [r for r in rows if r["kind"] in kinds]
    count = lambda part, *outcomes: sum(r["outcome"] in outcomes for r in part)
    null, effects, outside, symmetric = of("null"), of("effect", "pair"), of("outside", "value"), of("symmetric")
    changing, wrong_numerics = of("varies", "some"), [r for r in null if r["numerics"]]
    allowed = [r for r in effects if r["allowed"]]
    hits = [hit for r in effects if r["lam"] >= 100.0 for hit in r["holds"]]
    verdicts = Counter(r["verdict"] for r in rows)
    seconds = sorted(r["seconds"] for r in rows)
    return {
        "cases": len(rows),
        "nulls": {"n": len(null), "named": count(null, "false_alarm"), "clean": count(null, "clean"), "flagged": count(null, "flagged")},
        "effects": {
            "n": len(effects), "named_right": count(effects, "right"), "named_part": count(effects, "part"), "named_wrong": count(effects, "wrong"),
            "ambiguous_with": count(effects, "honest"), "ambiguous_half": count(effects, "half"), "ambiguous_without": count(effects, "astray"),
            "adequate": count(effects, "missed"), "withheld": count(effects, "withheld"), "varies": count(effects, "varied"),
            "numerics": count(effects, "numerics"), "not_in_library": count(effects, "not_in_library"), "failed": count(effects, "failed"),
            "oracle_allows": len(allowed), "oracle_named": count(allowed, "right"),
        },
        "outside": {"n": len(outside), "named": count(outside, "wrong", "varied"), "right": count(outside, "right"),
                    "not_in_library": count(outside, "not_in_library"), "ambiguous": count(outside, "astray"),
                    "adequate": count(outside, "missed")},
        "symmetric": {"n": len(symmetric), "named": named(symmetric), "ambiguous_with": count(symmetric, "honest")},
        "intervals": {"n": len(hits), "hold": sum(hits)},
        "varies": {"n": len(changing), "right": count(changing, "right"), "one_size": count(changing, "one_size"),
                   "wrong": count(changing, "wrong"), "ambiguous_with": count(changing, "honest")},
        "numerics": {"n": len(wrong_numerics), "told": sum(r["verdict"] == "numerics" for r in wrong_numerics),
                     "named": count(wrong_numerics, "false_alarm")},
        "not_in_library": verdicts["not_in_library"],
        "verdicts": dict(verdicts),
        "by_system": counted(rows, lambda c: c["system"]),
        "by_kind": counted(rows, lambda c: c["kind"]),
        "by_lambda": counted(rows, lambda c: f"{c['kind']} {c['lam']:g}"),
        "by_noise": counted(rows, lambda c: c["noise"]),
        "seconds": {"median": seconds[len(seconds) // 2], "longest": seconds[-1], "sum": round(sum(seconds), 1)} if rows else {},
        "requirements": requirements(rows),
    }  # fmt: skip


def rate(k: int, n: int) -> dict:
    low, high = clopper_pearson(k, n) if n else (0.0, 1.0)
    return {"k": k, "n": n, "rate": k / n if n else None, "low": low, "high": high}


def requirements(rows: list[dict]) -> list[dict]:
    """What must be reached: name, counts, and passes, fails or too few cases."""
    of = lambda *kinds: [r for r in rows if r["kind"] in kinds]
    count = lambda part, *outcomes: sum(r["outcome"] in outcomes for r in part)
    null = [r for r in of("null") if r["outcome"] != "failed"]
    allowed = [r for r in of("effect", "pair") if r["allowed"]]
    outside = [r for r in of("outside", "value") if r["lam"] >= 30.0]
    twins, failed = of("symmetric"), count(rows, "failed")
    strong = [r for r in of("effect", "pair") if r["outcome"] == "right" and r["lam"] >= 100.0]
    hits = [hit for r in strong for hit in r["holds"]]
    gains = [r["gain"] for r in strong if r["gain"] is not None]
    alarms, right, wrong = count(null, "false_alarm"), count(allowed, "right"), count(of("effect", "pair"), "wrong")
    effects, astray = of("effect", "pair"), count(of("effect", "pair"), "astray")
    imitated, alone = count(outside, "wrong", "varied"), named(twins)
    covered = sum(hits) / len(hits) if hits else 0.0
    listed = [
        ("every case answered", rate(failed, len(rows)), failed == 0, 1),
        ("false names ≤ 2 % of nulls", rate(alarms, len(null)), alarms <= 0.02 * len(null), 50),
        ("wrong names ≤ 2 % of effects", rate(wrong, len(effects)), wrong <= 0.02 * len(effects), 50),
        ("right names ≥ 95 % of nameable", rate(right, len(allowed)), right >= 0.95 * len(allowed), 20),
        ("ambiguous without it ≤ 2 % of effects", rate(astray, len(effects)), astray <= 0.02 * len(effects), 50),
        ("outside effects never named", rate(imitated, len(outside)), imitated == 0, 20),
        ("exact symmetries never named", rate(alone, len(twins)), alone == 0, 10),
        ("90 % intervals cover 85-95 %", rate(sum(hits), len(hits)), 0.85 <= covered <= 0.95, 40),
        ("gain's sign right", rate(sum(gains), len(gains)), all(gains), 20),
    ]
    out = []
    for name, counts, ok, least in listed:
        state = "too few cases" if counts["n"] < least else "passes" if ok else "fails"
        out.append({"name": name, **counts, "least": least, "state": state})
    out[1]["upper_bound_95"] = upper_bound(alarms, len(null))
    return out


def table(summary: dict) -> str:
    """The summary as plain text."""
    lines = []
    for title, key in (("system", "by_system"), ("kind", "by_kind"), ("kind, λ", "by_lambda"), ("noise", "by_noise")):
        lines.append(f"{title:17s}" + "".join(f"{c[:9]:>10s}" for c in OUTCOMES))
        for name, row in sorted(summary[key].items(), key=lambda kv: order(kv[0])):
            lines.append(f"{name:17s}" + "".join(f"{row.get(c, 0) or '·':>10}" for c in OUTCOMES))
        lines.append("")
    for key in ("nulls", "effects", "outside", "symmetric", "varies", "numerics", "intervals", "seconds"):
        lines.append(f"{key:10s} " + ", ".join(f"{name} {value}" for name, value in summary[key].items()))
    lines.append("")
    for row in summary["requirements"]:
        extra = f"  upper bound {row['upper_bound_95']:.3f}" if "upper_bound_95" in row else ""
        lines.append(f"  {row['state']:14s} {row['name']:36s} {row['k']}/{row['n']}{extra}")
    return "\n".join(lines)


def order(name: str) -> tuple[str, float]:
    kind, _, lam = name.partition(" ")
    return kind, float(lam or 0.0)
