"""pliant.jax against pliant's own vjp; run by test_jax.py in a process of its own.

Prints one JSON object: check -> the largest relative disagreement, or what was raised.
"""

import json
import sys
from pathlib import Path

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


class Problem:
    """A scene, its inputs, random cotangents, and the answers by vjp."""

    def __init__(self, name):
        self.model = model = pliant.load(SCENES / f"{name}.toml")
        self.inputs = (model.initial_state(), model.controls(STEPS), model.theta)
        rng = np.random.default_rng(0)
        self.x_bar = rng.normal(size=(STEPS + 1, model.nx))
        self.step_bar = rng.normal(size=model.nx)
        x0, u, theta = self.inputs
        self.roll = model.rollout(x0, u, theta)
        self.bars = self.roll.vjp(self.x_bar)
        self.scales = 1 + 0.01 * np.arange(BATCH)[:, None]
        self.thetas = theta * self.scales
        self.batch_bars = [model.rollout(x0, u, t).vjp(self.x_bar) for t in self.thetas]

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
    bars = p.model.rollout(x0, u[:1], theta).vjp(np.stack([0 * p.step_bar, p.step_bar]))
    return off(grad, (bars[0], bars[1][0], bars[2]))


def scan_of_steps(p):
    """Contacts start every step cold here and warm in the rollout: equal to the tolerance."""
    step = pliant.jax.step(p.model)

    def loss(x0, u, theta):
        def body(x, row):
            x = step(x, row, theta)
            return x, x

        _, xs = jax.lax.scan(body, jnp.asarray(x0), jnp.asarray(u))
        return (xs * p.x_bar[1:]).sum() + (x0 * p.x_bar[0]).sum()

    return off(jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*p.inputs), p.bars)


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
    return off((function(*p.inputs), grad(*p.inputs)), (p.roll.x, soft.vjp(p.x_bar)))


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


def balls_are_refused(p):
    try:
        pliant.jax.step(pliant.load(SCENES / "arm_free.toml"))
    except NotImplementedError as error:
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
ONCE = [long_rollout, wrong_shape, failed_numerics, balls_are_refused, needs_float64, wrong_dtype]


def main():
    jax.config.update("jax_enable_x64", True)
    found = {}
    for name in ("windy", "sliding"):
        problem = Problem(name)
        for check in AGREE:
            found[f"{name}-{check.__name__}"] = check(problem)
    problem = Problem("free_swing")
    found |= {check.__name__: check(problem) for check in ONCE}
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
