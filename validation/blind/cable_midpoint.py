"""What a fitter's step would make of the cable's own equations: the implicit midpoint rule at the scene's step.

    M(q̄) (v⁺ - v)/h + C(q̄, v̄) - f(q̄, v̄) = 0,   v̄ = (v + v⁺)/2,   q̄ half way from q to q⁺

Balls turn from q to q⁺ by Cayley's map of h v̄, tan(θ/2) = h |v̄|/2, and q̄ is half that turn away. Terms are
MuJoCo's. That the tool's laws and its step are these is for the reference tests to say.
"""

from __future__ import annotations

import mujoco
import numpy as np

from validation.blind import cable_forces, cables


def motion(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Places of the markers (samples, markers, 3) [m] where nothing is hidden, from rest."""
    effect, h = cables.Effect(), 1.0 / cables.RATE / cables.EVERY
    with cable_forces.alone():
        model = mujoco.MjModel.from_xml_string(cables.xml(effect))
        data = mujoco.MjData(model)
        command = cables.motor_command(effect, t, u, h, (len(t) - 1) * cables.EVERY)
        cable_forces.settle(model, data, u[0])
        q, v = data.qpos.copy(), np.zeros(model.nv)
        stiffness = np.array([cables.SERVO] * 2 + [cables.STIFFNESS] * (model.nv - 2))
        damping = np.array([cables.BRAKE] * 2 + [cables.DAMPING] * (model.nv - 2))
        out = [cables.markers(data)]
        for k, own in enumerate(command):
            data.ctrl[:] = own
            q, v = step(model, data, q, v, h, stiffness, damping)
            if (k + 1) % cables.EVERY == 0:
                data.qpos[:] = q
                mujoco.mj_kinematics(model, data)
                out.append(cables.markers(data))
    return np.array(out)


def step(
    model: mujoco.MjModel, data: mujoco.MjData, q: np.ndarray, v: np.ndarray, h: float, stiffness: np.ndarray, damping: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """q⁺, v⁺ by Newton's method with the mass at q̄ and these dampings and stiffnesses (nv,); what that leaves out is small."""
    new, mass = v.copy(), np.empty((model.nv, model.nv))
    for _ in range(30):
        mean = 0.5 * (v + new)
        data.qpos[:] = moved(model, q, mean, h, 0.5)
        data.qvel[:] = mean
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fullM(model, data, mass)
        force = data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
        slope = mass / h + np.diag(0.5 * damping + 0.25 * h * stiffness)
        change = np.linalg.solve(slope, mass @ (new - v) / h + force)
        new = new - change
        if np.abs(change).max() < 1e-11:
            break
    return moved(model, q, 0.5 * (v + new), h, 1.0), new


def moved(model: mujoco.MjModel, q: np.ndarray, v: np.ndarray, h: float, part: float) -> np.ndarray:
    """q moved by a part of Cayley's map of h v."""
    way = h * v
    for k in range(2, len(way), 3):
        size = np.linalg.norm(way[k : k + 3])
        way[k : k + 3] *= 2.0 * np.arctan(0.5 * size) / size if size > 0.0 else 1.0
    out = q.copy()
    mujoco.mj_integratePos(model, out, way, part)
    return out
