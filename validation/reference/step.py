"""One step as a root, for euler, midpoint and sdirk2, and the rollout.

Stage of length h, unknown y = v⁺ of the free rows of nodes and twists (driven ones follow v_cmd exactly):
    r = m (v⁺ - v)/h - Σ f(q̄, v̄, z̄; θ) - p(q⁺, v⁺)/h = 0   [N, N·m]
    q̄ = q + h (a0 v + a1 v⁺),  v̄ = b0 v + b1 v⁺,  q⁺ = q + h (d0 v + d1 v⁺)
z̄, z⁺: the axes of rods carried from q to q̄ and to q⁺. What sections of rods remember enters as it is when the step begins, with the
strains there, and moves on at the step's end. Under sdirk2 what lands is taken by two half steps by Euler (`landing`). Solved for
(h/m) r by damped Newton steps (`warm`), so that the tolerance is one on velocities; derivatives are those of the implicit function theorem.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from . import forces, landing, rods, warm
from .laws import taken

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
EULER = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
MIDPOINT_FREE = (0.25, 0.25, 0.5, 0.5, 0.5, 0.5)
MIDPOINT_DRIVEN = (0.0, 0.5, 0.0, 1.0, 0.0, 1.0)


class Scheme(NamedTuple):
    """An integrator without contact, as numbers: one compiled step serves all three."""

    stages: int  # 1 or 2
    coefficients: np.ndarray  # (6, nq): a0, a1, b0, b1, d0, d1
    length: float  # of a stage [s]
    elapsed: np.ndarray  # (2,) from the beginning of the step to where the forces of a stage are evaluated [s]


def scheme(model):
    """The scheme of the model's integrator."""
    h, midpoint = model.h, model.integrator == "midpoint"
    free, driven = (MIDPOINT_FREE, MIDPOINT_DRIVEN) if midpoint else (EULER, EULER)
    numbers = np.where(model.driven_rows, np.array(driven)[:, None], np.array(free)[:, None])
    if model.integrator == "sdirk2":
        return Scheme(2, numbers, GAMMA * h, np.array([GAMMA * h, h]))
    return Scheme(1, numbers, h, np.array([0.5 * h if midpoint else h, h]))


def cayley(a):
    """cay(a) = I + 4/(4 + |a|²) ([a]x + ½ [a]x²), a rotation matrix."""
    zero = jnp.zeros(())
    skew = jnp.array([[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]])
    return jnp.eye(3) + 4.0 / (4.0 + a @ a) * (skew + 0.5 * skew @ skew)


def commanded_velocity(model, q, u, theta):
    """v_cmd (n_nodes, 3) [m/s] over the full step h; zero at free nodes."""
    h, out = model.h, jnp.zeros((model.n_nodes, 3))
    for g in model.grippers:
        inputs, end = u[g.inputs], g.nodes[0]
        if g.mode == "prescribed":
            count = len(g.nodes)
            targets = inputs[: 3 * count].reshape(count, 3) + theta[g.offset]
            out = out.at[g.nodes].set((targets - q[g.nodes]) / h)
            if g.ghost is not None:
                axis = inputs[3:6] / jnp.sqrt(inputs[3:6] @ inputs[3:6])
                rest = g.fraction * theta[model.ropes[g.rope]["length"]]
                out = out.at[g.ghost].set((targets[0] - rest * axis - q[g.ghost]) / h)
        else:
            out = out.at[g.nodes].set(inputs[:3])
            if g.ghost is not None:
                turn = cayley(h * inputs[3:]) - jnp.eye(3)
                out = out.at[g.ghost].set(inputs[:3] + turn @ (q[g.ghost] - q[end]) / h)
    return out


def command(model, q, z, u, theta):
    """v_cmd (nq,) [m/s, rad/s] of all rows; zero at free ones."""
    x = nodes_of(model, q)
    nodes = commanded_velocity(model, x, u, theta).ravel()
    if model.rods is None:
        return nodes
    frames = z[model.n_memory :]
    return jnp.concatenate([nodes, rods.commanded_turns(model, x, q[3 * model.n_nodes :], frames, u, theta)])


def nodes_of(model, q):
    """The nodes' part of q or v (nq,), (n_nodes, 3)."""
    return q[: 3 * model.n_nodes].reshape(-1, 3)


def carry(model, start, z, end):
    """z with the axes carried along from q = `start` to `end` (nq,)."""
    if model.rods is None:
        return z
    memory, frames = jnp.split(z, [model.n_memory])
    return jnp.concatenate([memory, rods.carry(model.rods, nodes_of(model, start), frames, nodes_of(model, end))])


def strains(model, q, z):
    """Strains (J, 3) of rods that remember; None without any."""
    if not model.n_memory:
        return None
    t = rods.directions(model.rods.edges, nodes_of(model, q))
    return rods.strains(model.rods, t, q[3 * model.n_nodes :], z[model.n_memory :])


def remember(model, past, z, q_next, theta, h=None):
    """z (its axes those at q_next) with what sections remember at the end of the step of length `h`; `past`: strains at its beginning."""
    if not model.n_memory:
        return z
    memory, frames = jnp.split(z, [model.n_memory])
    memory = rods.remembered(model.rods, strains(model, q_next, z), theta, (memory, past, model.h if h is None else h))
    return jnp.concatenate([memory, frames])


def make_stage(model):
    """stage(q, v, z, v_cmd, theta, kappa, past, elapsed, h, coefficients) -> (v⁺ (nq,), size of the last Newton step [m/s, rad/s]).

    `past`: strains at the beginning of the step, which is `elapsed` [s] before forces are evaluated; `h`: length of the stage [s].
    """
    nodes, free, touching = model.free, np.flatnonzero(~model.driven_rows), bool(model.shapes)
    expanding = np.eye(model.nq)[:, free]
    of_nodes = np.eye(model.nq)[(3 * nodes[:, None] + np.arange(3)).ravel()]
    levels = max(0, round(math.log10(1e-3 / model.rest_gap))) if touching else 0

    def expand(y, v_cmd):
        return v_cmd + expanding @ y

    def at_nodes(q):
        return (of_nodes @ q).reshape(-1, 3)

    def scaled(y, args, scale=1.0):
        q, v, z, v_cmd, theta, kappa, past, elapsed, h, (a0, a1, b0, b1, d0, d1) = args
        vp = expand(y, v_cmd)
        q_bar, v_bar = q + h * (a0 * v + a1 * vp), b0 * v + b1 * vp
        memory, frames = jnp.split(carry(model, q, z, q_bar), [model.n_memory])
        force = forces.total_force(model, q_bar, v_bar, theta, frames, (memory, past, elapsed))
        if touching:
            q_next, v_next = at_nodes(q + h * (d0 * v + d1 * vp)), at_nodes(vp)
            smoothing = scale * taken(kappa, nodes)
            force += of_nodes.T @ (forces.contact_impulse(model, q_next, v_next, theta, smoothing, h) / h).ravel()
        return expanding.T @ (vp - v) - h * (expanding.T @ force) / (expanding.T @ forces.row_masses(model, theta))

    def start(args):
        q, v, _, v_cmd, theta, *_, h, _ = args

        def rows(y, scale):
            return scaled(y, args, scale)

        if not touching:
            return warm.follow(rows, lambda y: jnp.ones(1), v[free], weight(theta), 0)
        x = at_nodes(q)

        def margins(y):
            w = at_nodes(expand(y, v_cmd))
            return forces.contact_margins(model, x + h * w, w, theta, h)

        def geometry(w):
            return forces.gaps_and_normals(model, x + h * w, theta)

        raised = warm.admissible(geometry, at_nodes(v), h)
        y0 = expanding.T @ (v + of_nodes.T @ (raised - at_nodes(v)).ravel())
        return warm.follow(rows, margins, y0, weight(theta), levels)

    def weight(theta):
        return jnp.sqrt(forces.row_masses(model, theta)[free])

    def stage(*args):
        v_cmd = args[3]
        fixed = jax.lax.stop_gradient(args)
        y, inverse = jax.lax.stop_gradient(start(fixed))
        # the value is one more step of Newton's; its derivative -K⁻¹ ∂r/∂args is the theorem's
        d = inverse @ scaled(y, args)
        return expand(y - d, v_cmd), jnp.max(jnp.abs(jax.lax.stop_gradient(d)))

    return stage


def make_step(model, report=False):
    """step(x, u, theta[, kappa, by]) -> x⁺ (nx,), or (x⁺, size of the last Newton step [m/s, rad/s]) with `report`.

    kappa (n_nodes,) [J]: the smoothing; by default rest_gap m_i |g| at θ. by: the scheme, by default that of the model; with contact
    only a scheme of one stage takes its place.
    """
    if model.shapes and model.integrator == "midpoint":
        raise ValueError("midpoint has no contact")
    two_stage = model.integrator == "sdirk2"
    h = model.h
    stage = make_stage(model)

    def second_start(q, v, z, v1):
        """Where the second stage of sdirk2 begins."""
        q_second = q + (1.0 - GAMMA) * h * v1
        return q_second, v + (1.0 - GAMMA) / GAMMA * (v1 - v), carry(model, q, z, q_second)

    def plain(q, v, z, v_cmd, theta, kappa, by):
        past, (*_, d0, d1) = strains(model, q, z), by.coefficients

        def take(carried, elapsed):
            (q_ref, v_ref, z_ref), _, before = carried
            v_end, error = stage(q_ref, v_ref, z_ref, v_cmd, theta, kappa, past, elapsed, by.length, by.coefficients)
            q_end = q_ref + by.length * (d0 * v_ref + d1 * v_end)
            end = (q_end, v_end, carry(model, q_ref, z_ref, q_end))
            return second_start(q, v, z, v_end), end, jnp.maximum(before, error)

        def body(carried, turn):
            elapsed = jnp.asarray(by.elapsed)[turn]
            return jax.lax.cond(turn < by.stages, take, lambda carried, _: carried, carried, elapsed), None

        (_, (q_end, v_end, z_end), error), _ = jax.lax.scan(body, ((q, v, z), (q, v, z), jnp.zeros(())), jnp.arange(2))
        return q_end, v_end, remember(model, past, z_end, q_end, theta), error

    def landing_sdirk2(q, v, z, v_cmd, theta, kappa):
        """A scan over the first stage and its successors, the second stage or two half steps, so that a stage is compiled once.

        The second stage is computed twice: the scan has three turns.
        """
        coefficients = scheme(model).coefficients
        begun, at = (q, v, z), lambda y: nodes_of(model, y)[model.free]
        past = strains(model, q, z)

        def body(carried, turn):
            start, begins, thrown, error = carried
            first, after_half = turn == 0, thrown & (turn > 0)
            length = jnp.where(after_half, 0.5 * h, GAMMA * h)
            elapsed = jnp.where(first, GAMMA * h, jnp.where(after_half, 0.5 * h, h))
            v_end, last = stage(*start, v_cmd, theta, kappa, begins, elapsed, length, coefficients)
            q_end = start[0] + length * v_end
            z_end = carry(model, start[0], start[2], q_end)
            second = second_start(q, v, z, v_end)
            where = [(at(q), at(v)), (at(q_end), at(v_end)), (at(second[0]), at(second[1]))]
            found = landing.thrown_back(model, *where, theta, taken(kappa, model.free), (h, GAMMA * h))
            thrown = jnp.where(first, found, thrown)
            end = (q_end, v_end, remember(model, begins, z_end, q_end, theta, jnp.where(after_half, 0.5 * h, h)))
            follows = [jnp.where(thrown, b, s) for b, s in zip(begun, second, strict=True)]
            start = [jnp.where(first, f, jnp.where(thrown, e, s)) for f, e, s in zip(follows, end, start, strict=True)]
            if model.n_memory:
                begins = jnp.where(after_half, strains(model, start[0], start[2]), begins)
            return (tuple(start), begins, thrown, jnp.maximum(error, last)), end

        carried = (begun, past, jnp.zeros((), dtype=bool), jnp.zeros(()))
        (*_, error), ends = jax.lax.scan(body, carried, jnp.arange(3))
        return *(x[2] for x in ends), error

    def step(x, u, theta, kappa=None, by=None):
        q, v, z = jnp.split(x, [model.nq, 2 * model.nq])
        kappa = forces.kappas(model, theta) if kappa is None else kappa
        v_cmd = command(model, q, z, u, theta)
        if two_stage and model.shapes:
            *parts, error = landing_sdirk2(q, v, z, v_cmd, theta, kappa)
        else:
            *parts, error = plain(q, v, z, v_cmd, theta, kappa, scheme(model) if by is None else by)
        x_next = jnp.concatenate(parts)
        return (x_next, error) if report else x_next

    return step


def displaced(model, x, dx):
    """x ⊕ δx (nx,): axes move with their edges, then the material turns about them."""
    q, v, z = jnp.split(x, [model.nq, 2 * model.nq])
    dq, dv, dz = jnp.split(dx, [model.nq, 2 * model.nq])
    moved = carry(model, q, z, q + dq)
    if model.n_memory:
        moved = moved.at[: model.n_memory].add(dz)
    return jnp.concatenate([q + dq, v + dv, moved])


def change(model, x, at):
    """x ⊖ at (ndx,), exact to first order in it."""
    if model.rods is None:
        return x - at
    places = np.cumsum([3 * model.n_nodes, model.nq - 3 * model.n_nodes, model.nq, model.n_memory])
    parts = [jnp.split(y, places) for y in (x, at)]
    (p, twist, v, memory, frames), (p0, twist0, v0, memory0, frames0) = parts
    before = (p0.reshape(-1, 3), twist0, frames0)
    turns = rods.change_of_twists(model.rods, p.reshape(-1, 3), twist, frames, before)
    return jnp.concatenate([p - p0, turns, v - v0, memory - memory0])


def make_change_of_step(model):
    """step(dx, x, u, theta[, by]) -> (change of x⁺ (ndx,) by the change dx of x, (x⁺ (nx,), residual [m/s])), for derivatives at dx = 0."""
    step = make_step(model, report=True)

    def changed(dx, x, u, theta, by=None):
        x_next, error = step(displaced(model, x, dx), u, theta, by=by)
        at = jax.lax.stop_gradient(x_next)
        return change(model, x_next, at), (at, error)

    return changed


def make_rollout(model):
    """rollout(x0, u (T, nu), theta) -> (x (T + 1, nx), residuals (T,) [m/s])."""
    step = make_step(model, report=True)

    def rollout(x0, u, theta):
        def body(x, u_k):
            x_next, error = step(x, u_k, theta)
            return x_next, (x_next, error)

        _, (x, error) = jax.lax.scan(body, x0, u)
        return jnp.concatenate([x0[None], x]), error

    return rollout
