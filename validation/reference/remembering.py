"""What sections of rods remember: a Maxwell element's elastic strains, bending that has flowed, and that of friction which sticks.

Written from the equations of docs/theory/rods.md. Within a step strains change at constant rate from where it begins to where something is
evaluated, the time t [s] later. The numbers stand in the state behind the velocities: of every rope first the plastic bending of its
joints (2 each), then the elastic strains of its creep (3 each), then the elastic bending of its friction (2 each), all zero as the scene
begins.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from .laws import taken


@dataclass(frozen=True, eq=False)
class Memory:
    """Joints that remember, where in the state they do (from the first number remembered), and positions in θ."""

    count: int  # numbers in all
    plastic: np.ndarray  # (P,) joints
    plastic_place: np.ndarray  # (P, 2)
    yields: np.ndarray  # (P, 2) of the yield curvature and the time of the flow
    creep: np.ndarray  # (C,) joints
    creep_place: np.ndarray  # (C, 3)
    relaxes: np.ndarray  # (C, 4) of the fractions of the three strains and the time
    friction: np.ndarray  # (F,) joints
    friction_place: np.ndarray  # (F, 2)
    rubs: np.ndarray  # (F, 2) of the moment and the curvature


def build(ropes, joints, where):
    """Memory of the joints `joints[r]` (ranges) of ropes that twist; `where[r]`: positions in θ by name."""
    widths = {"plastic_place": 2, "yields": 2, "creep_place": 3, "relaxes": 4, "friction_place": 2, "rubs": 2}
    out = {key: [] for key in ("plastic", "creep", "friction", *widths)}
    count = 0

    def places(of, numbers):
        nonlocal count
        first, count = count, count + numbers * len(of)
        return list(np.arange(first, count).reshape(-1, numbers))

    for rope, of, p in zip(ropes, joints, where, strict=True):
        if "plasticity" in rope:
            out["plastic"] += list(of)
            out["plastic_place"] += places(of, 2)
            out["yields"] += [[p["yield_curvature"], p["plastic_time"]]] * len(of)
        if "creep" in rope:
            bend, twist = p["creep_fraction"], p.get("creep_twist_fraction", p["creep_fraction"])
            out["creep"] += list(of)
            out["creep_place"] += places(of, 3)
            out["relaxes"] += [[bend, bend, twist, p["creep_time"]]] * len(of)
        if "bend_friction" in rope:
            out["friction"] += list(of)
            out["friction_place"] += places(of, 2)
            out["rubs"] += [[p["friction_moment"], p["friction_curvature"]]] * len(of)
    shaped = lambda key, v: v.reshape(-1, widths[key]) if key in widths else v
    return Memory(count, **{key: shaped(key, np.array(v, dtype=int)) for key, v in out.items()})


def relaxed(e, change, t, tau):
    """e(t) of ė = rate - e/τ with rate = change/t: what was there decays, what comes is rate τ (1 - exp(-t/τ))."""
    return e * jnp.exp(-t / tau) - change * (tau / t) * jnp.expm1(-t / tau)


def dragged(e, change, limit):
    """The elastic part (2,) [-] of Dahl's friction after bending by `change` (2,) on a line: e' = n - e/limit along it, n its direction.

    e comes from where it was towards limit·n, by exp(-way/limit) of what is left, the way's length rounded off at its turn as the law says. A way
    of nothing leaves slopes of sticking.
    """
    square = _dot(change, change)
    moves = square > (1e-9 * limit) ** 2
    rounded = 1e-11 * limit
    way = jnp.sqrt(jnp.where(moves, square, 1.0) + rounded**2) - rounded
    towards = limit * change / way
    return jnp.where(moves, towards + (e - towards) * jnp.exp(-way / limit), e + change)


def flow(begin, change, t, tau, limit):
    """Elastic part x (2,) [-] of bending after t [s], from `begin`; beyond |x| = limit it flows: ẋ = k̇ - (|x| - limit)/τ x/|x|.

    The step has three parts, each may be empty: outside the circle, inside, outside again. Outside, the size is that of the law at the
    rate along x where the part began, the direction that of the strain as if nothing flowed; inside, x moves with the strain.
    """
    stays, inward = _outside(begin, change, t, tau, limit)
    enters = (inward > 0.0) & (inward < 1.0)
    s = jnp.where(enters, inward, 0.0)
    at = jnp.where(enters, _sized(jnp.where(enters, begin + s * change, jnp.array([1.0, 0.0])), limit), begin)
    outward = jnp.minimum(_leaves(at, change, limit), 1.0 - s)
    edge, rest = at + outward * change, 1.0 - s - outward
    # what is not used must be finite, so that its derivatives are
    again = rest > 0.0
    rim = jnp.where(again, edge, jnp.array([1.0, 0.0]) * limit)
    moved = jnp.where(again, edge + rest * change, rim)
    excess = -_dot(change, rim) / limit * (tau / t) * jnp.expm1(-rest * t / tau)
    last = jnp.where(again, _sized(moved, limit + excess), edge)
    return jnp.where(inward >= 1.0, stays, last)


def _outside(begin, change, t, tau, limit):
    """(x at the end if it stays outside, the fraction of the step after which it is inside: 0 if it begins there, 2 if never)."""
    starts = _dot(begin, begin) > limit**2
    safe = jnp.where(starts, begin, jnp.array([2.0, 0.0]) * limit)
    size = jnp.sqrt(_dot(safe, safe))
    steady, excess = _dot(change, safe) / size * tau / t, size - limit
    back = starts & (steady < 0.0)
    # d = steady + (excess - steady) exp(-s t/τ) vanishes at
    s = tau / t * jnp.log1p(-excess / jnp.where(back, steady, -1.0))
    inward = jnp.where(back & (s < 1.0), s, jnp.where(starts, 2.0, 0.0))
    stays = inward >= 1.0
    d = jnp.where(stays, steady + (excess - steady) * jnp.exp(-t / tau), 0.0)
    end = jnp.where(stays, safe + change, safe)
    return _sized(end, limit + d), inward


def _leaves(x, change, limit):
    """The fraction of the step after which x + s change, inside the circle or on it, leaves it."""
    square = _dot(change, change)
    moves = square > 0.0
    c2 = jnp.where(moves, square, 1.0)
    b = _dot(x, change)
    radicand = b**2 + c2 * (limit**2 - _dot(x, x))
    positive = moves & (radicand > 0.0)
    s = (jnp.sqrt(jnp.where(positive, radicand, 1.0)) - b) / c2
    return jnp.where(moves, jnp.where(positive, jnp.maximum(s, 0.0), 0.0), jnp.inf)


def _dot(a, b):
    return jnp.sum(a * b)


def _sized(x, size):
    return x * (size / jnp.sqrt(_dot(x, x)))


def bending(memory, z, limits, times, k, past, t):
    """Elastic parts (P, 2) of the bending of plastic joints; k, past (P, 2) bending without that at rest, now and at the beginning."""
    begin = past - taken(z, memory.plastic_place)
    return jax.vmap(flow, (0, 0, None, 0, 0))(begin, k - past, t, times, limits)


def strains(memory, z, theta, now, past, t):
    """The Maxwell elements' elastic strains (C, 3)."""
    tau = taken(theta, memory.relaxes[:, 3])[:, None]
    change = taken(now, memory.creep) - taken(past, memory.creep)
    return relaxed(taken(z, memory.creep_place), change, t, tau)


def sticking(memory, z, theta, lengths, now, past):
    """Elastic bending (F, 2) of joints with friction towards the material axes, and what it tends to (F, 1); lengths (J,), strains (J, 3)."""
    limit = taken(theta, memory.rubs[:, 1]) * taken(lengths, memory.friction)
    change = (taken(now, memory.friction) - taken(past, memory.friction))[:, :2]
    return jax.vmap(dragged)(taken(z, memory.friction_place), change, limit), limit[:, None]
