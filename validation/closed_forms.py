"""Contact against closed forms: how far off pliant is, and with which order in the step, at rest gaps of 1 nm, 1 µm and 0.1 mm.

    python -m validation.closed_forms [--case NAME] [--json] [--write]

Cases stand in validation/forms/. Errors are relative, or over the case's scale where the closed form is zero; those of derivatives are
over the derivative, or where that is zero over the case's scale per argument. Steps are halved from 4 ms to 0.5 ms, and at the largest rest
gap, where the smoothing of friction is felt longest, with Euler down to 0.125 ms. An error *stays* if it is above 1e-6 and more than
half of that at steps four times as long. `--write` makes validation/evidence/closed_forms.json, which docs/measured.md shows
(`python -m validation.evidence.page --write`).
"""

import argparse
import json
import math
import sys

from validation import evidence
from validation.forms import rolling, ropes, sliding, stacks
from validation.forms.case import Case, Found, orders, solve

STEPS = (4e-3, 2e-3, 1e-3, 5e-4)  # s
FINER = (2.5e-4, 1.25e-4)
REST_GAPS = (1e-9, 1e-6, 1e-4)  # m
NEGLIGIBLE = 1e-6  # relative errors below are not asked to fall: a gap of 1 nm between coordinates of 0.1 m has no more than 8 digits
CASES = {case.name: case for module in (sliding, rolling, ropes, stacks) for case in module.CASES}


def stays(errors: list[float]) -> bool:
    """Whether an error does not fall with the step, from errors at steps halved one after another."""
    return abs(errors[-1]) > max(NEGLIGIBLE, 0.5 * abs(errors[-3]))


def summary(errors: list[float]) -> dict:
    """Errors with their orders."""
    rounded = [None if math.isnan(p) else round(p, 3) for p in orders(errors)]
    return {"errors": [float(f"{e:.4g}") for e in errors], "orders": rounded, "stays": stays(errors)}


def row(case: Case, rest_gap: float, integrator: str) -> dict:
    """A case at one rest gap: values, errors and orders at all steps."""
    steps = STEPS + (FINER if case.refine and rest_gap == max(REST_GAPS) and integrator == "euler" else ())
    found: list[Found] = [solve(case, step, rest_gap, integrator) for step in steps]
    derivatives = {
        name: {"values": [f.derivatives[name] for f in found]} | summary([f.derivative_errors[name] for f in found]) for name in case.moves
    }
    start = {"integrator": integrator, "rest_gap": rest_gap, "steps": list(steps), "values": [f.value for f in found]}
    return start | summary([f.error for f in found]) | {"derivatives": derivatives}


def figures(cases: list[Case], report=None) -> list[dict]:
    """Of all cases; `report(case, row)` is called for each row."""
    out = []
    for case in cases:
        rows = []
        for integrator in case.integrators:
            for rest_gap in REST_GAPS:
                rows.append(row(case, rest_gap, integrator))
                if report:
                    report(case, rows[-1])
        exact = {"exact": case.value(), "derivatives": {name: case.derivative(name) for name in case.moves}}
        out.append({"name": case.name, "says": case.says, "unit": case.unit, "at": dict(case.at)} | exact | {"rows": rows})
    return out


def show(case: Case, found: dict) -> None:
    """Prints a row."""

    def line(name: str, part: dict) -> str:
        errors = " ".join(f"{e:9.1e}" for e in part["errors"])
        rates = " ".join("    -" if p is None else f"{p:5.2f}" for p in part["orders"])
        return f"  {name:12} {errors} | {rates}{'  stays' if part['stays'] else ''}"

    print(f"{case.name}: {case.says}, {found['integrator']}, rest gap {found['rest_gap']:g} m")
    for name, part in [("value", found), *((f"by {n}", p) for n, p in found["derivatives"].items())]:
        print(line(name, part), flush=True)


def main() -> int:
    """Prints errors and orders, as lines or as JSON."""
    parser = argparse.ArgumentParser(prog="python -m validation.closed_forms", description=__doc__.splitlines()[0])
    parser.add_argument("--case", action="append", choices=list(CASES), help="only this one; may be repeated")
    parser.add_argument("--json", action="store_true", help="print figures as JSON")
    parser.add_argument("--write", action="store_true", help="write the record in validation/evidence/")
    options = parser.parse_args()
    if options.write and options.case:
        parser.error("a record has all cases")
    run = evidence.Run()
    found = figures([CASES[name] for name in options.case or CASES], None if options.json else show)
    if options.json:
        print(json.dumps(found, indent=1))
    if options.write:
        print(run.write("closed_forms", None, {"cases": found}), file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
