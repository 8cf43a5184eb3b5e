"""pliant's bodies against the independent JAX reference at equal κ: states and all derivatives.

Bars: state ≤ 1e-9, derivatives ≤ 1e-8, relative. A derivative is compared by blocks: positions and
velocities of the state, one control, or one entry of θ.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from body_cases import STEPS, case
from reference_cases import jit
from scipy.spatial.transform import Rotation

from validation.reference import bodies, body_model, body_step, rotations

pliant = pytest.importorskip("pliant")

pytestmark = pytest.mark.long

CASES = [
    ("arm_free", "euler"),
    ("arm_free", "midpoint"),
    ("arm_free", "sdirk2"),
    ("crane", "euler"),
    ("crane", "midpoint"),
    ("crane", "sdirk2"),
    ("arm_stops", "euler"),
    ("arm_stops", "sdirk2"),
    ("arm_stops-resting", "euler"),
    ("gears", "euler"),
    ("gears", "sdirk2"),
]


def relative(a, b, floor=1e-300):
    """max |a - b| / max(|b|, floor)."""
    a, b = np.asarray(a), np.asarray(b)
    return np.abs(a - b).max(initial=0.0) / max(np.abs(b).max(initial=0.0), floor)


class Both:
    """A case simulated by both programs."""

    def __init__(self, name, integrator):
        self.case = case(name, integrator)
        self.ours = self.case.model
        self.model = pliant.loads(self.case.text)
        self.xs, self.error, self.slopes = self.case.rollout()
        self.roll = self.model.rollout(self.case.x0, self.case.u)


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def both(request):
    return Both(*request.param)


def test_parameters_and_start(both):
    model, ours = both.model, both.ours
    assert list(model.param_paths) == ours.paths
    np.testing.assert_allclose(model.theta, ours.theta, rtol=1e-14)
    assert (model.nx, model.ndx, model.nu) == (ours.nx, ours.ndx, ours.nu)
    np.testing.assert_allclose(model.initial_state(), ours.initial_state(), rtol=1e-15)


def test_mass_matrix(both):
    q = both.xs[-1][: both.ours.nq]
    m = jit(lambda *at: bodies.mass_matrix(both.ours, *at))(q, both.ours.theta)
    assert relative(both.model.mass_matrix(q), m) <= 1e-14


def test_energies(both):
    ours, theta = both.ours, jnp.asarray(both.ours.theta)

    @jit
    def energy(x):
        q, v = x[: ours.nq], x[ours.nq :]
        return 0.5 * v @ bodies.mass_matrix(ours, q, theta) @ v + bodies.potential(ours, q, theta)

    want = np.array([energy(x) for x in both.xs])
    assert relative(np.diff(both.roll.energy()), np.diff(want)) <= 1e-9
    assert relative(both.roll.energy(), want) <= 1e-12


def test_states(both):
    assert both.error < 1e-12
    # where a stop is hit under sdirk2, both take two half steps by Euler
    hits = both.ours.stops and both.ours.integrator == "sdirk2"
    assert np.all(both.roll.trace["retries"] <= (1 if hits else 0))
    nq = both.ours.nq
    assert relative(both.roll.x[:, :nq], both.xs[:, :nq]) <= 1e-9
    assert relative(both.roll.x[:, nq:], both.xs[:, nq:]) <= 1e-9


def test_step_jacobians(both):
    n = both.ours.nv
    for k, (a, b, c) in enumerate(both.slopes):
        got_a, got_b, got_c = both.roll.linearize(k)
        worst = {f"A{i}{j}": relative(got_a[r, s], a[r, s]) for i, r in halves(n) for j, s in halves(n)}
        worst |= {f"u[{j}]": relative(got_b[:, j], b[:, j]) for j in range(both.ours.nu)}
        floor = rounding(both.ours.theta, np.abs(c).max(axis=0))
        for j, path in enumerate(both.ours.paths):
            worst[path] = relative(got_c[:, j], c[:, j], floor[j])
        failed = {key: v for key, v in worst.items() if not v <= 1e-8}
        assert not failed, (k, failed)


def rounding(theta, slopes):
    """The slope by each entry of θ below which it is compared on this scale instead: where the whole of the entry (one SI
    unit, if it is zero) has a millionth of the strongest entry's effect, terms that cancel leave no more digits."""
    size = np.where(theta == 0.0, 1.0, np.abs(theta))
    return 1e-6 * (slopes * np.abs(theta)).max() / size


def halves(n):
    """Positions and velocities of a state's change."""
    return [("q", slice(0, n)), ("v", slice(n, 2 * n))]


def test_rollout_derivatives(both):
    ours, rng = both.ours, np.random.default_rng(3)
    x_bar = rng.normal(size=(STEPS + 1, ours.ndx))
    u_bar, theta_bar, bar = np.zeros_like(both.case.u), np.zeros_like(ours.theta), x_bar[-1].copy()
    for k in reversed(range(STEPS)):
        a, b, c = both.slopes[k]
        u_bar[k], bar, theta_bar = b.T @ bar, a.T @ bar + x_bar[k], theta_bar + c.T @ bar
    got_x0, got_u, got_theta = both.roll.vjp(x_bar)
    worst = {name: relative(got_x0[part], bar[part]) for name, part in halves(ours.nv)}
    worst |= {f"u[{j}]": relative(got_u[:, j], u_bar[:, j]) for j in range(ours.nu)}
    floor = rounding(ours.theta, np.abs(theta_bar))
    worst |= {p: relative(*pair) for p, *pair in zip(ours.paths, got_theta, theta_bar, floor, strict=True)}
    failed = {key: v for key, v in worst.items() if not v <= 1e-8}
    assert not failed, failed

    dx, du = rng.normal(size=ours.ndx), rng.normal(size=both.case.u.shape)
    dtheta = rng.normal(size=len(ours.theta)) * np.abs(ours.theta)
    tangents = [dx]
    for (a, b, c), row in zip(both.slopes, du, strict=True):
        tangents.append(a @ tangents[-1] + b @ row + c @ dtheta)
    got, want = both.roll.jvp(dx, du, dtheta), np.array(tangents)
    assert all(relative(got[:, part], want[:, part]) <= 1e-8 for _, part in halves(ours.nv))


def test_the_scenes_slide_stick_and_stop():
    slide, rest = Both("arm_stops", "euler"), Both("arm_stops-resting", "euler")
    assert np.all(slide.xs[:, 2] > 0.5) and np.abs(rest.xs[1:, 2]).max() < 1e-4
    for run in (slide, rest):
        assert 0 < 0.6 - run.xs[-1, 1] < 1e-4 and abs(run.xs[-1, 3]) < 1e-2
    crane = Both("crane", "euler")
    slew, tilt, rail = crane.xs[1:, :3].T
    for q, limit in [(slew, 0.2015), (tilt, -0.3005), (rail, 0.2005)]:
        assert np.abs(q - limit).min() < 1e-5
    speed = np.abs(crane.xs[1:, crane.ours.nq + 3])  # the winch holds its load, slips, and holds again
    assert np.all(speed[[0, 3]] < 1e-4) and np.all(speed[[0, 3]] > 1e-6) and np.all(speed[1:3] > 0.05)


def test_turns_are_those_of_scipy():
    rng = np.random.default_rng(0)

    @jit
    def both_turns(t):
        turn, half = rotations.exponential(t), rotations.square_root(rotations.cayley(t))
        return turn, rotations.matrix(turn), rotations.logarithm(turn), rotations.product(half, half)

    for size in (1e-9, 1e-3, 0.5, 3.0):
        t = rng.normal(size=3)
        t *= size / np.linalg.norm(t)
        turn, matrix, back, cayley = both_turns(t)
        theirs = Rotation.from_rotvec(t)
        np.testing.assert_allclose(turn, np.roll(theirs.as_quat(), 1), atol=1e-15)
        np.testing.assert_allclose(matrix, theirs.as_matrix(), atol=1e-15)
        np.testing.assert_allclose(back, t, rtol=1e-13, atol=1e-16)
        theirs = Rotation.from_rotvec(t * 2 * np.arctan(size / 2) / size)
        np.testing.assert_allclose(cayley, np.roll(theirs.as_quat(), 1), atol=1e-15)


def test_the_reference_is_newton_and_euler():
    """A spinning body's inertia force is R (I α + ω × I ω) and m times its centre's acceleration."""
    text = case("crane", "euler").text
    stone = "[[body]]" + text.split("[[body]]")[-1].split("[[actuator]]")[0].replace("armature = 0.01", "")
    stone = stone.replace("0.0025, 0.0, 0.0, 0.0", "0.0025, 0.0001, 0.0, 0.0").replace(
        "mass = 0.1", "mass = 0.1\ncenter_of_mass = [0.1, 0.2, -0.3]"
    )
    model = body_model.loads("schema_version = 1\n[time]\nstep = 0.01\n" + stone)
    q, v, a = jnp.asarray(model.q0), jnp.asarray(model.v0), jnp.arange(1.0, 7.0)
    found = jit(lambda *at: bodies.inertia_force(model, *at))(q, v, a, jnp.asarray(model.theta))
    r, w, alpha, c = rotations.matrix(q[3:]), v[3:], a[3:], np.array([0.1, 0.2, -0.3])
    inertia = np.array([[0.001, 0.0001, 0.0], [0.0001, 0.002, 0.0], [0.0, 0.0, 0.0025]])
    f = 0.1 * (a[:3] + r @ (np.cross(alpha, c) + np.cross(w, np.cross(w, c))))
    moment = inertia @ alpha + np.cross(w, inertia @ w) + np.cross(c, r.T @ f)
    np.testing.assert_allclose(found, np.concatenate([f, moment]), rtol=1e-13)


def test_jacobians_of_the_reference_against_differences():
    run = case("arm_free", "midpoint")
    model, theta = run.model, run.model.theta
    _, _, a, b, c = run.linearized(run.x0, run.u[0], theta)
    rng, h = np.random.default_rng(4), 1e-5
    dx, du, dtheta = rng.normal(size=model.ndx), rng.normal(size=model.nu), rng.normal(size=len(theta)) * np.abs(theta)
    ends = []
    for e in (h, -h):
        x = body_step.displaced(model, jnp.asarray(run.x0), e * dx)
        ends.append(run.linearized(x, run.u[0] + e * du, theta + e * dtheta)[0])
    middle = run.linearized(run.x0, run.u[0], theta)[0]
    difference = (body_step.change(model, ends[0], middle) - body_step.change(model, ends[1], middle)) / (2 * h)
    assert relative(a @ dx + b @ du + c @ dtheta, difference) < 1e-8
