"""Makes the logs of examples/arm_log: an arm in MuJoCo whose elbow has friction that its URDF lacks.

    python -m validation.arm_example

The motors follow sums of sines; encoders read in steps of 0.01° with an error of 0.02°.
"""

from pathlib import Path

import mujoco
import numpy as np

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "arm_log"
STEP, EVERY, SECONDS = 2e-4, 50, 2.0  # s, steps to a sample, s
DAMPING = 0.08  # N·m·s/rad


def model() -> mujoco.MjModel:
    """The arm of the URDF, with viscous friction in its elbow, and motors."""
    spec = mujoco.MjSpec.from_file(str(FOLDER / "arm.urdf"))
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    for joint in ("shoulder", "elbow"):
        spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    arm = spec.compile()
    arm.dof_damping[arm.joint("elbow").dofadr] = DAMPING
    return arm


def main() -> None:
    arm, rng = model(), np.random.default_rng(0)
    for run in range(3):
        data, rows = mujoco.MjData(arm), []
        hertz = rng.uniform(0.5, 1.5, 3)
        torque = lambda t, f=hertz: (1.5 * np.sin(2 * np.pi * f[0] * t) + 0.8 * np.sin(2 * np.pi * f[1] * t), 0.5 * np.sin(2 * np.pi * f[2] * t))
        for k in range(round(SECONDS / STEP) + 1):
            t = k * STEP
            if k % EVERY == 0:
                read = np.rad2deg(data.qpos) + rng.normal(0.0, 0.02, 2)
                rows.append((1e3 * t, *read, *torque(t)))
            data.ctrl[:] = torque(t + 0.5 * STEP)
            mujoco.mj_step(arm, data)
        header = "time_ms,shoulder_pos_deg,elbow_pos_deg,shoulder_torque,elbow_torque"
        np.savetxt(FOLDER / f"run{run + 1}.csv", rows, fmt=["%.0f", "%.2f", "%.2f", "%.4f", "%.4f"], delimiter=",", header=header, comments="")


if __name__ == "__main__":
    main()
