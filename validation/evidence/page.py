"""The table of docs/validation.md and that of closed forms in docs/measured.md, made from the files beside this one.

    python -m validation.evidence.page [--write]
"""

import argparse
import math

from validation.closed_forms import NEGLIGIBLE
from validation.evidence import FOLDER, read

PAGE = FOLDER.parents[1] / "docs" / "validation.md"
MEASURED = PAGE.with_name("measured.md")
BEGIN, END = "<!-- evidence: made by validation/evidence/page.py -->\n", "<!-- end of evidence -->"
FORMS = "<!-- closed forms: made by validation/evidence/page.py -->\n", "<!-- end of closed forms -->"
SYMBOLS = {"mu": "μ", "v0": "v₀", "alpha": "α", "m0": "m₁", "m2": "m₃", "below": "μ₁", "between": "μ₂"}
SYMBOLS |= {"length": "L", "hand": "z", "radius": "R"}
LENGTHS = {1e-9: "1 nm", 1e-6: "1 µm", 1e-4: "0.1 mm"}
HALF_MS = 5e-4  # s, the step at which the table of closed forms states orders


def answer(figures: dict) -> str:
    """A diagnosis in a line."""
    if "verdict" not in figures:  # fits of the double pendulum
        rigid, dry = figures["rigid"], figures["dry_friction"]
        errors = f"torque error on held-out recordings {rigid['torque_error']:.3f} → {dry['torque_error']:.3f} N·m"
        return f"{errors} with dry friction; m₂r₂ = {dry['lever']:.3f} kg·m"
    found = [value(cause) for cause in figures["causes"]]
    if not found:
        pairs = zip(figures["alternatives"], figures["alternative_objects"], strict=True)
        sets = [[f"`{n}`" + (f" ({o})" if o else "") for n, o in zip(*pair, strict=True)] for pair in pairs]
        found = [" or ".join(names) for names in sets]
    if figures["verdict"] == "not_in_library":
        found = ["beside a remainder " + value(stage) for stage in figures["stages"][1:]]
    return f"`{figures['verdict']}`" + (": " if found else "") + "; ".join(found)


def span(interval) -> str:
    """A 90 % interval in brackets; nothing where there is none."""
    return f" ({interval[0]:.5g} to {interval[1]:.5g})" if interval else ""


def value(cause: dict) -> str:
    """A cause with its parameters and their 90 % intervals."""
    at = f" ({cause['object']})" if cause.get("object") else ""
    sizes = [f"{p['path']} = {p['estimate']:.5g}" + span(p["interval"]) for p in cause["parameters"]]
    return f"`{cause['name']}`{at}, " + ", ".join(sizes)


def scenes(figures: dict) -> str:
    """Outcomes of the random scenes in a line."""
    counts = ", ".join(f"{count} {end}" for end, count in figures["counts"].items() if count)
    slowest = figures["slowest"]
    return f"of {figures['scenes']}: {counts}; slowest seed {slowest['seed']}, {slowest['seconds']:.0f} s beside other work"


def batch(figures: dict) -> str:
    """Outcomes of a blind batch in a line."""
    kinds: dict = {}
    for case in figures["cases"]:
        outcomes = kinds.setdefault(case["kind"], {})
        outcomes[case["outcome"]] = outcomes.get(case["outcome"], 0) + 1
    parts = []
    for kind, outcomes in sorted(kinds.items()):
        told = ", ".join(f"{count} {name}" for name, count in sorted(outcomes.items()))
        parts.append(f"{sum(outcomes.values())} {kind}: {told}")
    return "; ".join(parts)


def closed_forms(figures: dict) -> str:
    """How many errors of closed forms fall with the step, in a line."""
    rows = [row for case in figures["cases"] for row in case["rows"]]
    parts = rows + [part for row in rows for part in row["derivatives"].values()]
    return f"{len(figures['cases'])} closed forms: of {len(parts)} errors of values and derivatives {sum(p['stays'] for p in parts)} stay"


def soak(figures: dict) -> str:
    """What a long run ends with, in a line."""
    last = figures["periods"][-1]
    return f"{figures['steps']} steps of a moved cable: the last period differs from the one before by {last['change_m']:.0e} m"


def order(part: dict, last: int, halvings: int = 1) -> str:
    """Observed order up to the step of that number, over so many halvings, in brackets; nothing where an error is negligible."""
    before, now = (abs(part["errors"][k]) for k in (last - halvings, last))
    return f" ({math.log2(before / now) / halvings:.1f})" if now > NEGLIGIBLE and before else ""


def forms_table() -> str:
    """Closed forms of contact: three rows each, one for each rest gap."""
    head = "| closed form | δ | Euler, 4 ms | 2 ms | 1 ms | ½ ms | derivatives, Euler, ½ ms | SDIRK2, ½ ms |"
    lines = [head, "|---|---|---:|---:|---:|---:|---|---:|"]
    for case in read("closed_forms")["figures"]["cases"]:
        for gap, length in LENGTHS.items():
            rows = {row["integrator"]: row for row in case["rows"] if row["rest_gap"] == gap}
            row, last = rows["euler"], rows["euler"]["steps"].index(HALF_MS)
            cells = [plain(e) for e in row["errors"][:last]] + [figure(row, last, 1)]
            # where in a step a motion stops makes single orders of derivatives jump: over two halvings
            by = ", ".join(f"{SYMBOLS.get(n, n)} {figure(part, last, 2)}" for n, part in row["derivatives"].items())
            other = figure(rows["sdirk2"], last, 1) if "sdirk2" in rows else ""
            lines.append(f"| {case['says'] if gap == min(LENGTHS) else ''} | {length} | {' | '.join(cells)} | {by} | {other} |")
    return "\n".join(lines) + "\n"


def plain(error: float) -> str:
    """An error in two digits."""
    return f"{error:.1e}".replace("e-0", "e-").replace("e+00", "") if abs(error) > NEGLIGIBLE else "< 1e-6"


def figure(part: dict, last: int, halvings: int) -> str:
    """An error with its order, bold if it stays."""
    error = plain(part["errors"][last])
    return (f"**{error}**" if part["stays"] else error) + order(part, last, halvings)


def records() -> list[str]:
    """Names of all records."""
    return sorted(str(path.relative_to(FOLDER).with_suffix("")) for path in FOLDER.rglob("*.json"))


SAY = {"closed_forms": closed_forms, "soak": soak}


def table() -> str:
    """The records, one a row."""
    lines = ["| record | commit | date | processor | result |", "|---|---|---|---:|---|"]
    for name in records():
        record = read(name)
        commit = f"`{record['commit'][:7]}`" + (" and uncommitted changes" if record["dirty"] else "")
        say = answer if name.startswith("diagnoses/") else scenes if name.startswith("random_") else SAY.get(name, batch)
        result = say(record["figures"]).replace("|", "\\|")
        lines.append(f"| {name} | {commit} | {record['date'][:10]} | {record['processor_seconds']:.0f} s | {result} |")
    return "\n".join(lines) + "\n"


def split(text: str, marks: tuple[str, str] = (BEGIN, END)) -> tuple[str, str, str]:
    """A page before, in and after its table."""
    before, rest = text.split(marks[0])
    inside, after = rest.split(marks[1])
    return before, inside, after


def main() -> None:
    """Prints the tables, or puts them into their pages."""
    parser = argparse.ArgumentParser(prog="python -m validation.evidence.page", description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true")
    if not parser.parse_args().write:
        print(table(), forms_table(), sep="\n", end="")
        return
    before, _, after = split(PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(before + BEGIN + table() + END + after, encoding="utf-8")
    before, _, after = split(MEASURED.read_text(encoding="utf-8"), FORMS)
    MEASURED.write_text(before + FORMS[0] + forms_table() + FORMS[1] + after, encoding="utf-8")


if __name__ == "__main__":
    main()
