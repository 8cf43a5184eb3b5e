"""pliant.jax against pliant's own vjp; run by test_jax.py in a process of its own.

Prints one JSON object: check -> the largest relative disagreement, or what was raised.
"""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pliant
import pliant.jax

SCENES = Path(__file__).resolve().parents[1] / "scenes"
STEPS, BATCH = 6, 3


def off(ours, theirs):
    """Largest disagreement relative to the largest entry, over all pairs."""
    pairs = zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True)
    sizes = [(np.abs(np.asarray(a) - b).max(initial=0), np.abs(b).max(initial=0)) for a, b in pairs]
    return max(float(error / max(size, 1e-300)) for error, size in sizes)


def turned(p, w):
    """p (1, w/2): the quaternion p after a small turn w in the body's axes."""
    a, b = p, jnp.concatenate([jnp.ones(1), 0.5 * w])
    vector = a[0] * b[1:] + b[0] * a[1:] + jnp.cross(a[1:], b[1:])
    return jnp.concatenate([(a[0] * b[0] - a[1:] @ b[1:])[None], vector])


def changed(name, x, dx):
    """x ⊕ dx to first order. In `arm_free` the wrist's quaternion is x[3:7], the stone's x[11:15]."""
    if name != "arm_free":
        return x + dx
    turns = [turned(x[3:7], dx[3:6]), turned(x[11:15], dx[10:13])]
    return jnp.concatenate([x[:3] + dx[:3], turns[0], x[7:11] + dx[6:10], turns[1], x[15:] + dx[13:]])


class Problem:
    """A scene, its inputs, random cotangents, and the answers by vjp.

    With E(x) = ∂(x ⊕ δx)/∂δx, cotangents x̄ of states go to vjp as Eᵀ x̄, and come back by the pseudo-inverse of Eᵀ.
    """

    def __init__(self, name):
        self.name, self.model = name, pliant.load(SCENES / f"{name}.toml")
        model = self.model
        self._slope = jax.jit(jax.jacfwd(lambda dx, x: changed(name, x, dx)))
        self.inputs = (model.initial_state(), model.controls(STEPS), model.theta)
        rng = np.random.default_rng(0)
        self.x_bar = rng.normal(size=(STEPS + 1, model.nx))
        self.step_bar = rng.normal(size=model.nx)
        x0, u, theta = self.inputs
        self.roll = model.rollout(x0, u, theta)
        self.bars = self.vjp(self.roll, self.x_bar)
        self.scales = 1 + 0.01 * np.arange(BATCH)[:, None]
        self.thetas = theta * self.scales
        self.batch_bars = [self.vjp(model.rollout(x0, u, t), self.x_bar) for t in self.thetas]

    def slope(self, x):
        """E(x) (nx, ndx)."""
        return np.asarray(self._slope(np.zeros(self.model.ndx), x))

    def vjp(self, roll, x_bar):
        """The rollout's own vjp for cotangents of coordinates (T + 1, nx)."""
        slopes = [self.slope(x) for x in roll.x]
        x0_bar, u_bar, theta_bar = roll.vjp(np.array([e.T @ bar for e, bar in zip(slopes, x_bar, strict=True)]))
        return np.linalg.pinv(slopes[0]).T @ x0_bar, u_bar, theta_bar

    def loss(self, x0, u, theta):
        """A sum of states through rollout."""
        return (pliant.jax.rollout(self.model)(x0, u, theta) * self.x_bar).sum()


def rollout_value(p):
    return off(pliant.jax.rollout(p.model)(*p.inputs), p.roll.x)


def rollout_grad_jit(p):
    return off(jax.jit(jax.grad(p.loss, argnums=(0, 1, 2)))(*p.inputs), p.bars)


def rollout_value_and_grad(p):
    value, grad = jax.value_and_grad(p.loss, argnums=2)(*p.inputs)
    return off((value, grad), ((p.roll.x * p.x_bar).sum(), p.bars[2]))


def rollout_vmap(p):
    """Over theta alone: x0 and u are shared."""
    function = jax.vmap(pliant.jax.rollout(p.model), in_axes=(None, None, 0))
    x0, u, _ = p.inputs
    theirs = np.stack([p.model.rollout(x0, u, t).x for t in p.thetas])
    return off(jax.jit(function)(x0, u, p.thetas), theirs)


def rollout_vmap_grad(p):
    function = jax.vmap(jax.grad(p.loss, argnums=(0, 2)), in_axes=(None, None, 0))
    x0, u, _ = p.inputs
    theirs = [np.stack([bars[k] for bars in p.batch_bars]) for k in (0, 2)]
    return off(jax.jit(function)(x0, u, p.thetas), theirs)


def rollout_nested_vmap(p):
    inner = jax.vmap(pliant.jax.rollout(p.model), in_axes=(None, None, 0))
    outer = jax.vmap(inner, in_axes=(0, None, None))
    x0, u, _ = p.inputs
    x0s = np.stack([x0, x0])
    theirs = np.stack([[p.model.rollout(x, u, t).x for t in p.thetas] for x in x0s])
    return off(outer(x0s, u, p.thetas), theirs)


def step_value(p):
    x0, u, theta = p.inputs
    return off(pliant.jax.step(p.model)(x0, u[0], theta), p.model.step(x0, u[0], theta))


def step_grad(p):
    step = pliant.jax.step(p.model)
    x0, u, theta = p.inputs
    grad = jax.grad(lambda *a: step(*a) @ p.step_bar, argnums=(0, 1, 2))(x0, u[0], theta)
    bars = p.vjp(p.model.rollout(x0, u[:1], theta), np.stack([0 * p.step_bar, p.step_bar]))
    return off(grad, (bars[0], bars[1][0], bars[2]))


def scan_of_steps(p):
    """Contacts start every step cold here and warm in the rollout: equal to the tolerance."""
    step = pliant.jax.step(p.model)

    def loss(x0, u, theta):
        def body(x, row):
            x = step(x, row, theta)
            return x, x

        _, xs = jax.lax.scan(body, jnp.asarray(x0), jnp.asarray(u))
        return (xs * p.x_bar[1:]).sum()

    x_bar = p.x_bar.copy()
    x_bar[0] = 0.0
    return off(jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*p.inputs), p.vjp(p.roll, x_bar))


def vmap_of_scan(p):
    step = pliant.jax.step(p.model)
    x0, u, _ = p.inputs

    def last(theta):
        return jax.lax.scan(lambda x, row: (step(x, row, theta), None), jnp.asarray(x0), u)[0]

    theirs = np.stack([p.model.rollout(x0, u, t).x[-1] for t in p.thetas])
    return off(jax.jit(jax.vmap(last))(p.thetas), theirs)


def surrogate_grad(p):
    """Forward hard, gradients of smoother steps along it."""
    x0, u, theta = p.inputs
    function = pliant.jax.rollout(p.model, backward_rest_gap=1e-4)
    grad = jax.jit(jax.grad(lambda *a: (function(*a) * p.x_bar).sum(), argnums=(0, 1, 2)))
    soft = p.model.rollout(x0, u, theta, rest_gap=1e-4, states="hard")
    return off((function(*p.inputs), grad(*p.inputs)), (p.roll.x, p.vjp(soft, p.x_bar)))


def many_calls(p):
    """A descent under jit: many callbacks in one program."""
    x0, u, theta = p.inputs
    grad = jax.grad(p.loss, argnums=2)

    @jax.jit
    def descend(theta):
        return jax.lax.fori_loop(0, 30, lambda _, t: t + 0.0 * grad(x0, u, t), theta)

    return off(descend(theta), theta)


def long_rollout(p):
    """Megabytes through the callback."""
    x0, _, theta = p.inputs
    u = p.model.controls(3000)
    return off(jax.jit(pliant.jax.rollout(p.model))(x0, u, theta), p.model.rollout(x0, u).x)


def wrong_shape(p):
    x0, u, theta = p.inputs
    try:
        pliant.jax.rollout(p.model)(x0[1:], u, theta)
    except ValueError as error:
        return str(error)
    return "nothing was raised"


def failed_numerics(p):
    x0, u, theta = p.inputs
    try:
        np.asarray(jax.jit(pliant.jax.rollout(p.model))(x0 + np.inf, u, theta))
    except Exception as error:  # noqa: BLE001 (JAX wraps what the callback raises)
        return str(error)
    return "nothing was raised"


def needs_float64(p):
    with jax.enable_x64(False):
        try:
            pliant.jax.step(p.model)(p.inputs[0], p.inputs[1][0], p.inputs[2])
        except RuntimeError as error:
            return str(error)
    return "nothing was raised"


def wrong_dtype(p):
    x0, u, theta = p.inputs
    try:
        pliant.jax.rollout(p.model)(jnp.asarray(x0, dtype=jnp.float32), u, theta)
    except TypeError as error:
        return str(error)
    return "nothing was raised"


def attitude(p):
    """A loss of the final quaternions, the same for p and −p."""
    target = jnp.array([0.1, 0.7, -0.5, 0.3])

    def loss(x0, u, theta):
        last = pliant.jax.rollout(p.model)(x0, u, theta)[-1]
        return (last[3:7] @ target) ** 2 + 2.0 * (last[11:15] @ target) ** 2

    return loss


def central(function, step=1e-4):
    """Slope of a function of one number at 0, of fourth order."""
    f = [float(function(k * step)) for k in (-2, -1, 1, 2)]
    return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)


def quaternion_differences(p):
    """The gradient of a loss of final quaternions, along a curve through states that are one long."""
    loss, (x0, u, theta), rng = attitude(p), p.inputs, np.random.default_rng(1)
    bars = jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*p.inputs)
    dx, du, dtheta = rng.normal(size=p.model.ndx), rng.normal(size=u.shape), rng.normal(size=theta.shape) * np.abs(theta)

    def along(e):
        x = changed(p.name, jnp.asarray(x0), e * dx)
        x = x.at[3:7].divide(jnp.linalg.norm(x[3:7])).at[11:15].divide(jnp.linalg.norm(x[11:15]))
        return loss(x, u + e * du, theta + e * dtheta)

    slope = bars[0] @ p.slope(x0) @ dx + (bars[1] * du).sum() + bars[2] @ dtheta
    return off(slope, central(along))


def quaternion_chain(p):
    """Through x/|x|, from quaternions that are not one long."""
    loss, (x0, u, theta), rng = attitude(p), p.inputs, np.random.default_rng(2)
    raw, d = 1.7 * jnp.asarray(x0[11:15]) + 0.1, rng.normal(size=4)

    def normalized(raw):
        return loss(jnp.asarray(x0).at[11:15].set(raw / jnp.linalg.norm(raw)), u, theta)

    def as_it_is(raw):
        return loss(jnp.asarray(x0).at[11:15].set(raw), u, theta)

    truth = central(lambda e: normalized(raw + e * d))
    return off([jax.grad(f)(raw) @ d for f in (normalized, as_it_is)], [truth, truth])


def quaternion_radial(p):
    """The gradient's part along the quaternions, relative to the rest."""
    bar, x0 = jax.grad(attitude(p))(*p.inputs), p.inputs[0]
    along = [bar[part] @ x0[part] / jnp.linalg.norm(bar[part]) for part in (slice(3, 7), slice(11, 15))]
    return float(np.abs(along).max())


PENDULUM = """
schema_version = 1
[time]
step = 0.01
duration = 0.03
integrator = "midpoint"
[[body]]
name = "bob"
quaternion = [0.8, 0.0, 0.6, 0.0]
mass = 0.4
center_of_mass = [0.1, 0.2, 0.0]
inertia = [0.001, 0.002, 0.0025, 0.0, 0.0, 0.0]
[[body.joint]]
name = "hook"
kind = "ball"
stiffness = 0.3
velocity = [3.0, -4.0, 5.0]
"""


def quaternion_reference(p):
    """A gradient through a scan of steps, beside that of the JAX reference; the same along the sphere."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from reference_cases import jit

    from validation.reference import body_model, body_step

    model, ours = pliant.loads(PENDULUM), body_model.loads(PENDULUM)
    step, theirs = pliant.jax.step(model), body_step.make_step(ours)

    def end(x):
        return (x[:4] @ jnp.array([0.1, 0.7, -0.5, 0.3])) ** 2 + x[5]

    def loss(x0, theta):
        return end(jax.lax.scan(lambda x, _: (step(x, jnp.zeros(0), theta), None), x0, None, length=3)[0])

    @jit
    def pulled(x, theta, x_bar):
        x_next, pull = jax.vjp(lambda *a: theirs(a[0], jnp.zeros(0), a[1])[0], x, theta)
        return x_next, *pull(x_bar)

    x0, theta = jnp.asarray(model.initial_state()), jnp.asarray(model.theta)
    xs = [x0]
    for _ in range(3):
        xs.append(pulled(xs[-1], theta, 0.0 * x0)[0])
    bar, theta_bar = jax.grad(end)(xs[-1]), 0.0
    for x in reversed(xs[:-1]):
        _, bar, part = pulled(x, theta, bar)
        theta_bar += part
    got, want = jax.jit(jax.grad(loss, argnums=(0, 1)))(x0, theta), (bar, theta_bar)
    # the reference goes on beyond the sphere in a way of its own
    along = want[0][:4] - x0[:4] * (x0[:4] @ want[0][:4])
    return off(got, (np.concatenate([along, want[0][4:]]), np.asarray(want[1])))


def material(model, x):
    """A loss of all that a rod's state says of its material: nodes, velocities, material axes, twists between edges."""
    rod, nodes, edges, size = model.ropes["rod"], 3 * model.n_nodes, 8, model.nx - len(model.memory_names)
    at, turns, axes, twists = x[:nodes].reshape(-1, 3), x[nodes : nodes + edges], x[size : size + 3 * edges], x[size + 3 * edges :]
    # a ghost, node 0, lies before the rod's first node: edges follow one another
    assert rod == slice(1, 9, 1) and twists.size == edges - 1
    along, d = jnp.diff(at, axis=0), axes.reshape(-1, 3)
    t = along / jnp.linalg.norm(along, axis=1, keepdims=True)
    first = d * jnp.cos(turns)[:, None] + jnp.cross(t, d) * jnp.sin(turns)[:, None]
    numbers = jnp.concatenate([x[:nodes], x[nodes + edges : size], first.ravel(), jnp.diff(turns) + twists])
    return jnp.sin(3.0 * numbers) @ jnp.cos(jnp.arange(numbers.size))


def rod_differences(p):
    """The gradient of a loss of the last state, along a curve of states whose axes go with their edges."""
    (x0, u, theta), rng = p.inputs, np.random.default_rng(3)
    dx, du, dtheta = rng.normal(size=p.model.ndx), rng.normal(size=u.shape), rng.normal(size=theta.shape) * np.abs(theta)
    dx, du, dtheta = 1e-2 * dx, 1e-2 * du, 1e-2 * dtheta

    def loss(x0, u, theta):
        return material(p.model, pliant.jax.rollout(p.model)(x0, u, theta)[-1])

    bars = jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*p.inputs)
    ahead = [p.model.displaced(x0, k * 1e-3 * dx) for k in (-2, -1, 1, 2)]
    x_dot = (ahead[0] - 8 * ahead[1] + 8 * ahead[2] - ahead[3]) / 12e-3
    slope = bars[0] @ x_dot + (bars[1] * du).sum() + bars[2] @ dtheta
    return off(slope, central(lambda e: loss(p.model.displaced(x0, e * dx), u + e * du, theta + e * dtheta)))


def rod_scan(p):
    """A scan of steps hands cotangents of axes from step to step, as a rollout does inside."""
    x0, u, theta = p.inputs
    step, rollout = pliant.jax.step(p.model), pliant.jax.rollout(p.model)

    def scanned(x0, u, theta):
        last, _ = jax.lax.scan(lambda x, row: (step(x, row, theta), None), jnp.asarray(x0), jnp.asarray(u))
        return material(p.model, last)

    def rolled(x0, u, theta):
        return material(p.model, rollout(x0, u, theta)[-1])

    return off(*(jax.jit(jax.grad(f, argnums=(0, 1, 2)))(x0, u, theta) for f in (scanned, rolled)))


def says_surrogate(p):
    """Functions and batches say when their gradients are surrogates."""
    x0, u, theta = p.inputs
    plain = [pliant.jax.step(p.model), pliant.jax.rollout(p.model), p.model.rollout_batch(x0[None], u)]
    smooth = [pliant.jax.step(p.model, backward_rest_gap=1e-4), pliant.jax.rollout(p.model, backward_rest_gap=1e-4)]
    smooth.append(p.model.rollout_batch(x0[None], u, rest_gap=1e-4, states="hard"))
    names = [getattr(f, "__name__", repr(f)) for f in [*plain, *smooth]]
    return [[f.surrogate for f in plain], [f.surrogate for f in smooth], names]


AGREE = [
    rollout_value,
    rollout_grad_jit,
    rollout_value_and_grad,
    rollout_vmap,
    rollout_vmap_grad,
    rollout_nested_vmap,
    step_value,
    step_grad,
    scan_of_steps,
    vmap_of_scan,
    surrogate_grad,
    many_calls,
]
RODS = [rod_differences, rod_scan]
QUATERNIONS = [quaternion_differences, quaternion_chain, quaternion_radial, quaternion_reference]
ONCE = [says_surrogate, long_rollout, wrong_shape, failed_numerics, needs_float64, wrong_dtype]


def main():
    jax.config.update("jax_enable_x64", True)
    found = {}
    for name in ("windy", "sliding", "arm_free"):
        problem = Problem(name)
        for check in AGREE:
            found[f"{name}-{check.__name__}"] = check(problem)
    found |= {check.__name__: check(problem) for check in QUATERNIONS}
    rod = SimpleNamespace(model=pliant.load(SCENES / "twisting_rod.toml"))
    rod.inputs = (rod.model.initial_state(), rod.model.controls(STEPS), rod.model.theta)
    found |= {check.__name__: check(rod) for check in RODS}
    problem = Problem("free_swing")
    found |= {check.__name__: check(problem) for check in ONCE}
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
