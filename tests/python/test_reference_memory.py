"""Rods that creep, yield, stiffen and rub against the independent JAX reference, over a hundred steps; and the reference's own laws.

Bars as in `test_reference`: state ≤ 1e-9, gradient ≤ 1e-8, relative.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference_cases import case, gradient_errors, jit, parts, relative, wiggle

from validation.reference import remembering

pliant = pytest.importorskip("pliant")

pytestmark = pytest.mark.long

STEPS = 100
CASES = [
    ("rod_creep", "euler"),
    ("rod_creep", "midpoint"),
    ("rod_creep", "sdirk2"),
    ("rod_plastic", "euler"),
    ("rod_plastic", "midpoint"),
    ("rod_plastic", "sdirk2"),
    ("rod_friction", "euler"),
    ("rod_friction", "midpoint"),
    ("rod_friction", "sdirk2"),
    ("set_friction", "midpoint"),  # with creep and plasticity besides
]
TAU, LIMIT = 0.07, 0.1


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def both(request):
    """(reference case, pliant model, states of the reference, pliant's rollout)."""
    run = case(*request.param)
    model = pliant.loads(run.text)
    u = wiggle(run.model, run.model.q0, STEPS)
    # a state in which sections remember something
    x0 = run.model.initial_state()
    memory = slice(2 * run.model.nq, run.model.ndx)
    x0[memory] = 0.05 * np.random.default_rng(3).normal(size=run.model.n_memory)
    xs, error = run.rollout(x0, u, run.model.theta)
    assert error < 1e-11
    return run, model, xs, model.rollout(x0, u, run.model.theta)


def test_layout(both):
    run, model, *_ = both
    assert list(model.param_paths) == run.model.paths
    np.testing.assert_allclose(model.theta, run.model.theta, rtol=1e-15, atol=0.0)
    np.testing.assert_allclose(model.initial_state(), run.model.initial_state(), rtol=1e-12, atol=1e-14)
    assert (model.nx, model.ndx) == (run.model.nx, run.model.ndx)
    assert len(model.memory_names) == model.nx - 2 * run.model.nq


def test_states_of_a_hundred_steps(both):
    run, _, xs, roll = both
    assert not roll.trace["retries"].any()
    for got, expected in zip(parts(run.model, roll.x), parts(run.model, xs), strict=True):
        assert relative(got, expected) <= 1e-9


def test_gradients_of_a_hundred_steps(both):
    run, _, xs, roll = both
    x_bar = np.random.default_rng(11).normal(size=(STEPS + 1, run.model.ndx))
    expected, got = run.vjp(xs, np.asarray(roll.u), run.model.theta, x_bar), roll.vjp(x_bar)
    errors = gradient_errors(run.model, got, expected)
    assert {"rod.creep_time", "rod.friction_curvature"} & set(errors)
    failed = {k: v for k, v in errors.items() if not v <= 1e-8}
    assert not failed, failed


def test_the_plastic_case_flows_and_returns(both):
    run, _, xs, _ = both
    memory = run.model.rods.memory
    if not len(memory.plastic):
        return
    plastic = parts(run.model, xs)[4][:, memory.plastic_place]
    moves = np.linalg.norm(np.diff(plastic, axis=0), axis=2) > 1e-12
    assert 0.1 < moves.mean() < 0.9, "it yields in some steps and not in others"


flow = jit(jax.vmap(remembering.flow, (0, 0, 0, None, None)))


def flowed(begin, rate, t, n):
    """x after n equal steps at a constant rate (k, 2)."""
    step = jit(jax.vmap(lambda x, c: remembering.flow(x, c, t / n, TAU, LIMIT)))
    x = jnp.asarray(begin)
    for _ in range(n):
        x = step(x, jnp.asarray(rate) * (t / n))
    return x


def by_differential_equation(begin, rate, t, n=20000):
    """x' = rate - max(|x| - limit, 0)/τ x/|x| by Runge and Kutta's fourth-order steps."""

    def slope(x):
        size = jnp.linalg.norm(x, axis=1, keepdims=True)
        return rate - jnp.maximum(size - LIMIT, 0.0) / TAU * x / jnp.maximum(size, 1e-300)

    def body(x, _):
        h = t / n
        a = slope(x)
        b = slope(x + 0.5 * h * a)
        c = slope(x + 0.5 * h * b)
        d = slope(x + h * c)
        return x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d), None

    return jax.lax.scan(body, jnp.asarray(begin), None, length=n)[0]


def test_flow_on_a_line_does_not_know_the_step():
    # stays elastic, begins to flow, reverses and flows to the other side, flows all the time, comes back to rest within
    begin = np.array([0.02, 0.05, 0.6, 0.3, -0.3])
    rate = np.array([0.1, -2.0, -4.0, 1.0, 0.9])
    axis = np.array([np.cos(0.7), np.sin(0.7)])
    x, v = np.outer(begin, axis), np.outer(rate, axis)
    exact = by_differential_equation(x, v, 0.3)
    for n in (1, 3, 10):
        np.testing.assert_allclose(flowed(x, v, 0.3, n), exact, atol=1e-6)
    np.testing.assert_allclose(flowed(x, v, 0.3, 1), flowed(x, v, 0.3, 10), rtol=1e-12)


def test_flow_around_corners_is_of_first_order():
    begin, rate = np.array([[0.05, 0.02], [0.3, 0.0], [0.2, 0.1]]), np.array([[1.5, 0.9], [-0.5, 1.0], [-1.5, 0.3]])
    exact = by_differential_equation(begin, rate, 0.3)
    errors = [float(jnp.abs(flowed(begin, rate, 0.3, n) - exact).max()) for n in (20, 40, 80)]
    assert errors[0] / errors[1] > 1.7 and errors[1] / errors[2] > 1.7 and errors[2] < 2e-3, errors


def test_derivatives_of_flow_are_its_slopes():
    rng = np.random.default_rng(5)
    begin, change = rng.normal(size=(2, 500, 2)) * 0.2
    t = rng.uniform(0.01, 0.3, 500)
    d_begin, d_change = rng.normal(size=(2, 500, 2))

    def at(e):
        return flow(begin + e * d_begin, change + e * d_change, t, TAU, LIMIT)

    _, slope = jax.jvp(at, (0.0,), (1.0,))
    difference = (at(1e-6) - at(-1e-6)) / 2e-6
    assert np.isfinite(slope).all()
    assert np.abs(slope - difference).max() < 1e-5


def test_a_held_strain_relaxes_and_a_ramp_does_not_know_the_step():
    held = remembering.relaxed(0.3, 0.0, 0.2, TAU)
    np.testing.assert_allclose(held, 0.3 * np.exp(-0.2 / TAU), rtol=1e-15)
    e = 0.0
    for _ in range(7):
        e = remembering.relaxed(e, 2.0 * 0.3 / 7, 0.3 / 7, TAU)
    np.testing.assert_allclose(e, 2.0 * TAU * -np.expm1(-0.3 / TAU), rtol=1e-13)


def test_friction_loads_and_returns(both):
    run, _, xs, _ = both
    memory = run.model.rods.memory
    if not len(memory.friction):
        return
    e = parts(run.model, xs)[4][:, memory.friction_place]
    unloads = (np.sum(e[:-1] * np.diff(e, axis=0), axis=2) < 0.0).mean()
    assert 0.1 < unloads < 0.9, "it loads in some steps and unloads in others"


def test_friction_is_its_differential_equation():
    rng = np.random.default_rng(2)
    e, change = rng.normal(size=(2, 200, 2)) * 0.05
    n = change / np.linalg.norm(change, axis=1, keepdims=True)
    way, x, steps = np.linalg.norm(change, axis=1, keepdims=True), e, 2000
    for _ in range(steps):
        h = way / steps
        slope = n - x / LIMIT
        x = x + h * (n - (x + 0.5 * h * slope) / LIMIT)
    found = jax.vmap(remembering.dragged, (0, 0, None))(e, change, LIMIT)
    np.testing.assert_allclose(found, x, atol=1e-7)


def test_friction_on_a_line_does_not_know_the_step():
    e = once = jnp.array([0.03, -0.05])
    change = jnp.array([0.2, 0.1])
    for _ in range(10):
        e = remembering.dragged(e, change / 10, LIMIT)
    # every step forgets too little by the rounding of its length
    np.testing.assert_allclose(e, remembering.dragged(once, change, LIMIT), rtol=0.0, atol=2.0 * 10 * 1e-11 * LIMIT)
