"""The cable's generator against closed forms and another integrator; what its oracle knows of exact symmetries."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validation.blind import cable_forces, cable_midpoint, cable_oracle, cables
from validation.blind.cable_forces import Forces
from validation.blind.cables import Effect
from validation.blind.measure import Noise

SHORT = 0.4  # s


def short(effect: Effect) -> np.ndarray:
    return cables.seen(effect, cables.motion(effect, *cables.commands(0, 0, SHORT))[0])


@pytest.fixture(scope="module")
def nominal() -> np.ndarray:
    return short(Effect())


def test_it_hangs_at_rest_where_gravity_points():
    effect = Effect(tilt=(0.02, 0.0))
    first = short(effect)[0]
    assert np.allclose(first[:, 0], 0.0, atol=1e-12)
    along = first[-1] / np.linalg.norm(first[-1])
    g = cables.gravity(effect) / effect.gravity
    # springs at the carriage hold it back
    assert 0.0 < along[1] < g[1] and np.linalg.norm(first[-1]) == pytest.approx(0.36, abs=1e-4)


def test_the_rate_of_a_rotation_vector_is_the_derivative_of_its_turn():
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, w, h = rng.standard_normal(3), rng.standard_normal(3), 1e-6
        ahead, behind = (Rotation.from_rotvec(q) * Rotation.from_rotvec(s * h * w) for s in (1, -1))
        slope = (ahead.as_rotvec() - behind.as_rotvec()) / (2 * h)
        assert np.allclose(cable_forces.rate(q) @ w, slope, atol=1e-8)


def test_forces_of_our_own_meet_those_of_mujoco_at_their_limits(nominal):
    """A spring without slack, and one that does not creep, are MuJoCo's; one that creeps at once is none."""
    for same in (Forces(slack={2: 0.0}), Forces(creep={2: 1e-9})):
        assert np.abs(short(Effect(forces=same)) - nominal).max() < 1e-10
    without = short(Effect(joint={"joint_2": {"stiffness": 0.0}}))
    creeping = short(Effect(forces=Forces(creep={2: 1e4})))
    assert np.abs(creeping - without).max() < 0.02 * np.abs(without - nominal).max()


def test_no_callback_stays():
    short(Effect(forces=Forces(drag=0.01)))
    assert mujoco.get_mjcb_passive() is None


def test_midpoint_converges_in_second_order_to_mujoco(nominal, monkeypatch):
    error = []
    for every in (2, 4):
        monkeypatch.setattr(cables, "EVERY", every)
        error.append(np.abs(cable_midpoint.motion(*cables.commands(0, 0, SHORT)) - nominal).max())
    assert 3.5 < error[0] / error[1] < 4.5


def test_the_oracle_knows_symmetries():
    """A servo's offset moves all that is read, and nothing else: the sensor's bias. A late servo lags, to first order."""
    if not cable_oracle.cached(0).exists():
        pytest.skip("derivatives not cached; call cable_oracle.known(0) once")
    oracle = cable_oracle.Oracle(cable_oracle.known(0), Noise(0.5, 3e-4))
    offset = oracle.cosines(oracle.change(Effect(offset=(0.1, 0.0))))
    assert offset["sensor_bias"] > 0.9999
    late = oracle.cosines(oracle.change(Effect(late=(1e-3, 0.0))))
    assert late["actuator_lag:motor_x"] > 0.999 and late["joint_stiffness:joint_1"] < 0.9
    assert oracle.mismatch_t2() < 1.0
