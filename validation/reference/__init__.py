"""An independent JAX reference of pliant's ropes, rods, cloth and articulated bodies.

Written from the formulas alone; it shares no code with pliant and nothing in the
product imports it. Every law is an energy, a dissipation or a force (`laws`),
differentiated by JAX; the step is a root found by optimistix (`step`), whose
implicit-function adjoint gives the derivatives. SI units, float64 throughout.

    model = load("scene.toml")
    step = make_step(model)
    x_next = step(x, u, model.theta)          # jax.jvp, jax.vjp, jax.jacobian go through it

Scenes of bodies have `body_model.loads` and `body_step.make_step` instead: poses of a tree of joints (`bodies`),
energies and d'Alembert's principle on them, friction and stops (`joints`).

Where solids touch there are `touching_model.loads` and `touching_solve.Stepper`: features of shapes (`solids`, `hulls`), which of them may
meet in a stage (`listing`, `edge_listing`), their gaps and the contact law (`touching`), a stage's residual (`touching_step`) and what lands
under sdirk2 (`touching_landing`).
"""

import jax

jax.config.update("jax_enable_x64", True)

from .equilibrium import make_equilibrium
from .model import Model, load, loads
from .step import make_change_of_step, make_rollout, make_step

__all__ = ["Model", "load", "loads", "make_change_of_step", "make_equilibrium", "make_rollout", "make_step"]
