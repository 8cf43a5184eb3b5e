"""Static equilibrium: Σ f(q, v = 0; θ) = 0 at the free nodes, driven nodes at their targets.

Contact-free. The root is optimistix's, with its implicit adjoint; `find` brings a guess
close by pseudo-transient continuation (Newton on K + m/τ², τ grown as the force falls).
"""

import jax
import jax.numpy as jnp
import lineax
import numpy as np
import optimistix

from . import forces
from .step import commanded_velocity


def driven_positions(model, q, u, theta):
    """q (n_nodes, 3) with driven nodes at the prescribed targets (velocity grippers: unmoved)."""
    moved = q + model.h * commanded_velocity(model, q, u, theta)
    prescribed = np.zeros(model.n_nodes, dtype=bool)
    for g in model.grippers:
        if g.mode == "prescribed":
            prescribed[g.nodes] = True
            prescribed[[] if g.ghost is None else g.ghost] = True
    return jnp.where(prescribed[:, None], moved, q)


def make_equilibrium(model):
    """(equilibrium(u, theta, guess) -> q (n_nodes, 3), find(u, theta, guess) -> a good guess).

    `equilibrium` is differentiable in u and θ (guess: only through velocity-driven nodes, which
    stay where the guess has them).
    """
    free = model.free

    def force(y, args):
        q, theta, precondition = args
        rows = forces.static_force(model, q.at[free].set(y.reshape(-1, 3)), theta)[free].ravel()
        return rows if precondition is None else precondition @ rows

    solver = optimistix.Newton(rtol=1e-13, atol=1e-13, linear_solver=lineax.LU())
    adjoint = optimistix.ImplicitAdjoint(linear_solver=lineax.LU())

    def equilibrium(u, theta, guess):
        q = driven_positions(model, guess.reshape(-1, 3), u, theta)
        y0 = jax.lax.stop_gradient(q[free].ravel())
        fixed = jax.lax.stop_gradient((q, theta))
        inverse = jnp.linalg.inv(jax.jacfwd(force)(y0, (*fixed, None)))
        args = (q, theta, jax.lax.stop_gradient(inverse))
        found = optimistix.root_find(force, solver, y0, args, adjoint=adjoint, max_steps=50)
        return q.at[free].set(found.value.reshape(-1, 3))

    @jax.jit
    def slope(y, q, theta):
        rows = forces.static_force(model, q.at[free].set(y.reshape(-1, 3)), theta)[free].ravel()
        return rows, jax.jacfwd(force)(y, (q, theta, None))

    def find(u, theta, guess, max_iterations=2000):
        q = driven_positions(model, jnp.asarray(guess).reshape(-1, 3), u, theta)
        y, tau = np.array(q[free]).ravel(), 1e-2
        m = np.repeat(np.asarray(forces.masses(model, theta))[free], 3)
        rows, slopes = map(np.asarray, slope(y, q, theta))
        for _ in range(max_iterations):
            d = np.linalg.solve(np.diag(m / tau**2) - slopes, rows)
            trial, trial_slopes = map(np.asarray, slope(y + d, q, theta))
            ratio = np.linalg.norm(rows) / max(np.linalg.norm(trial), 1e-300)
            if not np.isfinite(ratio) or ratio < 0.5:
                tau /= 4.0
                continue
            y, rows, slopes = y + d, trial, trial_slopes
            if np.abs(d).max() < 1e-12 and tau > 1e3:
                break
            tau = min(tau * np.clip(ratio, 1.0, 3.0) * 1.1, 1e5)
        return jnp.asarray(q).at[free].set(y.reshape(-1, 3))

    return equilibrium, find
