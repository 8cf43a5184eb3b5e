"""What lands under sdirk2: which of its steps two half steps by Euler take instead.

With V the velocity with which something hits a shape and stops within the first stage, the second stage's reference

    v_r = v + (1 + √2) (v₁ - v),   q_r = q + (1 + √2) (q₁ - q)

leaves with √2 V. At a free node and a shape of outward unit normal n, with g = |gravity| (10 m/s² where there is none):

    pierced   gap(q_r) < -0.1 g h² and gap(q_r) < gap(q)
    bounced   γ_n of the first stage > 0.1 g h m,   n(q_r)·v_r > 0.1 g h,   n(q)·v < -0.1 g h

Either makes the whole step one of Euler's halves. Nothing is differentiated through the choice.
"""

import jax
import jax.numpy as jnp

from . import forces

SLOW = 0.1  # part of a step's fall


def thrown_back(model, begin, first, reference, theta, kappa, lengths):
    """Whether any free node is (bool). begin, first, reference: (positions, velocities) (n, 3) of the free nodes where the step begins,
    at the end of the first stage, and where the second begins; kappa (n,) [J]; lengths [s]: of the step and of its stages."""
    h, stage = lengths
    magnitude = jnp.abs(theta[model.magnitude])
    slow = SLOW * jnp.where(magnitude > 0.0, magnitude, 10.0) * h
    mass = forces.masses(model, theta)[model.free]
    loads = forces.normal_impulses(model, *first, theta, kappa, stage)
    at_begin, at_reference = (forces.gaps_and_normals(model, q, theta) for q, _ in (begin, reference))
    along = jax.vmap(jnp.dot)
    thrown = jnp.zeros((), dtype=bool)
    for load, (gap, normal, _), (gap_r, normal_r, _) in zip(loads, at_begin, at_reference, strict=True):
        pierced = (gap_r < -slow * h) & (gap_r < gap)
        bounced = (load > slow * mass) & (along(normal_r, reference[1]) > slow) & (along(normal, begin[1]) < -slow)
        thrown |= jnp.any(pierced | bounced)
    return thrown
