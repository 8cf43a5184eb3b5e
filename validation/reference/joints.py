"""What joints do: how they move a body, and their springs, friction, motors and stops.

Coordinates of a revolute or prismatic joint are one angle [rad] or length [m]; of a ball, a unit
quaternion. A universal joint is two revolute ones, a free body three prismatic ones and a ball.
Signs: force f = -∂E/∂q for an energy E [J], f = -∂R/∂v for a dissipation R [W].
"""

import jax.numpy as jnp

from . import rotations

WEIGHT = 10.0  # [m/s²]: makes a weight of an inertia, in what smooths friction and stops
FRICTION_FLOOR = 1e-3  # of that weight, which smooths friction of size zero
RHO = 0.3  # step of the natural residual over the inertia of its degree of freedom


def sliding(axis, q):
    """The body's new frame in its old one, (4, 4), of a prismatic joint at q [m]."""
    return _frame(jnp.eye(3), axis * q)


def turning(quaternion, anchor):
    """Likewise of a turn about the anchor, a point of the body's frame."""
    rotation = rotations.matrix(quaternion)
    return _frame(rotation, anchor - rotation @ anchor)


def _frame(rotation, position):
    return jnp.concatenate([jnp.column_stack([rotation, position]), jnp.array([[0.0, 0.0, 0.0, 1.0]])])


def spring_energy(stretch2, stiffness, cubic):
    """E = ½ k x² + ¼ k₃ x⁴ [J] of x² = (q - rest)², or the squared rotation vector of a ball."""
    return 0.5 * stiffness * stretch2 + 0.25 * cubic * stretch2**2


def quadratic_dissipation(speed2, quadratic):
    """R = ⅓ k |v|³ [W] of a force -∂R/∂v = -k |v| v, of |v|² = v², or the squared angular velocity of a ball."""
    moving = speed2 > 0.0
    return jnp.where(moving, quadratic * jnp.where(moving, speed2, 1.0) ** 1.5 / 3.0, 0.0)


def cogging_energy(q, cycles, sine, cosine):
    """E = (a cos(n q) - b sin(n q))/n [J] of a torque -∂E/∂q = a sin(n q) + b cos(n q) [N·m], n cycles per turn."""
    return (sine * jnp.cos(cycles * q) - cosine * jnp.sin(cycles * q)) / cycles


def motor_force(kind, p, u, q, v):
    """Generalized force [N·m or N] on a joint at (q, v) whose motor turns `gear` times as far.

    The motor's own torque is τ = gain u, k (u - gear q) - d gear v, or d (u - gear v), plus an
    offset; its power is τ gear v, so the joint sees gear τ.
    """
    turn, speed = p["gear"] * q, p["gear"] * v
    torque = {
        "torque": lambda: p["gain"] * u,
        "position": lambda: p["stiffness"] * (u - turn) - p["damping"] * speed,
        "velocity": lambda: p["damping"] * (u - speed),
    }[kind]()
    return p["gear"] * (torque + p["offset"])


def positive_part(x, area):
    """φ(x) = (x + √(x² + 4 area))/2 > 0, the root of φ (φ - x) = area."""
    root = jnp.sqrt(x * x + 4.0 * area)
    return jnp.where(x < 0.0, 2.0 * area / (root - jnp.minimum(x, 0.0)), 0.5 * (x + root))


def friction_bound(coulomb, stiction, stribeck, v):
    """b = c + s exp(-(v/v_s)²) [N·m or N]: Stribeck's curve without its viscous part."""
    return coulomb + stiction * jnp.exp(-((v / stribeck) ** 2))


def friction_residual(bound, v, gamma, rho, kappa):
    """F = γ + b - φ(γ - ρ v + b) + φ(γ - ρ v - b) [N·m·s]: |γ| ≤ b against v; b an impulse."""
    z, area = gamma - rho * v, rho * kappa
    return gamma + bound - positive_part(z + bound, area) + positive_part(z - bound, area)


def stop_residual(v_n, gamma, rho, kappa):
    """F = γ - φ(γ - ρ v_n) [N·m·s], zero where γ v_n = κ; v_n = distance at the end of the step / h."""
    return gamma - positive_part(gamma - rho * v_n, rho * kappa)
