"""pliant's step and rollout as differentiable JAX functions.

    import pliant, pliant.jax

    step = pliant.jax.step(model)          # (x, u, theta) -> x_next
    rollout = pliant.jax.rollout(model)    # (x0, u, theta) -> xs

With `backward_rest_gap` [m] larger than the scene's the forward simulation stays the scene's, and
gradients are those of smoother contact: *surrogates*, which reach contacts not yet made, and are the
gradient of no single function. Such a function says so: its attribute `surrogate` is True, and its name begins
with `surrogate_`.

States are numbers x (nx,). Among them are the unit quaternions of balls and of free bodies, and the axes of rods' edges,
whose cotangents are numbers too. On the way into a step they become cotangents of changes of the state, by
`Model.pull_displaced`, and those go out by `Model.pull_difference`; both are exact along every curve of states. A step takes
a quaternion p for p/|p|, and refuses axes that do not belong to their edges: change states as `Model.displaced` does.
What of a rod's turning is in an edge's angle and what in its axis d is a matter of bookkeeping: let a loss depend on the
material axes, cos(angle) d + sin(angle) t × d with the edge's direction t (`Model.material_axes`), not on either alone.

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
    """`f(x, u, theta) -> x_next`: x (nx,) [m, rad, m/s, rad/s], u (nu,), theta (n_params,), all float64."""

    def forward(x, u, theta):
        return (_batch(model, x, u[..., None, :], theta, record=False).x[:, 1],)

    def backward(x, u, theta, next_bar):
        batch = _batch(model, x, u[..., None, :], theta, record=True, rest_gap=backward_rest_gap)
        xs_bar = np.zeros((len(batch), 2, model.nx))
        xs_bar[:, 1] = next_bar.reshape(-1, model.nx)
        return _pulled_back(model, batch, xs_bar)

    return _differentiable(
        _name("step", model, backward_rest_gap),
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
        return _pulled_back(model, batch, xs_bar)

    return _differentiable(
        _name("rollout", model, backward_rest_gap),
        forward,
        backward,
        inputs=lambda u: ((model.nx,), (*u.shape[:1], model.nu), (model.n_params,)),
        output=lambda u: (u.shape[0] + 1, model.nx),
    )


def _pulled_back(model, batch, xs_bar):
    """Cotangents of (x0, u, theta) from those of the numbers of all states."""
    rows = model.pull_displaced(batch.x.reshape(-1, model.nx), xs_bar.reshape(-1, model.nx))
    dx0_bar, u_bar, theta_bar = batch.vjp(rows.reshape(*batch.x.shape[:2], model.ndx))
    return model.pull_difference(batch.x[:, 0], dx0_bar), u_bar, theta_bar


def _batch(model, x0, u, theta, record, rest_gap=None):
    """The rollouts of arguments with any number of leading axes."""
    states = "smooth" if rest_gap is None else "hard"
    x0, theta = x0.reshape(-1, model.nx), theta.reshape(-1, model.n_params)
    return model.rollout_batch(x0, u.reshape(len(x0), *u.shape[-2:]), theta, record=record, rest_gap=rest_gap, states=states)


def _name(function, model, backward_rest_gap):
    """A step or rollout of the scene's own contact keeps its name."""
    return function if backward_rest_gap in (None, model.rest_gap) else f"surrogate_{function}"


def _differentiable(name: str, forward, backward, *, inputs, output) -> Function:
    """One JAX function from two of NumPy, which take leading axes and return them as one.

    inputs, output: shapes of a single call's arguments and result, as functions of u.
    """

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
        for argument, array, shape in zip(("x", "u", "theta"), (x, u, theta), inputs(u), strict=True):
            if array.shape != shape:
                raise ValueError(f"{argument} has shape {array.shape}, but {shape} is needed")
        return function(x, u, theta)

    checked.__name__ = checked.__qualname__ = name
    checked.surrogate = name.startswith("surrogate_")
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
