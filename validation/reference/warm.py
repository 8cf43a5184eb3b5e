"""A robust start for the root of a step: damped Newton along a decreasing κ.

No derivative passes through this file: the root that follows does not depend on where
its search began. The path multiplies κ by `scale` = 10^k, …, 10, 1. At each level Newton steps
d = -K⁻¹ r are shortened until they stay admissible and contract in the natural sense
‖K⁻¹ r(y + α d)‖ ≤ (1 - α/4) ‖d‖ (Deuflhard 2004, §3.3), mass-weighted.
"""

import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl

SHORTEST = 20  # the smallest step factor tried is 2^-SHORTEST
KEEP = 0.05  # a step may use up at most 1 - KEEP of a margin


def follow(residual, margins, y0, weight, levels, max_iterations=400):
    """y near the root of residual(·, scale=1).

    residual(y, scale) -> (n,) [m/s]; margins(y) -> array, positive where admissible;
    weight (n,) [√kg]; levels: number of tenfold reductions of κ. y0 must be admissible.
    """
    factors = 0.5 ** jnp.arange(SHORTEST + 1)

    def size(d):
        return jnp.sqrt(jnp.sum((weight * d) ** 2, axis=-1))

    def body(carry):
        y, level, count, _ = carry
        scale = 10.0**level
        factor = jsl.lu_factor(jax.jacfwd(residual)(y, scale))
        d = -jsl.lu_solve(factor, residual(y, scale))
        trials = y + factors[:, None] * d
        inside = margins(y)
        kept = jax.vmap(lambda t: jnp.all(margins(t) > KEEP * inside))(trials)
        rows = jax.vmap(lambda t: residual(t, scale))(trials)
        after = size(jsl.lu_solve(factor, rows.T).T)
        contracts = kept & (after <= (1.0 - factors / 4.0) * size(d))
        fallback = jnp.where(kept & jnp.isfinite(after), after, jnp.inf)
        choice = jnp.where(jnp.any(contracts), jnp.argmax(contracts), jnp.argmin(fallback))
        y = trials[choice]
        settled = (choice == 0) & contracts[0] & (after[0] <= 0.1 * size(d))
        fine = after[choice] <= 1e-9 * (1e-3 * jnp.linalg.norm(weight) + size(y))
        done = settled & fine & (level == 0)
        level = jnp.where(settled, jnp.maximum(level - 1, 0), level)
        return y, level, count + 1, done

    def unfinished(carry):
        return ~carry[3] & (carry[2] < max_iterations)

    start = (y0, jnp.asarray(levels), 0, False)
    return jax.lax.while_loop(unfinished, body, start)[0]


def admissible(margins_and_normals, v, h):
    """Velocities (n, 3) moved into the admissible set of every shape.

    margins_and_normals(v) -> list of (gap (n,), normal (n, 3), friction) at q + h v. Where
    gap/h < 2 μ |v_t| + 1e-4/h the tangential part is dropped and the normal part raised.
    """
    count = len(margins_and_normals(v))
    for k in range(count):
        gap, normal, friction = margins_and_normals(v)[k]
        v_n = jnp.sum(normal * v, axis=1, keepdims=True)
        slip = jnp.linalg.norm(v - v_n * normal, axis=1)
        near = gap / h < 2.0 * friction * slip + 1e-4 / h
        v = jnp.where(near[:, None], v_n * normal, v)
    for k in range(count):
        gap, normal, _ = margins_and_normals(v)[k]
        v = v + jnp.maximum(0.0, (1e-4 - gap) / h)[:, None] * normal
    return v
