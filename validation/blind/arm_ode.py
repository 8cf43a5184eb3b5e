"""The two-link arm of `arms.py` in closed form, many variants at once: what the oracle's sensitivities are made of.

    M(q₂) q̈ = τ - C(q, q̇) - G(q)      angles from hanging [rad], the second relative to the first

Classical Runge-Kutta, or the implicit midpoint rule (what a fitter's step would make of the same equations). Forces of a variant
are entries of `ZERO`, arrays over variants; commands are given at the middles of steps, after delay, lag and limits.
"""

from __future__ import annotations

import numpy as np

L1, C1, C2 = 0.3, 0.15, 0.12  # m
M1, I1 = 1.0, 0.0085  # kg, kg·m²
M2, I2 = 0.7, 0.0045  # kg; kg·m², which grows with the mass
G = 9.81  # m/s²
SHARP = 2e-3  # rad/s, over which dry friction turns

# what a variant may change; pairs are shoulder, elbow
ZERO: dict[str, float | tuple[float, float]] = {
    "lower_mass": M2,
    "upper_mass": M1,
    "lower_com": 0.0,  # m, of the lower link's centre, further out
    "damping": (0.0, 0.0),  # N·m·s/rad
    "friction": (0.0, 0.0),  # N·m
    "push": (0.0, 0.0),  # N·m, constant
    "load": (0.0, 0.0),  # friction per torque of the motor
    "stribeck": (0.0, 0.0),  # N·m, of 0.3 rad/s
    "stiffness": (0.0, 0.0),  # N·m/rad
    "cubic": (0.0, 0.0),  # N·m/rad³
    "armature": (0.0, 0.0),  # kg·m²
    "ripple": (0.0, 0.0),  # N·m of sin(8 q)
    "quadratic": (0.0, 0.0),  # N·m·s²/rad²
    "tilt": 0.0,  # rad
}
RIPPLES = 8.0  # per rad
FADING = 0.3  # rad/s


def parameters(variants: list[dict]) -> dict[str, np.ndarray]:
    """Arrays over variants of everything in `ZERO`."""
    return {
        key: np.array([variant.get(key, zero) for variant in variants], float).T
        for key, zero in ZERO.items()
    }


def acceleration(
    p: dict[str, np.ndarray], q: np.ndarray, v: np.ndarray, torque: np.ndarray
) -> np.ndarray:
    """q̈ of states (2, n) under motor torques (2, n)."""
    m2 = p["lower_mass"]
    m1 = p["upper_mass"]
    i1, i2 = I1 * m1 / M1, I2 * m2 / M2
    c2 = C2 + p["lower_com"]
    coupling = m2 * L1 * c2
    m12 = i2 + m2 * c2**2 + coupling * np.cos(q[1])
    m22 = i2 + m2 * c2**2 + p["armature"][1]
    m11 = (
        i1
        + m1 * C1**2
        + i2
        + m2 * (L1**2 + c2**2)
        + 2 * coupling * np.cos(q[1])
        + p["armature"][0]
    )
    h = coupling * np.sin(q[1])
    a1, a2 = q[0] + p["tilt"], q[0] + q[1] + p["tilt"]
    lower = m2 * c2 * G * np.sin(a2)
    bound = (
        p["friction"]
        + p["load"] * np.abs(torque)
        + p["stribeck"] * np.exp(-((v / FADING) ** 2))
    )
    f = torque + p["push"] - p["damping"] * v - bound * np.tanh(v / SHARP)
    f = f - p["stiffness"] * q - p["cubic"] * q**3
    f = f + p["ripple"] * np.sin(RIPPLES * q) - p["quadratic"] * v * np.abs(v)
    r1 = (
        f[0]
        + h * (2 * v[0] * v[1] + v[1] ** 2)
        - (m1 * C1 + m2 * L1) * G * np.sin(a1)
        - lower
    )
    r2 = f[1] - h * v[0] ** 2 - lower
    det = m11 * m22 - m12**2
    return np.stack([(m22 * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det])


def simulate(
    p: dict[str, np.ndarray],
    q: np.ndarray,
    v: np.ndarray,
    torque: np.ndarray,
    h: float,
    every: int,
    midpoint: bool = False,
) -> np.ndarray:
    """Angles (samples, 2, n) at every `every`-th step from states (2, n); torques (steps, 2, n) at the steps' middles."""
    out = [q]
    for k in range(len(torque)):
        u = torque[k]
        if midpoint:
            a = acceleration(p, q, v, u)
            for _ in range(6):
                a = acceleration(p, q + 0.5 * h * (v + 0.5 * h * a), v + 0.5 * h * a, u)
            q, v = q + h * (v + 0.5 * h * a), v + h * a
        else:
            # commands are linear between the middles of steps
            last, following = torque[max(k - 1, 0)], torque[min(k + 1, len(torque) - 1)]
            before, after = 0.5 * (last + u), 0.5 * (u + following)
            k1 = acceleration(p, q, v, before)
            k2 = acceleration(p, q + 0.5 * h * v, v + 0.5 * h * k1, u)
            k3 = acceleration(p, q + 0.5 * h * (v + 0.5 * h * k1), v + 0.5 * h * k2, u)
            k4 = acceleration(p, q + h * (v + 0.5 * h * k2), v + h * k3, after)
            q = q + h * v + h * h / 6 * (k1 + k2 + k3)
            v = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if (k + 1) % every == 0:
            out.append(q)
    return np.stack(out)
