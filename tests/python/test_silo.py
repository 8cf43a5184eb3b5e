"""Stiffness and damping of an arm's drives from a log of MuJoCo's: gradients against random search."""

import numpy as np
import pytest

pytest.importorskip("mujoco", minversion="4.0")
from validation.silo import align


@pytest.fixture(scope="module")
def log():
    commands = align.actions(1.0, seed=3)
    return commands, align.real(commands, seed=3)


def test_gradients_find_the_gains_with_few_simulations(log):
    arm = align.Arm(*log)
    found = align.descend(arm)
    assert align.rms(arm, found) < 1.1 * align.rms(arm, align.TRUTH)
    assert np.abs(found - align.TRUTH).max() < 0.05
    assert arm.simulations <= 20
    other = align.Arm(*log)
    search, _ = align.search(other, simulations=10 * arm.simulations, batch=32, seed=0)
    assert other.simulations > 5 * arm.simulations
    assert align.rms(other, search) > 10 * align.rms(arm, found)


def test_the_jacobian_is_that_of_the_residual(log):
    arm = align.Arm(*log)
    p = 0.5 * (align.LOW + align.HIGH)
    arm.residual(p)
    direction = np.random.default_rng(0).standard_normal(len(p))
    slope = arm.jacobian(p) @ direction
    step = 1e-5
    difference = (arm.residual(p + step * direction) - arm.residual(p - step * direction)) / (2 * step)
    assert np.abs(slope - difference).max() < 1e-6 * np.abs(difference).max()


def test_actions_beyond_one_are_cut(log):
    commands, readings = log
    assert (np.abs(commands) > 1).any()
    arm = align.Arm(np.clip(commands, -1, 1), readings)
    np.testing.assert_allclose(arm.residual(align.TRUTH), align.Arm(*log).residual(align.TRUTH), atol=1e-12)
