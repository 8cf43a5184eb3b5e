"""Writes the benchmark page from the JSON of `python -m validation.bench --json` and of `python -m validation.bench.rods_cloth --json`.

python -m validation.bench.page bench.json rods_cloth.json --out BENCHMARKS.md
"""

import argparse
import json
from pathlib import Path

INTRODUCTION = """# Benchmarks

pliant beside MuJoCo 4.0, in turns in one run on one thread. *ratio* = pliant / peer: below 1, pliant is faster. Every figure is the
median over the rounds of one of these:

| | pliant, timed by its own loop in Rust | MuJoCo, timed in C |
|---|---|---|
| step | mean of 240 steps, along the rollout | ropes, rods, cloth: median over a rollout of 60 steps, in chunks of 5; bodies: mean of 200 steps |
| jacobian | mean of 240 steps with A and B (rods, cloth: 60) | ropes, rods, cloth: one `mjd_transitionFD` a third of the way; bodies: median along the rollout |
| rollout_vjp | median of the rollouts of a round | forward differences: as many rollouts as parameters, and one more |

A mean counts expensive steps (landings) in full, a median leaves them out.

*rope*: 1 m, 0.05 kg, EA 10⁴ N, EI 10⁻³ N·m², step 1/60 s, implicit Euler. Without contact it hangs from one node and swings; in
`rope_step_contact` it lies on a floor (friction 0.5, every node in contact), in `rope_step_sliding` it slides over one (1 m/s,
friction 0.1).

*bodies*: chains of rods of 0.1 m and 0.2 kg, joined by hinges with damping and a motor each, fall for 200 steps of 1/240 s, implicit
Euler beside MuJoCo's `implicitfast`. Where a chain has fewer parameters than a row differences, the row is left out.

*cable*: 18 capsules on ball joints (57 degrees of freedom, 0.375 m) fall 8 cm onto a floor, curled, and come to rest; *arm_box*: an
arm of two links with position drives pushes a box over a floor (8 degrees of freedom). The same steps.

The comparison is not equal:

- pliant solves each step to 10⁻¹² of the velocity scale and keeps the exact Jacobian. MuJoCo takes one linearized, positive
  semi-definite step at its default tolerance, holds the edges of a rope by a soft constraint instead of EA, and (unless "without
  twist") carries a hinge per edge. `implicitfast` is implicit in damping alone; pliant takes inertia, Coriolis forces and weight at the
  end of the step.
- `mjd_transitionFD` gives forward differences in the state, with errors near 10⁻⁶; pliant's Jacobian also covers the controls, and
  its reverse mode gives the gradient by all parameters, controls and the initial state at once.
- pliant's contacts are hard (rest gap 1 nm, of *arm_box* 10 nm) and hold where the step ends; MuJoCo's are soft, at their defaults, and
  are found where it begins."""


RODS_AND_CLOTH = """## Rods and cloth

*rod*: the rope above with twist, GJ = 2/3 EI; *cloth*: a sheet of 10 × 10 nodes (its size is nodes per side), 0.5 m, 0.2 kg/m²,
E 5·10⁴ Pa, held at a corner and falling, beside MuJoCo's two-dimensional flex with the same membrane. In `_contact` each lies on a
floor, every node in contact (20 and 100). Gradients are of 60 steps. `jacobian` is A and B (pliant's with the step, MuJoCo's of the
state only). Beside "pliant, step" the ratio is its cost in steps; beside "pliant, forward rollout" it is the cost of all gradients in
rollouts. *published*: figures of CORD-SLS for its own rope of 20 nodes and cloth of 10 × 10 on a GPU, with another machine and another
step: an order of magnitude."""

# CORD-SLS, its Table 2: seconds of a step and of its Jacobian
PUBLISHED = {"rod_step": 1.095e-3, "rod_jacobian": 5.198e-3, "cloth_step": 15.08e-3, "cloth_jacobian": 10.06e-3}


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "–"
    for scale, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= scale or unit == "µs":
            return f"{seconds / scale:.3g} {unit}"
    raise AssertionError("unreachable")


def table(rows: list[dict]) -> str:
    """A Markdown table of benchmark rows."""
    lines = [
        "| work | nodes, links or dofs | pliant | peer | peer's time | ratio |",
        "|---|---:|---:|---|---:|---:|",
    ]
    for row in rows:
        ratio = "–" if row["ratio"] is None else f"{row['ratio']:.3g}"
        cells = [row["work"], str(row["size"]), _time(row["pliant_s"]), row["peer"] or "–"]
        lines.append("| " + " | ".join([*cells, _time(row["peer_s"]), ratio]) + " |")
    return "\n".join(lines)


def with_published(rows: list[dict]) -> str:
    """The table of rods and cloth, with the published figures in a column of their own."""
    head, line, *lines = table(rows).split("\n")
    published = [_time(PUBLISHED.get(row["work"].replace("_contact", ""))) for row in rows]
    cells = [f"{text} {figure} |" for text, figure in zip(lines, published, strict=True)]
    return "\n".join([f"{head} published, GPU |", f"{line}---:|", *cells])


def listing(rows: list[dict], columns: dict) -> str:
    """A Markdown table of the rows' entries; columns: entry to title."""
    text = lambda x: "–" if x is None else f"{x:.3g}" if isinstance(x, float) else str(x)
    lines = ["| " + " | ".join(columns.values()) + " |", "|---|" + "---:|" * (len(columns) - 1)]
    return "\n".join(lines + ["| " + " | ".join(text(row[key]) for key in columns) + " |" for row in rows])


def rods_and_cloth(found: dict) -> list[str]:
    """The parts of the page about rods that twist and cloth."""
    growth = {"work": "work", "nodes": "nodes", "pliant_s": "s", "exponent": "exponent since the size before"}
    batch = {"work": "work", "rollouts": "rollouts", "one_thread_s": "one thread, s", "speedup_of_two": "speed-up on two threads"}
    memory = {"work": "kept for derivatives", "bytes_per_step": "bytes a step"}
    return [
        RODS_AND_CLOTH,
        with_published(found["compared"]),
        listing(found["growth"], growth),
        listing(found["batch"], batch),
        listing(found["memory"], memory),
    ]


def how(program: str, about: dict) -> str:
    """On what, when and by which command it was measured."""
    machine = about["machine"]
    versions = ", ".join(f"{k} {v}" for k, v in machine["versions"].items() if v)
    command = " ".join([f"python -m {program}", *about["command"]])
    return (
        f"`{command}`, {machine['date']}. {machine['processor']}, {machine['cores']} cores, "
        f"{machine['system']}, Python {machine['python']}; {versions}. "
        f"Load over the last minute at the end of the run: {machine['load_1min']}; on a busy "
        "machine trust the ratios, which are taken in turns, not the times."
    )


def page(rows: list[dict], found: dict) -> str:
    """The whole page; `found`: what `rods_cloth` measured."""
    against = [row for row in rows if row["peer"]]
    alone = [row for row in rows if not row["peer"]]
    parts = [INTRODUCTION, "## Against peers", table(against)]
    if alone:
        parts += ["## Growth with size", table(alone)]
    parts += rods_and_cloth(found)
    parts += ["## How it was measured", how("validation.bench", rows[0]), how("validation.bench.rods_cloth", found)]
    return "\n\n".join(parts) + "\n"


def main():
    """Read the JSON, write the page."""
    parser = argparse.ArgumentParser(prog="python -m validation.bench.page")
    parser.add_argument("result", type=Path, help="output of validation.bench --json")
    parser.add_argument("rods_cloth", type=Path, help="output of validation.bench.rods_cloth --json")
    parser.add_argument("--out", type=Path, default=Path("BENCHMARKS.md"))
    options = parser.parse_args()
    rows, found = (json.loads(path.read_text(encoding="utf-8")) for path in (options.result, options.rods_cloth))
    options.out.write_text(page(rows, found), encoding="utf-8")


if __name__ == "__main__":
    main()
