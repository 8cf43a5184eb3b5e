"""Rods that twist, beside closed forms: Michell's ring and the localised helix of a rod that was twisted too far.

    python -m validation.rods        prints both, over several meshes (about a minute)
"""

from __future__ import annotations

import math

import numpy as np
import pliant

SCENE = """
schema_version = 1
[time]
step = {step}
duration = {duration}
integrator = "euler"
[gravity]
magnitude = 0.0
[[rope]]
name = "rod"
nodes = {nodes}
length = {length}
linear_density = {density}
stretch_stiffness = 1.0e5
bend_stiffness = {bend}
drag_linear = {drag}
radius = 0.005
initial = {initial}
[rope.twist]
stiffness = {twist}
damping = {damping}
inertia = {inertia}
director = [0.0, 0.0, 1.0]
initial = {turn}
[[gripper]]
name = "first"
rope = "rod"
end = "first"
[[gripper]]
name = "last"
rope = "rod"
end = "last"
"""


# ---- Michell's ring -----------------------------------------------------------------------------

RADIUS = 0.1  # m
BEND = 1e-2  # N·m²


def critical_turn(ratio: float) -> float:
    """The turn [rad] at which a ring of GJ/EI = ratio leaves its plane (Michell 1889)."""
    return 2.0 * math.pi * math.sqrt(3.0) / ratio


def ring(edges: int, ratio: float, turn: float) -> tuple[pliant.Model, np.ndarray]:
    """A rod bent to a circle, its ends held together, one turned against the other; and the input that holds it."""
    angles = np.linspace(0.0, 2.0 * math.pi, edges + 1)
    points = RADIUS * np.stack([np.sin(angles), 1.0 - np.cos(angles), 0.0 * angles], 1)
    listed = ", ".join("[{}, {}, {}]".format(*map(float, p)) for p in points)
    model = pliant.loads(
        SCENE.format(
            step=0.1, duration=0.1, nodes=edges + 1, length=2.0 * edges * RADIUS * math.sin(math.pi / edges), density=0.01,
            bend=BEND, drag=0.0, initial=f'{{ shape = "points", points = [{listed}] }}', twist=BEND * ratio, damping=0.0,
            inertia=1.25e-7, turn=turn,
        )
    )
    last = [0.0, -math.sin(turn), math.cos(turn)]
    return model, np.concatenate([points[0], [1, 0, 0], [0, 0, 1], points[-1], [-1, 0, 0], last])


def softest(edges: int, ratio: float, turn: float) -> float:
    """Least stiffness over mass [1/s²] of the ring at rest, but for its free turning about the common tangent of its ends."""
    model, u = ring(edges, ratio, turn)
    rest = model.equilibrium(u)
    a = model.rollout(rest.x, u[None]).linearize(0)[0]
    h, n = model.step_length, model.ndx // 2
    # an Euler step at rest turns a displacement into the velocity −h (M + h²K)⁻¹ K: eigenvalues k/(m + h²k) over −h
    eigenvalues = np.linalg.eigvals(-a[n:, :n] / h).real
    least = np.sort(np.delete(eigenvalues, np.argmin(np.abs(eigenvalues))))[0]
    return float(least / (1.0 - h * h * least))


def buckles_at(edges: int, ratio: float) -> float:
    """Turn at which the least stiffness vanishes, over the critical one, approached from below along chords."""
    at = lambda f: softest(edges, ratio, f * critical_turn(ratio))
    f = [0.9, 0.97]
    k = [at(x) for x in f]
    while True:
        root = f[1] + (f[1] - f[0]) * k[1] / (k[0] - k[1])
        if root - f[1] < 1e-3:
            return root
        f = [f[1], f[1] + 0.7 * (root - f[1])]
        k = [k[1], at(f[1])]
        if k[1] > k[0]:
            return root  # it has left its plane already: the polygon is not quite flat under twist


# ---- Localised helix ----------------------------------------------------------------------------

LENGTH, ALPHA, BETA, TURNS, SLACK = 9.29, 1.345, 0.789, 27, 0.3  # Bergou et al. 2008, §7


def helix(edges: int, duration: float = 120.0, step: float = 0.02) -> dict[str, float]:
    """Twists a straight rod, lets its ends come together, and compares what it settles to with the envelope

        (cos φ − cos φ₀)/(1 − cos φ₀) = tanh²(s/s*),  s* = (2α/βm) √((1 + cos φ₀)/(1 − cos φ₀))

    of an infinite rod of twist m per length, φ being the angle of its tangent to its axis, φ₀ the largest.
    """
    model = pliant.loads(
        SCENE.format(
            step=step, duration=duration, nodes=edges + 1, length=LENGTH, density=1.0, bend=ALPHA, drag=20.0,
            initial='{ shape = "straight", from = [0.0, 0.0, 0.0], direction = [1.0, 0.0, 0.0] }', twist=BETA, damping=0.1,
            inertia=1.25e-3, turn=TURNS * 2.0 * math.pi,
        )
    )
    u = model.controls()
    t = step * np.arange(1, len(u) + 1)
    pulled = 0.006  # a little tension first, or it would buckle everywhere at once
    u[:, 9] -= np.where(t < 2.0, -pulled * t / 2.0, -pulled + (SLACK + pulled) * np.clip((t - 2.0) / (0.6 * duration), 0, 1))
    nodes = model.n_nodes
    bump = np.zeros(model.ndx)
    bump[1 : 3 * nodes : 3] = 1e-3 * np.exp(-((np.linspace(-1.0, 1.0, nodes) / 0.1) ** 2))
    bump[[1, 4, 3 * nodes - 5, 3 * nodes - 2]] = 0.0
    x = model.rollout(model.displaced(model.initial_state(), bump), u, record=False).x[-1]
    edge = np.diff(x[: 3 * nodes].reshape(-1, 3), axis=0)
    cosine = edge[1:-1, 0] / np.linalg.norm(edge[1:-1], axis=1)
    twists = np.diff(x[3 * nodes : 4 * nodes - 1]) + x[-(nodes - 2) :]
    m = twists[2:-2].mean() * edges / LENGTH
    s, least = (np.arange(edges) + 0.5) * LENGTH / edges, cosine.min()
    dip = np.where(1.0 - cosine > 0.2 * (1.0 - least), 1.0 - cosine, 0.0)
    s -= (dip * s).sum() / dip.sum()
    width = 2.0 * ALPHA / (BETA * m) * math.sqrt((1.0 + least) / (1.0 - least))
    error = np.abs((cosine - least) / (1.0 - least) - np.tanh(s / width) ** 2).max()
    return {"error": float(error), "twist": float(m), "angle": math.degrees(math.acos(least))}


if __name__ == "__main__":
    for ratio in (1.0, 0.5):
        for edges in (20, 40, 80):
            print(f"ring, GJ/EI = {ratio}, {edges} edges: buckles at {buckles_at(edges, ratio):.4f} of the critical turn")
    for edges in (40, 60, 80, 120, 180):
        print(f"helix, {edges} edges:", helix(edges))
