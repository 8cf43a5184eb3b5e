"""How well ropes and folded cloth are perceived in noisy images, and how long it takes: `python -m validation.perception [--seeds 8]`.

Shapes of a known form, rendered by MuJoCo (`validation.camera`) from two places; ropes also behind a post, held at both ends. Printed as
rows of the table in docs/perception.md; seeds begin at `--first`.
"""

import argparse
import time

from validation.camera import HEIGHT, WIDTH, Scene, noisy, render  # isort: skip  # chooses OpenGL before MuJoCo is imported
import numpy as np

from pliant.perception import Camera, cloth, rope
from validation.mujoco_cloth import Sheet

RADIUS = 0.004
NODES = 21
VIEWS = {"above": (0.0, -0.0, 0.7), "aslant": (0.1, -0.5, 0.6)}
SIZE = (WIDTH, HEIGHT)
FOLDS = [(0.2, 0.01), (0.16, 0.01), (0.18, 0.02), (0.14, 0.008), (0.15, 0.03)]  # (flat to, radius of the bend) [m]


def view(name, target=(0.0, 0.0, 0.05)):
    return Camera.looking_at(target, VIEWS[name], f=600.0, size=SIZE)


def cloth_view(name):
    return Camera.looking_at((0.1, 0.0, 0.0), {"above": (0.1, 0.0, 0.7), "aslant": (0.1, -0.25, 0.65)}[name], f=600.0, size=SIZE)


def even(points, n):
    """Points equally spaced along a curve, and its length."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return np.stack([np.interp(np.linspace(0.0, s[-1], n), s, c) for c in points.T], axis=1), float(s[-1])


T = np.linspace(0.0, 1.0, 2000)
CURVES = {
    "line": np.stack([0.4 * T - 0.2, 0.1 * T, 0.0 * T + RADIUS], axis=1),
    "arc": np.stack([0.15 * np.cos(2.5 * T), 0.15 * np.sin(2.5 * T), 0.0 * T + RADIUS], axis=1),
    "U": np.stack([0.1 * np.cos(1.4 * np.pi * T), 0.1 * np.sin(1.4 * np.pi * T), RADIUS + 0.1 * T], axis=1),
    "S": np.stack([0.4 * T - 0.2, 0.08 * np.sin(2.0 * np.pi * T), RADIUS + 0.06 * np.sin(np.pi * T) ** 2], axis=1),
    "crossing": np.stack(
        [
            0.12 * np.sin(1.8 * np.pi * T + 0.3),
            0.2 * T - 0.1 + 0.1 * np.cos(1.8 * np.pi * T + 0.3),
            RADIUS + 0.02 * np.sin(np.pi * T) + 0.03 * T,
        ],
        axis=1,
    ),
    "hanging": np.stack([0.4 * T - 0.2, 0.0 * T, 0.3 - 0.2 * (1.0 - (2.0 * T - 1.0) ** 2)], axis=1),
}
OBSTACLES = {
    "hand": {"balls": [((0.05, 0.02, 0.25), 0.03)]},
    "post": {"boxes": [((-0.06, 0.0, 0.15), (0.012, 0.25, 0.15))]},
}


def drawn(name, n=161):
    """Nodes as they are drawn, the true nodes, and the length."""
    points, length = even(CURVES[name], n)
    return points, points[:: (n - 1) // (NODES - 1)], length


def errors(nodes, truth):
    return np.linalg.norm(nodes - truth, axis=-1)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def folded(upper_from, bend, n, m, size=(0.3, 0.2)):
    """Nodes (n, m, 3) of a sheet that lies flat to `upper_from`, bends over as a half circle of radius `bend`, and lies flat again."""
    s = np.linspace(0.0, size[0], n)
    angle = np.clip((s - upper_from) / bend, 0.0, np.pi)
    back = np.maximum(0.0, s - upper_from - np.pi * bend)
    x = np.minimum(s, upper_from) + bend * np.sin(angle) - back
    z = 1e-3 + bend * (1.0 - np.cos(angle))
    y = size[1] * (np.linspace(0.0, 1.0, m) - 0.5)
    return np.stack(np.broadcast_arrays(x[:, None], y, z[:, None]), axis=-1)


class Figures:
    """Distances [m], the same in standard deviations, and times [s], by kind."""

    def __init__(self):
        self.distance, self.scaled, self.times = {}, [], {}

    def add(self, kind, seconds, found, error):
        visible = found.visible
        self.times.setdefault(kind, []).append(seconds)
        for what, which in (("seen", visible), ("hidden", ~visible)):
            self.distance.setdefault((kind, what), []).extend(error[which])
        self.scaled.extend(error / found.sigma)

    def table(self) -> str:
        rows = ["| | nodes | rms | 95 % | largest | time, median and 95 % |", "|---|---:|---:|---:|---:|---:|"]
        for (kind, what), values in self.distance.items():
            if values:
                v, t = 1e3 * np.array(values), 1e3 * np.array(self.times[kind])
                spent = f"{np.median(t):.0f}, {np.quantile(t, 0.95):.0f} ms" if what == "seen" else ""
                rows.append(f"| {kind}, {what} | {len(v)} | {rms(v):.2f} | {np.quantile(v, 0.95):.2f} | {v.max():.2f} | {spent} |")
        z = np.array(self.scaled)
        return "\n".join([*rows, "", f"within sigma {np.mean(z < 1.0):.1%}, within twice that {np.mean(z < 2.0):.1%}"])


def measure(seeds) -> Figures:
    """All scenes with all seeds."""
    figures = Figures()
    for where in VIEWS:
        eye = view(where)
        for name in CURVES:
            points, truth, length = drawn(name)
            ends = {"start": np.stack([points[0], points[1] - points[0]]), "end": points[-1]}
            for kind, obstacle, known in (("rope", {}, {"reference": truth[0]}), ("rope behind a post", OBSTACLES["post"], ends)):
                mask, depth = render(Scene(rope=points, radius=RADIUS, **obstacle), eye)
                for seed in seeds:
                    images = noisy(mask, depth, np.random.default_rng(seed))
                    begin = time.perf_counter()
                    found = rope(*images, eye, nodes=NODES, radius=RADIUS, length=length, **known)
                    figures.add(kind, time.perf_counter() - begin, found, errors(found.nodes, truth))
        eye = cloth_view(where)
        for upper_from, bend in FOLDS:
            nodes, truth = folded(upper_from, bend, 301, 3), folded(upper_from, bend, NODES, 3)
            triangles = Sheet(nodes=nodes.shape[:2]).triangles()
            mask, depth = render(Scene(sheet=(nodes.reshape(-1, 3), triangles), table=-1e-3), eye)
            for seed in seeds:
                images = noisy(mask, depth, np.random.default_rng(seed))
                begin = time.perf_counter()
                found = cloth(*images, eye, nodes=(NODES, 3), size=(0.3, 0.2), edge=nodes[0, [0, -1]])
                figures.add("fold", time.perf_counter() - begin, found, errors(found.nodes, truth).max(axis=1))
    return figures


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--first", type=int, default=7000)
    arguments.add_argument("--seeds", type=int, default=8)
    chosen = arguments.parse_args()
    print(measure(range(chosen.first, chosen.first + chosen.seeds)).table())
