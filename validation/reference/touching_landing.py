"""Which steps of sdirk2 two half steps by Euler take instead, where solids hit each other: docs/theory/step.md, "Impacts under SDIRK2".

The rule for nodes is in `landing`; here gaps and rates are those of the contacts listed in the first stage, extrapolated from it. NumPy,
and slopes by differences: nothing is differentiated through the choice.
"""

import numpy as np

from . import bodies, listing, touching_step
from .landing import AHEAD, SLOW

EPS = 1e-6  # [rad, m] difference of a coordinate


def thrown_back(model, ends, contacts, loads, theta, h):
    """Whether a contact is pierced or bounces, or a stage begins deep. ends: (q, v) where the step begins, at the end of the first stage
    (of length h) and where the second begins; contacts with their w₀ [N·s] in the first stage."""
    slow = SLOW * (abs(theta[model.magnitude]) or 10.0) * model.h
    instants = [listing.Instant(touching_step.frames_of(model, q), theta) for q, _ in ends]
    rates = [touching_step.rates_of(model, q, v) for q, v in ends]
    yields = mobilities(model, ends[0][0], theta, h)
    for contact, load in zip(contacts, loads, strict=True):
        gaps, speeds, sides = [], [], (contact.first.frames[0], contact.second.frames[0])
        for at, rate in zip(instants, rates, strict=True):
            gap, n, c = at.meeting(contact.kind, contact.first, contact.second, contact.sign)
            x = [np.append(at.frames[f][:, :3].T @ (c - at.frames[f][:, 3]), 1.0) for f in sides]
            gaps.append(gap)
            speeds.append(n @ (rate[sides[0]] @ x[0] - rate[sides[1]] @ x[1]))
            if at is instants[0]:
                mobility = sum(yields(f, n, point) for f, point in zip(sides, x, strict=True))
        ahead = [x[0] + AHEAD * (x[1] - x[0]) for x in (gaps, speeds)]
        pierced = ahead[0] < -slow * model.h and ahead[0] < gaps[0]
        bounced = load * mobility > slow and speeds[0] < -slow and ahead[1] > slow
        if pierced or bounced or min(gaps[0], gaps[2]) < -slow * model.h:
            return True
    return False


def mobilities(model, q, theta, h):
    """yields(frame, n, r): velocity along n [m/s] of a frame's point r that a unit impulse along n there makes, all joints yielding
    but for their armature, damping and stiffness."""
    units = np.eye(model.nv)
    slopes = [touching_step.frames_of(model, touching_step.moved(model, q, s * EPS * e)) for e in units for s in (1.0, -1.0)]
    slopes = (np.array(slopes[::2]) - np.array(slopes[1::2])) / (2.0 * EPS)
    inertia = np.diag([*np.repeat(touching_step.node_masses(model, theta), 3), *np.zeros(model.nv - 3 * model.n_nodes)])
    if model.bodies is not None:
        own = theta[model.of_bodies]
        moments = np.asarray(bodies.moments(model.bodies, own))
        parts = [np.asarray(bodies.by_dof(model.bodies, own, key)) for key in ("armature", "damping", "stiffness")]
        rows = slice(3 * model.n_nodes, None)
        of = slopes[rows, : model.n_bodies]
        inertia[rows, rows] = np.einsum("kbic,bcd,lbid->kl", of, moments, of) + np.diag(parts[0] + h * parts[1] + h * h * parts[2])

    def yields(frame, n, r):
        row = slopes[:, frame] @ r @ n
        return row @ np.linalg.solve(inertia, row)

    return yields
