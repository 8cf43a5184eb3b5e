"""Motions of a rod that twists, held by two grippers that swing and turn, with one effect hidden, made by the JAX reference.

    python -m validation.blind.rods FOLDER [--effect bend_friction] [--seed 0]

The reference shares no code with pliant; it takes steps of 1.25 ms by sdirk2 where the scene that pliant gets is stepped by midpoint. A
record begins at rest. Markers at the nodes that no gripper holds are read with noise; the scene lacks what was hidden, and its bending
stiffness is a guess, to be refitted.
"""

from __future__ import annotations

import argparse
import functools
from pathlib import Path

import jax
import numpy as np

from validation import reference
from validation.blind.measure import AXES, Noise, coloured

NODES = 9
LENGTH, SPAN = 0.6, 0.45  # m, between the ends as the scene begins
STIFFNESS, GUESS = 1e-3, 0.9  # N·m², and the scene's over the true one
RATE, FINE, SAMPLES = 100.0, 8, 120  # Hz, true steps a sample, samples after the first
EVERY = 8  # pliant's steps a sample: with 4 of them its own error is a tenth of the noise, and seen
SETTLE = 1200  # steps of Euler, which bring the rod to rest; four times as long ones fail on some processors
FITTED, RECORDS = 3, 4
NOISE = Noise(0.3, 3e-4)
HELD = {"left": (0, 1), "right": (NODES - 2, NODES - 1)}
MARKED = range(2, NODES - 2)

# effect -> values by path; the laws are all in the true rod, silent where nothing is said
EFFECTS: dict[str, dict[str, float]] = {
    "null": {},
    "bend_friction": {"rod.friction_moment": 1e-3, "rod.friction_curvature": 0.5},
    "rod_creep": {"rod.creep_fraction": 0.6, "rod.creep_time": 0.4},
    "edge_lengths": {"rod.edge[2].rest_strain": 0.02, "rod.edge[4].rest_strain": -0.03, "rod.edge[5].rest_strain": 0.02},
    "twist_stiffness": {"rod.twist_stiffness": 2e-3, "right.roll": 0.0},
    "gripper_offset": {"left.offset[1]": 4e-3, "left.offset[2]": -3e-3},
}
LAWS = """[rope.creep]
fraction = 0.0
time = 0.4
[rope.bend_friction]
moment = 0.0
curvature = 0.5
"""


def arc() -> np.ndarray:
    """Nodes (NODES, 3) [m] on a parabola of the rod's length between its ends."""
    x = np.linspace(0.0, SPAN, NODES)
    shape = lambda sag: np.stack([x, 0.0 * x, -4.0 * sag * x * (SPAN - x) / SPAN**2], axis=1)
    low, high = 0.0, LENGTH
    for _ in range(60):
        sag = 0.5 * (low + high)
        long = np.linalg.norm(np.diff(shape(sag), axis=0), axis=1).sum() > LENGTH
        low, high = (low, sag) if long else (sag, high)
    return np.round(shape(low), 6)


def rod(step: float, integrator: str, stiffness: float, laws: str = "", strains: bool = False) -> str:
    """The rod and its grippers; `stiffness` in bending [N·m²], `laws` of its section."""
    edges = f"edge_rest_strains = {[0.0] * (NODES - 1)}\n" if strains else ""
    grippers = "".join(f'[[gripper]]\nname = "{name}"\nrope = "rod"\nnodes = {list(nodes)}\n' for name, nodes in HELD.items())
    return f"""schema_version = 1
[time]
step = {step!r}
duration = {SAMPLES / RATE}
integrator = "{integrator}"
[[rope]]
name = "rod"
nodes = {NODES}
length = {LENGTH}
linear_density = 0.03
stretch_stiffness = 300.0
stretch_damping = 0.3
bend_stiffness = {stiffness!r}
bend_damping = 3e-5
{edges}initial = {{ shape = "points", points = {arc().tolist()} }}
[rope.twist]
stiffness = 1e-3
damping = 3e-5
inertia = 4e-7
director = [0, 1, 0]
{laws}{grippers}"""


@functools.cache
def truth(settling: bool = False):
    """The reference's model of the true rod and its compiled rollout; by long steps of Euler for coming to rest."""
    step, integrator = (0.005, "euler") if settling else (1.0 / RATE / FINE, "sdirk2")
    model = reference.loads(rod(step, integrator, STIFFNESS, LAWS, strains=True))
    return model, jax.jit(reference.make_rollout(model))


def commands(record: int, t: np.ndarray) -> np.ndarray:
    """Places of the held nodes (times, 12) [m]: both grippers begin to swing, and turn what they hold about the vertical."""
    at, out = arc(), []
    rng = np.random.default_rng([record, 11])
    # from rest: a jolt would show the scene's step and nothing else
    wave = lambda size, f, phase: size * (1.0 - np.exp(-((t / 0.15) ** 2))) * np.sin(f * t + phase)
    for nodes in HELD.values():
        by = np.stack([wave(size, *rng.uniform((4.0, 0.0), (7.0, 6.0))) for size in (0.06, 0.08, 0.05)], axis=1)
        angle = wave(0.5, *rng.uniform((4.0, 0.0), (6.0, 6.0)))
        centre, edge = at[list(nodes)].mean(axis=0), at[nodes[1]] - at[nodes[0]]
        turned = np.stack(
            [
                edge[0] * np.cos(angle) - edge[1] * np.sin(angle),
                edge[0] * np.sin(angle) + edge[1] * np.cos(angle),
                0 * t + edge[2],
            ],
            axis=1,
        )
        out += [centre + by - 0.5 * turned, centre + by + 0.5 * turned]
    return np.concatenate(out, axis=1)


def motion(hidden: dict[str, float], record: int) -> np.ndarray:
    """Nodes (SAMPLES + 1, NODES, 3) [m] of a rod that begins at rest; `hidden`: values by path."""
    model, rollout = truth()
    theta, silent = np.array(model.theta), np.array(model.theta)
    for path, value in hidden.items():
        theta[model.index(path)] = value
        silent[model.index(path)] = model.theta[model.index(path)] if "creep" in path or "friction" in path else value
    t = np.arange(SAMPLES * FINE + 1) / RATE / FINE
    # the log is interpolated linearly, and so is what moves the truth
    logged = np.arange(SAMPLES + 1) / RATE
    u = np.stack([np.interp(t, logged, column) for column in commands(record, logged).T], axis=1)
    settling, settle = truth(settling=True)
    settled, left = settle(settling.initial_state(), np.tile(u[0], (SETTLE, 1)), silent)
    x, residuals = rollout(at_rest(model, np.array(settled[-1])), u[1:], theta)
    assert max(map(float, map(np.max, [left, residuals]))) < 1e-8, "a step of the reference did not converge"
    return np.array(x)[::FINE, : 3 * NODES].reshape(-1, NODES, 3)


def at_rest(model, x: np.ndarray) -> np.ndarray:
    """The state with no velocities, and nothing remembered but the axes of its edges."""
    out, first = np.array(model.initial_state()), 2 * model.nq
    axes = 3 * (NODES - 1)
    out[: model.nq] = x[: model.nq]
    out[first : first + axes] = x[first : first + axes]
    return out


def columns(nodes) -> list[str]:
    return [f"n{node}{axis}" for node in nodes for axis in AXES]


def write(hidden: dict[str, float], folder: Path, seed: list[int], noise: Noise = NOISE) -> Path:
    """Scene and logs in a folder; returns the scene's path."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    held = [node for nodes in HELD.values() for node in nodes]
    t = np.arange(SAMPLES + 1) / RATE
    for record in range(RECORDS):
        y = motion(hidden, record)[:, list(MARKED)]
        y = noise.quantum * np.round((y + coloured(noise, y.shape, rng)) / noise.quantum)
        table = np.column_stack([t, y.reshape(len(t), -1), commands(record, t)])
        header = ",".join(["t", *columns(MARKED), *columns(held)])
        np.savetxt(folder / f"run{record}.csv", table, "%.7f", ",", header=header, comments="")
    path = folder / "scene.toml"
    path.write_text(rod(1.0 / RATE / EVERY, "midpoint", GUESS * STIFFNESS) + experiment(), encoding="utf-8")
    return path


def experiment() -> str:
    """What was measured, and what is refitted."""
    quoted = lambda nodes: str(columns(nodes)).replace("'", '"')
    out = '[experiment]\ninitial = "rest"\ntime = { column = "t" }\nlead_in = 0.1\n'
    for node in MARKED:
        out += f'[[experiment.marker]]\nrope = "rod"\nnode = {node}\ncolumns = {quoted([node])}\n'
    for name, nodes in HELD.items():
        out += f'[[experiment.input]]\ngripper = "{name}"\ncolumns = {quoted(nodes)}\n'
    for record in range(RECORDS):
        role = "fit" if record < FITTED else "held_out"
        out += f'[[experiment.record]]\nfile = "run{record}.csv"\nrole = "{role}"\n'
    return out + '[experiment.fit]\nfree = [{ path = "rod.bend_stiffness", lower = 1e-5, upper = 1e-1 }]\n'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--effect", choices=EFFECTS, default="bend_friction")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    print(write(EFFECTS[args.effect], args.folder, [args.seed]))


if __name__ == "__main__":
    main()
