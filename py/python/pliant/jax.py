"""pliant's step and rollout as differentiable JAX functions.

    import pliant, pliant.jax

    step = pliant.jax.step(model)          # (x, u, theta) -> x_next
    rollout = pliant.jax.rollout(model)    # (x0, u, theta) -> xs

With `backward_rest_gap` [m] larger than the scene's the forward simulation stays the scene's, and
gradients are those of smoother contact: *surrogates*, which reach contacts not yet made, and are the
gradient of no single function.

States are coordinates x (nx,). Where a joint is a ball, or free, these hold a unit quaternion p (w first), and its
cotangent lives in R⁴ too: a turn ω in the body's axes moves p by ṗ = ½ p (0, ω), so that

    ω̄ = ½ L(p)ᵀ p̄   on the way into a step,     p̄ = 2 L(p) ω̄ / |p|²   on the way out,     L(p) ω = p (0, ω)

pull cotangents through exactly. They have no part along p: how a function of x goes on beyond unit length does not
matter to the chain rule through quaternions that are one long. A step takes p for p/|p|.

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
    chart = _Chart(model)

    def forward(x, u, theta):
        return (_batch(model, x, u[..., None, :], theta, record=False).x[:, 1],)

    def backward(x, u, theta, next_bar):
        batch = _batch(model, x, u[..., None, :], theta, record=True, rest_gap=backward_rest_gap)
        xs_bar = np.zeros((len(batch), 2, model.ndx))
        xs_bar[:, 1] = chart.to_changes(batch.x[:, 1], next_bar.reshape(-1, model.nx))
        return chart.pulled_back(batch, xs_bar)

    return _differentiable(
        model,
        forward,
        backward,
        inputs=lambda u: ((model.nx,), (model.nu,), (model.n_params,)),
        output=lambda u: (model.nx,),
    )


def rollout(model: Model, *, backward_rest_gap: float | None = None) -> Function:
    """`f(x0, u, theta) -> xs`: x0 (nx,), u (T, nu), theta (n_params,) to xs (T + 1, nx)."""
    chart = _Chart(model)

    def forward(x0, u, theta):
        return (_batch(model, x0, u, theta, record=False).x,)

    def backward(x0, u, theta, xs_bar):
        batch = _batch(model, x0, u, theta, record=True, rest_gap=backward_rest_gap)
        return chart.pulled_back(batch, chart.to_changes(batch.x, xs_bar.reshape(batch.x.shape)))

    return _differentiable(
        model,
        forward,
        backward,
        inputs=lambda u: ((model.nx,), (*u.shape[:1], model.nu), (model.n_params,)),
        output=lambda u: (u.shape[0] + 1, model.nx),
    )


class _Chart:
    """Cotangents of states x (…, nx) and of their changes δx (…, ndx), which have a turn for a quaternion."""

    def __init__(self, model: Model):
        nodes, names = 3 * model.n_nodes, model.dof_names
        # only a ball's three parts, and no name of a joint, end in an index of two
        balls = np.array([k - 2 for k, name in enumerate(names) if name.endswith("[2]")], dtype=int)
        if len(balls) != model.nx - model.ndx:
            raise RuntimeError(f"{model.nx - model.ndx} quaternions in a state, but joints with {len(balls)}: {names}")
        self.turns = nodes + balls[:, None] + np.arange(3)
        self.quaternions = nodes + (balls + np.arange(len(balls)))[:, None] + np.arange(4)
        self.plain_change = np.setdiff1d(np.arange(model.ndx), self.turns)
        self.plain = np.setdiff1d(np.arange(model.nx), self.quaternions)
        self.sizes = (model.nx, model.ndx)

    def to_changes(self, x, x_bar):
        """δx̄ (…, ndx) of x̄ (…, nx) at x: ω̄ = ½ L(p)ᵀ p̄."""
        out = np.empty((*x_bar.shape[:-1], self.sizes[1]))
        out[..., self.plain_change] = x_bar[..., self.plain]
        (w, u), (w_bar, u_bar) = (_split(a[..., self.quaternions]) for a in (x, x_bar))
        out[..., self.turns] = 0.5 * (w * u_bar - w_bar * u - np.cross(u, u_bar))
        return out

    def to_coordinates(self, x, dx_bar):
        """x̄ (…, nx) of δx̄ (…, ndx) at x: p̄ = 2 L(p) ω̄ / |p|²."""
        out = np.empty((*dx_bar.shape[:-1], self.sizes[0]))
        out[..., self.plain] = dx_bar[..., self.plain_change]
        p, turn = x[..., self.quaternions], dx_bar[..., self.turns]
        (w, u), size2 = _split(p), np.sum(p * p, axis=-1, keepdims=True)
        vector = w * turn + np.cross(u, turn)
        scalar = -np.sum(u * turn, axis=-1, keepdims=True)
        out[..., self.quaternions] = 2.0 / size2 * np.concatenate([scalar, vector], axis=-1)
        return out

    def pulled_back(self, batch, dxs_bar):
        """Cotangents of (x0, u, theta) from those of the changes of all states."""
        dx0_bar, u_bar, theta_bar = batch.vjp(dxs_bar)
        return self.to_coordinates(batch.x[:, 0], dx0_bar), u_bar, theta_bar


def _split(quaternions):
    """Scalar parts (…, n, 1) and vector parts (…, n, 3)."""
    return quaternions[..., :1], quaternions[..., 1:]


def _batch(model, x0, u, theta, record, rest_gap=None):
    """The rollouts of arguments with any number of leading axes."""
    states = "smooth" if rest_gap is None else "hard"
    x0, theta = x0.reshape(-1, model.nx), theta.reshape(-1, model.n_params)
    return model.rollout_batch(x0, u.reshape(len(x0), *u.shape[-2:]), theta, record=record, rest_gap=rest_gap, states=states)


def _differentiable(model: Model, forward, backward, *, inputs, output) -> Function:
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
