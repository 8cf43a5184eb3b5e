"""What lands under sdirk2: which of its steps two half steps by Euler take instead.

With V the velocity with which something hits a shape and stops within the first stage, the second stage's reference

    v_r = v + (1 + √2) (v₁ - v),   q_r = q + (1 + √2) (q₁ - q)

leaves with √2 V. At a free node and a shape of outward unit normal n, with g = |gravity| (10 m/s² where there is none):

    pierced   gap(q_r) < -0.1 g h² and gap(q_r) < gap(q)
    bounced   γ_n of the first stage > 0.1 g h m,   n(q_r)·v_r > 0.1 g h,   n(q)·v < -0.1 g h

Either makes the whole step one of Euler's halves. Nothing is differentiated through the choice. At a stop of a joint the gap is the way to
the limit, m the inertia with all other joints yielding, and gap and rate at the reference are extrapolated from the stage like q and v.
"""

import jax
import jax.numpy as jnp
import numpy as np

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


AHEAD = 1.0 + 2.0**0.5  # (1 - γ)/γ of sdirk2


def stops_hit(model, begin, first, impulses, theta, weights):
    """Whether any joint hits a stop (bool). begin, first: (q, v) where the step begins and at the end of the first stage; impulses of the
    stops there; weights as `bodies.weights` gives them."""
    thrown = jnp.zeros((), dtype=bool)
    magnitude = jnp.abs(theta[model.magnitude])
    slow = SLOW * jnp.where(magnitude > 0.0, magnitude, 10.0) * model.h
    for (joint, limit, side), impulse in zip(model.stops, impulses, strict=True):
        gap, gap_1 = (side * (q[joint.q.start] - theta[limit]) for q, _ in (begin, first))
        rate, rate_1 = (side * v[joint.v.start] for _, v in (begin, first))
        gap_r, rate_r = gap + AHEAD * (gap_1 - gap), rate + AHEAD * (rate_1 - rate)
        pierced = (gap_r < -slow * model.h) & (gap_r < gap)
        mass = float(np.asarray(weights[1])[joint.v.start])
        thrown |= pierced | ((impulse > slow * mass) & (rate_r > slow) & (rate < -slow))
    return thrown
