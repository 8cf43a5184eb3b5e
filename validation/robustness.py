"""What pliant does with scenes that nobody chose: a thousand by seed, each in a process of its own with a time limit.

    python -m validation.robustness --count 1000 --seed 0 [--bodies] [--save FOLDER] [--write]

Ropes, rods, sheets and chains, or with `--bodies` piles, stacks and impacts of bodies. `--write` puts the outcomes into
validation/evidence/random_scenes.json or random_bodies.json.

A run is *good* if it comes to its end with finite states and an energy that has a cause: at no time more than

    energy at the beginning + work of the hand + 2 % of (M g L + kinetic energy at the beginning + work of the hand)

where only weight and one hand push (its work follows from the momentum of everything); with contact, if the hand moves, the same from
the moment at which it stops (halfway), without work; in the wind, which may do work for ever, it need be finite only. The 2 % are for
what an implicit step may create on concave energies (buckling) and for midpoint's error of second order. Bodies may never have more than
they began with and 2 % of their weight times the scene's size and their kinetic energy at the beginning, and none may come to lie with its
centre below the floor. Otherwise it *grew*, *stopped*
(an error of the numerics that names the step and what went wrong), stopped *mutely* (an error that does not), was *refused* as a scene,
panicked (*panic*), died, or did not end (*hang*).
"""

import argparse
import math
import multiprocessing
import os
import re
import sys
import time
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation import evidence
from validation.random_bodies import random_bodies
from validation.random_scenes import GRAVITY, Scene, random_scene

LIMIT = 60.0  # s a scene
SHARE = 0.02
ENDS = ("good", "grew", "not finite", "stopped", "mute", "refused", "panic", "died", "hang")
# A small server forks each scene's process: forking one that holds much (JAX, in the tests) costs more than the scene.
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["validation.robustness"])


@dataclass
class Outcome:
    """How a scene ended, in one word and in a sentence."""

    seed: int
    end: str
    message: str
    seconds: float
    what: list


def inputs(model, steps: int, moves: bool) -> np.ndarray:
    """The scene's controls, stopped halfway where a hand moves: (steps, nu)."""
    u = model.controls(steps)
    if moves:
        still = [("velocity" in name) for name in model.control_names]
        u[steps // 2 :] = np.where(still, 0.0, u[steps // 2 - 1])
    return u


def work(model, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Work [J] of the one hand, which only translates, up to each state, (T + 1,); weight is the only other force.

    The hand's force is what changes the momentum of everything, driven nodes included, beside weight.
    """
    n, h = 3 * model.n_nodes, model.step_length
    m, half = model.masses(), model.ndx // 2
    q, v = (x[:, first : first + n].reshape(len(x), -1, 3) for first in (0, half))
    weight = m.sum() * np.array([0.0, 0.0, -model.theta[model.param_index("gravity.magnitude")]])
    force = np.diff(np.einsum("tna,n->ta", v, m), axis=0) / h - weight
    if not model.nu:
        return np.zeros(len(x))
    hand = next(k for k, name in enumerate(model.control_names) if name.endswith(".x") and "axis" not in name)
    name = model.control_names[hand]
    if "velocity" in name:
        speed = u[:, hand : hand + 3]
    else:
        start = u[0, hand : hand + 3] - (q[1] - q[0])[held(name, model)]
        speed = np.diff(np.vstack([start, u[:, hand : hand + 3]]), axis=0) / h
    return np.concatenate([[0.0], np.cumsum(h * np.einsum("ta,ta->t", force, speed))])


def held(name: str, model) -> int:
    """The node of the model that the control `hand.node[i].x` or `hand.position.x` drives."""
    nodes = next(iter((model.ropes | model.cloths).values()))
    numbered = re.search(r"node\[(\d+)\]", name)
    if numbered:
        return nodes.start + int(numbered.group(1))
    return nodes.start if nodes.start > 0 else nodes.stop - 1  # a ghost comes before the first node or after the last one


def grown(model, scene: Scene, roll, u) -> str | None:
    """What is wrong with the energy of a finished run."""
    energy, x = roll.energy(), roll.x
    if not (np.isfinite(x).all() and np.isfinite(energy).all()):
        return "not finite"
    if "wind" in scene.what:
        return None  # it may do work for ever
    begin, done = 0, np.zeros(len(x))
    if scene.moves:
        if scene.alone:
            done = work(model, x, u)
        else:
            begin = scene.steps // 2 + 1
    if scene.scale is not None:
        excess = energy - energy[0] - SHARE * scene.scale
        worst = int(np.argmax(excess))
        if excess[worst] > 0.0:
            return f"energy {energy[worst]:.4g} J at step {worst}, {energy[0]:.4g} J at the beginning, scale {scene.scale:.3g} J"
        return fallen_through(scene, x)
    n, half = 3 * model.n_nodes, (model.ndx // 2)
    v = x[begin, half : half + n].reshape(-1, 3)
    kinetic = 0.5 * float(model.masses() @ (v**2).sum(axis=1))
    scale = model.masses().sum() * GRAVITY * scene.length + kinetic + np.abs(done)
    excess = energy[begin:] - energy[begin] - done[begin:] - SHARE * scale[begin:] - 1e-9 * np.abs(energy[begin:])
    worst = int(np.argmax(excess))
    if excess[worst] <= 0.0:
        return None
    k = begin + worst
    return f"energy {energy[k]:.4g} J at step {k}, {energy[begin]:.4g} J at step {begin}, work {done[k]:.3g} J, scale {scale[k]:.3g} J"


def fallen_through(scene: Scene, x: np.ndarray) -> str | None:
    """Bodies whose centre has passed the floor."""
    plane = tomllib.loads(scene.text)["plane"][0]
    normal = np.asarray(plane["normal"]) / np.linalg.norm(plane["normal"])
    free = x[:, : x.shape[1] // 13 * 7].reshape(len(x), -1, 7)[:, :, :3]
    height = (free - np.asarray(plane["point"])) @ normal
    k, body = np.unravel_index(np.argmin(height), height.shape)
    return f"body {body} is {-height[k, body]:.3g} m below the floor at step {k}" if height[k, body] < 0.0 else None


def simulate(scene: Scene) -> tuple[str, str]:
    """Runs a scene: (end, message)."""
    import pliant

    try:
        model = pliant.loads(scene.text)
    except pliant.InputError as error:
        return "refused", str(error)
    try:
        u = inputs(model, scene.steps, scene.moves)
        roll = model.rollout(model.initial_state(), u, record=False)
        problem = grown(model, scene, roll, u)
    except pliant.NumericsError as error:
        named = re.search(r"step \d+", str(error)) is not None
        return ("stopped" if named else "mute"), str(error)
    except pliant.InputError as error:
        return "refused", str(error)
    if problem == "not finite":
        return "not finite", "a state or an energy is not finite"
    return ("grew", problem) if problem else ("good", "")


def _work(scene, pipe):
    # messages of a panic belong into the report, not on the terminal
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    try:
        pipe.send(simulate(scene))
    except BaseException as error:  # noqa: BLE001  # a panic of the engine is no Exception
        pipe.send(("panic", f"{type(error).__name__}: {error}"))
    finally:
        pipe.close()


def run(seed: int, limit: float = LIMIT, make=random_scene) -> Outcome:
    """Runs the scene that `make` gives for a seed in a process of its own."""
    scene = make(seed)
    mine, theirs = PROCESSES.Pipe(duplex=False)
    process = PROCESSES.Process(target=_work, args=(scene, theirs), daemon=True)
    began = time.perf_counter()
    process.start()
    theirs.close()
    end, message = "hang", f"no end within {limit:.0f} s"
    try:
        if mine.poll(limit):
            end, message = mine.recv()
    except EOFError:
        process.join(5.0)
        end, message = "died", f"exit code {process.exitcode}"
    if process.is_alive() and end == "hang":
        process.kill()
    process.join()
    return Outcome(seed, end, message, time.perf_counter() - began, scene.what)


def sweep(seeds, jobs: int = 1, limit: float = LIMIT, report=None, make=random_scene) -> list[Outcome]:
    """Outcomes of many seeds, in order; `report(outcome)` is called as they come."""

    def one(seed):
        outcome = run(seed, limit, make)
        if report:
            report(outcome)
        return outcome

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, seeds))


def main():
    """Prints how many scenes ended how, and the seeds of the bad ones."""
    parser = argparse.ArgumentParser(prog="python -m validation.robustness")
    parser.add_argument("--count", type=int, default=1000, help="scenes")
    parser.add_argument("--seed", type=int, default=0, help="of the first scene; the others follow it")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="scenes at a time")
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds a scene may take")
    parser.add_argument("--save", type=Path, help="folder for the scenes that ended badly")
    parser.add_argument("--bodies", action="store_true", help="scenes of bodies")
    parser.add_argument("--write", action="store_true", help="write the record in validation/evidence/")
    options = parser.parse_args()
    width, record = max(map(len, ENDS)), evidence.Run()

    def report(outcome):
        if outcome.end != "good":
            print(f"{outcome.seed:6} {outcome.end:{width}} {', '.join(outcome.what)}: {outcome.message}", flush=True)

    make = random_bodies if options.bodies else random_scene
    outcomes = sweep(range(options.seed, options.seed + options.count), options.jobs, options.limit, report, make)
    counts = Counter(o.end for o in outcomes)
    slow = sorted(outcomes, key=lambda o: -o.seconds)[:3]
    for end in ENDS:
        seeds = [o.seed for o in outcomes if o.end == end]
        if seeds:
            shown = "" if end == "good" else "  seeds " + " ".join(map(str, seeds))
            print(f"{end:{width}} {counts[end]:5}  {100 * counts[end] / len(outcomes):5.1f} %{shown}")
    print("slowest:", ", ".join(f"seed {o.seed} {o.seconds:.1f} s" for o in slow))
    if options.write:
        figures = {
            "scenes": len(outcomes),
            "counts": {end: counts[end] for end in ENDS},
            "limit": options.limit,
            "slowest": {"seed": slow[0].seed, "seconds": round(slow[0].seconds, 1)},
            "bad": [{"seed": o.seed, "end": o.end, "message": o.message} for o in outcomes if o.end != "good"],
        }
        print(record.write("random_bodies" if options.bodies else "random_scenes", {"first": options.seed, "count": options.count}, figures))
    if options.save:
        options.save.mkdir(parents=True, exist_ok=True)
        for o in outcomes:
            if o.end != "good":
                text = f"# {o.end}: {o.message}\n".replace("\n", " ") + "\n" + make(o.seed).text
                (options.save / f"{o.end.replace(' ', '_')}_{o.seed}.toml").write_text(text)
    return 0 if math.isclose(counts["good"], len(outcomes)) else 1


if __name__ == "__main__":
    sys.exit(main())
