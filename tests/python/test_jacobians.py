"""Jacobians of whole rollouts, many tangents at once, and the nearest points of grippers."""

import numpy as np
import pliant
import pytest
from validation.control.tasks import make


@pytest.fixture(scope="module", params=["LiftRope", "DragRope"])
def case(request):
    """A quasi-static rope that is held from the third step on, by a draw of inputs."""
    task = make(request.param, 3).load()
    lower, upper = task.bounds
    u = np.clip(np.random.default_rng(5).normal(0, 0.1, (8, task.model.nu)), lower, upper)
    x0 = task.x0.copy()
    reach = task.model.reach(x0, task.model.grasping[0])
    x0[3 * task.model.n_nodes - 3 * len(task.model.grasping) :][:3] = reach["point"] + [0, 0, 0.004]
    roll = task.model.rollout(x0, u)
    assert task.model.held(roll.x[1])[0] and not task.model.held(roll.x[0])[0]
    return task.model, roll


def test_jacobians_are_those_of_each_step(case):
    model, roll = case
    a, b = roll.jacobians()
    a3, b3, c = roll.jacobians(theta=True)
    # contact is 1e7 times stiffer than the rope, and refinement ends at rounding by another way with more columns
    for own, other in ((a, a3), (b, b3)):
        assert np.abs(own - other).max() < 1e-9 * np.abs(other).max()
    assert c.shape == (8, model.ndx, model.n_params)
    for k in range(8):
        for own, other in zip((a3[k], b3[k], c[k]), roll.linearize(k), strict=True):
            assert np.array_equal(own, other)


def test_jacobians_go_into_given_arrays(case):
    model, roll = case
    a, b = np.full((8, model.ndx, model.ndx), np.nan), np.full((8, model.ndx, model.nu), np.nan)
    got = roll.jacobians(out=(a, b))
    assert got[0] is a and got[1] is b
    assert np.array_equal(a, roll.jacobians()[0]) and np.array_equal(b, roll.jacobians()[1])


def test_wrong_arrays_are_refused(case):
    model, roll = case
    a, b = roll.jacobians()
    with pytest.raises(pliant.InputError, match="out has 2 arrays, but 3 are needed"):
        roll.jacobians(theta=True, out=(a, b))
    with pytest.raises(pliant.InputError, match=r"out\[1\] must be a C-contiguous float64 array of shape"):
        roll.jacobians(out=(a, a))
    with pytest.raises(pliant.InputError, match=r"out\[0\]"):
        roll.jacobians(out=(a.transpose(0, 2, 1), b))


def test_quasi_static_steps_do_not_depend_on_velocities(case):
    model, roll = case
    a, _ = roll.jacobians()
    nv = (model.ndx - len(model.memory_names)) // 2
    assert np.all(a[:, :, nv : 2 * nv] == 0)
    x0_dot = np.zeros(model.ndx)
    x0_dot[nv : 2 * nv] = np.random.default_rng(1).normal(size=nv)
    assert np.all(roll.jvp(x0_dot=x0_dot)[1:] == 0)
    # the columns that are left are those of tangents
    x0_dot = np.random.default_rng(2).normal(size=model.ndx)
    x0_dot[nv : 2 * nv] = 0
    tangent = roll.jvp(x0_dot=x0_dot)[1]
    assert np.linalg.norm(a[0] @ x0_dot - tangent) < 1e-9 * np.linalg.norm(tangent)


def test_many_tangents_are_single_ones(case):
    model, roll = case
    rng = np.random.default_rng(4)
    x0_dot, u_dot, theta_dot = (rng.normal(size=shape) for shape in [(model.ndx, 3), (8, model.nu, 3), (model.n_params, 3)])
    many = roll.jvp_columns(x0_dot, u_dot, theta_dot)
    assert many.shape == (9, model.ndx, 3)
    for k in range(3):
        one = roll.jvp(x0_dot[:, k], u_dot[:, :, k], theta_dot[:, k])
        assert np.abs(many[:, :, k] - one).max() < 1e-9 * np.abs(one).max()


def test_wrong_directions_are_refused(case):
    model, roll = case
    with pytest.raises(pliant.InputError, match="at least one of"):
        roll.jvp_columns()
    with pytest.raises(pliant.InputError, match=r"x0_dot has shape"):
        roll.jvp_columns(x0_dot=np.zeros(model.ndx))
    with pytest.raises(pliant.InputError, match="theta_dot"):
        roll.jvp_columns(x0_dot=np.zeros((model.ndx, 2)), theta_dot=np.zeros((model.n_params, 3)))
    with pytest.raises(pliant.InputError, match="u_dot has 7 steps, but the rollout has 8"):
        roll.jvp_columns(u_dot=np.zeros((7, model.nu, 2)))


def test_the_nearest_point_and_its_distance(case):
    model, roll = case
    x, name = roll.x[0].copy(), model.grasping[-1]
    q = x[: 3 * model.n_nodes].reshape(-1, 3)
    (rope,) = model.ropes.values()
    # beside an edge: at a node the distance has a kink in its slope
    gripper = q[rope][7] + 0.3 * (q[rope][8] - q[rope][7]) + [0.01, 0.02, 0.03]
    x[3 * model.n_nodes - 3 : 3 * model.n_nodes] = gripper
    reach = model.reach(x, name)
    # the nearest of many points on the rope's edges
    t = np.linspace(0, 1, 2001)[:, None]
    points = np.concatenate([a + t * (b - a) for a, b in zip(q[rope][:-1], q[rope][1:], strict=True)])
    distances = np.linalg.norm(points - gripper, axis=1)
    assert distances.min() - 1e-6 < reach["distance"] <= distances.min() + 1e-12
    assert np.allclose(reach["weights"] @ q[reach["nodes"]], reach["point"], atol=1e-15)
    dx = np.random.default_rng(0).normal(size=model.ndx)
    h = 1e-6
    ends = [model.reach(model.displaced(x, s * h * dx), name)["distance"] for s in (1, -1)]
    assert abs((ends[0] - ends[1]) / (2 * h) - reach["distance_by_x"] @ dx) < 1e-7
    with pytest.raises(pliant.InputError, match="no gripper named \"foot\" grasps"):
        model.reach(x, "foot")
