"""The JAX reference against closed forms and its own differences, without pliant."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference_cases import case, jit, wiggle

from validation import reference
from validation.reference import contact, forces, laws, rods
from validation.reference.step import cayley, commanded_velocity

pytestmark = pytest.mark.long


def random_stencil(seed):
    return jnp.asarray(np.random.default_rng(seed).normal(size=(6, 3)))


def test_bend_rate_closed_form_equals_the_definition():
    @jit
    @jax.vmap
    def both(s):
        d = laws.bend_rate(*s)
        return d @ d, laws.bend_rate_squared_closed(*s)

    definition, closed = both(jnp.stack([random_stencil(k) for k in range(50)]))
    np.testing.assert_allclose(closed, definition, rtol=1e-9)


def test_only_spinning_about_the_tangent_dissipates():
    x = random_stencil(1)[:3]
    t1, t2 = laws.tangents(*x)
    mean = (t1 + t2) / jnp.linalg.norm(t1 + t2)
    rate = jit(lambda w: laws.bend_rate(*x, *(jnp.cross(w, p) + 0.3 for p in x)))
    across = jnp.cross(mean, jnp.array([0.3, -0.2, 0.7]))
    assert jnp.linalg.norm(rate(across)) < 1e-12
    assert jnp.linalg.norm(rate(mean)) > 0.1


def test_bend_energy_and_gravity_closed_forms():
    x = random_stencil(2)[:3]
    t1, t2 = laws.tangents(*x)
    c = t1 @ t2
    np.testing.assert_allclose(
        laws.bend_energy(*x, 0.1, 0.02), 2.0 * 0.2 * (1 - c) / (1 + c), rtol=1e-12
    )
    g = laws.gravity_vector(9.81, jnp.array([0.1, 0.0]))
    np.testing.assert_allclose(g, 9.81 * np.array([0.0, np.sin(0.1), -np.cos(0.1)]), atol=1e-15)
    g = laws.gravity_vector(9.81, jnp.array([0.0, 0.1]))
    np.testing.assert_allclose(g, 9.81 * np.array([-np.sin(0.1), 0.0, -np.cos(0.1)]), atol=1e-15)


@pytest.mark.parametrize(("law", "sharper"), [("coulomb", 1.0), ("coulomb", 16.0), ("anitescu", 1.0)])
def test_contact_impulse_lies_on_the_central_path(law, sharper):
    h, mu, kappa, gap = 0.01, 0.6, 1e-5, 3e-3
    step = contact.FRICTION_TIME / sharper**0.5
    n, v = jnp.array([0.0, 0.6, 0.8]), jnp.array([0.2, -0.1, 0.15])
    p = contact.impulse(law, gap, n, v, (h, step), mu, kappa)
    v_t, w0 = contact.tangential(n, v), n @ p
    w = contact.tangential(n, p) / mu
    slip = (sharper * np.hypot(mu, contact.LEAST_SLIP) if law == "coulomb" else mu) * v_t
    s0 = gap / h
    if law == "coulomb":  # s0 - |s̄|²/s0 = v̂_n
        s0 = (s0 + jnp.sqrt(s0**2 + 4 * slip @ slip)) / 2
    np.testing.assert_allclose(s0 * w0 + slip @ w, kappa, rtol=1e-12)
    np.testing.assert_allclose(s0 * w + w0 * slip, 0.0, atol=1e-12 * kappa)


def rod_at(x, twist):
    """The rods of a scene at nodes x with twists, their axes carried from a straight start; and its θ."""
    model = case("rod_on_floor", "euler", "coulomb").model
    frames = rods.carry(model.rods, model.q0, model.rods.frames0, x)
    return model.rods, rods.strains(model.rods, rods.directions(model.rods.edges, x), twist, frames), model.theta


def test_curvature_of_a_rod_is_a_ropes_whatever_its_twist():
    rng = np.random.default_rng(4)
    x = jnp.asarray(case("rod_on_floor", "euler", "coulomb").model.q0 + 0.02 * rng.normal(size=(8, 3)))
    whole = [jnp.linalg.norm(laws.curvature(*x[k : k + 3])) for k in range(6)]
    for twist in (np.zeros(7), rng.normal(size=7), 3.0 * np.arange(7)):
        _, strain, _ = rod_at(x, twist)
        np.testing.assert_allclose(jnp.linalg.norm(strain[:, :2], axis=1), whole, rtol=1e-12)


def test_twist_of_a_rod_is_what_turns_its_axes():
    model = case("rod_on_floor", "euler", "coulomb").model
    # a full circle about the rod's own direction, and a closed way of its directions on the sphere, turn what is carried
    straight, turns = jnp.asarray(model.q0), 3.0 * np.arange(7)
    np.testing.assert_allclose(rod_at(straight, turns)[1], np.tile([0.0, 0.0, 3.0], (6, 1)), atol=1e-14)
    x, corner = jnp.eye(3), model.q0.copy()
    d = jnp.array([0.0, 1.0, 0.0])
    for a, b in ((0, 2), (2, 1), (1, 0)):  # x -> z -> y -> x: an eighth of the sphere
        d = rods.carried(x[a], x[b], d)
    np.testing.assert_allclose(rods.angle(jnp.array([0.0, 1.0, 0.0]), d, x[0]), -np.pi / 2, rtol=1e-14)
    corner[4:] += [0.0, 0.1, 0.0]
    np.testing.assert_allclose(rod_at(jnp.asarray(corner), np.zeros(7))[1][:, 2], 0.0, atol=1e-14)  # flat: no writhe


def test_normals_are_the_gradients_of_the_gaps():
    shapes = {
        "plane": {"normal": jnp.array([0.0, 0.6, 0.8]), "point": jnp.ones(3), "height": 0.2, "rotation": jnp.array([0.1, -0.2, 0.05])},
        "sphere": {"center": jnp.ones(3), "radius": 0.2},
        "capsule": {"a": jnp.ones(3), "b": jnp.array([1.0, 2.0, 1.5]), "radius": 0.2},
    }
    for kind, shape in shapes.items():
        for x in (jnp.array([0.3, 1.4, 0.2]), jnp.array([0.0, 0.1, 0.4])):
            gap_of = contact.GAPS[kind]
            slope = jax.grad(lambda p, f=gap_of, s=shape: f(p, 0.01, s)[0])(x)
            np.testing.assert_allclose(gap_of(x, 0.01, shape)[1], slope, atol=1e-14)


def test_velocity_gripper_turns_the_ghost_rigidly():
    model = case("velocity_gripper").model
    u = np.concatenate([[0.1, 0.2, 0.3], [1.0, -2.0, 40.0], np.zeros(3)])
    q = jnp.asarray(model.q0)
    g = model.grippers[0]
    after = q + model.h * commanded_velocity(model, q, u, model.theta)
    before = np.linalg.norm(q[g.ghost] - q[g.nodes[0]])
    np.testing.assert_allclose(np.linalg.norm(after[g.ghost] - after[g.nodes[0]]), before)
    rotation = cayley(jnp.array([0.3, 0.1, -2.0]))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)


def floor_case():
    run = case("sliding", "euler", "coulomb")
    x0 = run.model.initial_state()
    q, v = x0.reshape(2, -1, 3).copy()
    q[:, 2] = 0.004 + 2e-6
    return run, q, v


def test_free_fall():
    run, q, v = floor_case()
    theta = run.model.theta.copy()
    theta[run.model.index("floor.height")] = -100.0
    xs, error = run.rollout(np.concatenate([q, v]).ravel(), np.zeros((5, 0)), theta)
    fall = v - 9.81 * 5 * run.model.h * np.array([0.0, 0.0, 1.0])
    assert error < 1e-12
    np.testing.assert_allclose(xs[-1].reshape(2, -1, 3)[1], fall, rtol=1e-7, atol=1e-10)


def test_a_resting_cable_hovers_at_the_rest_gap():
    run, q, _ = floor_case()
    x0 = np.concatenate([q, np.zeros_like(q)]).ravel()
    xs, _ = run.rollout(x0, np.zeros((20, 0)), run.model.theta)
    height = xs[-1].reshape(2, -1, 3)[0][:, 2] - 0.004
    np.testing.assert_allclose(height, run.model.rest_gap, rtol=1e-8)


def test_a_sliding_cable_slows_by_friction():
    run, q, v = floor_case()
    q[:, 2] = 0.004 + run.model.rest_gap
    x0 = np.concatenate([q, v]).ravel()
    xs, _ = run.rollout(x0, np.zeros((5, 0)), run.model.theta)
    before, after = (np.linalg.norm(x.reshape(2, -1, 3)[1], axis=1) for x in (xs[0], xs[-1]))
    np.testing.assert_allclose((before - after) / (5 * run.model.h), 0.4 * 9.81, rtol=2e-3)


def difference_error(run, x0, u, directions, sizes, seed=3):
    """Relative error of the pullback against the best central difference over `sizes`."""
    theta = run.model.theta
    x_bar = np.random.default_rng(seed).normal(size=(len(u) + 1, run.model.nx))
    xs, error = run.rollout(x0, u, theta)
    assert error < 1e-12
    bars = run.vjp(xs, u, theta, x_bar)
    dx, du, dtheta = directions
    slope = sum(np.sum(b * d) for b, d in zip(bars[:3], directions, strict=True))

    def value(e):
        return np.sum(x_bar * run.rollout(x0 + e * dx, u + e * du, theta + e * dtheta)[0])

    return min(abs((value(e) - value(-e)) / (2 * e) - slope) / abs(slope) for e in sizes)


def test_gradient_against_differences_smooth():
    run = case("windy", "sdirk2")
    model, rng = run.model, np.random.default_rng(5)
    u = wiggle(model, model.q0, 3)
    directions = (
        rng.normal(size=model.nx) * 0.01,
        rng.normal(size=u.shape) * 0.01,
        rng.normal(size=len(model.theta)) * np.maximum(np.abs(model.theta), 1e-3),
    )
    error = difference_error(run, model.initial_state(), u, directions, (1e-3, 1e-4, 1e-5))
    assert error < 1e-7


def test_gradient_against_differences_sliding():
    run, q, v = floor_case()
    model, rng = run.model, np.random.default_rng(6)
    q[:, 2] = 0.004 + model.rest_gap
    x0 = np.concatenate([q, v]).ravel()
    level = np.tile([1.0, 1.0, 0.0], 2 * model.n_nodes)  # moves along the floor
    theta = rng.normal(size=len(model.theta)) * np.abs(model.theta)
    theta[[model.index("cable.radius"), model.index("floor.height")]] = 0.0
    directions = (0.01 * level * rng.normal(size=model.nx), np.zeros((4, 0)), theta)
    assert difference_error(run, x0, np.zeros((4, 0)), directions, (1e-3, 1e-4, 1e-5)) < 1e-6


def test_equilibrium_of_a_hanging_cable():
    model = case("free_swing").model
    top = model.q0[0]
    arc = np.concatenate([[0.0], np.cumsum(model.edge_fraction)]) * 0.6
    guess = top - arc[:, None] * np.array([0.0, 0.02, 1.0])
    guess[0] = top
    equilibrium, find = reference.make_equilibrium(model)
    u, path = jnp.asarray(model.hold()), model.index("cable.linear_density")
    guess = find(u, model.theta, guess)
    direction = jnp.zeros(len(model.theta)).at[path].set(1.0)

    def hanging(theta):  # z of each node: edges stretched by the weight below
        m = forces.masses(model, theta)
        below = jnp.cumsum(m[::-1])[::-1][1:] * theta[model.magnitude]
        edges = model.edge_fraction * theta[model.index("cable.length")]
        longer = edges * (1.0 + below / theta[model.index("cable.stretch_stiffness")])
        return top[2] - jnp.concatenate([jnp.zeros(1), jnp.cumsum(longer)])

    def solved(theta):
        return equilibrium(u, theta, guess)

    q, q_dot = jit(lambda t: jax.jvp(solved, (t,), (direction,)))(jnp.asarray(model.theta))
    z, z_dot = jax.jvp(hanging, (jnp.asarray(model.theta),), (direction,))
    np.testing.assert_allclose(q[:, 2], z, rtol=1e-12)
    np.testing.assert_allclose(q[:, :2], np.tile(top[:2], (model.n_nodes, 1)), atol=1e-12)
    np.testing.assert_allclose(q_dot[:, 2], z_dot, rtol=1e-10, atol=1e-14)
