"""pliant's step and rollout as differentiable JAX functions.

    import pliant, pliant.jax

    step = pliant.jax.step(model)          # (x, u, theta) -> x_next
    rollout = pliant.jax.rollout(model)    # (x0, u, theta) -> xs

With `backward_rest_gap` [m] larger than the scene's the forward simulation stays the scene's, and
gradients are those of smoother contact: *surrogates*, which reach contacts not yet made, and are the
gradient of no single function.

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


def step(model: Model, *, backward_rest_gap: float | None = None) -> Function:
    """`f(x, u, theta) -> x_next`: x (nx,) [m, m/s], u (nu,), theta (n_params,), all float64."""

    def forward(x, u, theta):
        return (_batch(model, x, u[..., None, :], theta, record=False).x[:, 1],)

    def backward(x, u, theta, next_bar):
        batch = _batch(model, x, u[..., None, :], theta, record=True, rest_gap=backward_rest_gap)
        xs_bar = np.zeros((len(batch), 2, model.nx))
        xs_bar[:, 1] = next_bar.reshape(-1, model.nx)
        return batch.vjp(xs_bar)

    return _differentiable(
        model,
        forward,
        backward,
        inputs=lambda u: ((model.nx,), (model.nu,), (model.n_params,)),
        output=lambda u: (model.nx,),
    )


def rollout(model: Model, *, backward_rest_gap: float | None = None) -> Function:
    """`f(x0, u, theta) -> xs`: x0 (nx,), u (T, nu), theta (n_params,) to xs (T + 1, nx)."""

    def forward(x0, u, theta):
        return (_batch(model, x0, u, theta, record=False).x,)

    def backward(x0, u, theta, xs_bar):
        batch = _batch(model, x0, u, theta, record=True, rest_gap=backward_rest_gap)
        return batch.vjp(xs_bar.reshape(-1, *xs_bar.shape[-2:]))

    return _differentiable(
        model,
        forward,
        backward,
        inputs=lambda u: ((model.nx,), (*u.shape[:1], model.nu), (model.n_params,)),
        output=lambda u: (u.shape[0] + 1, model.nx),
    )


def _batch(model, x0, u, theta, record, rest_gap=None):
    """The rollouts of arguments with any number of leading axes."""
    states = "smooth" if rest_gap is None else "hard"
    x0, theta = x0.reshape(-1, model.nx), theta.reshape(-1, model.n_params)
    return model.rollout_batch(x0, u.reshape(len(x0), *u.shape[-2:]), theta, record=record, rest_gap=rest_gap, states=states)


def _differentiable(model: Model, forward, backward, *, inputs, output) -> Function:
    """One JAX function from two of NumPy, which take leading axes and return them as one.

    inputs, output: shapes of a single call's arguments and result, as functions of u.
    """

    if model.ndx != model.nx:
        raise NotImplementedError(
            "pliant.jax does not differentiate scenes with ball or free joints yet: a state has a quaternion, its change "
            "a turn of three numbers; use the rollout's own vjp and jvp"
        )

    @jax.custom_vjp
    def function(x, u, theta):
        return _on_host(forward, (output(u),), x, u, theta)[0]

    def function_fwd(x, u, theta):
        return function(x, u, theta), (x, u, theta)

    def function_bwd(given, out_bar):
        return _on_host(backward, [a.shape for a in given], *given, out_bar)

    function.defvjp(function_fwd, function_bwd)

    def checked(x, u, theta):
        x, u, theta = _float64("x", x), _float64("u", u), _float64("theta", theta)
        for name, array, shape in zip(("x", "u", "theta"), (x, u, theta), inputs(u), strict=True):
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}, but {shape} is needed")
        return function(x, u, theta)

    return checked


def _on_host(function, shapes, *args):
    """Calls `function` with NumPy arrays; under vmap all of them have the same leading axes."""

    def call(*args):
        arrays = [np.asarray(a) for a in args]
        lead = arrays[0].shape[:-1]
        results = zip(function(*arrays), shapes, strict=True)
        return tuple(result.reshape(*lead, *shape) for result, shape in results)

    results = tuple(jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes)
    return jax.pure_callback(call, results, *args, vmap_method="broadcast_all")


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
