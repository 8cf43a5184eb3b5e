"""One step as a root, for euler, midpoint and sdirk2, and the rollout.

Stage of length h, unknown y = v⁺ of the free nodes (driven nodes follow v_cmd exactly):
    r = m (v⁺ - v)/h - Σ f(q̄, v̄; θ) - p(q⁺, v⁺)/h = 0   [N]
    q̄ = q + h (a0 v + a1 v⁺),  v̄ = b0 v + b1 v⁺,  q⁺ = q + h (d0 v + d1 v⁺)
solved as P (h/m) r = 0 with P the constant inverse Jacobian near the root, so that the
tolerance is one on velocities. optimistix's implicit adjoint differentiates it.
"""

import math

import jax
import jax.numpy as jnp
import lineax
import numpy as np
import optimistix

from . import forces, warm

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
EULER = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
MIDPOINT_FREE = (0.25, 0.25, 0.5, 0.5, 0.5, 0.5)
MIDPOINT_DRIVEN = (0.0, 0.5, 0.0, 1.0, 0.0, 1.0)
RTOL = ATOL = 1e-13  # of velocities [m/s]


def coefficients(model):
    """(a0, a1, b0, b1, d0, d1), each (n_nodes, 1)."""
    midpoint = model.integrator == "midpoint"
    free, driven = (MIDPOINT_FREE, MIDPOINT_DRIVEN) if midpoint else (EULER, EULER)
    return [np.where(model.driven, d, f)[:, None] for f, d in zip(free, driven, strict=True)]


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
                axis = inputs[3:] / jnp.sqrt(inputs[3:] @ inputs[3:])
                rest = g.fraction * theta[model.ropes[g.rope]["length"]]
                out = out.at[g.ghost].set((targets[0] - rest * axis - q[g.ghost]) / h)
        else:
            out = out.at[g.nodes].set(inputs[:3])
            if g.ghost is not None:
                turn = cayley(h * inputs[3:]) - jnp.eye(3)
                out = out.at[g.ghost].set(inputs[:3] + turn @ (q[g.ghost] - q[end]) / h)
    return out


def make_stage(model, h):
    """stage(q, v, v_cmd, theta, kappa) -> (v⁺ (n_nodes, 3), residual size [m/s])."""
    a0, a1, b0, b1, d0, d1 = coefficients(model)
    free, touching = model.free, bool(model.shapes)
    levels = max(0, round(math.log10(1e-3 / model.rest_gap))) if touching else 0

    def expand(y, v_cmd):
        return v_cmd.at[free].set(y.reshape(-1, 3))

    def scaled(y, args, scale=1.0):
        q, v, v_cmd, theta, kappa, _ = args
        vp = expand(y, v_cmd)
        q_bar, v_bar = q + h * (a0 * v + a1 * vp), b0 * v + b1 * vp
        force = forces.total_force(model, q_bar, v_bar, theta)[free]
        if touching:
            q_next = (q + h * (d0 * v + d1 * vp))[free]
            smoothing = scale * kappa[free]
            force += forces.contact_impulse(model, q_next, vp[free], theta, smoothing, h) / h
        m = forces.masses(model, theta)[free, None]
        return (vp[free] - v[free] - h / m * force).ravel()

    def root(y, args):
        return args[-1] @ scaled(y, args)

    def start(args):
        q, v, _, theta, _, _ = args

        def rows(y, scale):
            return scaled(y, args, scale)

        if not touching:
            return warm.follow(rows, lambda y: jnp.ones(1), v[free].ravel(), weight(theta), 0)

        def margins(y):
            w = y.reshape(-1, 3)
            return forces.contact_margins(model, q[free] + h * w, w, theta, h)

        def geometry(w):
            return forces.gaps_and_normals(model, q[free] + h * w, theta)

        y0 = warm.admissible(geometry, v[free], h).ravel()
        return warm.follow(rows, margins, y0, weight(theta), levels)

    def weight(theta):
        return jnp.repeat(jnp.sqrt(forces.masses(model, theta)[free]), 3)

    solver = optimistix.Newton(rtol=RTOL, atol=ATOL, linear_solver=lineax.LU())
    adjoint = optimistix.ImplicitAdjoint(linear_solver=lineax.LU())

    def stage(q, v, v_cmd, theta, kappa):
        args = (q, v, v_cmd, theta, kappa, None)
        fixed = jax.lax.stop_gradient(args)
        y0, inverse = jax.lax.stop_gradient(start(fixed))
        args = (*args[:5], inverse)
        found = optimistix.root_find(
            root, solver, y0, args, adjoint=adjoint, max_steps=20, throw=False
        )
        error = jnp.max(jnp.abs(jax.lax.stop_gradient(root(found.value, args))))
        return expand(found.value, v_cmd), error

    return stage


def make_step(model, report=False):
    """step(x, u, theta[, kappa]) -> x⁺ (nx,), or (x⁺, preconditioned residual [m/s]) with `report`.

    kappa (n_nodes,) [J]: the smoothing; by default rest_gap m_i |g| at θ.
    """
    if model.shapes and model.integrator == "midpoint":
        raise ValueError("midpoint has no contact")
    two_stage = model.integrator == "sdirk2"
    h = model.h
    stage = make_stage(model, GAMMA * h if two_stage else h)

    def sdirk2(q, v, v_cmd, theta, kappa):
        def body(carry, _):
            q_ref, v_ref, _ = carry
            v1, error = stage(q_ref, v_ref, v_cmd, theta, kappa)
            q_next = q_ref + GAMMA * h * v1
            blend = (1.0 - GAMMA) / GAMMA
            return (q + (1.0 - GAMMA) * h * v1, v + blend * (v1 - v), error), (q_next, v1, error)

        _, (q_next, v_next, error) = jax.lax.scan(body, (q, v, jnp.zeros(())), None, length=2)
        return q_next[1], v_next[1], jnp.max(error)

    def one_stage(q, v, v_cmd, theta, kappa):
        vp, error = stage(q, v, v_cmd, theta, kappa)
        *_, d0, d1 = coefficients(model)
        return q + h * (d0 * v + d1 * vp), vp, error

    def step(x, u, theta, kappa=None):
        q, v = x.reshape(2, -1, 3)
        kappa = forces.kappas(model, theta) if kappa is None else kappa
        v_cmd = commanded_velocity(model, q, u, theta)
        q_next, v_next, error = (sdirk2 if two_stage else one_stage)(q, v, v_cmd, theta, kappa)
        x_next = jnp.concatenate([q_next.ravel(), v_next.ravel()])
        return (x_next, error) if report else x_next

    return step


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
