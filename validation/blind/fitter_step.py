"""The fitter's own numerics on the generator's forces: what a perfect fitter would still get wrong.

One implicit-midpoint step of length h, as pliant takes it: the driven nodes move linearly between
the logged positions u, v_driven⁺ = (u + offset - q)/h, and for the free nodes

    m (v⁺ - v)/h = f(q̄, v̄),   q̄ = q + h (v + v⁺)/4,   v̄ = (v + v⁺)/2,   q⁺ = q + h (v + v⁺)/2

(driven: q̄ = q + h v⁺/2, v̄ = v⁺, q⁺ = q + h v⁺). The difference to the ODE at the log's times is the
generator-fitter mismatch of a family; `oracle.mismatch` whitens it and projects it.
"""

from __future__ import annotations

import numpy as np

from validation.blind.families import Family, driven_positions
from validation.blind.rope_ode import Params, equilibrium, forces, masses, take


def midpoint_rollout(family: Family, p: Params, records: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Positions at the log's times (T, 3, n, B) [m], by implicit midpoint at `family.step`."""
    sub = round(1.0 / (family.rate * family.step))
    assert sub >= 1, "the fitter's step must divide the log's interval"
    h = 1.0 / (family.rate * sub)
    shift = p["offset"].T.reshape(len(records), -1, 3).transpose(2, 1, 0)[..., None]
    command = np.stack([driven_positions(family, r, family.times) for r in records], axis=2) + shift
    q = equilibrium(family, p, command[..., 0], guess)
    v = np.zeros_like(q)
    out = np.empty((len(family.times), *q.shape))
    out[0] = q
    for row in range(1, len(family.times)):
        start = command[..., row - 1]
        for part in range(1, sub + 1):  # linear between logged positions
            target = start + (command[..., row] - start) * (part / sub)
            q, v = midpoint_step(family, p, q, v, target, h)
        out[row] = q
    return out


def midpoint_step(
    family: Family, p: Params, q: np.ndarray, v: np.ndarray, target: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """One step for every variant; chord Newton with a forward-difference Jacobian."""
    n_batch = q.shape[2]
    free, held = family.free_nodes, family.driven
    width = free.stop - free.start
    k = 3 * width
    m = masses(family, p)[free]

    def residual(v_free: np.ndarray, pp: Params, index: np.ndarray) -> np.ndarray:
        v_new = v[:, :, index].copy()
        v_new[:, held] = (target - q[:, held])[:, :, index] / h
        v_new[:, free] = v_free
        v_mid = 0.5 * (v[:, :, index] + v_new)
        v_mid[:, held] = v_new[:, held]
        f = forces(family, pp, q[:, :, index] + 0.5 * h * v_mid, v_mid)
        return m[:, index] * (v_free - v[:, free][:, :, index]) / h - f[:, free]

    every = np.arange(n_batch)
    spread = np.repeat(every, k + 1)
    delta = 1.0e-6
    y = v[:, free].copy()
    trial = np.repeat(y, k + 1, axis=2).reshape(3, width, n_batch, k + 1)
    for j in range(k):
        trial[j // width, j % width, :, j + 1] += delta
    r = residual(trial.reshape(3, width, -1), take(p, spread), spread).reshape(k, n_batch, k + 1)
    r = r.transpose(1, 0, 2)
    inverse = np.linalg.inv((r[:, :, 1:] - r[:, :, :1]) / delta)
    value = r[:, :, 0]
    for _ in range(40):
        step = -np.einsum("bij,bj->bi", inverse, value)
        y += step.reshape(n_batch, 3, width).transpose(1, 2, 0)
        if np.abs(step).max() < 1.0e-10:
            break
        value = residual(y, p, every).reshape(k, n_batch).T
    else:
        raise RuntimeError(f"midpoint step did not converge: {np.abs(step).max():.1e} m/s")
    q_new, v_new = q.copy(), v.copy()
    q_new[:, held], v_new[:, held] = target, (target - q[:, held]) / h
    q_new[:, free] += 0.5 * h * (v[:, free] + y)
    v_new[:, free] = y
    return q_new, v_new
