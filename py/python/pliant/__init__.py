"""Differentiable physics for things that bend.

    import pliant

    model = pliant.load("scene.toml")
    roll = model.rollout(model.initial_state(), model.controls())
    x0_bar, u_bar, theta_bar = roll.vjp(x_bar)

All arrays are float64 in SI units; a state is x = [q, v], coordinates then velocities: three numbers
per node [m, m/s], then those of joints [rad or m]. `pliant.jax` has the same as differentiable JAX functions.
"""

from ._pliant import (
    Batch,
    Equilibrium,
    InputError,
    Model,
    NumericsError,
    Rollout,
    SurrogateRollout,
    __version__,
    bench,
    cable,
    diagnose,
    fit,
    import_model,
    load,
    loads,
)

__all__ = [
    "Batch",
    "Equilibrium",
    "InputError",
    "Model",
    "NumericsError",
    "Rollout",
    "SurrogateRollout",
    "__version__",
    "bench",
    "cable",
    "diagnose",
    "fit",
    "import_model",
    "load",
    "loads",
]


def __getattr__(name: str):
    """Import `pliant.jax` when it is first used, so that JAX is loaded only then."""
    if name == "jax":
        from importlib import import_module

        return import_module(".jax", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
