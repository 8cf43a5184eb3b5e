"""The stretch of a rope between two seen points: what a rod of the right length does there at rest."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from .._pliant import InputError, Model, NumericsError, loads
from .camera import Array, numbers, positive

# Stretching stiffnesses of the rod, EA ℓ²/EI, one after the other: Newton's method finds a soft rod from any guess, and a stiff one, which
# keeps its length, from the one before.
STIFFENING = (1e3, 1e4, 1e5)
# A stretch that is longer than its chord by less than this part of it is straight.
STRAIGHT = 1e-4
# Weight of a rope that has none, relative to EI/ℓ³, towards the side of the guess: a rope that may turn about its chord freely has no
# equilibrium that Newton's method can find. It moves nodes by less than 1e-4 ℓ.
LIGHTEST = 1e-2
# Halvings of the interval in which the size of a curve's end derivatives is sought.
HALVINGS = 20
# Samples of a curve per node, of which its length is summed.
SAMPLES = 6


def hidden_stretch(
    start: ArrayLike,
    start_direction: ArrayLike,
    end: ArrayLike,
    end_direction: ArrayLike,
    length: float,
    nodes: int = 17,
    *,
    load: ArrayLike = (0.0, 0.0, 0.0),
    aside: ArrayLike | None = None,
) -> tuple[Array, bool]:
    """Nodes (nodes, 3) [m] of a rope at rest of `length` [m] from `start` to `end` (3,) [m], the ends included.

    start_direction, end_direction (3,): the rope's direction there, from start towards end; of any size.
    load (3,): weight over bending stiffness, ρA g/EI [1/m³]; zero is the elastica, the curve of least ∫ κ² ds. A rope on a table is
    nearest to that: the table carries its weight and friction keeps what is not known.

    aside (3,): the side to which it is believed to bend, of any size, where ends that look at each other leave that open.

    Equilibrium of a pliant rope with both ends clamped (`Model.equilibrium`). The second value says whether it was found; if
    not, the nodes are those of a smooth curve of that length. Equilibria with these ends are many where the stretch is long (a loop may go
    either way): the one nearest to the smooth curve of least energy is taken. InputError if the ends are further apart than the length.

    Bending: Bergou et al., "Discrete elastic rods", 2008, as in docs/theory/rods.md.
    """
    a, b = numbers("start", start, (3,)), numbers("end", end, (3,))
    ta, tb = (_unit(n, d) for n, d in (("start_direction", start_direction), ("end_direction", end_direction)))
    length, weight = positive("length", length, "m"), numbers("load", load, (3,))
    aside = None if aside is None else numbers("aside", aside, (3,))
    if nodes < 6:
        raise InputError(f"nodes is {nodes}, but a hidden stretch needs at least 6")
    chord = float(np.linalg.norm(b - a))
    if chord > length * (1.0 + STRAIGHT):
        text = "the length is too small, or these ends do not belong together"
        raise InputError(f"the ends of the hidden stretch are {chord:.4g} m apart, but it is {length:.4g} m long: {text}")
    s = np.linspace(0.0, 1.0, nodes)[:, None]
    if length < chord * (1.0 + STRAIGHT):
        return a + s * (b - a), True
    guesses = _guesses(a, ta, b, tb, length, nodes, weight, aside)
    model = _rope(nodes)
    for guess in guesses:
        pull = weight
        if np.linalg.norm(weight) * length**3 < LIGHTEST:
            side = guess.mean(axis=0) - 0.5 * (a + b)
            pull = LIGHTEST / length**3 * side / max(1e-12, float(np.linalg.norm(side)))
        turn, load_1 = _to_down(pull), max(1e-6 * LIGHTEST, float(np.linalg.norm(pull)) * length**3)
        u = np.concatenate([np.zeros(3), turn @ ta, turn @ (b - a) / length, -turn @ tb])
        # the clamps' auxiliary nodes lie an edge beyond the ends
        edge = length / (nodes - 1)
        q = (np.vstack([a - edge * ta, guess, b + edge * tb]) - a) @ turn.T / length
        try:
            for stretch in STIFFENING:
                q = model.equilibrium(u, model.theta_with({"rope.linear_density": load_1, "rope.stretch_stiffness": stretch}), q).q
        except NumericsError:
            continue
        return a + length * q.reshape(-1, 3)[1:-1] @ turn, True
    return guesses[0], False


def _guesses(a: Array, ta: Array, b: Array, tb: Array, length: float, nodes: int, weight: Array, aside: Array | None) -> list[Array]:
    """Curves of the right ends and length, that of the least energy first.

    Cubics with long end derivatives suit ends that turn towards each other; a bulge suits ends that look at each other, which buckle
    towards the weight, `aside`, or else to any side.
    """
    curves = [_sized(lambda size: _cubic(a, ta, b, tb, size, nodes), length, nodes)]
    chord = (b - a) / max(1e-12, float(np.linalg.norm(b - a)))
    sides = [w for w in (aside, weight) if w is not None and np.linalg.norm(np.cross(chord, w)) > 0.0]
    sides += [ta - tb, np.eye(3)[np.argmin(np.abs(chord))]]
    natural = float(np.linalg.norm(b - a))
    for side in sides:
        across = side - chord * (chord @ side)
        if np.linalg.norm(across) < 1e-9 * max(1e-12, float(np.linalg.norm(side))):
            continue
        across = across / np.linalg.norm(across)
        s = np.linspace(0.0, 1.0, SAMPLES * nodes)[:, None]
        base, bulge = _cubic(a, ta, b, tb, natural, nodes), 16.0 * s**2 * (1.0 - s) ** 2
        curves.append(_sized(lambda size, base=base, bulge=bulge, way=across: base + size * bulge * way, length, nodes))
    curves = [c for c in curves if c is not None] or [a + np.linspace(0.0, 1.0, nodes)[:, None] * (b - a)]
    return sorted(curves, key=lambda c: _energy(c, ta, tb, length, weight))


def _energy(nodes: Array, ta: Array, tb: Array, length: float, weight: Array) -> float:
    """½ ∫ κ² ds minus the work of the weight, both over EI."""
    edges = np.diff(nodes, axis=0)
    way = np.vstack([ta, edges / np.maximum(np.linalg.norm(edges, axis=1, keepdims=True), 1e-12), tb])
    turns = np.linalg.norm(np.diff(way, axis=0), axis=1)
    edge = length / (len(nodes) - 1)
    return float(0.5 * (turns**2).sum() / edge - edge * (nodes @ weight).sum())


@lru_cache(maxsize=16)
def _rope(nodes: int) -> Model:
    """A rope of unit length and bending stiffness, along x, with both ends clamped; gravity 1 along −z."""
    return loads(
        f"""schema_version = 1
[time]
step = 0.01
[gravity]
magnitude = 1.0
[[rope]]
name = "rope"
nodes = {nodes}
length = 1.0
linear_density = 1.0
stretch_stiffness = {STIFFENING[-1]}
bend_stiffness = 1.0
initial = {{ shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }}
[[gripper]]
name = "start"
rope = "rope"
end = "first"
[[gripper]]
name = "end"
rope = "rope"
end = "last"
""",
        "the hidden stretch",
    )


def _to_down(weight: Array) -> Array:
    """A rotation (3, 3) that turns the direction of the weight to −z."""
    size = float(np.linalg.norm(weight))
    if size == 0.0:
        return np.eye(3)
    z = -weight / size
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _cubic(a: Array, ta: Array, b: Array, tb: Array, size: float, nodes: int) -> Array:
    """Samples of the cubic with these ends, whose end derivatives are of a size [m]."""
    s = np.linspace(0.0, 1.0, SAMPLES * nodes)[:, None]
    ends = (1.0 + 2.0 * s) * (1.0 - s) ** 2 * a + s**2 * (3.0 - 2.0 * s) * b
    return ends + size * (s * (1.0 - s) ** 2 * ta + s**2 * (s - 1.0) * tb)


def _sized(curve: Callable[[float], Array], length: float, nodes: int) -> Array | None:
    """Equally spaced nodes of the curve whose size gives it the length; None if no size from 0 to 8 lengths does."""

    def along(points: Array) -> Array:
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))

    low, high = 0.0, 8.0 * length
    if along(curve(low))[-1] > length:
        return None
    for _ in range(HALVINGS):
        size = 0.5 * (low + high)
        low, high = (low, size) if along(curve(size))[-1] > length else (size, high)
    points = curve(low)
    at = along(points)
    return np.stack([np.interp(np.linspace(0.0, at[-1], nodes), at, c) for c in points.T], axis=1)


def _unit(name: str, direction: ArrayLike) -> Array:
    way = numbers(name, direction, (3,))
    size = float(np.linalg.norm(way))
    if size == 0.0:
        raise InputError(f"{name} is zero, but must point along the rope")
    return way / size
