"""The rope's laws on their stencils: energies, dissipations and forces.

Signs: force on the nodes f = -∂E/∂q for an energy E [J] and f = -∂R/∂v for a
(Rayleigh) dissipation R [W]. Vectors are world-frame arrays of shape (3,).
"""

import jax
import jax.numpy as jnp
import numpy as np


def dot(a, b):
    """a·b of two vectors (as a fused sum: it compiles several times faster than `@`)."""
    return jnp.sum(a * b)


def taken(x, index):
    """x[index] along the first axis, as a constant matrix's product: scatters, which the transposed would be, compile slowly."""
    index = np.asarray(index)
    select = np.zeros((index.size, len(x)))
    select[np.arange(index.size), index.ravel()] = 1.0
    return (select @ x).reshape(*index.shape, *x.shape[1:])


def safe_norm(a):
    """|a| = sqrt(a·a), with derivative 0 at a = 0."""
    square = dot(a, a)
    positive = square > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def gravity_vector(magnitude, tilt):
    """g = magnitude Ry(tilt[1]) Rx(tilt[0]) (0, 0, -1)  [m/s²]; tilt [rad], right-handed."""
    cx, sx = jnp.cos(tilt[0]), jnp.sin(tilt[0])
    cy, sy = jnp.cos(tilt[1]), jnp.sin(tilt[1])
    about_x = jnp.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = jnp.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    return magnitude * (about_y @ about_x @ jnp.array([0.0, 0.0, -1.0]))


def gravity_energy(x, mass, gravity):
    """E = -m g·x  [J]."""
    return -mass * dot(gravity, x)


def strain(x1, x2, rest_length):
    """ε = |x2 - x1| / l0 - 1  [-]."""
    edge = x2 - x1
    return jnp.sqrt(dot(edge, edge)) / rest_length - 1.0


def stretch_energy(x1, x2, rest_length, stiffness, rest_strain):
    """E = ½ EA l0 (ε - δ)²  [J];  EA [N], δ [-] the strain at rest."""
    return 0.5 * stiffness * rest_length * (strain(x1, x2, rest_length) - rest_strain) ** 2


def stretch_dissipation(x1, x2, v1, v2, rest_length, damping):
    """R = ½ c_s l0 ε̇²  [W];  c_s [N·s], ε̇ = dε/dt along (v1, v2)."""
    _, rate = jax.jvp(lambda a, b: strain(a, b, rest_length), (x1, x2), (v1, v2))
    return 0.5 * damping * rest_length * rate**2


def tangents(x0, x1, x2):
    """Unit tangents of the two edges of a bending stencil."""
    e1, e2 = x1 - x0, x2 - x1
    return e1 / jnp.sqrt(dot(e1, e1)), e2 / jnp.sqrt(dot(e2, e2))


def curvature(x0, x1, x2):
    """κ⃗ = 2 (t2 - t1) / |t1 + t2|  [-];  |κ⃗| = 2 tan(θ/2), θ the turning angle."""
    t1, t2 = tangents(x0, x1, x2)
    total = t1 + t2
    return 2.0 * (t2 - t1) / jnp.sqrt(dot(total, total))


def bend_energy(x0, x1, x2, voronoi_length, stiffness):
    """E = ½ (EI / l_v) |κ⃗|²  [J];  EI [N·m²]."""
    k = curvature(x0, x1, x2)
    return 0.5 * stiffness / voronoi_length * dot(k, k)


def bend_rate(x0, x1, x2, v0, v1, v2):
    """D = P_T dκ⃗/dt  [1/s],  T = (t1 + t2)/|t1 + t2|, P_T = I - T Tᵀ, from the definition."""
    t1, t2 = tangents(x0, x1, x2)
    total = t1 + t2
    mean = total / jnp.sqrt(dot(total, total))
    _, k_dot = jax.jvp(curvature, (x0, x1, x2), (v0, v1, v2))
    return k_dot - mean * dot(mean, k_dot)


def bend_rate_squared_closed(x0, x1, x2, v0, v1, v2):
    """|D|² in closed form; only for the test that it equals `bend_rate`.

    a = t1·ṫ2, b = t2·ṫ1, ċ = a + b, m = a - b, N = |ṫ1|² + |ṫ2|² - 2 ṫ1·ṫ2, s² = 2 (1 + c):
    |D|² = (4/s²) [ N + (2ċ² - m²)/s² + (1 - c)/(1 + c) ċ²/s² ].
    """
    (t1, t2), (t1_dot, t2_dot) = jax.jvp(tangents, (x0, x1, x2), (v0, v1, v2))
    c, a, b = t1 @ t2, t1 @ t2_dot, t2 @ t1_dot
    c_dot, m, s2 = a + b, a - b, 2.0 * (1.0 + c)
    n = t1_dot @ t1_dot + t2_dot @ t2_dot - 2.0 * (t1_dot @ t2_dot)
    bracket = n + (2.0 * c_dot**2 - m**2) / s2 + (1.0 - c) / (1.0 + c) * c_dot**2 / s2
    return 4.0 / s2 * bracket


def bend_dissipation(x0, x1, x2, v0, v1, v2, voronoi_length, damping):
    """R = ½ (c_b / l_v) |D|²  [W];  c_b [N·m²·s]."""
    rate = bend_rate(x0, x1, x2, v0, v1, v2)
    return 0.5 * damping / voronoi_length * dot(rate, rate)


def drag_force(velocity, wind, voronoi_length, linear, quadratic):
    """f = -L (linear + quadratic |u|) u  [N],  u = v - wind; [kg/(m·s)], [kg/m²]."""
    u = velocity - wind
    return -voronoi_length * (linear + quadratic * safe_norm(u)) * u
