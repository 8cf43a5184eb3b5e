"""Unit quaternions (w, x, y, z) and the three ways a step turns a body.

A change of rotation is a vector in the *body's* axes: R ⊕ t = R · matrix(turn(t)).
"""

import jax
import jax.numpy as jnp
import numpy as np

HAT = -np.array([[[(i - j) * (j - k) * (k - i) / 2.0 for k in range(3)] for j in range(3)] for i in range(3)])  # of u ×
PRODUCT = np.zeros((4, 4, 4))  # (a b)_i = Σ PRODUCT_ijk a_j b_k
PRODUCT[0] = np.diag([1.0, -1.0, -1.0, -1.0])
PRODUCT[1:, 0, 1:] = PRODUCT[1:, 1:, 0] = np.eye(3)
PRODUCT[1:, 1:, 1:] = HAT.transpose(0, 2, 1)
TERMS = 14  # of the series in |t|²: below 1e-16 for |t| < 4
SMALL = 1e-4  # tan² of half the angle, below which the logarithm is taken from its series


def product(a, b):
    """The quaternion of first b, then a, both (4,)."""
    return jnp.einsum("ijk,j,k->i", PRODUCT, a, b)


def conjugate(a):
    """The inverse of a unit quaternion."""
    return a * jnp.array([1.0, -1.0, -1.0, -1.0])


def unit(a):
    """a/|a|."""
    return a / jnp.sqrt(jnp.sum(a * a))


def matrix(a):
    """R with R x = a (0, x) a⁻¹, (3, 3):  R x = x + 2 w u×x + 2 u×(u×x),  a = (w, u)."""
    hat = jnp.einsum("ijk,k->ij", HAT, a[1:])
    return jnp.eye(3) + 2.0 * a[0] * hat + 2.0 * hat @ hat


def about(axis, angle):
    """Turning by `angle` [rad] about a unit axis."""
    return jnp.concatenate([jnp.cos(angle / 2)[None], jnp.sin(angle / 2) * axis])


def exponential(t):
    """Turning by |t| about t: (cos(|t|/2), sin(|t|/2) t/|t|), by its power series in |t|², which is smooth at 0."""
    x = -jnp.sum(t * t) / 4.0
    k = 2.0 * np.arange(TERMS, 0, -1)
    factors = 1.0 / np.stack([(k - 1) * k, k * (k + 1)], axis=1)
    (cosine, sine), _ = jax.lax.scan(lambda sums, factor: (1.0 + x * factor * sums, None), jnp.ones(2), factors)
    return jnp.concatenate([cosine[None], 0.5 * sine * t])


def of_vector(t):
    """R = rot(t) (3, 3), turning by |t| [rad] about t."""
    return matrix(exponential(t))


def cayley(t):
    """Turning by 2 atan(|t|/2) about t; equals the exponential map up to third order in t."""
    return unit(jnp.concatenate([jnp.ones(1), 0.5 * t]))


def square_root(a):
    """The turn that, made twice, is a (w > -1)."""
    return unit(a + jnp.array([1.0, 0.0, 0.0, 0.0]))


def logarithm(a):
    """The rotation vector (3,), at most π long [rad]: 2 atan2(|u|, w) u/|u|, a = (w, u)."""
    a = jnp.where(a[0] < 0.0, -a, a)
    w, u = a[0], a[1:]
    s2 = jnp.sum(u * u)
    x = s2 / w**2
    near = x < SMALL
    series = 2.0 / w * (1.0 - x / 3.0 + x**2 / 5.0 - x**3 / 7.0 + x**4 / 9.0)
    s = jnp.sqrt(jnp.where(near, 1.0, s2))
    return jnp.where(near, series, 2.0 * jnp.arctan2(s, w) / s) * u
