"""Articulated bodies against MuJoCo's RK4, a high-order solver, and what mechanics conserves."""

from pathlib import Path

import mujoco
import numpy as np
import pliant
import pytest
from scipy.integrate import solve_ivp

from validation.bodies import chains
from validation.bodies.chains import Chain

SECONDS = 0.25
SCENES = Path(__file__).resolve().parents[1] / "scenes"


def reference(chain: Chain, step: float = 1e-5) -> np.ndarray:
    """MuJoCo's coordinates after SECONDS, RK4."""
    model = mujoco.MjModel.from_xml_string(chains.mjcf(chain, integrator="RK4", step=step))
    data = mujoco.MjData(model)
    data.qpos[:] = chains.start(chain)
    mujoco.mj_step(model, data, round(SECONDS / step))
    return data.qpos.copy()


def simulate(text: str):
    model = pliant.loads(text)
    return model.rollout(model.initial_state(), model.controls())


def end(chain: Chain, integrator: str, step: float) -> np.ndarray:
    x = simulate(chains.scene(chain, integrator=integrator, step=step, duration=SECONDS)).x[-1]
    return x[: len(chains.start(chain))]


@pytest.mark.parametrize(
    "chain",
    [Chain(2), Chain(7), Chain(18), Chain(7, armature=0.01), Chain(6, joint="ball", stiffness=0.05, damping=1e-3)],
    ids=["2", "7", "18", "7 with rotors", "6 balls"],
)
def test_chains_converge_to_mujoco_at_second_order(chain):
    truth = reference(chain)
    steps = [2e-3, 1e-3, 5e-4]
    for integrator, order in [("midpoint", 2.0), ("sdirk2", 2.0), ("euler", 1.0)]:
        errors = [np.abs(end(chain, integrator, h) - truth).max() for h in steps]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert abs(orders[-1] - order) < 0.15, (integrator, errors, orders)
        if order == 2.0:
            assert errors[-1] < 2e-4, (integrator, errors)


def double_pendulum(t, y):
    """Two rods of `chains` in one plane, both hinges along y; y = (q1, q2, v1, v2), q2 relative."""
    m, length, g = chains.MASS, chains.LENGTH, 9.81
    inertia = Chain(2).inertia[1]
    q1, q2, v1, v2 = y
    half = length / 2
    # point masses at the centres, angles from x downwards
    m12 = inertia + m * half**2 + m * length * half * np.cos(q2)
    m22 = inertia + m * half**2
    m11 = 2 * inertia + 2 * m * half**2 + m * length**2 + 2 * m * length * half * np.cos(q2)
    bend = m * length * half * np.sin(q2)
    down = m * g * half * np.cos(q1 + q2)
    torque = np.array([bend * (2 * v1 * v2 + v2**2) + m * g * (half + length) * np.cos(q1) + down, -bend * v1**2 + down])
    return [v1, v2, *np.linalg.solve([[m11, m12], [m12, m22]], torque)]


def test_double_pendulum_against_a_high_order_solver():
    truth = solve_ivp(double_pendulum, (0, 5), [0.3, 0.3, 0, 0], method="DOP853", rtol=1e-13, atol=1e-13).y[:2, -1]
    chain = Chain(2, damping=0.0)
    errors = []
    for step in [1e-3, 5e-4, 2.5e-4]:
        text = chains.scene(chain, integrator="midpoint", step=step, duration=5.0).replace("axis = [0, 0, 1]", "axis = [0, 1, 0]")
        errors.append(np.abs(simulate(text).x[-1][:2] - truth).max())
    assert abs(np.log2(errors[1] / errors[2]) - 2) < 0.1, errors
    assert errors[2] < 0.02, errors


SPINNING = """
schema_version = 1
[time]
step = 0.01
duration = 20.0
integrator = "midpoint"
[gravity]
magnitude = 0.0
[[body]]
name = "stone"
position = [3.0, 0.0, 0.0]
mass = 0.4
inertia = [0.001, 0.002, 0.0025, 0.0002, 0.0, -0.0001]
[[body.joint]]
name = "flight"
kind = "free"
velocity = [0.5, 0.0, 2.0, 0.1, 6.0, 0.2]
"""


def test_free_rotation_keeps_energy_and_momentum():
    run = simulate(SPINNING)
    energy = np.asarray(run.energy())
    # a step's root is found to 1e-12 of its velocities; 2000 steps add up
    assert np.abs(energy / energy[0] - 1).max() < 1e-10
    w, x, y, z = run.x[:, 3:7].T
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    inertia = np.array([[0.001, 0.0002, 0.0], [0.0002, 0.002, -0.0001], [0.0, -0.0001, 0.0025]])
    momentum = np.einsum("tij,jk,tk->ti", rotation, inertia, run.x[:, 10:13])
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    # turning about the middle axis is unstable: it must have tumbled, or nothing was shown
    assert (run.x[:, 11] < -3).any()
    np.testing.assert_allclose(run.x[-1, :3], [13.0, 0.0, 40.0], atol=1e-9)


WHEEL = """
schema_version = 1
[time]
step = 0.002
duration = 1.0
integrator = "{integrator}"
[[body]]
name = "wheel"
mass = 1.0
inertia = [0.01, 0.01, 0.02, 0, 0, 0]
[[body.joint]]
name = "hub"
kind = "revolute"
friction = 0.1
velocity = [3.0]
[[actuator]]
name = "motor"
joint = "hub"
kind = "torque"
command = {{ kind = "hold", value = {torque} }}
"""


@pytest.mark.parametrize("integrator", ["euler", "midpoint", "sdirk2"])
def test_dry_friction_slows_at_its_torque_and_then_holds(integrator):
    run = simulate(WHEEL.format(integrator=integrator, torque=0.0))
    v = run.x[:, 1]
    t = 0.002 * np.arange(len(v))
    sliding = t < 0.55  # 3 rad/s at 5 rad/s²: 0.6 s
    np.testing.assert_allclose(v[sliding], 3.0 - 5.0 * t[sliding], atol=1e-6)
    assert np.abs(v[t > 0.61]).max() < 1e-6
    # below its bound it holds; the creep is (rest gap / step) ρ/(1 − ρ²), twice the smoothing
    resting = WHEEL.replace("velocity = [3.0]", "velocity = [0.0]")
    held = simulate(resting.format(integrator=integrator, torque=0.05)).x[-1, 1]
    assert 0 < held < 5e-6
    moving = simulate(WHEEL.format(integrator=integrator, torque=0.2)).x[-1, 1]
    assert abs(moving - (3.0 + 5.0)) < 1e-6


def test_a_stop_holds_without_rebound():
    text = WHEEL.format(integrator="euler", torque=0.3).replace("friction = 0.1", "limits = [-1.0, 0.5]")
    run = simulate(text)
    q, v = run.x[:, 0], run.x[:, 1]
    assert q.max() < 0.5 and q[-1] > 0.5 - 1e-6
    assert v.min() > -1e-6


def test_states_hold_what_joints_and_motors_remember():
    """x = [q, v, z]: sizes and names agree, and a Jacobian has the rows of z."""
    model = pliant.load(SCENES / "arm_actuators.toml")
    names = model.memory_names
    assert names == (
        ["shoulder_servo.target"]
        + [f"shoulder_servo.command[{k}]" for k in range(4)]
        + ["shoulder_servo.lagged", "elbow_motor.command[0]", "elbow_motor.command[1]", "finger_motor.lagged"]
    )
    roll = model.rollout(model.initial_state(), model.controls())
    assert roll.x.shape[1] == model.nx == model.ndx + 1  # one ball
    z = roll.x[:, -len(names) :]
    assert np.array_equal(z[1:, 1], z[1:, 0])  # the newest command kept is the target
    assert np.array_equal(z[1:, 2], z[:-1, 1])
    step = int(np.argmax(np.abs(roll.u[:, 0]) < 0.9))  # the first one whose command is not cut
    a, b, _ = roll.linearize(step)
    assert a.shape == (model.ndx, model.ndx) and a[-len(names) + 2, -len(names) + 1] == 1.0
    assert b[-len(names), 0] == 0.02
    theta_bar = roll.vjp(np.ones((len(roll.x), model.ndx)))[2]
    assert theta_bar[model.param_index("shoulder_servo.delay")] != 0.0


DRAGGED = """
schema_version = 1
[time]
step = {step}
duration = {seconds}
integrator = "{integrator}"
[gravity]
magnitude = {gravity}
[air]
wind = [0.0, {wind}, 0.0]
density = {density}
viscosity = {viscosity}
[[body]]
name = "box"
mass = {mass}
center_of_mass = [0.0, 0.01, -0.02]
inertia = [{moment}, {moment}, {moment}, 0.0, 0.0, 0.0]
drag_area = {area}
[[body.joint]]
name = "loose"
kind = "free"
"""


def test_drag_is_the_closed_form_of_a_fall_and_mujocos_in_wind():
    """v = v∞ tanh(g t/v∞) of a fall, v∞² = 2 m g/(ρ A); and a cube that the wind takes along an edge, as MuJoCo's box of equal inertia
    (½ ρ times its side times the square). Along no edge the two differ: MuJoCo squares the velocity along each edge by itself, so that
    drag is not against the motion; nor does pliant's turn a body about its centre."""
    half, mass, gravity, wind, seconds = 0.1, 0.2, 9.81, -3.0, 0.5
    moment, area = mass * (2 * half) ** 2 / 6.0, (2 * half) ** 2
    fixed = {"mass": mass, "moment": moment, "area": area, "seconds": seconds, "density": 1.2, "viscosity": 0.0}
    last = np.sqrt(2.0 * mass * gravity / (1.2 * area))
    fall = last**2 / gravity * np.log(np.cosh(gravity * seconds / last))
    blown = wind * seconds - np.sign(wind) * np.log1p(abs(wind) * 1.2 * area * seconds / (2.0 * mass)) * 2.0 * mass / (1.2 * area)
    for integrator, order in [("midpoint", 2.0), ("sdirk2", 2.0), ("euler", 1.0)]:
        errors = []
        for step in (4e-3, 2e-3, 1e-3):
            common = fixed | {"step": step, "integrator": integrator}
            fallen = simulate(DRAGGED.format(**common, gravity=gravity, wind=0.0)).x[-1][:3]
            carried = simulate(DRAGGED.format(**common, gravity=0.0, wind=wind)).x[-1][:3]
            assert np.abs(fallen[:2]).max() < 1e-12 and np.abs(carried[[0, 2]]).max() < 1e-12  # no moment about the centre turns it
            errors.append([abs(fallen[2] + fall), abs(carried[1] - blown)])
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert np.abs(orders[-1] - order).max() < 0.1, (integrator, errors)
        assert np.max(errors[-1]) < (1e-6 if order == 2.0 else 3e-3), (integrator, errors)
    # MuJoCo's in a viscous medium is Stokes' for the mean half edge
    rate = 6.0 * np.pi * 0.1 * half / mass
    slowed = fixed | {"step": 1e-3, "integrator": "sdirk2", "gravity": 0.0, "wind": wind, "area": np.pi * half**2, "density": 0.0, "viscosity": 0.1}
    creeping = wind * (seconds - (1.0 - np.exp(-rate * seconds)) / rate)
    assert abs(simulate(DRAGGED.format(**slowed)).x[-1][1] - creeping) < 1e-6
    for medium, place in [('density="1.2"', blown), ('viscosity="0.1"', creeping)]:
        theirs = mujoco.MjModel.from_xml_string(
            f'<mujoco><option gravity="0 0 0" {medium} wind="0 {wind} 0" timestep="1e-4" integrator="RK4"/><worldbody><body>'
            f'<freejoint/><geom type="box" size="{half} {half} {half}" mass="{mass}"/></body></worldbody></mujoco>'
        )
        data = mujoco.MjData(theirs)
        mujoco.mj_step(theirs, data, round(seconds / 1e-4))
        assert abs(data.qpos[1] - place) < 1e-9 * abs(place) and abs(place) > 0.05


def test_drag_of_the_air_is_refused_where_it_does_nothing():
    text = DRAGGED.format(
        mass=0.2, moment=1e-3, area=0.04, seconds=0.1, step=1e-3, integrator="euler", gravity=9.81, wind=0.0, density=1.2, viscosity=1e-5
    )
    for wrong, by, says in [
        ("density = 1.2", "density = -1.2", ["air.density", "-1.2", "kg/m³"]),
        ("viscosity = 1e-05", "viscosity = -1.0", ["air.viscosity", "Pa·s"]),
        ("drag_area = 0.04", "drag_area = -0.04", ["body[0].drag_area", "m²"]),
    ]:
        with pytest.raises(ValueError) as refused:
            pliant.loads(text.replace(wrong, by))
        assert all(word in str(refused.value) for word in says), refused.value
    rope = (SCENES / "free_swing.toml").read_text(encoding="utf-8")
    with pytest.raises(ValueError, match=r"air\.density.*drag_quadratic"):
        pliant.loads(rope + "\n[air]\ndensity = 1.2\n")
    frame = '[[body]]\nname = "frame"\ndrag_area = 0.1\n[[body.joint]]\nname = "hinge"\nkind = "revolute"\n'
    with pytest.raises(ValueError, match=r"body\[1\]\.drag_area.*no mass"):
        pliant.loads(text + frame)
