"""`python -m validation.bench.stepping`: steps one by one from Python, and many copies at once.

A table in Markdown: what a loop over `VectorStepper.step` with one copy costs beside `Model.rollout` of the same steps and
beside a loop over `Model.step`, and what two threads gain on 64 copies (with nothing else on the machine: `rollout_batch` gains
no more on a busy one). All parties take turns; medians over the rounds. *rope*: the benchmark's rope of 20 nodes, hanging and on a floor; *chain*, *arm_box*: the benchmark's bodies.
"""

import argparse
import json
import time
from statistics import median

import numpy as np

import pliant
from validation.bench import bodies, scenes, touching
from validation.bench.machine import describe

CASES = {
    "rope": lambda: scenes.scene_text(20, "hang"),
    "rope_contact": lambda: scenes.scene_text(20, "rest"),
    "chain": lambda: bodies.scene_text(18),
    "arm_box": lambda: touching.scene_text("arm_box"),
}
STEPS = 60
COPIES = 64


def seconds(work) -> float:
    """What a call takes."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def loop(stepper, rows):
    """Steps through all rows of inputs."""
    for u in rows:
        stepper.step(u)


def cold_loop(model, x, rows):
    """The same, each step from a new solver."""
    for u in rows:
        x = model.step(x, u)


def one_copy(model, rounds: int) -> dict:
    """Microseconds a step of one copy, of a rollout, and of a loop without memory."""
    x0, u = model.initial_state(), model.controls(STEPS)
    times = {"rollout": [], "stepper": [], "step": []}
    for _ in range(rounds):
        stepper = model.stepper(1, x0s=x0)
        times["rollout"].append(seconds(lambda: model.rollout(x0, u, record=False)))
        times["stepper"].append(seconds(lambda stepper=stepper: loop(stepper, u)))
        times["step"].append(seconds(lambda: cold_loop(model, x0, u)))
    found = {f"{name}_us": 1e6 * median(t) / STEPS for name, t in times.items()}
    ratios = [a / b for a, b in zip(times["stepper"], times["rollout"], strict=True)]
    return {**found, "stepper_by_rollout": median(ratios)}


def overhead(rounds: int) -> float:
    """Microseconds of a call of `step` with one copy beyond the engine's own step: of a single body that falls."""
    text = 'schema_version = 1\n[time]\nstep = 0.01\nduration = 0.6\nintegrator = "euler"\n[[body]]\nname = "ball"\nmass = 1.0\n'
    text += 'inertia = [1.0, 1.0, 1.0, 0, 0, 0]\n[[body.joint]]\nname = "rail"\nkind = "prismatic"\naxis = [0, 0, 1]\n'
    stepper, u = pliant.loads(text).stepper(1), np.zeros(0)
    times = [seconds(lambda: loop(stepper, [u] * 1000)) / 1000 for _ in range(rounds)]
    return 1e6 * (median(times) - pliant.bench(text, "step", 1000))


def two_threads(model, rounds: int) -> dict:
    """Milliseconds of a step of all copies on one thread, and the speed-up by two."""
    rows = model.controls(STEPS)
    thetas = np.tile(model.theta, (COPIES, 1))
    thetas[:, model.param_index("gravity.magnitude")] *= np.linspace(0.9, 1.1, COPIES)
    x0, times = model.initial_state(), {1: [], 2: []}
    for _ in range(rounds):
        for threads, taken in times.items():
            stepper = model.stepper(COPIES, thetas, x0s=x0, threads=threads)
            taken.append(seconds(lambda stepper=stepper: loop(stepper, rows)))
    return {
        "one_thread_ms": 1e3 * median(times[1]) / STEPS,
        "speedup_of_two": median(a / b for a, b in zip(times[1], times[2], strict=True)),
    }


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m validation.bench.stepping")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    for name, text in CASES.items():
        model = pliant.loads(text())
        rows.append({"scene": name, **one_copy(model, options.rounds), **two_threads(model, options.rounds)})
    found = {"rows": rows, "overhead_us": overhead(options.rounds), "machine": describe()}
    if options.json:
        print(json.dumps(found, indent=2))
        return
    print("| " + " | ".join(rows[0]) + " |\n|---|" + "---:|" * (len(rows[0]) - 1))
    for row in rows:
        print("| " + " | ".join(x if isinstance(x, str) else f"{x:.3g}" for x in row.values()) + " |")
    print(f"\nA call of step beyond the engine's own: {found['overhead_us']:.2f} µs.")


if __name__ == "__main__":
    main()
