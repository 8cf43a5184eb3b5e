"""Rods that twist: material axes carried along with their edges, strains of joints, energies and clamps.

Written from Bergou et al. (Discrete Elastic Rods, 2008; Discrete Viscous Threads, 2010) with curvatures towards the axes half way
between both edges (docs/theory/rods.md). An edge has a twist θ [rad] among the coordinates and a reference axis d, a unit vector across it, in
the state's third part z = [what sections remember, d of every edge, m of every joint], m the twist between neighbours' reference axes. A
*change* of a state carries the axes along and turns the material by one number per edge.
"""

import itertools
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from . import remembering
from .laws import taken

PERMUTATION = np.array([[[(i - j) * (j - k) * (k - i) / 2.0 for k in range(3)] for j in range(3)] for i in range(3)])
SECTION = ("length", "bend_stiffness", "bend_stiffness_2", "twist_stiffness", "section_roll", "rest_curvature_0",
           "rest_curvature_1", "rest_twist", "bend_damping", "twist_damping")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Rods:
    """Edges that twist and the joints between them; positions in θ are per element."""

    edges: np.ndarray  # (E, 2) nodes
    inertia: np.ndarray  # (E,) of ρI_p [kg·m]
    length: np.ndarray  # (E,) of the rod's length [m]
    fraction: np.ndarray  # (E,) rest length / rod length
    joints: np.ndarray  # (J, 2) edges
    section: np.ndarray  # (J, len(SECTION))
    own: np.ndarray  # (J, 3) of what each joint adds to the rest curvatures, and of its stiffness as a multiple of the rod's
    joint_fraction: np.ndarray  # (J,)
    rest: np.ndarray  # (J, 3) strains without forces, beside those of θ
    stiffens: np.ndarray  # (S, 2) joints whose bending stiffens, and where in θ by what coefficient
    twist0: np.ndarray  # (E,) as the scene begins
    frames0: np.ndarray  # (3 E + J,)
    memory: remembering.Memory


@dataclass(frozen=True, eq=False)
class Held:
    """An edge whose axes a gripper holds: its number, nodes, and [direction, first material axis, place] as the scene begins."""

    edge: int
    nodes: tuple
    start: np.ndarray


def dots(a, b):
    """a·b along the last axis, which is kept with one number."""
    return jnp.sum(a * b, axis=-1, keepdims=True)


def cross(a, b):
    """a × b along the last axis (as a contraction: it compiles several times faster than `jnp.cross`)."""
    return jnp.einsum("...j,...k,jki->...i", a, b, PERMUTATION)


def carried(a, b, d):
    """The vector d, across the unit vector a, after the smallest rotation that takes a into the unit vector b."""
    return d - (a + b) * (dots(b, d) / (1.0 + dots(a, b)))


def angle(u, v, axis):
    """The angle [rad] from u to v about the unit vector axis, which both are normal to."""
    return jnp.arctan2(dots(cross(u, v), axis), dots(u, v))[..., 0]


def unit(a):
    """a/|a|."""
    return a / jnp.sqrt(dots(a, a))


def directions(edges, x):
    """Unit tangents (E, 3) of edges at nodes x (n, 3)."""
    ends = taken(jnp.asarray(x), edges.T)
    return unit(ends[1] - ends[0])


def turned(t, d, twist):
    """First material axis: d turned by `twist` about t."""
    twist = jnp.asarray(twist)[..., None]
    return jnp.cos(twist) * d + jnp.sin(twist) * cross(t, d)


def split_frames(rods, frames):
    """(d (E, 3), m (J,))."""
    count = 3 * len(rods.edges)
    return frames[:count].reshape(-1, 3), frames[count:]


def reference_twist(rods, t, d, near):
    """m (J,): the twist [rad] of each joint's second reference axis against the first one's, with the whole turns of `near`."""
    (t1, t2), (d1, d2) = taken(t, rods.joints.T), taken(d, rods.joints.T)
    principal = angle(carried(t1, t2, d1), d2, t2)
    return principal + 2.0 * jnp.pi * jax.lax.stop_gradient(jnp.round((near - principal) / (2.0 * jnp.pi)))


def carry_along(rods, before, frames, t):
    """z's part of rods at the edges' directions t (E, 3), carried along from those `before`."""
    d, m = split_frames(rods, frames)
    d = carried(before, t, d)
    return jnp.concatenate([d.ravel(), reference_twist(rods, t, d, m)])


def carry(rods, start, frames, end):
    """z's part of rods at nodes `end` (n, 3), carried along from `start`."""
    return carry_along(rods, directions(rods.edges, start), frames, directions(rods.edges, end))


def strains(rods, t, twist, frames):
    """(J, 3): curvatures κ₁, κ₂ [-] towards the material axes half way between the joint's edges, and the twist τ [rad].

    The curvature vector 2 (t₂ − t₁)/|t₁ + t₂| is a rope's (`laws.curvature`).
    """
    d, m = split_frames(rods, frames)
    (t1, t2), one = taken(t, rods.joints.T), rods.joints[:, 0]
    first = turned(t1, taken(d, one), taken(twist, one))
    tau = taken(twist, rods.joints[:, 1]) - taken(twist, one) + m
    total = t1 + t2
    middle = unit(total)
    curvature = 2.0 * (t2 - t1) / jnp.sqrt(dots(total, total))
    half = turned(middle, carried(t1, middle, first), 0.5 * tau)
    return jnp.concatenate([dots(curvature, half), dots(curvature, cross(middle, half)), tau[:, None]], axis=1)


def _section(rods, theta):
    p = dict(zip(SECTION, taken(theta, rods.section.T), strict=True))
    return p, taken(theta, rods.own.T), rods.joint_fraction * p["length"]


def principal(rods, strain, theta):
    """(J, 3): what is left of the strains in the section's own axes, without what they are at rest."""
    p, own, length = _section(rods, theta)
    excess = strain - rods.rest
    c, s = jnp.cos(p["section_roll"]), jnp.sin(p["section_roll"])
    k1 = c * excess[:, 0] + s * excess[:, 1] - (p["rest_curvature_0"] + own[0]) * length
    k2 = c * excess[:, 1] - s * excess[:, 0] - (p["rest_curvature_1"] + own[1]) * length
    return jnp.stack([k1, k2, excess[:, 2] - p["rest_twist"] * length], axis=1)


def energy(rods, k, theta):
    """Σ [s EI₁ k₁² + s EI₂ k₂² + GJ k₃²]/(2 l) [J] of strains k (J, 3) in the section's own axes, s the joint's factor."""
    p, own, length = _section(rods, theta)
    sums = own[2] * (p["bend_stiffness"] * k[:, 0] ** 2 + p["bend_stiffness_2"] * k[:, 1] ** 2)
    return jnp.sum(0.5 * (sums + p["twist_stiffness"] * k[:, 2] ** 2) / length)


def beyond(rods, k, theta):
    """Σ c s (EI₁ k₁² + EI₂ k₂²) (k₁² + k₂²)/(4 l³) [J] of the joints that stiffen; as in `energy`."""
    joints, where = rods.stiffens.T
    p, own, length = _section(rods, theta)
    one, two = (own[2] * p[key] / length**3 for key in ("bend_stiffness", "bend_stiffness_2"))
    squares = (k**2).T
    each = (one * squares[0] + two * squares[1]) * (squares[0] + squares[1])
    return 0.25 * jnp.sum(taken(theta, where) * taken(each, joints))


def moments(rods, strain, theta, begin):
    """Moments (J, 3) [N·m] against the strains: of the elastic section, of which bending may flow, Maxwell elements and friction beside it.

    `begin` = (numbers remembered, strains (J, 3) where the step begins, time since then [s]).
    """
    k, turn_back = jax.vjp(lambda strain: principal(rods, strain, theta), strain)
    elastic = elastic_parts(rods, strain, theta, begin)
    total = jax.grad(energy, 1)(rods, elastic, theta)
    if len(rods.stiffens):
        total += jax.grad(beyond, 1)(rods, elastic, theta)
    memory = rods.memory
    if len(memory.creep):
        z, past, t = begin
        e = _placed(memory.creep, remembering.strains(memory, z, theta, strain, past, t), k)
        fraction = _placed(memory.creep, taken(theta, memory.relaxes[:, :3]), k)
        _, turned_e = jax.jvp(lambda strain: principal(rods, strain, theta), (strain,), (e,))
        total += fraction * jax.grad(energy, 1)(rods, turned_e, theta)
    out = turn_back(total)[0]
    if len(memory.friction):
        e, limit = _friction(rods, strain, theta, begin)
        moment = taken(theta, memory.rubs[:, :1]) * e / limit
        out += _placed(memory.friction, jnp.pad(moment, ((0, 0), (0, 1))), k)
    return out


def _friction(rods, strain, theta, begin):
    z, past, _ = begin
    return remembering.sticking(rods.memory, z, theta, _section(rods, theta)[2], strain, past)


def elastic_parts(rods, strain, theta, begin):
    """(J, 3): the strains in the section's own axes, of bending that may flow the elastic part; `begin` as in `moments`."""
    k, memory = principal(rods, strain, theta), rods.memory
    if not len(memory.plastic):
        return k
    z, past, t = begin
    now, past = (taken(a, memory.plastic)[:, :2] for a in (k, principal(rods, past, theta)))
    limit, time = taken(theta, memory.yields.T)
    limit *= taken(_section(rods, theta)[2], memory.plastic)
    flowed = remembering.bending(memory, z, limit, time, now, past, t) - now
    return k + _placed(memory.plastic, jnp.pad(flowed, ((0, 0), (0, 1))), k)


def remembered(rods, strain, theta, begin):
    """What sections remember at the end of a step, whose strains are these."""
    (z, past, t), memory = begin, rods.memory
    if len(memory.plastic):
        plastic = principal(rods, strain, theta) - elastic_parts(rods, strain, theta, begin)
        z = z.at[memory.plastic_place].set(taken(plastic, memory.plastic)[:, :2])
    if len(memory.creep):
        z = z.at[memory.creep_place].set(remembering.strains(memory, begin[0], theta, strain, past, t))
    if len(memory.friction):
        z = z.at[memory.friction_place].set(_friction(rods, strain, theta, begin)[0])
    return z


def _placed(joints, values, like):
    """Values of some joints among those of all."""
    return jnp.zeros_like(like).at[joints].set(values)


def dissipation(rods, rate, theta):
    """Σ [c_b (κ̇₁² + κ̇₂²) + c_t τ̇²]/(2 l) [W]."""
    p = dict(zip(SECTION, taken(theta, rods.section.T), strict=True))
    length = rods.joint_fraction * p["length"]
    sums = p["bend_damping"] * (rate[:, 0] ** 2 + rate[:, 1] ** 2) + p["twist_damping"] * rate[:, 2] ** 2
    return jnp.sum(0.5 * sums / length)


def force(rods, q, v, theta, frames, begin):
    """Forces [N] on nodes and moments [N·m] on twists (nq,) at q, v (nq,); `frames` belong to q, `begin` as in `moments`.

    The virtual displacements are those that carry the axes along from q.
    """

    x, _ = _split(rods, q)
    here = directions(rods.edges, x)

    def strain(dq):
        moved, twist = _split(rods, q + dq)
        t = directions(rods.edges, moved)
        return strains(rods, t, twist, carry_along(rods, here, frames, t))

    zero = jnp.zeros_like(q)
    value, rate_of = jax.linearize(strain, zero)
    moment = moments(rods, value, theta, begin) + jax.grad(dissipation, 1)(rods, rate_of(v), theta)
    return -jax.linear_transpose(rate_of, zero)(moment)[0]


def _split(rods, q):
    count = len(q) - len(rods.edges)
    return q[:count].reshape(-1, 3), q[count:]


def inertias(rods, theta):
    """Moments of inertia of the edges about themselves (E,) [kg·m²]."""
    return taken(theta, rods.inertia) * taken(theta, rods.length) * rods.fraction


def commanded_turns(model, x, twist, frames, u, theta):
    """Rates (E,) [rad/s] of the twists that grippers hold, over the full step; zero at the others.

    Held by a director D: at the step's end the first axis is D's part across the edge, turned by φ; without one, the axis the scene
    begins with, by the smallest rotation. φ = roll + a·(t⁺ − t₀) + b·(x⁺ − x₀), x₀ the first node's place, or the rope's end's where that
    is clamped, x⁺ where its control takes it (without the offset). An angular velocity ω turns by 2 atan(h ω·t/2).
    """
    rods, h, out = model.rods, model.h, jnp.zeros(len(model.rods.edges))
    t = directions(rods.edges, x)
    d, _ = split_frames(rods, frames)
    for g in model.grippers:
        inputs = u[g.inputs]
        for held in g.held:
            now = t[held.edge]
            if g.mode == "velocity":
                spin = 0.0 if g.ghost is None else 2.0 / h * jnp.arctan(0.5 * h * dots(inputs[3:6], now)[0])
                out = out.at[held.edge].set(spin)
                continue
            if g.ghost is None:
                place = [list(g.nodes).index(node) for node in held.nodes]
                ends = [inputs[3 * k :][:3] for k in place]
                end, at = unit(ends[1] - ends[0]), ends[0]
                wish = carried(held.start[0], end, held.start[1])
            else:
                end = unit(inputs[3:6]) * (-1.0 if held.nodes[1] == g.ghost else 1.0)
                wish = unit(inputs[6:9] - end * dots(end, inputs[6:9]))
                at = inputs[:3]
            roll, a, b = theta[g.roll[0]], theta[g.roll[1:4]], theta[g.roll[4:]]
            phi = roll + dots(a, end - held.start[0])[0] + dots(b, at - held.start[2])[0]
            wish = turned(end, wish, phi)
            axis = carried(now, end, turned(now, d[held.edge], twist[held.edge]))
            out = out.at[held.edge].set(angle(axis, wish, end) / h)
    return out


def change_of_twists(rods, x, twist, frames, at):
    """How far (E,) [rad] the material has turned about its edges from the configuration `at` = (x, twist, frames), carried along."""
    x0, twist0, frames0 = at
    t0, t = directions(rods.edges, x0), directions(rods.edges, x)
    (d0, _), (d, _) = split_frames(rods, frames0), split_frames(rods, frames)
    return twist - twist0 + angle(carried(t0, t, d0), d, t)


# ---- From a scene -------------------------------------------------------------------------------


def build(ropes, where, mesh, q0, params):
    """Rods of all ropes with a twist table; None without any. `params[r]`: positions in θ of the table's entries."""
    out = {k: [] for k in ("edges", "inertia", "length", "fraction", "joints", "section", "own", "joint_fraction")}
    start = {"axes": [], "twist0": []}
    rest_initial, remember, stiffens = [], [], []
    for r, rope in enumerate(ropes):
        if "twist" not in rope:
            continue
        twist, values = rope["twist"], where[r] | params[r]
        real, fractions = mesh["rope_nodes"][r], list(rope["fractions"])
        first, last = ((r, end) in mesh["ghosts"] for end in ("first", "last"))
        chain = [*[real[0] - 1] * first, *real, *[real[-1] + 1] * last]
        lengths = [*fractions[:1] * first, *fractions, *fractions[-1:] * last]
        base = len(out["edges"])
        out["edges"] += list(itertools.pairwise(chain))
        out["fraction"] += lengths
        out["inertia"] += [values["twist_inertia"]] * len(lengths)
        out["length"] += [values["length"]] * len(lengths)
        inside = [*[0.0] * first, *fractions, *[0.0] * last]  # of a clamped end's joint only the rod's half counts
        halves = [0.5 * (a + b) for a, b in itertools.pairwise(inside)]
        remember.append((rope, range(len(out["joints"]), len(out["joints"]) + len(halves)), values))
        if "stiffening" in rope:
            stiffens += [(j, values["stiffening"]) for j in remember[-1][1]]
        out["joints"] += [(base + k, base + k + 1) for k in range(len(halves))]
        out["joint_fraction"] += halves
        out["section"] += [[values[key] for key in SECTION]] * len(halves)
        out["own"] += list(values["joints"])
        rest_initial += [twist.get("rest", "straight") == "initial"] * len(halves)
        t = np.diff(q0[chain], axis=0)
        t /= np.linalg.norm(t, axis=1, keepdims=True)
        if "director" not in twist:
            raise ValueError("the reference wants a director")
        d = np.array(twist["director"], dtype=float)
        d -= t[0] * (t[0] @ d)
        start["axes"].append(d / np.linalg.norm(d))
        for a, b in itertools.pairwise(t):
            start["axes"].append(np.asarray(carried(a, b, start["axes"][-1])))
        along = np.concatenate([[0.0], np.cumsum(halves)])
        start["twist0"] += list(along / along[-1] * twist.get("initial", 0.0))
    if not out["edges"]:
        return None
    integer = {k: np.array(out[k], dtype=int) for k in ("edges", "inertia", "length", "joints", "section", "own")}
    real = {k: np.array(out[k]) for k in ("fraction", "joint_fraction")}
    axes, twist0 = np.array(start["axes"]), np.array(start["twist0"])
    count = len(out["joints"])
    memory = remembering.build(*zip(*remember, strict=True))
    stiffens = np.array(stiffens, dtype=int).reshape(-1, 2)
    start = {"rest": np.zeros((count, 3)), "twist0": twist0, "frames0": np.zeros(0)}
    rods = Rods(**integer, **real, **start, stiffens=stiffens, memory=memory)
    m = reference_twist(rods, directions(rods.edges, q0), axes, jnp.zeros(count))
    frames = np.concatenate([axes.ravel(), m])
    rest = np.where(np.array(rest_initial)[:, None], strains(rods, directions(rods.edges, q0), twist0, frames), 0.0)
    return replace(rods, rest=rest, frames0=frames)


def held_edges(rods, q0, nodes, end=None):
    """Edges of which a gripper's nodes are both ends; `end`: the rope's clamped end."""
    if rods is None:
        return []
    t = np.asarray(directions(rods.edges, q0))
    d = rods.frames0[: 3 * len(t)].reshape(-1, 3)
    axes = np.asarray(turned(t, d, rods.twist0))
    pairs = enumerate(map(tuple, rods.edges))
    held = [(k, ends) for k, ends in pairs if set(ends) <= set(nodes)]
    return [Held(k, ends, np.array([t[k], axes[k], q0[ends[0] if end is None else end]])) for k, ends in held]
