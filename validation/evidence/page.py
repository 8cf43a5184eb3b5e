"""The table of docs/validation.md, made from the files beside this one.

    python -m validation.evidence.page [--write]
"""

import argparse

from validation.evidence import FOLDER, read

PAGE = FOLDER.parents[1] / "docs" / "validation.md"
BEGIN, END = "<!-- evidence: made by validation/evidence/page.py -->\n", "<!-- end of evidence -->"


def answer(figures: dict) -> str:
    """A diagnosis in a line."""
    if "verdict" not in figures:  # fits of the double pendulum
        rigid, dry = figures["rigid"], figures["dry_friction"]
        errors = f"torque error on held-out recordings {rigid['torque_error']:.3f} → {dry['torque_error']:.3f} N·m"
        return f"{errors} with dry friction; m₂r₂ = {dry['lever']:.3f} kg·m"
    found = [value(cause) for cause in figures["causes"] if cause["name"] != "discretisation"]
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


def records() -> list[str]:
    """Names of all records."""
    return sorted(str(path.relative_to(FOLDER).with_suffix("")) for path in FOLDER.rglob("*.json"))


def table() -> str:
    """The records, one a row."""
    lines = ["| record | commit | date | processor | result |", "|---|---|---|---:|---|"]
    for name in records():
        record = read(name)
        commit = f"`{record['commit'][:7]}`" + (" and uncommitted changes" if record["dirty"] else "")
        say = answer if name.startswith("diagnoses/") else scenes if name.startswith("random_") else batch
        result = say(record["figures"]).replace("|", "\\|")
        lines.append(f"| {name} | {commit} | {record['date'][:10]} | {record['processor_seconds']:.0f} s | {result} |")
    return "\n".join(lines) + "\n"


def split(text: str) -> tuple[str, str, str]:
    """A page before, in and after its table."""
    before, rest = text.split(BEGIN)
    inside, after = rest.split(END)
    return before, inside, after


def main() -> None:
    """Prints the table, or puts it into the page."""
    parser = argparse.ArgumentParser(prog="python -m validation.evidence.page", description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true")
    if not parser.parse_args().write:
        print(table(), end="")
        return
    before, _, after = split(PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(before + BEGIN + table() + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
