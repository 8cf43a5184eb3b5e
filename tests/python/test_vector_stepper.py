"""Copies of one model that are stepped together: the steps of rollouts, their derivatives, failures, errors."""

import threading
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

SCENES = Path(__file__).resolve().parents[2] / "tests" / "scenes"


def load(name):
    """The model of tests/scenes/<name>.toml."""
    return pliant.load(SCENES / f"{name}.toml")


def starts(model, n, seed=0):
    """The scene's start with other velocities."""
    x0s = np.tile(model.initial_state(), (n, 1))
    v = slice(model.nx - len(model.memory_names) - 3 * model.n_nodes, model.nx - len(model.memory_names))
    x0s[:, v] += 0.05 * np.random.default_rng(seed).normal(size=x0s[:, v].shape)
    return x0s


@pytest.mark.parametrize("name", ["windy", "sliding", "arm_pushes", "press"])
def test_a_loop_over_steps_is_the_rollout(name):
    model = load(name)
    u = model.controls(12)
    roll = model.rollout(model.initial_state(), u, record=False)
    stepper = model.stepper()
    assert len(stepper) == 1 and stepper.model is model
    np.testing.assert_array_equal(stepper.x, roll.x[:1])
    for k, row in enumerate(u):
        x = stepper.step(row)
        assert x.shape == (1, model.nx) and x.dtype == np.float64
        np.testing.assert_array_equal(x[0], roll.x[k + 1])
        np.testing.assert_array_equal(stepper.x, x)
    np.testing.assert_allclose(stepper.t, [12 * model.step_length])


@pytest.mark.parametrize("threads", [1, 2, None])
def test_copies_are_bitwise_the_single_rollouts(threads):
    model, rng = load("sliding"), np.random.default_rng(5)
    x0s, thetas = starts(model, 5), model.theta * rng.uniform(0.9, 1.1, size=(5, 1))
    us = np.tile(model.controls(8), (5, 1, 1))
    stepper = model.stepper(5, thetas, x0s=x0s, threads=threads)
    np.testing.assert_array_equal(stepper.thetas, thetas)
    for k in range(8):
        stepper.step(us[:, k])
    for i in range(5):
        roll = model.rollout(x0s[i], us[i], thetas[i], record=False)
        np.testing.assert_array_equal(stepper.x[i], roll.x[-1])
    assert not stepper.failed.any() and stepper.errors == {}


def test_each_copy_starts_at_the_equilibrium_of_its_parameters():
    model = load("clamped_ends")
    thetas = np.stack([model.theta, model.theta_with({"cable.linear_density": 2 * model.theta[model.param_index("cable.linear_density")]})])
    stepper = model.stepper(2, thetas)
    expected = np.stack([model.initial_state(theta) for theta in thetas])
    np.testing.assert_array_equal(stepper.x, expected)
    stepper.step(model.controls(1)[0])
    stepper.reset(1)
    np.testing.assert_array_equal(stepper.x[1], expected[1])
    np.testing.assert_array_equal(stepper.t > 0, [True, False])


def test_reset_clone_and_parameters():
    model = load("sliding")
    u, x0 = model.controls(1)[0], model.initial_state()
    stepper = model.stepper(3, x0s=starts(model, 3))
    for _ in range(6):
        stepper.step(u)
    clone = stepper.clone()
    np.testing.assert_array_equal(stepper.step(u), clone.step(u))
    np.testing.assert_array_equal(stepper.step(u), clone.step(u))
    stepper.reset(0, x0)
    np.testing.assert_array_equal(stepper.x[0], x0)
    np.testing.assert_array_equal(clone.x[1:], stepper.x[1:])
    assert stepper.t[0] == 0.0 and stepper.t[1] > 0.0
    np.testing.assert_array_equal(stepper.step(u)[0], model.rollout(x0, [u]).x[1])
    stepper.clone_copy(0, -1)
    assert stepper.t[2] == stepper.t[0]
    x = stepper.step(u)
    np.testing.assert_array_equal(x[0], x[2])
    theta = model.theta * 1.05
    stepper.set_theta(1, theta)
    before = stepper.x[1]
    np.testing.assert_array_equal(stepper.thetas[1], theta)
    np.testing.assert_array_equal(stepper.step(u)[1], model.rollout(before, [u], theta).x[1])


@pytest.mark.parametrize("name", ["sliding", "arm_actuators"])
def test_derivatives_are_those_of_the_rollout(name):
    model, rng = load(name), np.random.default_rng(7)
    u = model.controls(5)
    roll = model.rollout(model.initial_state(), u)
    stepper = model.stepper(2)
    for k, row in enumerate(u):
        stepper.step(row, record=True)
        for ours, theirs in zip(stepper.linearize(-1), roll.linearize(k), strict=True):
            np.testing.assert_array_equal(ours, theirs)
    a, b, c = stepper.linearize(1)
    dots = [rng.normal(size=n) for n in (model.ndx, model.nu, model.n_params)]
    expected = a @ dots[0] + b @ dots[1] + c @ dots[2]
    np.testing.assert_allclose(stepper.jvp(1, *dots), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    x_bar = rng.normal(size=model.ndx)
    for ours, by_matrix in zip(stepper.vjp(1, x_bar), (x_bar @ a, x_bar @ b, x_bar @ c), strict=True):
        np.testing.assert_allclose(ours, by_matrix, rtol=0, atol=1e-11 * np.abs(by_matrix).max(initial=0))
    stepper.step(u[0])
    with pytest.raises(pliant.InputError, match=r"copy 1 has no record of a last step.*record=True"):
        stepper.linearize(1)


def test_a_copy_that_fails_ends_alone():
    model = load("sliding")
    u, x0s = model.controls(1)[0], starts(model, 3)
    sound, stepper = model.stepper(3, x0s=x0s), model.stepper(3, x0s=x0s)
    fast = x0s[1].copy()
    fast[3 * model.n_nodes : 6 * model.n_nodes] = 1e200
    stepper.reset(1, fast)
    for _ in range(3):
        expected, x = sound.step(u), stepper.step(u)
        np.testing.assert_array_equal(x[[0, 2]], expected[[0, 2]])
        np.testing.assert_array_equal(x[1], fast)
    assert stepper.failed.dtype == bool and stepper.failed.tolist() == [False, True, False]
    assert list(stepper.errors) == [1]
    assert isinstance(stepper.errors[1], pliant.NumericsError)
    assert str(stepper.errors[1]).startswith("copy 1: step 0: ")
    assert repr(stepper) == "<pliant.VectorStepper: 3 copies, 1 failed>"
    stepper.reset(1, x0s[1])
    assert not stepper.failed.any()
    np.testing.assert_array_equal(stepper.step(u)[1], model.rollout(x0s[1], [u]).x[1])


def test_bad_input_is_refused_before_any_copy_steps():
    model = load("velocity_gripper")
    nx, nu = model.nx, model.nu
    stepper = model.stepper(3)
    x, u = stepper.x, np.zeros((3, nu))
    lost, bad = x[0].copy(), u.copy()
    lost[2], bad[1, nu - 1] = np.inf, np.nan
    cases = [
        (lambda: model.stepper(0), "0 copies has nothing to step"),
        (lambda: model.stepper(-2), "n is -2, but must be at least 1"),
        (lambda: model.stepper(2, threads=0), "threads is 0"),
        (lambda: model.stepper(2, [model.theta] * 3), rf"thetas has shape \(3, {model.n_params}\), but \(2, {model.n_params}\) or"),
        (lambda: model.stepper(2, -model.theta), "copy 0: parameter `.*outside its physical range"),
        (lambda: model.stepper(2, x0s=x), rf"x0s has shape \(3, {nx}\), but \(2, {nx}\) or, shared by all, \({nx},\)"),
        (lambda: model.stepper(2, x0s=[x[0], lost]), "x of copy 1 is inf in component 2"),
        (lambda: stepper.step(u[:2]), rf"u has shape \(2, {nu}\), but \(3, {nu}\) or, shared by all, \({nu},\)"),
        (lambda: stepper.step(u[:, 1:]), "u has shape"),
        (lambda: stepper.step("a"), "u is not an array of numbers"),
        (lambda: stepper.step(bad), f"u of copy 1 is NaN in component {nu - 1}, but must be finite"),
        (lambda: stepper.reset(0, lost), "x of copy 0 is inf in component 2"),
        (lambda: stepper.reset(0, x), "x has shape"),
        (lambda: stepper.set_theta(0, [1.0]), r"theta has shape \(1,\)"),
        (lambda: stepper.vjp(0, x[0]), "copy 0 has no record"),
    ]
    for call, text in cases:
        with pytest.raises(pliant.InputError, match=text):
            call()
    for call in (lambda: stepper.reset(3), lambda: stepper.clone_copy(0, -4), lambda: stepper.linearize(3)):
        with pytest.raises(IndexError, match=r"there is no copy -?\d: there are 3, counted from 0"):
            call()
    np.testing.assert_array_equal(stepper.x, x)
    np.testing.assert_array_equal(stepper.t, 0)
    stepper.step(u, record=True)
    with pytest.raises(pliant.InputError, match=r"x_bar\[0\] is NaN"):
        stepper.vjp(0, np.full(model.ndx, np.nan))


def test_the_interpreter_is_free_while_it_steps():
    """During one long step of many copies another thread counts, and a third that reads their times waits for its end."""
    model, counted, done, read = load("cloth_sphere"), 0, threading.Event(), []
    stepper, u = model.stepper(400), model.controls(1)[0]

    def count():
        nonlocal counted
        while not done.wait(1e-3):
            counted += 1

    def look():
        while not done.wait(1e-3):
            read.append(stepper.t)

    threads = [threading.Thread(target=work) for work in (count, look)]
    [thread.start() for thread in threads]
    before = counted
    stepper.step(u)
    after = counted
    done.set()
    [thread.join() for thread in threads]
    assert after - before >= 5
    assert read and all(np.all(t == t[0]) for t in read)
