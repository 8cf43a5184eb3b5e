"""Rods that twist and sheets of cloth beside MuJoCo 4.0's: `python -m validation.bench.rods_cloth [--quick] [--json]`.

In turns in one run, one thread: a step, its full Jacobian, and the gradient of a rollout of 60 steps of 1/60 s by implicit Euler, of

* `rod`: the benchmark's rope of 20 nodes with twist, round (GJ = 2/3 EI), held at one node and swinging, or on a floor with 20 contacts;
  MuJoCo's discrete rod with a hinge per edge and its own edge constraint;
* `cloth`: a sheet of 10 × 10 nodes, 0.5 m, 0.2 kg/m², held at a corner and falling, or on a floor with 100 contacts; MuJoCo's
  two-dimensional flex with the same membrane.

What is not equal stands in BENCHMARKS.md for ropes and holds here too. Then pliant alone: how a step's time grows with size, what a second
thread gains in a batch, and the memory of a step that is kept for derivatives, as a record or by checkpoints (the growth of the process's
largest size with more steps).
"""

from validation.bench import __main__ as bench  # first: it sets one thread  # isort: skip

import argparse
import json
import subprocess
import sys
import time
from statistics import median

import numpy as np

from validation import mujoco_cloth
from validation.bench import scenes
from validation.bench.machine import describe
from validation.bench.page import table
from validation.bench.peers import FD_PARAMETERS, MujocoRope, MujocoSheet
from validation.mujoco_cloth import Sheet

WORKS = {"step": "step", "jacobian": "linearize", "rollout_vjp": "rollout_vjp"}
PEERS = {
    "step": ("mj_step", "step"),
    "jacobian": ("mjd_transitionFD (state only)", "jacobian"),
    "rollout_vjp": (f"forward differences in {FD_PARAMETERS} parameters", "gradient"),
}
# units of work in a round, as parts of those of the step; whole rollouts, for landing takes more iterations than lying
FEWER = {"step": 1, "jacobian": 4, "rollout_vjp": 40}
CONTACTS = {"hang": "", "rest": "_contact"}
FLOOR = 'name = "floor"\nfriction = 0.5\n'


def rod_text(nodes: int, kind: str, steps: int = scenes.STEPS) -> str:
    """The TOML scene of the rope with twist."""
    text = scenes.scene_text(nodes, kind)
    rope = f"velocity = {list(scenes.VELOCITY[kind])}\n"
    twist = f"[rope.twist]\nstiffness = {2.0 / 3.0 * scenes.rope(nodes).bend_stiffness!r}\n"
    assert text.count(rope) == 1
    return text.replace(rope, rope + twist).replace(f"duration = {scenes.STEPS * scenes.STEP!r}", f"duration = {steps * scenes.STEP!r}")


def sheet(nodes: int, kind: str) -> Sheet:
    """The benchmark's sheet of `nodes` × `nodes`."""
    height = 0.0 if kind == "hang" else 5e-4 + 1e-9
    held = (0,) if kind == "hang" else ()
    return Sheet(nodes=(nodes, nodes), size=(0.5, 0.5), origin=(0.0, 0.0, height), youngs_modulus=5e4, held=held)


def cloth_text(nodes: int, kind: str, steps: int = scenes.STEPS) -> str:
    """The TOML scene of the sheet."""
    rest = "" if kind == "hang" else f"[[plane]]\n{FLOOR}"
    text = mujoco_cloth.scene(sheet(nodes, kind), scenes.STEP, "euler", rest)
    head = f"step = {scenes.STEP!r}\n"
    assert text.count(head) == 1
    return text.replace(head, f"{head}duration = {steps * scenes.STEP!r}\n")


def against_peers(rod_nodes: int, cloth_nodes: int, rounds: int, repeats: int) -> list[dict]:
    """Rows of all works beside MuJoCo, and of gradients beside pliant's own rollout."""
    rows = []
    for kind, contact in CONTACTS.items():
        cases = (
            ("rod", rod_nodes, rod_text(rod_nodes, kind), MujocoRope(rod_nodes, kind, twist=True), "MuJoCo 4.0 rod with twist"),
            ("cloth", cloth_nodes, cloth_text(cloth_nodes, kind), MujocoSheet(sheet(cloth_nodes, kind), kind), "MuJoCo 4.0 flex"),
        )
        for what, size, text, peer, name in cases:
            for work, ours in WORKS.items():
                units = max(1, repeats // FEWER[work])
                print(f"{what}{contact}_{work}, {size} ...", file=sys.stderr)
                does, timer = PEERS[work]
                timers = {f"{name}, {does}": getattr(peer, timer)}
                our_timer = lambda text=text, ours=ours, units=units: bench.pliant.bench(text, ours, units)
                rows += bench.compare(f"{what}{contact}_{work}", size, our_timer, timers, rounds)
            rows += bench.beside_itself(f"{what}{contact}_rollout_vjp", size, text, rounds, max(1, repeats // FEWER["rollout_vjp"]))
            step = {"pliant, step": lambda text=text: bench.pliant.bench(text, "step", repeats)}
            jacobian = lambda text=text: bench.pliant.bench(text, "linearize", max(1, repeats // FEWER["jacobian"]))
            rows += bench.compare(f"{what}{contact}_jacobian", size, jacobian, step, rounds)
    return rows


def growth(sizes: dict, seconds: float) -> list[dict]:
    """Seconds of a step by size, from about `seconds` of steps each; `exponent` of the growth in nodes since the size before."""
    rows = []
    for what, (text_of, numbers) in sizes.items():
        before = None
        for size in numbers:
            text = text_of(size, "hang", 5)
            once = bench.pliant.bench(text, "step", 5)
            took = once if 5 * once > seconds else bench.pliant.bench(text, "step", min(5000, int(seconds / once)))
            nodes = size if what == "rod" else size * size
            exponent = None if before is None else float(np.log(took / before[1]) / np.log(nodes / before[0]))
            rows.append({"work": f"{what}_step", "nodes": nodes, "pliant_s": took, "exponent": exponent})
            print(f"{what}, {nodes} nodes: {took:.3g} s a step", file=sys.stderr)
            before = (nodes, took)
    return rows


def batch(texts: dict, count: int, rounds: int) -> list[dict]:
    """How much faster two threads are on a batch of rollouts."""
    rows = []
    for what, text in texts.items():
        model = bench.pliant.loads(text)
        x0 = np.tile(model.initial_state(), (count, 1))
        u, times = model.controls(), {1: [], 2: []}
        for _ in range(rounds):
            for threads, seconds in times.items():
                begin = time.perf_counter()
                model.rollout_batch(x0, u, threads=threads, record=False)
                seconds.append(time.perf_counter() - begin)
        speedups = [a / b for a, b in zip(times[1], times[2], strict=True)]
        rows.append({"work": f"{what}_batch", "rollouts": count, "one_thread_s": median(times[1]), "speedup_of_two": median(speedups)})
    return rows


# Linux counts the largest size of the parent into ru_maxrss of a child: there the kernel's own mark is read, which begins anew
MEASURE = """
import pathlib, re, resource, sys, pliant
model = pliant.loads(sys.stdin.read())
most = int(sys.argv[2])
roll = model.rollout(model.initial_state(), model.controls(int(sys.argv[1])), max_records=most or None)
status = pathlib.Path("/proc/self/status")
if status.exists():
    print(1024 * int(re.search(r"VmHWM:\\s+(\\d+) kB", status.read_text()).group(1)))
else:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
"""


def memory(cases: dict) -> list[dict]:
    """Bytes of a step that is kept for derivatives; cases: (scene, step counts, most records at a time, 0 for all)."""
    rows = []
    for what, (text, steps, most) in cases.items():
        peaks = []
        for count in steps:
            command = [sys.executable, "-c", MEASURE, str(count), str(most)]
            run = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
            peaks.append(int(run.stdout))
        rows.append({"work": what, "bytes_per_step": (peaks[1] - peaks[0]) / (steps[1] - steps[0])})
    return rows


def kept(texts: dict, quick: bool) -> dict:
    """The cases of `memory`: rods and sheets as records and by checkpoints, and the largest sheet."""
    steps = (20, 60) if quick else (200, 1200)
    cases = {f"{what}_record": (text, steps, 0) for what, text in texts.items()}
    # states are so small that it takes many of them to see
    many = steps if quick else (1000, 11_000)
    cases |= {f"{what}_checkpoints": (text, many, 10) for what, text in texts.items()}
    if not quick:
        large = cloth_text(100, "hang", 6)
        cases |= {"large_cloth_record": (large, (2, 6), 0), "large_cloth_checkpoints": (large, (2, 6), 1)}
    return cases


def measure(quick: bool) -> dict:
    """Everything; `quick`: small sizes and few rounds, to see that it runs."""
    rounds, repeats = (1, 5) if quick else (9, 240)
    rod, cloth = (6, 4) if quick else (20, 10)
    sizes = {
        "rod": (rod_text, (10, 20) if quick else (20, 100, 500, 1000, 3000, 10_000)),
        "cloth": (cloth_text, (4, 6) if quick else (10, 20, 30, 50, 70, 100)),
    }
    texts = {"rod": rod_text(rod, "hang"), "cloth": cloth_text(cloth, "hang")}
    return {
        "compared": against_peers(rod, cloth, rounds, repeats),
        "growth": growth(sizes, 0.01 if quick else 2.0),
        "batch": batch(texts, 4 if quick else 64, 1 if quick else 5),
        "memory": memory(kept(texts, quick)),
        "machine": describe(),
        "command": sys.argv[1:],
    }


def main():
    """Print JSON, or tables."""
    parser = argparse.ArgumentParser(prog="python -m validation.bench.rods_cloth")
    parser.add_argument("--json", action="store_true", help="machine-readable output")
    parser.add_argument("--quick", action="store_true", help="small sizes, few rounds: whether it runs")
    options = parser.parse_args()
    found = measure(options.quick)
    if options.json:
        print(json.dumps(found, indent=2))
        return
    print(table(found["compared"]))
    for key in ("growth", "batch", "memory"):
        print()
        for row in found[key]:
            print(", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()))


if __name__ == "__main__":
    main()
