"""Differentiable physics for things that bend.

    import pliant

    model = pliant.load("scene.toml")
    roll = model.rollout(model.initial_state(), model.controls())
    x0_bar, u_bar, theta_bar = roll.vjp(x_bar)

All arrays are float64 in SI units; a state is x = [q, v, z]: coordinates, velocities and history
variables. q and v have three numbers per node [m, m/s], then those of joints [rad or m]; z has the plastic
strains, delays, loads and grasps that the scene has (`model.memory_names`), often none. `pliant.jax` has the same as differentiable JAX functions.
"""

from ._pliant import (
    Batch,
    Equilibrium,
    InputError,
    Model,
    Mpc,
    Mppi,
    NumericsError,
    Plan,
    Rollout,
    Sensing,
    SurrogateRollout,
    Task,
    VectorStepper,
    __version__,
    bench,
    cable,
    conformal_bound,
    diagnose,
    fit,
    import_model,
    load,
    load_task,
    loads,
    loads_task,
    plan,
)

__all__ = [
    "Batch",
    "Equilibrium",
    "InputError",
    "Model",
    "Mpc",
    "Mppi",
    "NumericsError",
    "Plan",
    "Rollout",
    "Sensing",
    "SurrogateRollout",
    "Task",
    "VectorStepper",
    "__version__",
    "bench",
    "cable",
    "conformal_bound",
    "diagnose",
    "fit",
    "import_model",
    "load",
    "load_task",
    "loads",
    "loads_task",
    "plan",
]


def __getattr__(name: str):
    """Import `pliant.jax`, `pliant.logs`, `pliant.own` and `pliant.perception` when they are first used: what they need is loaded only then."""
    if name in ("jax", "logs", "own", "perception"):
        from importlib import import_module

        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
