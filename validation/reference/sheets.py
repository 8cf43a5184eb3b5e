"""Sheets of cloth: triangles that stretch and shear, plates' bending by the folds between them, damping, drag (docs/theory/cloth.md).

Membrane: St. Venant and Kirchhoff's energy of Green strain, plane stress. Bending: a triangle of constant curvature H shows the folds
ψ = M H at its edges; the least that a Kirchhoff plate costs with them is ½ ψᵀ A (M C⁻¹ Mᵀ)⁻¹ ψ (cf. Oñate and Zárate 2000). Only grids.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from .laws import taken
from .parameters import SHEET_ENTRIES
from .rods import cross, dots, unit


@dataclass(frozen=True, eq=False)
class Sheets:
    """Triangles of all sheets; positions in θ are per triangle, `of` by entry."""

    triangles: np.ndarray  # (T, 3) nodes
    of: dict  # entry of SHEET_ENTRIES -> (T,)
    share: np.ndarray  # (T,) of the sheet's area
    slopes: np.ndarray  # (T, 3, 2) of the hat functions in the rest plane, of a sheet of area 1 [-]
    beyond: np.ndarray  # (T, 3) the neighbour's third node, over the edge opposite of each node; the own node at a free edge
    joined: np.ndarray  # (T, 3) whether there is a neighbour
    curved: np.ndarray  # (T, 3, 3) M/√A: folds by curvature (xx, yy, xy); 0 at free edges


def grid(entry):
    """(rest positions (n, 2), triangles (T, 3)) of a scene's grid; node (i, j) is i · nodes[1] + j."""
    (nu, nv), size = entry["nodes"], entry["size"]
    x, y = np.meshgrid(np.linspace(0.0, size[0], nu), np.linspace(0.0, size[1], nv), indexing="ij")
    number, diagonal = np.arange(nu * nv).reshape(nu, nv), entry.get("diagonal", "up")
    faces = []
    for i in range(nu - 1):
        for j in range(nv - 1):
            a, b, c, d = number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]
            up = diagonal == "up" or (diagonal == "alternating" and (i + j) % 2 == 0)
            faces += [(a, b, c), (a, c, d)] if up else [(a, b, d), (b, c, d)]
    return np.stack([x.ravel(), y.ravel()], axis=1), np.array(faces)


def neighbours(triangles):
    """(beyond, joined), both (T, 3)."""
    third = {}
    for face in triangles:
        for k in range(3):
            third.setdefault(frozenset((face[k - 2], face[k - 1])), []).append(face[k])
    beyond, joined = triangles.copy(), np.zeros(triangles.shape, dtype=bool)
    for t, face in enumerate(triangles):
        for k in range(3):
            others = [node for node in third[frozenset((face[k - 2], face[k - 1]))] if node != face[k]]
            if others:
                beyond[t, k], joined[t, k] = others[0], True
    return beyond, joined


def folds_by_curvature(rest, triangles, beyond, joined):
    """M/√A (T, 3, 3): the fold at PQ is (h + h')/h times ½ (R − P)·H (R − Q)/h, h and h' the heights over it."""
    out = np.zeros((len(triangles), 3, 3))
    for t, face in enumerate(triangles):
        area = _area(*rest[face])
        for k in np.flatnonzero(joined[t]):
            p, q, r, far = (rest[node] for node in (face[k - 2], face[k - 1], face[k], beyond[t, k]))
            base = np.linalg.norm(q - p)
            height, other = 2.0 * area / base, 2.0 * _area(p, q, far) / base
            a, b = r - p, r - q
            by = np.array([a[0] * b[0], a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
            out[t, k] = (height + other) / (2.0 * height**2) * by / np.sqrt(area)
    return out


def _area(p, q, r):
    a, b = q - p, r - p
    return 0.5 * abs(a[0] * b[1] - a[1] * b[0])


def build(entries, where, first):
    """Sheets whose nodes begin at `first`: (Sheets, node fractions, node areas and densities in θ, q0, v0); None without any."""
    out = {k: [] for k in ("triangles", "share", "slopes", "beyond", "joined", "curved")}
    of, nodes = {key: [] for key in SHEET_ENTRIES}, {k: [] for k in ("fraction", "area", "density", "radius", "q0", "v0")}
    for entry, places in zip(entries, where, strict=True):
        if "mesh" in entry or "points" in entry:
            raise ValueError("the reference knows flat grids")
        rest, faces = grid(entry["grid"])
        beyond, joined = neighbours(faces)
        areas = np.array([_area(*rest[f]) for f in faces])
        total, count = areas.sum(), len(rest)
        fraction = np.zeros(count)
        np.add.at(fraction, faces, (areas / total / 3.0)[:, None])
        slopes = [np.linalg.inv(np.vstack([rest[f].T / np.sqrt(total), np.ones(3)]))[:, :2] for f in faces]
        out["triangles"].append(faces + first)
        out["share"].append(areas / total)
        out["slopes"].append(slopes)
        out["beyond"].append(beyond + first)
        out["joined"].append(joined)
        out["curved"].append(folds_by_curvature(rest, faces, beyond, joined))
        for key in SHEET_ENTRIES:
            of[key].append(np.full(len(faces), places[key]))
        u, v = (np.array(entry.get(k, usual), dtype=float) for k, usual in (("u_axis", [1, 0, 0]), ("v_axis", [0, 1, 0])))
        axes = np.stack([u / np.linalg.norm(u), v / np.linalg.norm(v)])
        nodes["fraction"].append(fraction)
        for key, entry_key in (("area", "area"), ("density", "area_density"), ("radius", "radius")):
            nodes[key].append(np.full(count, places[entry_key]))
        nodes["q0"].append(np.array(entry.get("origin", [0.0, 0.0, 0.0])) + rest @ axes)
        nodes["v0"].append(np.tile(np.array(entry.get("velocity", [0.0, 0.0, 0.0])), (count, 1)))
        first += count
    if not entries:
        return None, {}
    joint = {k: np.concatenate([np.asarray(x) for x in v]) for k, v in out.items()}
    sheets = Sheets(of={k: np.concatenate(v) for k, v in of.items()}, **joint)
    return sheets, {k: np.concatenate(v) for k, v in nodes.items()}


def values(sheets, theta):
    """The triangles' parameters by name, (T,) each."""
    return {key: taken(theta, places) for key, places in sheets.of.items()}


def deformation(sheets, x, area):
    """F (T, 3, 2) at nodes x (n, 3)."""
    return jnp.einsum("tna,tnb->tab", taken(x, sheets.triangles), sheets.slopes) / jnp.sqrt(area)[:, None, None]


def green(sheets, x, area):
    """G = (FᵀF − I)/2 (T, 2, 2)."""
    f = deformation(sheets, x, area)
    return 0.5 * (jnp.einsum("tab,tac->tbc", f, f) - np.eye(2))


def folds(sheets, x):
    """ψ = 2 tan(θ/2) (T, 3) at the edges opposite of each node; 0 at free edges."""
    corners, far = taken(x, sheets.triangles), taken(x, sheets.beyond)
    p, q = jnp.roll(corners, -1, axis=1), jnp.roll(corners, -2, axis=1)
    far = jnp.where(sheets.joined[..., None], far, p + q - corners)
    edge = unit(q - p)
    own, other = unit(cross(edge, corners - p)), unit(cross(far - p, edge))
    return 2.0 * dots(edge, cross(own, other))[..., 0] / (1.0 + dots(own, other)[..., 0])


def stiffness(sheets, nu):
    """A (M C⁻¹ Mᵀ)⁻¹ (T, 3, 3) of unit D; of free edges that of a fold by itself, which is zero."""
    zero, one = jnp.zeros_like(nu), jnp.ones_like(nu)
    rows = jnp.array([[one, nu, zero], [nu, one, zero], [zero, zero, 2.0 * (1.0 - nu)]])
    inverse = jnp.linalg.inv(jnp.moveaxis(rows, 2, 0))
    free = np.where(sheets.joined, 0.0, 1.0)[:, :, None] * np.eye(3)
    return jnp.linalg.inv(jnp.einsum("tia,tab,tjb->tij", sheets.curved, inverse, sheets.curved) + free)


def squared(g, nu):
    """(1 − ν) |G|² + ν tr(G)² (T,)."""
    return (1.0 - nu) * jnp.sum(g * g, axis=(1, 2)) + nu * jnp.trace(g, axis1=1, axis2=2) ** 2


def energy(sheets, x, theta):
    """Elastic energy [J] of nodes x (n, 3)."""
    p = values(sheets, theta)
    nu, psi = p["poisson_ratio"], folds(sheets, x)
    modulus = sheets.share * p["area"] * p["thickness"] * p["youngs_modulus"] / (2.0 * (1.0 - nu**2))
    plate = p["bend_stiffness"] * jnp.einsum("ti,tij,tj->t", psi, stiffness(sheets, nu), psi)
    return jnp.sum(modulus * squared(green(sheets, x, p["area"]), nu) + 0.5 * plate)


def dissipation(sheets, x, v, theta):
    """R [W] of stretching and of bending."""
    p = values(sheets, theta)
    rate, turning = jax.jvp(lambda x: (green(sheets, x, p["area"]), folds(sheets, x)), (x,), (v,))[1]
    membrane = sheets.share * p["area"] * p["thickness"] * p["membrane_damping"] * jnp.sum(rate * rate, axis=(1, 2))
    plate = p["bend_damping"] * jnp.einsum("ti,tij,tj->t", turning, stiffness(sheets, p["poisson_ratio"]), turning)
    return 0.5 * jnp.sum(membrane + plate)


def drag(sheets, x, v, wind, theta):
    """Air drag (n, 3) [N]: −A' (c + d |u_n|) u_n n of each triangle, a third on each of its nodes."""
    p = values(sheets, theta)
    corners, u = taken(x, sheets.triangles), jnp.mean(taken(v, sheets.triangles), axis=1) - wind
    area = 0.5 * cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    u_n = dots(unit(area), u)[:, 0]
    pressure = (p["drag_normal"] + p["drag_quadratic"] * jnp.abs(u_n)) * u_n
    at_nodes = np.zeros((len(x), len(sheets.triangles)))
    np.add.at(at_nodes, (sheets.triangles, np.arange(len(sheets.triangles))[:, None]), 1.0 / 3.0)
    return -at_nodes @ (pressure[:, None] * area)
