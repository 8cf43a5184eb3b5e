"""Assembly: θ-dependent masses and smoothing, total force and contact impulse of a model."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from . import contact, formulas, laws, rods, sheets


def rope_values(model, theta, key, rope_of):
    """The rope parameter `key`, gathered for elements that belong to ropes `rope_of`."""
    return laws.taken(theta, np.array([where[key] for where in model.ropes], dtype=int)[rope_of])


def voronoi_lengths(model, theta):
    """L_i  [m] of the ropes' nodes; zero at ghosts."""
    return model.node_voronoi * rope_values(model, theta, "length", model.node_rope)


def masses(model, theta):
    """m_i = linear_density L_i + node[i].mass (+ tip_mass on the rope's last node), area_density A_i of a sheet  [kg]."""
    density = rope_values(model, theta, "linear_density", model.node_rope)
    extra = np.zeros((len(model.node_rope), len(model.theta)))
    for where, nodes in zip(model.ropes, model.rope_nodes, strict=True):
        extra[nodes, where["node_mass"]] = 1.0
        extra[nodes[-1], where["tip_mass"]] = 1.0
    m = density * voronoi_lengths(model, theta) + extra @ theta
    if model.sheets is None:
        return m
    area, density = (laws.taken(theta, model.sheet_nodes[key]) for key in ("area", "density"))
    return jnp.concatenate([m, area * density * model.sheet_nodes["fraction"]])


def radii(model, theta):
    """Radius of each node  [m]."""
    r = rope_values(model, theta, "radius", model.node_rope)
    return r if model.sheets is None else jnp.concatenate([r, laws.taken(theta, model.sheet_nodes["radius"])])


def row_masses(model, theta):
    """Inertia of each row of q (nq,)  [kg, kg·m²]."""
    nodes = jnp.repeat(masses(model, theta), 3)
    return nodes if model.rods is None else jnp.concatenate([nodes, rods.inertias(model.rods, theta)])


def kappas(model, theta):
    """κ_i = rest_gap m_i |g|  [J]; follows θ, so that a resting node hovers at rest_gap."""
    return model.rest_gap * masses(model, theta) * theta[model.magnitude]


def gravity(model, theta):
    """g  [m/s²]."""
    return laws.gravity_vector(theta[model.magnitude], theta[model.tilt])


def rest_strains(model, theta):
    """δ of every edge  [-]."""
    of_rope = lambda where, nodes: theta[np.array(where, dtype=int)] if where else jnp.zeros(len(nodes) - 1)
    parts = [of_rope(w["rest_strain"], nodes) for w, nodes in zip(model.ropes, model.rope_nodes, strict=True)]
    return jnp.concatenate(parts)


def potential(model, q, theta):
    """Energy  [J] of weight, stretching and bending at q (n_nodes, 3); bending of rods is by itself."""
    g, m = gravity(model, theta), masses(model, theta)
    e = jnp.sum(jax.vmap(laws.gravity_energy, (0, 0, None))(q, m, g))
    if model.sheets is not None:
        e += sheets.energy(model.sheets, q, theta)
    if not model.ropes:
        return e
    pairs, rope = model.edges, model.edge_rope
    rest = model.edge_fraction * rope_values(model, theta, "length", rope)
    stiffness = rope_values(model, theta, "stretch_stiffness", rope)
    own = rest_strains(model, theta)
    e += jnp.sum(jax.vmap(laws.stretch_energy)(*laws.taken(q, pairs.T), rest, stiffness, own))
    if len(model.stencils):
        x, rope = laws.taken(q, model.stencils.T), model.stencil_rope
        voronoi = model.stencil_voronoi * rope_values(model, theta, "length", rope)
        stiffness = rope_values(model, theta, "bend_stiffness", rope)
        e += jnp.sum(jax.vmap(laws.bend_energy)(*x, voronoi, stiffness))
    return e


def dissipation(model, q, v, theta):
    """Stretch and bend dissipation R  [W]."""
    r = 0.0 if model.sheets is None else sheets.dissipation(model.sheets, q, v, theta)
    if not model.ropes:
        return r
    pairs, rope = model.edges.T, model.edge_rope
    ends = lambda x: laws.taken(x, pairs)
    rest = model.edge_fraction * rope_values(model, theta, "length", rope)
    damping = rope_values(model, theta, "stretch_damping", rope)
    r += jnp.sum(jax.vmap(laws.stretch_dissipation)(*ends(q), *ends(v), rest, damping))
    if len(model.stencils):
        nodes, rope = model.stencils.T, model.stencil_rope
        voronoi = model.stencil_voronoi * rope_values(model, theta, "length", rope)
        damping = rope_values(model, theta, "bend_damping", rope)
        at = (*laws.taken(q, nodes), *laws.taken(v, nodes))
        r += jnp.sum(jax.vmap(laws.bend_dissipation)(*at, voronoi, damping))
    return r


def drag(model, q, v, theta):
    """Air drag (n_nodes, 3)  [N]."""
    wind = theta[model.wind]
    on_sheets = 0.0 if model.sheets is None else sheets.drag(model.sheets, q, v, wind, theta)
    if not model.ropes:
        return on_sheets
    linear = rope_values(model, theta, "drag_linear", model.node_rope)
    quadratic = rope_values(model, theta, "drag_quadratic", model.node_rope)
    each = jax.vmap(laws.drag_force, (0, None, 0, 0, 0))
    count = len(model.node_rope)
    on_ropes = each(v[:count], wind, voronoi_lengths(model, theta), linear, quadratic)
    return on_ropes if model.sheets is None else jnp.zeros_like(q).at[:count].set(on_ropes) + on_sheets


@partial(jax.jit, static_argnums=0)
def total_force(model, q, v, theta, frames, begin):
    """Σ f (nq,)  [N, N·m], contact excluded, at q, v (nq,); `frames`: of rods at q, `begin`: what their sections begin with."""
    count = 3 * model.n_nodes
    x, x_dot = q[:count].reshape(-1, 3), v[:count].reshape(-1, 3)
    elastic = -jax.grad(potential, 1)(model, x, theta)
    damping = -jax.grad(dissipation, 2)(model, x, x_dot, theta)
    nodes = elastic + damping + drag(model, x, x_dot, theta)
    nodes = formulas.add_to_nodes(model.forces, x, x_dot, theta, nodes).ravel()
    if model.rods is None:
        return nodes
    twists = jnp.zeros(model.nq - count)
    return rods.force(model.rods, q, v, theta, frames, begin) + jnp.concatenate([nodes, twists])


def static_force(model, q, theta):
    """Σ f at rest (n_nodes, 3)  [N]: elastic, gravity, the wind's drag and forces of one's own."""
    still = jnp.zeros_like(q)
    f = -jax.grad(potential, 1)(model, q, theta) + drag(model, q, still, theta)
    return formulas.add_to_nodes(model.forces, q, still, theta, f)


def _shape_values(shape, theta):
    kind, where, constants = shape
    return contact.GAPS[kind], constants | {key: theta[at] for key, at in where.items()}


def gaps_and_normals(model, q, theta):
    """[(gap (n,), normal (n, 3), friction)] of every shape at the free nodes q (n, 3)."""
    radius = radii(model, theta)[model.free]
    out = []
    for shape in model.shapes:
        gap_of, values = _shape_values(shape, theta)
        gap, normal = jax.vmap(lambda x, r, f=gap_of, s=values: f(x, r, s))(q, radius)
        out.append((gap, normal, values["friction"]))
    return out


@partial(jax.jit, static_argnums=0)
def contact_impulse(model, q, v, theta, kappa, h):
    """p (n, 3)  [N·s] of all shapes on the free nodes, geometry at q = q⁺; κ (n,) [J]."""
    total = jnp.zeros_like(q)
    for gap, normal, friction in gaps_and_normals(model, q, theta):
        each = jax.vmap(contact.impulse, (None, 0, 0, 0, None, None, 0))
        total += each(model.law, gap, normal, v, (h, model.h), friction, kappa)
    return total


def normal_impulses(model, q, v, theta, kappa, h):
    """[γ_n (n,)] [N·s] of every shape on the free nodes, as in `contact_impulse`."""
    out = []
    for gap, normal, friction in gaps_and_normals(model, q, theta):
        each = jax.vmap(contact.impulse, (None, 0, 0, 0, None, None, 0))
        impulse = each(model.law, gap, normal, v, (h, model.h), friction, kappa)
        out.append(jnp.sum(impulse * normal, axis=1))
    return out


def contact_margins(model, q, v, theta, h):
    """(shapes, n) distances to the edge of the admissible set [m/s]; positive inside."""
    rows = []
    for gap, normal, friction in gaps_and_normals(model, q, theta):
        each = jax.vmap(contact.margin, (None, 0, 0, 0, None, None))
        rows.append(each(model.law, gap, normal, v, h, friction))
    return jnp.stack(rows)
