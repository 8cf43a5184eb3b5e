"""Where bodies are, and what moves them, from poses and energies alone.

A body's pose T = (R | p), (3, 4), places its points r at T (r, 1). Its mass enters as the moments
J = ∫ (r, 1)(r, 1)ᵀ dm, (4, 4), so d'Alembert's principle, ∫ δx·(ẍ - g) dm = f·δq, is
    tr(∂_l T J T̈ᵀ) + ∂_l E = f_l      (J. J. Uicker, 1965; there is no angular velocity in it)
with ∂_l T and T̈ by automatic differentiation of T(q).
"""

import jax
import jax.numpy as jnp
import numpy as np

from . import formulas, joints, laws, rotations
from .contact import sharpness

UPPER = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])  # places of a spread's six numbers

def _range(part):
    return range(part.start, part.stop)


def _places(model, ball):
    """Coordinates and degrees of freedom of all balls, (n, 4) and (n, 3), or of all other joints, (n, 1) each."""
    chosen = [j for j in model.joints if (j.kind == "ball") == ball]
    return np.array([_range(j.q) for j in chosen]), np.array([_range(j.v) for j in chosen])


def add(model, q, t, turn):
    """q ⊕ t (nq,): coordinates displaced by t (nv,); `turn` makes quaternions of rotation vectors."""
    where_q, where_v = _places(model, ball=False)
    if len(where_q):
        q = q.at[where_q].add(t[where_v])
    where_q, where_v = _places(model, ball=True)
    if len(where_q):
        q = q.at[where_q].set(jax.vmap(rotations.product)(q[where_q], jax.vmap(turn)(t[where_v])))
    return q


def moves(model, q):
    """(n_joints, 4, 4): what each joint does to its body's frame."""
    frames, order = [], []
    for kind in ("revolute", "prismatic", "ball"):
        chosen = [k for k, j in enumerate(model.joints) if j.kind == kind]
        if not chosen:
            continue
        of = [model.joints[k] for k in chosen]
        axis, anchor = np.array([j.axis for j in of]), np.array([j.anchor for j in of])
        x = q[np.array([_range(j.q) for j in of])]
        if kind == "prismatic":
            frames.append(jax.vmap(joints.sliding)(axis, x[:, 0]))
        else:
            turns = x if kind == "ball" else jax.vmap(rotations.about)(axis, x[:, 0])
            frames.append(jax.vmap(joints.turning)(turns, anchor))
        order += chosen
    return jnp.concatenate(frames)[np.argsort(order)]


def poses(model, q):
    """T (n_bodies, 3, 4), the bodies' frames in the world, columns R and p [m].

    Frame by frame, F_k = F_before(k) C_k M_k with the constant C and the motion M of a joint.
    """
    before, constant, joint, last = model.links
    move = jnp.concatenate([moves(model, q), jnp.eye(4)[None]])[joint]

    def body(frames, link):
        k, k_before, c, m = link
        return frames.at[k].set(frames[k_before] @ c @ m), None

    n = len(before)
    start = jnp.tile(jnp.eye(4), (n + 1, 1, 1))  # the last is the world
    frames, _ = jax.lax.scan(body, start, (np.arange(n), before, constant, move))
    return frames[last, :3]


def moments(model, theta):
    """J = m (U Uᵀ + c cᵀ, c; cᵀ, 1), (n_bodies, 4, 4)  [kg m², kg m, kg]; zero for bodies without mass."""

    def of(x):
        m, c, s = x[0], x[1:4], x[4:]
        u = jnp.zeros((3, 3)).at[UPPER].set(s)
        second = u @ u.T + jnp.outer(c, c)
        return m * jnp.block([[second, c[:, None]], [c[None, :], jnp.ones((1, 1))]])

    heavy = np.array([k for k, body in enumerate(model.bodies) if body.theta is not None])
    where = np.array([model.bodies[k].theta for k in heavy])
    return jnp.zeros((len(model.bodies), 4, 4)).at[heavy].set(jax.vmap(of)(theta[where]))


def by_dof(model, theta, key):
    """A joint parameter by degree of freedom (nv,); 0 for joints without it."""
    where = [(d, joint.theta[key]) for joint in model.joints if key in joint.theta for d in _range(joint.v)]
    dofs, places = np.array(where, dtype=int).reshape(-1, 2).T
    return jnp.zeros(model.nv).at[dofs].set(theta[places])


def inertia_force(model, q, v, a, theta):
    """tr(∂_l T J T̈ᵀ) + armature a (nv,)  [N·m or N] at coordinates q, velocities v, accelerations a.

    The curve q ⊕ (v s + a s²/2) has these at s = 0, where every map of turns agrees with the
    exponential up to third order.
    """
    body_moments = moments(model, theta)

    def moved(t):
        return poses(model, add(model, q, t, rotations.cayley))

    def velocity(s):
        return jax.jvp(lambda s: moved(v * s + 0.5 * a * s * s), (s,), (1.0,))[1]

    acceleration = jax.jvp(velocity, (0.0,), (1.0,))[1]
    _, pull = jax.vjp(moved, jnp.zeros(model.nv))
    return pull(acceleration @ body_moments)[0] + by_dof(model, theta, "armature") * a


def mass_matrix(model, q, theta):
    """tr(∂_k T J ∂_l Tᵀ) + armatures, (nv, nv)."""
    moved = jax.jacfwd(lambda t: poses(model, add(model, q, t, rotations.cayley)))(jnp.zeros(model.nv))
    inertia = jnp.einsum("bick,bcd,bidl->kl", moved, moments(model, theta), moved)
    return inertia + jnp.diag(by_dof(model, theta, "armature"))


def potential(model, q, theta):
    """Weight, springs and cogging  [J]."""
    return -jnp.sum(poses(model, q) * weights_on_frames(model, theta)) + springs(model, q, theta)


def weights_on_frames(model, theta):
    """g (m c; m)ᵀ (n_bodies, 3, 4): what the weight is as a load on the frames T."""
    g = laws.gravity_vector(theta[model.magnitude], theta[model.tilt])
    return g[:, None] * moments(model, theta)[:, None, :, 3]


def springs(model, q, theta):
    """Springs and cogging  [J]."""
    e = jnp.zeros(())
    for ball in (False, True):
        sprung = [j for j in model.joints if "stiffness" in j.theta and (j.kind == "ball") == ball]
        if not sprung:
            continue
        x = q[np.array([_range(j.q) for j in sprung])]
        k, cubic = (theta[np.array([j.theta[key] for j in sprung])] for key in ("stiffness", "cubic_stiffness"))
        if ball:
            stretch2 = jnp.sum(jax.vmap(rotations.logarithm)(x) ** 2, axis=1)
        else:
            stretch2 = (x[:, 0] - theta[np.array([j.theta["rest"] for j in sprung])]) ** 2
        e += jnp.sum(joints.spring_energy(stretch2, k, cubic))
    for joint, cycles, (sine, cosine) in model.coggings:
        e += joints.cogging_energy(q[joint.q.start], cycles, theta[sine], theta[cosine])
    return e


def quadratic_dissipation(model, v, theta):
    """Of damping by the square of the speed  [W]."""
    r = jnp.zeros(())
    for ball in (False, True):
        damped = [j for j in model.joints if "quadratic_damping" in j.theta and (j.kind == "ball") == ball]
        if damped:
            k = theta[np.array([j.theta["quadratic_damping"] for j in damped])]
            speed2 = jnp.sum(v[np.array([_range(j.v) for j in damped])] ** 2, axis=1)
            r += jnp.sum(joints.quadratic_dissipation(speed2, k))
    return r


def drag_dissipation(model, q, v, theta):
    """∑ ½ ρ A |u|³/3 + ½ 6 η √(π A) |u|² over the bodies  [W], u the velocity of a centre of mass less the wind; its slope by v is the drag."""
    if model.medium is None:
        return jnp.zeros(())
    moved = jax.jvp(lambda t: poses(model, add(model, q, t, rotations.cayley)), (jnp.zeros(model.nv),), (v,))[1]
    shown = [k for k, body in enumerate(model.bodies) if body.drag is not None]
    centres = theta[np.array([model.bodies[k].theta[1:4] for k in shown])]
    areas = jnp.array([theta[d] if isinstance(d, int) else d for d in (model.bodies[k].drag for k in shown)])
    u = jnp.einsum("bij,bj->bi", moved[np.array(shown)], jnp.pad(centres, ((0, 0), (0, 1)), constant_values=1.0)) - theta[model.wind]
    square = jnp.sum(u * u, axis=1)
    still = square == 0.0
    speed = jnp.where(still, 0.0, jnp.sqrt(jnp.where(still, 1.0, square)))
    density, viscosity = (theta[k] for k in model.medium)
    return density * jnp.sum(areas * speed**3) / 6.0 + 3.0 * viscosity * jnp.sum(jnp.sqrt(jnp.pi * areas) * square)


def force(model, q, v, u, theta, energy=potential):
    """All that acts on the joints at (q, v) and controls u (nv,)  [N·m or N]: -∂E/∂q - ∂R/∂v + motors."""

    def energy_at(t):
        return energy(model, add(model, q, t, rotations.cayley), theta)

    def dissipation(v):
        return 0.5 * jnp.sum(by_dof(model, theta, "damping") * v * v) + quadratic_dissipation(model, v, theta) + drag_dissipation(model, q, v, theta)

    f = -jax.grad(energy_at)(jnp.zeros(model.nv)) - jax.grad(dissipation)(v)
    for motor, control in zip(model.motors, u, strict=True) if model.motors else ():
        p = {key: theta[at] for key, at in motor.theta.items()}
        joint = motor.joint
        f = f.at[joint.v].add(joints.motor_force(motor.kind, p, control, q[joint.q], v[joint.v]))
    for own in model.forces:
        joint = own.place
        coordinates = rotations.logarithm(q[joint.q]) if joint.kind == "ball" else q[joint.q]
        f = f.at[joint.v].add(formulas.of_joint(own, coordinates, v[joint.v], theta))
    return f


def weights(model):
    """Inertia of each degree of freedom as the scene begins (nv,): all others held, all others yielding.

    What smooths friction and stops; it does not follow θ, and no derivative passes through it.
    """
    m = np.asarray(jax.jit(lambda *at: mass_matrix(model, *at))(model.q0, model.theta))
    return np.diag(m), 1.0 / np.diag(np.linalg.inv(m))


def rows(model, weights, q, v, gamma, theta, h, scale=1.0):
    """Residuals F (n_rows,) of friction, then stops, then couplings, of joints at q = q⁺, v = v⁺, for impulses gamma.

    κ = ε rest_gap (c + WEIGHT/1000 inertia) of friction with Coulomb part c, rest_gap WEIGHT inertia of a
    stop [J]; `scale` multiplies κ. A coupling gives way by rest_gap/(WEIGHT inertia) beyond its own compliance.
    """
    held, yielding = weights
    out, n = [], len(model.frictions)
    if n:
        dof = np.array([joint.v.start for joint, _ in model.frictions])
        c, s, v_s = theta[np.array([where for _, where in model.frictions]).T]
        bound = h * joints.friction_bound(c, s, v_s, v[dof])
        kappa = sharpness(model.h) * model.rest_gap * (c + joints.FRICTION_FLOOR * joints.WEIGHT * held[dof])
        out.append(joints.friction_residual(bound, v[dof], gamma[:n], joints.RHO * yielding[dof], scale * kappa))
    if model.stops:
        dof, at = (np.array([getattr(joint, x).start for joint, *_ in model.stops]) for x in "vq")
        limit, side = np.array([limit for _, limit, _ in model.stops]), np.array([side for *_, side in model.stops])
        kappa = model.rest_gap * joints.WEIGHT * held[dof]
        approach = side * (q[at] - theta[limit]) / h
        own = gamma[n : n + len(dof)]
        out.append(joints.stop_residual(approach, own, joints.RHO * yielding[dof], scale * kappa))
    for coupling, g in zip(model.couplings, gamma[n + len(model.stops) :], strict=True):
        wanted, _ = led(coupling, q, theta)
        stiff, soft = coupled_inertias(model, coupling, weights)
        own = 0.0 if coupling.compliance is None else theta[coupling.compliance]
        give = (own + model.rest_gap / (joints.WEIGHT * stiff)) / h**2
        out.append(joints.RHO * soft * ((q[coupling.joint.q] - wanted) / h + give * g))
    return jnp.concatenate(out) if out else jnp.zeros(0)


def led(coupling, q, theta):
    """Coordinate of a coupled joint that the leading one's asks for, p(d), and p'(d)."""
    coefficients = theta[coupling.coefficients][::-1]
    if coupling.lead is None:
        return coefficients[-1], 0.0
    d = q[coupling.lead.q][0] - theta[coupling.reference]
    return jnp.polyval(coefficients, d), jnp.polyval(jnp.polyder(coefficients), d)


def coupled_inertias(model, coupling, weights):
    """Inertia seen from a coupled joint as the scene begins, all others held, and all yielding."""
    follower, lead = coupling.joint, coupling.lead
    if lead is None:
        return [inertia[follower.v.start] for inertia in weights]
    d = model.q0[lead.q][0] - model.theta[coupling.reference]
    slope = np.polyval(np.polyder(model.theta[coupling.coefficients][::-1]), d)
    return [1.0 / (1.0 / inertia[follower.v.start] + slope**2 / inertia[lead.v.start]) for inertia in weights]


def directions(model, q, theta):
    """(nv, n_rows): the generalized impulse of each row's γ at coordinates q; of a coupling -p' on the joint that leads."""
    first = len(model.frictions) + len(model.stops)
    out = jnp.asarray(np.hstack([fixed_directions(model), np.zeros((model.nv, len(model.couplings)))]))
    for k, coupling in enumerate(model.couplings):
        out = out.at[coupling.joint.v.start, first + k].add(1.0)
        if coupling.lead is not None:
            out = out.at[coupling.lead.v.start, first + k].add(-led(coupling, q, theta)[1])
    return out


def fixed_directions(model):
    """Those of friction and stops, which do not change."""
    out = np.zeros((model.nv, len(model.frictions) + len(model.stops)))
    for k, (joint, _) in enumerate(model.frictions):
        out[joint.v.start, k] = 1.0
    for k, (joint, _, side) in enumerate(model.stops):
        out[joint.v.start, len(model.frictions) + k] = side
    return out
