"""pliant's step and rollout as differentiable JAX functions.

    import pliant, pliant.jax

    step = pliant.jax.step(model)          # (x, u, theta) -> x_next
    rollout = pliant.jax.rollout(model)    # (x0, u, theta) -> xs

Both work under jit, grad, vmap and scan, in reverse mode once. They call pliant on the host through
`jax.pure_callback`, which touches only NumPy, and keep no state between calls: the backward
pass simulates again with records, then pulls the cotangents back.

JAX must be in 64-bit mode: `jax.config.update("jax_enable_x64", True)` at the start.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from ._pliant import Model

__all__ = ["rollout", "step"]

Function = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]


def step(model: Model) -> Function:
    """`f(x, u, theta) -> x_next`: x (nx,) [m, m/s], u (nu,), theta (n_params,), all float64."""

    def forward(x, u, theta):
        return _batched(model, x, u[..., None, :], theta, record=False).x[:, 1]

    def backward(x, u, theta, x_bar):
        batch = _batched(model, x, u[..., None, :], theta, record=True)
        bars = np.zeros((len(batch), 2, model.nx))
        bars[:, 1] = x_bar.reshape(len(batch), model.nx)
        x_bar, u_bar, theta_bar = batch.vjp(bars)
        return x_bar, u_bar[:, 0], theta_bar

    return _differentiable(model, forward, backward, lambda u: (model.nu,), lambda u: (model.nx,))


def rollout(model: Model) -> Function:
    """`f(x0, u, theta) -> xs`: x0 (nx,), u (T, nu), theta (n_params,) to xs (T + 1, nx)."""

    def forward(x0, u, theta):
        return _batched(model, x0, u, theta, record=False).x

    def backward(x0, u, theta, x_bar):
        batch = _batched(model, x0, u, theta, record=True)
        return batch.vjp(x_bar.reshape(len(batch), *x_bar.shape[-2:]))

    def shape_of_u(u):
        return (*u.shape[:1], model.nu)

    return _differentiable(
        model, forward, backward, shape_of_u, lambda u: (u.shape[0] + 1, model.nx)
    )


def _batched(model, x0, u, theta, record):
    """The rollouts of any number of leading axes, flattened into one."""
    return model.rollout_batch(
        x0.reshape(-1, model.nx),
        u.reshape(-1, *u.shape[-2:]),
        theta.reshape(-1, model.n_params),
        record=record,
    )


def _differentiable(model: Model, forward, backward, shape_of_u, shape_of_out) -> Function:
    """Wraps the two NumPy functions, which map stacks to stacks, as one JAX function."""

    def call(function, shapes, *args):
        """`function` on the host; vmap adds leading axes to every argument."""

        def on_host(*args):
            args = [np.asarray(a) for a in args]
            lead = args[0].shape[:-1]
            out = function(*args)
            if isinstance(shapes, tuple) and isinstance(shapes[0], jax.ShapeDtypeStruct):
                pairs = zip(out, shapes, strict=True)
                return tuple(o.reshape(*lead, *s.shape) for o, s in pairs)
            return out.reshape(*lead, *shapes.shape)

        return jax.pure_callback(on_host, shapes, *args, vmap_method="broadcast_all")

    def evaluate(x, u, theta):
        return call(forward, _like(shape_of_out(u)), x, u, theta)

    @jax.custom_vjp
    def function(x, u, theta):
        return evaluate(x, u, theta)

    def function_fwd(x, u, theta):
        return evaluate(x, u, theta), (x, u, theta)

    def function_bwd(inputs, out_bar):
        shapes = tuple(_like(a.shape) for a in inputs)
        return call(backward, shapes, *inputs, out_bar)

    function.defvjp(function_fwd, function_bwd)

    def checked(x, u, theta):
        x, u, theta = (_float64(name, a) for name, a in (("x", x), ("u", u), ("theta", theta)))
        _check_shape("x", x, (model.nx,))
        _check_shape("u", u, shape_of_u(u))
        _check_shape("theta", theta, (model.n_params,))
        return function(x, u, theta)

    return checked


def _like(shape) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(tuple(shape), np.float64)


def _float64(name: str, value) -> jax.Array:
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "pliant needs float64, but JAX is in 32-bit mode: call "
            'jax.config.update("jax_enable_x64", True) before anything else'
        )
    array = jnp.asarray(value)
    if array.dtype != np.float64:
        raise TypeError(f"{name} is {array.dtype}, but pliant needs float64: {name}.astype(float)")
    return array


def _check_shape(name: str, array: jax.Array, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, but {shape} is needed")
