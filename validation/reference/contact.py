"""Node spheres against fixed shapes: gaps, normals, central-path impulses.

With v̂_n = gap/h [m/s] and v_t = (I - n nᵀ) v⁺, the impulse p = w₀ n + μ w̄ [N·s] solves
s ∘ w = κ e, s = (v̂_n + ς, σ v_t), w in the second-order cone; σ = μ (anitescu), σ = √(μ² + μ₀²)/ε, ε = min(1, h²/τ²) (coulomb).
Admissible: gap > 0 (coulomb), v̂_n > μ |v_t| (anitescu).
"""

import jax.numpy as jnp

from . import rotations
from .laws import dot

FRICTION_TIME = 0.002  # τ [s]
LEAST_SLIP = 0.05  # μ₀ [-]


def plane_gap(x, radius, shape):
    """gap = n·(x - p) - height - r  [m]; n = rot(a) n₀, a the rotation vector [rad], n₀ and p constant."""
    normal = rotations.of_vector(shape["rotation"]) @ shape["normal"]
    return dot(normal, x - shape["point"]) - shape["height"] - radius, normal


def sphere_gap(x, radius, shape):
    """gap = |x - c| - R - r  [m]; n = (x - c)/|x - c|."""
    offset = x - shape["center"]
    distance = jnp.sqrt(dot(offset, offset))
    return distance - shape["radius"] - radius, offset / distance


def capsule_gap(x, radius, shape):
    """gap = |x - s| - R - r  [m], s the point of the segment ab closest to x."""
    a, axis = shape["a"], shape["b"] - shape["a"]
    fraction = jnp.clip(dot(x - a, axis) / dot(axis, axis), 0.0, 1.0)
    offset = x - (a + fraction * axis)
    distance = jnp.sqrt(dot(offset, offset))
    return distance - shape["radius"] - radius, offset / distance


GAPS = {"plane": plane_gap, "sphere": sphere_gap, "capsule": capsule_gap}


def tangential(normal, velocity):
    """v_t = (I - n nᵀ) v  [m/s]."""
    return velocity - normal * dot(normal, velocity)


def sharpness(h):
    """ε = min(1, h²/τ²): smoothing of friction over that along the normal."""
    return jnp.minimum(1.0, (h / FRICTION_TIME) ** 2)


def impulse(law, gap, normal, velocity, lengths, friction, kappa):
    """p = γ_n n + γ_t  [N·s]; lengths [s] of the stage and of the scene's step, which ε follows.

    coulomb:  s0 = (v̂_n + √(v̂_n² + 4|σ v_t|²))/2, γ_n = κ/v̂_n, γ_t = -μ γ_n σ v_t/s0.
    anitescu: d = v̂_n² - μ²|v_t|², γ_n = κ v̂_n/d, γ_t = -κ μ² v_t/d.
    """
    h, step = lengths
    approach = gap / h
    v_t = tangential(normal, velocity)
    if law == "coulomb":
        slip = jnp.hypot(friction, LEAST_SLIP) * v_t / sharpness(step)
        s0 = 0.5 * (approach + jnp.sqrt(approach**2 + 4.0 * dot(slip, slip)))
        gamma_n = kappa / approach
        return gamma_n * normal - friction * gamma_n / s0 * slip
    if law == "anitescu":
        d = approach**2 - friction**2 * dot(v_t, v_t)
        return kappa / d * (approach * normal - friction**2 * v_t)
    raise ValueError(f"unknown contact law {law!r}")


def margin(law, gap, normal, velocity, h, friction):
    """Distance to the edge of the admissible set [m/s]; positive inside."""
    if law == "coulomb":
        return gap / h
    v_t = tangential(normal, velocity)
    return gap / h - friction * jnp.sqrt(dot(v_t, v_t))
