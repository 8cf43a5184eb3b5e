"""One step of bodies as a root, for euler, midpoint and sdirk2, and changes of states.

Stage of length h, unknowns y = (v⁺, γ), ā = (v⁺ - v)/h:
    inertia(q̄, v̄, ā) - f(q̄, v̄, u) - D(q̄) γ/h = 0  [N·m or N],   F(γ; q⁺, v⁺) = 0 for friction, stops and couplings
    euler     q̄ = q⁺ = q ⊕ exp(h v⁺), v̄ = v⁺
    midpoint  v̄ = (v + v⁺)/2, q⁺ = q ⊕ cay(h v̄), q̄ the exact half of that displacement
The root is Newton's; derivatives are those of the implicit function theorem. Under sdirk2 a step in which a joint hits its stop is taken
by two half steps by Euler (`landing`).
"""

import math

import jax
import jax.numpy as jnp

from . import bodies, landing, rotations, warm
from .step import GAMMA

TOLERANCE = 1e-13  # relative size of the Newton step left by the search


def ends(model, q, v, v_next, h):
    """(q̄, v̄, q⁺) of a stage."""
    if model.integrator != "midpoint":
        q_next = bodies.add(model, q, h * v_next, rotations.exponential)
        return q_next, v_next, q_next
    middle = 0.5 * (v + v_next)
    # other coordinates than quaternions are displaced by half as much
    half = bodies.add(model, q, 0.5 * h * middle, lambda t: rotations.square_root(rotations.cayley(2.0 * t)))
    return half, middle, bodies.add(model, q, h * middle, rotations.cayley)


def make_stage(model):
    """stage(q, v, u, theta, h) -> (v⁺ (nv,), impulses of the stops, size of the last Newton step)."""
    if model.integrator == "midpoint" and (model.stops or model.couplings):
        raise ValueError("midpoint has no stops and no couplings")
    weights, directions = bodies.weights(model), bodies.directions(model, model.q0, model.theta)
    n, n_rows = model.nv, directions.shape[1]
    levels = max(0, round(math.log10(1e-3 / model.rest_gap))) if n_rows else 0

    def residual(y, args, scale=1.0):
        q, v, u, theta, h = args
        v_next, gamma = y[:n], y[n:]
        q_bar, v_bar, q_next = ends(model, q, v, v_next, h)
        r = bodies.inertia_force(model, q_bar, v_bar, (v_next - v) / h, theta)
        r -= bodies.force(model, q_bar, v_bar, u, theta) + bodies.directions(model, q_bar, theta) @ gamma / h
        return jnp.concatenate([r, bodies.rows(model, weights, q_next, v_next, gamma, theta, h, scale)])

    def search(args):
        y0 = jnp.concatenate([args[1], jnp.zeros(n_rows)])
        inertia = jnp.sqrt(weights[1])
        size = jnp.concatenate([inertia, 1.0 / (jnp.abs(directions.T) @ inertia)])
        return warm.follow(
            lambda y, scale: residual(y, args, scale), lambda y: jnp.ones(1), y0, size, levels, tolerance=TOLERANCE
        )

    first = n + len(model.frictions)
    stops = slice(first, first + len(model.stops))

    def stage(q, v, u, theta, h):
        args = (q, v, u, theta, jnp.asarray(h))
        y, inverse = jax.lax.stop_gradient(search(jax.lax.stop_gradient(args)))
        # the value is one more step of Newton's; its derivative -K⁻¹ ∂r/∂args is the theorem's
        d = inverse @ residual(y, args)
        return (y - d)[:n], y[stops], jnp.max(jnp.abs(jax.lax.stop_gradient(d[:n])))

    return stage


def make_step(model):
    """step(x (nx,), u (nu,), theta) -> (x⁺ (nx,), size of the last Newton step [rad/s or m/s])."""
    h = model.h
    weights = bodies.weights(model)
    two_stage = model.integrator == "sdirk2"
    stage = make_stage(model)

    def sdirk2(q, v, u, theta):
        """A scan over the first stage and its successors: the second stage, or where a stop is hit two half steps by Euler.

        With stops the scan has three turns, and the second stage is computed twice.
        """

        def body(carry, turn):
            start, thrown = carry
            first, after_half = turn == 0, thrown & (turn > 0)
            length = jnp.where(after_half, 0.5 * h, GAMMA * h)
            v1, impulses, error = stage(*start, u, theta, length)
            q_end = bodies.add(model, start[0], length * v1, rotations.exponential)
            q_second = bodies.add(model, q, (1.0 - GAMMA) * h * v1, rotations.exponential)
            second = (q_second, v + (1.0 - GAMMA) / GAMMA * (v1 - v))
            found = landing.stops_hit(model, (q, v), (q_end, v1), impulses, theta, weights)
            thrown = jnp.where(first, found, thrown)
            follows = [jnp.where(thrown, x, y) for x, y in zip((q, v), second, strict=True)]
            later = [jnp.where(thrown, x, y) for x, y in zip((q_end, v1), start, strict=True)]
            start = tuple(jnp.where(first, x, y) for x, y in zip(follows, later, strict=True))
            return (start, thrown), (q_end, v1, error)

        turns = jnp.arange(3 if model.stops else 2)
        _, (q_end, v_end, error) = jax.lax.scan(body, ((q, v), jnp.zeros((), dtype=bool)), turns)
        return q_end[-1], v_end[-1], jnp.max(error)

    def one_stage(q, v, u, theta):
        v_next, _, error = stage(q, v, u, theta, h)
        return ends(model, q, v, v_next, h)[2], v_next, error

    def step(x, u, theta):
        q, v = x[: model.nq], x[model.nq :]
        q_next, v_next, error = (sdirk2 if two_stage else one_stage)(q, v, u, theta)
        return jnp.concatenate([q_next, v_next]), error

    return step


def displaced(model, x, dx):
    """x ⊕ δx (nx,), exact to second order in δx (ndx,)."""
    q = bodies.add(model, x[: model.nq], dx[: model.nv], rotations.cayley)
    return jnp.concatenate([q, x[model.nq :] + dx[model.nv :]])


def change(model, x, at):
    """x ⊖ at (ndx,), exact to second order in it."""
    parts = []
    for joint in model.joints:
        if joint.kind == "ball":
            parts.append(2.0 * rotations.product(rotations.conjugate(at[joint.q]), x[joint.q])[1:])
        else:
            parts.append(x[joint.q] - at[joint.q])
    return jnp.concatenate([*parts, x[model.nq :] - at[model.nq :]])


def make_linearized_step(model):
    """step(x, u, theta) -> (x⁺, size of the last Newton step, A (ndx, ndx), B (ndx, nu), C (ndx, n_params)).

    Jacobians of the change of x⁺ by the change of x, by u and by θ.
    """
    step = make_step(model)

    def changed(z, x, u, theta):
        dx, du, dtheta = jnp.split(z, [model.ndx, model.ndx + model.nu])
        x_next, error = step(displaced(model, x, dx), u + du, theta + dtheta)
        at = jax.lax.stop_gradient(x_next)
        return change(model, x_next, at), (at, error)

    def linearized(x, u, theta):
        zero = jnp.zeros(model.ndx + model.nu + len(theta))
        slopes, (x_next, error) = jax.jacfwd(changed, has_aux=True)(zero, x, u, theta)
        return x_next, error, *jnp.split(slopes, [model.ndx, model.ndx + model.nu], axis=1)

    return linearized
