"""A step of what touches, as a root: implicit Euler, or the two stages of sdirk2.

Unknowns of a stage y = (v⁺, γ, w₀): velocities, impulses at joints and a normal impulse of each contact listed where it begins. With
q⁺ = q ⊕ exp(h v⁺), p = w₀ n + μ w̄ the impulse of a contact and c its point (`touching`),

    nodes     m (v⁺ - v)/h - f - Σ p/h = 0                               [N]
    bodies    inertia(q⁺, v⁺, ā) - f - D γ/h - Σ (∂x_A - ∂x_B)·p/h = 0    [N·m, N],  ∂x: of the body's point at c by its coordinates
    contacts  w₀ = φ(w₀ - ρ v_n),  v_n = (gap - gap*)/h + C w₀/h²          [N·s]

Derivatives are those of the implicit function theorem; every partial derivative is JAX's.
"""

import numpy as np
import jax
import jax.numpy as jnp

from . import bodies, body_step, forces, listing, rotations, solids, touching
from .step import commanded_velocity

RHO = 0.3  # step ρ over the lighter solid's mass; the root does not depend on it
EPS = 1e-6  # [s] difference for velocities of frames, which are needed for margins only


def frames_of(model, q):
    """(m, 3, 4): bodies, the world, nodes; NumPy."""
    out, count = [], 3 * model.n_nodes
    world = np.eye(3, 4)
    if model.bodies is not None:
        x = q[count:]
        for body in model.bodies.bodies:
            frame = np.vstack([world if body.parent is None else out[body.parent], [0.0, 0.0, 0.0, 1.0]]) @ body.frame
            for joint in body.joints:
                move = np.eye(4)
                if joint.kind == "prismatic":
                    move[:3, 3] = joint.axis * x[joint.q][0]
                else:
                    turn = x[joint.q] if joint.kind == "ball" else solids.quaternion(x[joint.q][0] * joint.axis)
                    move[:3, :3] = solids.rotation(turn)
                    move[:3, 3] = joint.anchor - move[:3, :3] @ joint.anchor
                frame = frame @ move
            out.append(frame[:3])
    nodes = [np.column_stack([np.eye(3), x]) for x in q[:count].reshape(-1, 3)]
    return np.array([*out, world, *nodes])


def moved(model, q, t):
    """q ⊕ exp(t); NumPy."""
    count = 3 * model.n_nodes
    out = q.copy()
    out[:count] += t[:count]
    if model.bodies is None:
        return out
    for joint in model.bodies.joints:
        to, by = slice(count + joint.q.start, count + joint.q.stop), t[count:][joint.v]
        if joint.kind != "ball":
            out[to] += by
            continue
        w, *u = solids.quaternion(by)
        a, b = q[to][0], q[to][1:]
        out[to] = np.concatenate([[a * w - b @ u], a * np.array(u) + w * b + np.cross(b, u)])
    return out


def rates_of(model, q, v):
    """Rates (m, 3, 4) of the frames, for margins and thresholds only."""
    later, before = (frames_of(model, moved(model, q, t * v)) for t in (EPS, -EPS))
    return (later - before) / (2.0 * EPS)


def slopes_of_moved(model, t):
    """Slopes of the change of q ⊕ exp(t) by that of q and by t, (nv, nv) each; NumPy. Of a ball Rᵀ(t) and the right Jacobian of its
    turns, 1 - (1 - cos a)/a² [t] + (a - sin a)/a³ [t]²."""
    by_q, by_t = np.eye(model.nv), np.eye(model.nv)
    for joint in model.bodies.joints if model.bodies else ():
        if joint.kind != "ball":
            continue
        rows = slice(3 * model.n_nodes + joint.v.start, 3 * model.n_nodes + joint.v.stop)
        x = t[rows]
        a, hat = np.linalg.norm(x), np.cross(np.eye(3), x)
        series = a < 1e-2  # next terms are a⁴/720 and a⁴/5040
        first = 0.5 - a * a / 24.0 if series else (1.0 - np.cos(a)) / a**2
        second = 1.0 / 6.0 - a * a / 120.0 if series else (a - np.sin(a)) / a**3
        by_t[rows, rows] = np.eye(3) - first * hat + second * hat @ hat
        by_q[rows, rows] = solids.rotation(solids.quaternion(x)).T
    return by_q, by_t


def add(model, q, t):
    """q ⊕ exp(t)."""
    count = 3 * model.n_nodes
    if model.bodies is None:
        return q + t
    of_bodies = bodies.add(model.bodies, q[count:], t[count:], rotations.exponential)
    return jnp.concatenate([q[:count] + t[:count], of_bodies])


def difference(model, q, at):
    """q ⊖ at (nv,), exact to first order in it."""
    count = 3 * model.n_nodes
    parts = [q[:count] - at[:count]]
    if model.bodies is not None:
        nothing = jnp.zeros(model.bodies.nv)
        x, y = (jnp.concatenate([z[count:], nothing]) for z in (q, at))
        parts.append(body_step.change(model.bodies, x, y)[: model.bodies.nv])
    return jnp.concatenate(parts)


def commands(model, nodes, u, theta):
    """v_cmd (3 n_nodes,) of nodes that are at `nodes` (3 n_nodes,); zero at free ones."""
    if model.nodes is None:
        return jnp.zeros(0)
    return commanded_velocity(model.nodes, nodes.reshape(-1, 3), u[: model.nodes.nu], theta[model.of_nodes]).ravel()


def body_residual(model, q, v, a, u, theta, gamma, h):
    """(frames, rates) of the bodies, and what takes their wrenches Σ p (c; 1)ᵀ/h (n, 3, 4), in their own frames, to the residual."""
    own = model.bodies

    def at(t):
        return bodies.poses(own, bodies.add(own, q, t, rotations.cayley))

    def curve(s):
        return jax.jvp(lambda s: at(v * s + 0.5 * a * s * s), (s,), (1.0,))

    (frames, rates), (_, accelerations) = jax.jvp(curve, (0.0,), (1.0,))
    _, pull = jax.vjp(at, jnp.zeros(own.nv))
    inertia = accelerations @ bodies.moments(own, theta) - bodies.weights_on_frames(own, theta)
    rest = bodies.by_dof(own, theta, "armature") * a - bodies.force(own, q, v, u, theta, bodies.springs)
    if len(gamma):
        rest -= bodies.directions(own, q, theta) @ gamma / h
    return frames, rates, lambda loads: pull(inertia - loads)[0] + rest


def make_stage(model, kinds):
    """stage(z, q, v, command, u, theta, y, h, contacts, scale) -> (residual (n_y,), q⁺ ⊖ itself (nv,)) at changes z of (q, v, command,
    u, θ, y); command (3 n_nodes,): nodes where the step begins, from which grippers are commanded; kinds: of contacts that may be listed."""
    nv, count = model.nv, 3 * model.n_nodes
    weights = bodies.weights(model.bodies) if n_rows(model) else None
    driven = np.zeros(0, dtype=bool) if model.nodes is None else model.nodes.driven_rows

    def stage(z, q, v, command, u, theta, y, h, c, scale):
        sizes = np.cumsum([nv, nv, count, len(u), len(theta)])
        dq, dv, dc, du, dt, dy = jnp.split(z, sizes)
        q, v, command, u, theta, y = add(model, q, dq), v + dv, command + dc, u + du, theta + dt, y + dy
        v_next, gamma, w0 = y[:nv], y[nv : nv + n_rows(model)], y[nv + n_rows(model) :]
        q_next = add(model, q, h * v_next)
        nodes, v_nodes = q_next[:count].reshape(-1, 3), v_next[:count].reshape(-1, 3)
        of_nodes = jnp.concatenate([jnp.tile(jnp.eye(3), (model.n_nodes, 1, 1)), nodes[:, :, None]], axis=2)
        rates_of_nodes = jnp.concatenate([jnp.zeros((model.n_nodes, 3, 3)), v_nodes[:, :, None]], axis=2)
        world = jnp.asarray(np.eye(3, 4))[None]
        frames, rates, to_rows = [world, of_nodes], [0.0 * world, rates_of_nodes], None
        begin = [world, jnp.concatenate([of_nodes[:, :, :3], q[:count].reshape(-1, 3, 1)], axis=2)]
        if model.bodies is not None:
            own = theta[model.of_bodies]
            a, u_bodies = (v_next - v)[count:] / h, u[len(u) - model.bodies.nu :]
            of, rate, to_rows = body_residual(model, q_next[count:], v_next[count:], a, u_bodies, own, gamma, h)
            frames, rates = [of, *frames], [rate, *rates]
            begin = [bodies.poses(model.bodies, q[count:]), *begin]
        frames, rates, begin = (jnp.concatenate(x) for x in (frames, rates, begin))
        loads, contact_rows = act(frames, rates, begin, w0, theta, h, c, scale)
        rows = []
        if model.nodes is not None:
            own, at_end = theta[model.of_nodes], q_next[:count]
            f = forces.total_force(model.nodes, at_end, v_next[:count], own, None, None)
            m = forces.row_masses(model.nodes, own)
            on_nodes = loads[model.n_bodies + 1 :, :, 3].ravel()
            free = m * (v_next - v)[:count] / h - f - on_nodes
            rows.append(jnp.where(driven, v_next[:count] - commands(model, command, u, theta), free))
        if to_rows is not None:
            rows.append(to_rows(loads[: model.n_bodies]))
            if n_rows(model):
                own = theta[model.of_bodies]
                rows.append(bodies.rows(model.bodies, weights, q_next[count:], v_next[count:], gamma, own, h, scale))
        end = difference(model, q_next, jax.lax.stop_gradient(q_next))
        return jnp.concatenate([*rows, contact_rows, end])

    def act(frames, rates, begin, w0, theta, h, c, scale):
        """Loads Σ ±p (r; 1)ᵀ/h (m, 3, 4) on frames at their own points r, and the contacts' rows."""
        one = jnp.concatenate([jnp.ones(1), theta])
        rot = jax.vmap(jax.vmap(rotations.of_vector))(jnp.where(c["turn"] < 0, 0.0, theta[c["turn"]]))
        c = c | {"rot": rot}
        # at the end and at the beginning of the stage in one, which compiles once
        twice = {key: jnp.concatenate([x, x + len(frames)] if key in ("frames", "other") else [x, x]) for key, x in c.items()}
        met = touching.all_meet(kinds, twice, jnp.concatenate([frames, begin]), theta)
        (gap, n, point, shares), start = (x[: len(w0)] for x in met), met[0][len(w0) :]
        target = jnp.where(c["deep"], start + listing.DEEP * h * h, 0.0)
        kappa = c["kappa"]
        if model.nodes is not None:
            g = jnp.abs(theta[model.magnitude])
            of_node = model.rest_gap * forces.masses(model.nodes, theta[model.of_nodes]) * jnp.where(g > 0.0, g, solids.WEIGHT)
            kappa = jnp.where(c["node"] >= 0, of_node[c["node"]], kappa)
        kappa = scale * kappa

        def each(c, gap, target, n, point, shares, w0, kappa):
            of_a, of_b = frames[c["frames"][0]], frames[c["other"]]
            # the points of both solids that are at the contact
            r_a, r_b = (of[:, :3].T @ (point - of[:, 3]) for of in (of_a, of_b))
            at = lambda rate, r: rate[:, :3] @ r + rate[:, 3]
            on_nodes = c["kind"] >= touching.ON_NODES
            of_nodes = shares @ rates[c["frames"]][:, :, 3]
            u = jnp.where(on_nodes, of_nodes, at(rates[c["frames"][0]], r_a) - at(rates[c["other"]], r_b))
            v_n = (gap - target) / h + (c["compliance"] @ one) * w0 / h**2
            f, p = touching.law(w0, v_n, u - n * touching.dot(n, u), n, c["friction"] @ one, kappa, model.h, c["rho"])
            arm = lambda r: jnp.outer(p, jnp.append(r, 1.0)) / h
            nodes = shares[:, None, None] * arm(jnp.zeros(3))
            of_solids = jnp.stack([arm(r_a), jnp.zeros((3, 4)), jnp.zeros((3, 4))])
            loads = jnp.concatenate([jnp.where(on_nodes, nodes, of_solids), jnp.where(on_nodes, 0.0, -arm(r_b))[None]])
            return jnp.where(c["listed"], f, w0), jnp.where(c["listed"], loads, 0.0)

        rows, loads = jax.vmap(each)(c, gap, target, n, point, shares, w0, kappa)
        to = jnp.concatenate([c["frames"], c["other"][:, None]], axis=1)
        which = (to[:, :, None] == jnp.arange(len(frames))).astype(float)
        return jnp.einsum("csf,csij->fij", which, loads), rows

    return stage


def n_rows(model):
    """Rows of friction, stops and couplings of joints."""
    own = model.bodies
    return 0 if own is None else len(own.frictions) + len(own.stops) + len(own.couplings)


def node_masses(model, theta):
    """Masses of the nodes  [kg]; NumPy."""
    return np.zeros(0) if model.nodes is None else np.asarray(forces.masses(model.nodes, theta[model.of_nodes]))


def mass_of(model, contact):
    """Of the lighter of the two solids, as the scene begins  [kg]."""
    if contact.node >= 0:
        return node_masses(model, model.theta)[contact.node]
    return contact.kappa / (model.rest_gap * solids.WEIGHT)


AFFINE = ("points", "others", "pivot", "half", "radius", "thick", "friction", "compliance")


def packed(model, contacts, size, width):
    """Contacts as arrays of `size` rows, of which the last are idle, affine in `width` entries of θ."""
    if len(contacts) > size:
        raise ValueError(f"{len(contacts)} contacts")
    n, world = 1 + width, model.n_bodies
    shapes = {"points": (3, 3, n), "others": (2, 3, n), "axes": (3, 3), "half": (3, n)}
    shapes["pivot"] = (2, 3, n)
    shapes |= {key: (n,) for key in ("radius", "thick", "friction", "compliance")}
    out = {key: np.zeros((size, *shape)) for key, shape in shapes.items()}
    out |= {"kappa": np.ones(size), "rho": np.ones(size), "sign": np.ones(size)}
    out |= {"kind": np.zeros(size, dtype=int), "node": np.full(size, -1), "frames": np.full((size, 3), world)}
    out |= {"turn": np.full((size, 2, 3), -1), "other": np.full(size, world), "listed": np.zeros(size, dtype=bool), "deep": np.zeros(size, dtype=bool)}
    for k, c in enumerate(contacts):
        a, b = c.first, c.second
        row = {"points": a.points, "others": b.points[:2], "axes": b.axes, "half": b.half, "radius": a.radius, "thick": b.radius}
        row |= {"friction": c.friction, "compliance": 0.0 if c.compliance is None else c.compliance, "sign": c.sign}
        row |= {"kind": touching.KINDS.index(c.kind), "node": c.node, "frames": a.frames, "other": b.frames[0], "deep": c.deep}
        row |= {"pivot": (a.pivot, b.pivot), "turn": [x.turn or (-1,) * 3 for x in (a, b)]}
        row |= {"listed": True, "kappa": c.kappa if c.kappa > 0.0 else 1.0, "rho": RHO * mass_of(model, c)}
        for key, value in row.items():
            affine = key in AFFINE and np.ndim(value)
            if affine:
                out[key][k][..., : 1 + len(model.theta)] = value
            else:
                out[key][k] = value
    return out


def listed(model, q, v, v_cmd, theta, h):
    """Contacts of a stage of length h that begins at (q, v)."""
    driven = np.zeros(model.nv, dtype=bool)
    if model.nodes is not None:
        driven[: 3 * model.n_nodes] = model.nodes.driven_rows
    way = np.where(driven, np.concatenate([v_cmd, np.zeros(model.nv - len(v_cmd))]), v)
    now, ahead = (listing.Instant(frames_of(model, moved(model, q, t * way)), theta) for t in (0.0, h))
    of_pairs = listing.contacts(now, ahead, rates_of(model, q, v), model.pairs, h, model.rest_gap, theta[model.magnitude])
    fall = abs(theta[model.magnitude]) * h * h
    of_edges = [c for group in model.edges for c in group.contacts(now, ahead, way, h, fall)]
    return [*model.always, *of_pairs, *of_edges]
