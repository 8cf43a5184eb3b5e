"""`python validation/bench --json`: pliant and its peers, interleaved, one thread.

The same as `python -m validation.bench --json` at the repository's root.

Each round times every party once; the medians over the rounds are reported, and `ratio` is
pliant_s / peer_s (below 1: pliant is faster). Where pliant is not installed its times and the
ratios are null, so that the peers can be measured alone. `ratio_min` compares the fastest
rounds in the same way: on a busy machine the two ratios should agree.

work: rope_step, rope_step_contact (at rest), rope_step_sliding [s per step]; rope_jacobian
[s per full step Jacobian]; rope_rollout_vjp [s per 60-step rollout with its reverse gradient];
bodies_step, bodies_jacobian and bodies_rollout_vjp the same of chains of hinges, 200 steps;
cable_… and arm_box_… the same of the cable on the floor and of the arm that pushes a box. `size`
is the number of nodes, or of links, or of degrees of freedom.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import argparse
import json
import sys
from pathlib import Path
from statistics import median

if not __package__:  # run as a folder: the package is then found from the repository's root
    sys.path[0] = str(Path(__file__).resolve().parents[2])

from validation.bench import bodies, scenes, touching
from validation.bench.machine import describe
from validation.bench.peers import FD_PARAMETERS, JaxRope, MujocoChain, MujocoRope

try:
    import pliant
except ImportError:
    pliant = None

# work -> (pliant's name for it, the scene's kind, the peers' timer)
WORKS = {
    "rope_step": ("step", "hang", "step"),
    "rope_step_contact": ("step", "rest", "step"),
    "rope_step_sliding": ("step", "slide", "step"),
    "rope_jacobian": ("linearize", "hang", "jacobian"),
    "rope_rollout_vjp": ("rollout_vjp", "hang", "gradient"),
}
PEERS = {
    "step": "MuJoCo 4.0 rod, mj_step",
    "jacobian": "MuJoCo 4.0 rod, mjd_transitionFD (state only)",
    "gradient": f"MuJoCo 4.0 rod, forward differences in {FD_PARAMETERS} parameters",
}


def time_pliant(work: str, size: int, repeats: int) -> float | None:
    """Median seconds per unit of work from pliant's own loop; None where not installed."""
    if pliant is None:
        return None
    name, kind, _ = WORKS[work]
    return pliant.bench(scenes.scene_text(size, kind), name, repeats)


def peers_of(work: str, size: int, jax: bool) -> dict:
    """Timers by peer name: MuJoCo with and without twist hinges, JAX if asked for."""
    _, kind, timer = WORKS[work]
    timers = {}
    for twist in (True, False):
        label = PEERS[timer] + ("" if twist else ", without twist")
        timers[label] = getattr(MujocoRope(size, kind, twist=twist), timer)
    if jax:
        timers["JAX reference"] = getattr(JaxRope(size, kind), timer)
    return timers


def own_rollout(rounds: int, repeats: int, size: int = 20) -> list[dict]:
    """pliant's gradient beside its own forward rollout: what reverse mode costs."""
    text = scenes.scene_text(size, "hang")
    return beside_itself("rope_rollout_vjp", size, text, rounds, repeats)


def beside_itself(work: str, size: int, text: str, rounds: int, repeats: int) -> list[dict]:
    """The gradient of a scene's rollout beside the rollout."""
    if pliant is None:
        return []
    forward = {"pliant, forward rollout": lambda: pliant.bench(text, "rollout", repeats)}
    return compare(work, size, lambda: pliant.bench(text, "rollout_vjp", repeats), forward, rounds)


def measure(work: str, size: int, rounds: int, repeats: int, jax: bool) -> list[dict]:
    """Interleaved rounds of pliant and every peer on one work and size of rope."""
    return compare(work, size, lambda: time_pliant(work, size, repeats), peers_of(work, size, jax), rounds)


def compare(work: str, size: int, our_timer, timers: dict, rounds: int) -> list[dict]:
    """Interleaved rounds of pliant's timer and the peers' by name; a row for each peer."""
    for timer in timers.values():
        timer()  # warm caches and compilers
    ours, theirs = [], {name: [] for name in timers}
    for _ in range(rounds):
        ours.append(our_timer())
        for name, timer in timers.items():
            theirs[name].append(timer())
    return [_row(work, size, name, ours, times) for name, times in theirs.items()]


def measure_chain(links: int, rounds: int, repeats: int) -> list[dict]:
    """All works of a chain of that many links."""
    return measure_bodies("bodies", links, bodies.scene_text(links), MujocoChain(links), rounds, repeats)


def measure_touching(case: str, rounds: int, repeats: int) -> list[dict]:
    """All works of bodies that touch."""
    peer = touching.MujocoTouching(case)
    return measure_bodies(case, peer.model.nv, touching.scene_text(case), peer, rounds, repeats)


def measure_bodies(kind: str, size: int, text: str, peer, rounds: int, repeats: int) -> list[dict]:
    """All works of a scene of bodies beside a `MujocoRun`."""
    rows = []
    n_params = None if pliant is None else pliant.loads(text).n_params
    # a rollout is 200 steps long: fewer of them per round
    rollouts = max(1, repeats // 16)
    for work, name in bodies.WORKS.items():
        units = rollouts if name == "rollout_vjp" else repeats

        def our_timer(name=name, units=units):
            return None if pliant is None else pliant.bench(text, name, units)

        timers = bodies.timers(name, peer, n_params)
        rows += compare(f"{kind}_{work}", size, our_timer, timers, rounds)
    return rows + beside_itself(f"{kind}_rollout_vjp", size, text, rounds, rollouts)


def growth(sizes, rounds: int, repeats: int) -> list[dict]:
    """pliant's step alone, by size: how the time per node grows."""
    if pliant is None:
        return []
    rows = []
    for size in sizes:
        times = [time_pliant("rope_step", size, repeats) for _ in range(rounds)]
        rows.append(_row("rope_step", size, None, times, [None]))
    return rows


def _row(work, size, peer, ours, theirs):
    pliant_s = None if None in ours else median(ours)
    peer_s = None if None in theirs else median(theirs)
    both = pliant_s is not None and peer_s is not None
    return {
        "work": work,
        "size": size,
        "pliant_s": pliant_s,
        "peer": peer,
        "peer_s": peer_s,
        "ratio": pliant_s / peer_s if both else None,
        "pliant_min_s": None if pliant_s is None else min(ours),
        "ratio_min": min(ours) / min(theirs) if both else None,
        "peer_min_s": None if peer_s is None else min(theirs),
    }


def main():
    """Run the benchmark and print JSON, or a table."""
    parser = argparse.ArgumentParser(prog="python -m validation.bench")
    parser.add_argument("--json", action="store_true", help="machine-readable output")
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds")
    parser.add_argument("--repeats", type=int, default=240, help="pliant's units per round")
    parser.add_argument("--chains", type=int, nargs="*", default=[2, 7, 18], help="links, with MuJoCo")
    parser.add_argument("--touching", nargs="*", default=touching.CASES, choices=touching.CASES)
    parser.add_argument("--sizes", type=int, nargs="*", default=[20], help="nodes, with peers")
    parser.add_argument("--growth", type=int, nargs="*", default=[20, 60, 200, 500, 1000])
    parser.add_argument(
        "--jax", action="store_true", help="also the JAX reference (compiles minutes)"
    )
    options = parser.parse_args()
    rows = []
    for size in options.sizes:
        for work in WORKS:
            print(f"{work}, {size} nodes ...", file=sys.stderr)
            rows += measure(work, size, options.rounds, options.repeats, options.jax)
    rows += own_rollout(options.rounds, options.repeats)
    for links in options.chains:
        print(f"bodies, {links} links ...", file=sys.stderr)
        rows += measure_chain(links, options.rounds, options.repeats)
    for case in options.touching:
        print(f"{case} ...", file=sys.stderr)
        rows += measure_touching(case, options.rounds, options.repeats)
    rows += growth(options.growth, min(options.rounds, 5), options.repeats)
    if options.json:
        about = {"machine": describe(), "command": sys.argv[1:]}
        print(json.dumps([row | about for row in rows], indent=2))
    else:
        from validation.bench.page import table

        print(table(rows))


if __name__ == "__main__":
    main()
