"""Joints that follow others: closed forms of gears and screws, and MuJoCo's equality constraints at a small step."""

from pathlib import Path

import numpy as np
import pliant
import pytest

SCENE = (Path(__file__).parents[1] / "scenes" / "gears.toml").read_text()
# two wheels, a motor at the first one: no weight, no friction
PAIR = """
schema_version = 1
[time]
step = 0.005
duration = 1.0
integrator = "{integrator}"
[gravity]
magnitude = 0.0
{bodies}
[[coupling]]
name = "gear"
joint = "second"
to = "first"
coefficients = [0.0, {ratio}]
[[actuator]]
name = "motor"
joint = "first"
kind = "torque"
"""
WHEEL = """
[[body]]
name = "wheel_{name}"
position = [{x}, 0, 0]
mass = {mass}
inertia = [{inertia}, {inertia}, {inertia}, 0, 0, 0]
[[body.joint]]
name = "{name}"
kind = "{kind}"
"""


def pair(ratio, kind="revolute", integrator="sdirk2", inertias=(0.02, 0.5)):
    wheels = [
        WHEEL.format(name=name, x=x, mass=1.5, inertia=inertia, kind=which)
        for name, x, inertia, which in zip(
            ("first", "second"), (0, 1), inertias, ("revolute", kind), strict=True
        )
    ]
    return PAIR.format(bodies="".join(wheels), ratio=ratio, integrator=integrator)


@pytest.mark.parametrize("integrator", ["euler", "sdirk2"])
@pytest.mark.parametrize(
    ("kind", "ratio"), [("revolute", -0.25), ("revolute", 8.0), ("prismatic", 0.02)]
)
def test_gears_and_screws_have_the_inertia_that_the_motor_feels(kind, ratio, integrator):
    """J = J1 + n^2 J2, of a screw J1 + n^2 m; a constant torque turns it evenly, and work is not lost."""
    model = pliant.loads(pair(ratio, kind, integrator))
    torque, steps = 0.3, 200
    x = model.rollout(model.initial_state(), np.full((steps, 1), torque)).x
    felt = 0.02 + ratio**2 * (0.5 if kind == "revolute" else 1.5)
    rate = torque / felt
    assert x[-1, 2] == pytest.approx(rate * 1.0, rel=1e-6)
    assert x[-1, 3] == pytest.approx(ratio * rate * 1.0, rel=1e-6)
    # the torque that the teeth carry bends them by a rest gap's compliance
    assert np.abs(x[:, 1] - ratio * x[:, 0]).max() < 1e-7
    order = 0.005 if integrator == "euler" else 1e-5
    assert x[-1, 0] == pytest.approx(rate / 2, rel=1.1 * order)


def test_gradients_know_the_ratio():
    """The derivative of the speed reached by the ratio, from the closed form."""
    ratio, torque = 0.6, 0.3
    model = pliant.loads(pair(ratio))
    run = model.rollout(model.initial_state(), np.full((200, 1), torque))
    x_bar = np.zeros_like(run.x)
    x_bar[-1, 2] = 1.0
    theta_bar = run.vjp(x_bar)[2]
    k = model.param_paths.index("gear.coefficient[1]")
    felt = 0.02 + 0.5 * ratio**2
    assert theta_bar[k] == pytest.approx(-torque / felt**2 * 2 * 0.5 * ratio, rel=1e-5)


MUJOCO = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" integrator="implicit"/>
  <worldbody>
    <body name="pinion">
      <joint name="pinion_axle" axis="0 1 0" armature="0.0001" damping="0.001"/>
      <inertial pos="0.04 0 0" mass="0.3" diaginertia="0.0002 0.0003 0.0002"/>
    </body>
    <body name="wheel" pos="0.2 0 0">
      <joint name="wheel_axle" axis="0 1 0" damping="0.002"/>
      <inertial pos="0 0 -0.02" mass="0.8" diaginertia="0.001 0.002 0.001"/>
      <body name="slider" pos="0.1 0 0">
        <joint name="rail" type="slide" axis="1 0 0" stiffness="5"/>
        <inertial pos="0 0 0" mass="0.2" diaginertia="0.0001 0.0001 0.0001"/>
      </body>
    </body>
  </worldbody>
  <equality>
    <joint joint1="wheel_axle" joint2="pinion_axle" polycoef="0 -0.5 0 0 0" solref="{soft} 1" solimp="0.9999 0.9999 0.001 0.5 2"/>
    <joint joint1="rail" joint2="wheel_axle" polycoef="0 0.02 0.03 -0.01 0" solref="{soft} 1" solimp="0.9999 0.9999 0.001 0.5 2"/>
  </equality>
</mujoco>
"""


def test_gears_and_a_cam_move_as_in_mujoco():
    """Both differ from the limit of rigid teeth and no step by what their steps make; MuJoCo's teeth are springs."""
    mujoco = pytest.importorskip("mujoco")

    def theirs(step):
        mj = mujoco.MjModel.from_xml_string(MUJOCO.format(step=step, soft=2 * step))
        data = mujoco.MjData(mj)
        data.qpos[:], data.qvel[:] = (0.2, -0.1, -0.00169), (1.5, -0.75, -0.010275)
        for _ in range(round(0.4 / step)):
            mujoco.mj_step(mj, data)
        return data.qpos.copy()

    def ours(step):
        text = SCENE.replace("step = 0.004166666666666667", f"step = {step!r}").replace(
            "compliance = 1e-6\n", ""
        )
        model = pliant.loads(text)
        steps = round(0.4 / step)
        return model.rollout(model.initial_state(), model.controls(steps), record=False).x[-1][:3]

    # first order in the step: extrapolated to none
    coarse, fine = theirs(1e-4), theirs(5e-5)
    expected = 2 * fine - coarse
    error = np.abs(ours(0.001) - expected).max()
    assert error < 2e-5, (error, fine - coarse)
