"""A robust start for the root of a step: damped Newton along a decreasing κ.

No derivative passes through this file: the root that follows does not depend on where
its search began. The path multiplies κ by `scale` = 10^k, …, 10, 1. At each level Newton steps
d = -K⁻¹ r are shortened until they stay admissible and contract in the natural sense
‖K⁻¹ r(y + α d)‖ ≤ (1 - α/4) ‖d‖ (Deuflhard 2004, §3.3), mass-weighted.
"""

import jax
import jax.numpy as jnp

SHORTEST = 2.0**-20  # a shorter step is taken as it is
NOISE = 1e-14  # relative size of a step that is rounding: it need not contract
KEEP = 0.05  # a step may use up at most 1 - KEEP of a margin


def follow(residual, margins, y0, weight, levels, tolerance=1e-9, max_iterations=1000):
    """(y near the root of residual(·, scale=1), the inverse of K = ∂residual/∂y there).

    residual(y, scale) -> (n,) [m/s]; margins(y) -> array, positive where admissible;
    weight (n,) [√kg]; levels: number of tenfold reductions of κ. y0 must be admissible. tolerance: relative
    size of the Newton step at most left at the end; then steps go on for as long as they shrink tenfold.
    """

    def size(d):
        return jnp.sqrt(jnp.sum((weight * d) ** 2))

    def twice(y, scale):
        rows = residual(y, scale)
        return rows, rows

    def body(carry):
        y, d, inverse, alpha, level, fresh, count, _ = carry
        trial = jnp.where(fresh, y, y + alpha * d)
        slope, rows = jax.jacfwd(twice, has_aux=True)(trial, 10.0**level)
        after = size(inverse @ rows)
        noise = after <= NOISE * (1e-3 * jnp.linalg.norm(weight) + size(trial))
        contracts = (after <= (1.0 - alpha / 4.0) * size(d)) | (alpha < SHORTEST) | noise
        accept = fresh | (contracts & jnp.all(margins(trial) > KEEP * margins(y)))
        quick = after <= 0.1 * size(d)
        settled = accept & ~fresh & (alpha == 1.0) & (quick | noise)
        fine = after <= tolerance * (1e-3 * jnp.linalg.norm(weight) + size(trial))
        y = jnp.where(accept, trial, y)
        new_inverse = jnp.linalg.inv(slope)
        inverse = jnp.where(accept, new_inverse, inverse)
        d = jnp.where(accept, -new_inverse @ rows, d)
        alpha = jnp.where(accept, 1.0, 0.5 * alpha)
        done = fine & ~fresh & (level == 0) & (~quick | noise)
        fresh = settled & (level > 0)
        return y, d, inverse, alpha, level - fresh, fresh, count + 1, done

    def unfinished(carry):
        return ~carry[-1] & (carry[-2] < max_iterations)

    n = len(y0)
    start = (y0, jnp.zeros(n), jnp.eye(n), 1.0, jnp.asarray(levels), True, 0, False)
    y, _, inverse, *_ = jax.lax.while_loop(unfinished, body, start)
    return y, inverse


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
