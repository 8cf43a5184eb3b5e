"""One contact of two features: gap, normal and point, and the impulse of Coulomb's law there.

The normal n points from the second solid to the first, c lies half way between the surfaces; a ball of radius r at x over what is `gap`
beyond it meets it at c = x - (r + gap/2) n. Functions take the module `np` they compute with: NumPy to list contacts, jax.numpy to
differentiate them. Lengths in m.
"""

import jax
import jax.numpy as jnp

from . import solids
from .contact import LEAST_SLIP, sharpness

KINDS = ("face", "segment", "box", "line", "rim", "edge to point", "edge to line", "edge to segment", "triangle to point")
ON_NODES = KINDS.index("edge to point")  # from here on the first is an edge or triangle of nodes


def dot(a, b):
    """a·b."""
    return (a * b).sum()


def unit(np, a):
    """a/|a|."""
    return a / np.sqrt(dot(a, a))


def _ball(x, r, gap, n):
    return gap, n, x - (r + 0.5 * gap) * n


def _apart(np, x, r, d, thick):
    distance = np.sqrt(dot(d, d))
    return _ball(x, r, distance - r - thick, d / distance)


def face(np, x, r, at, n):
    """A ball over a plane: gap = n·(x - at) - r."""
    return _ball(x, r, dot(n, x - at) - r, n)


def part(np, x, a, b):
    """t of the point a + t (b - a) of a line nearest to x; 0 if a = b."""
    e = b - a
    square = dot(e, e)
    return np.where(square > 0.0, dot(x - a, e) / np.where(square > 0.0, square, 1.0), 0.0)


def segment(np, x, r, a, b, thick):
    """A ball and a ball or capsule: gap = |x - y| - r - thick, y the point of the segment nearest to x."""
    t = np.clip(part(np, x, a, b), 0.0, 1.0)
    return _apart(np, x, r, x - a - t * (b - a), thick)


def box(np, x, r, centre, axes, half):
    """A ball at a box: gap and normal to the nearest point of the box, or from inside to the nearest face."""
    y = axes.T @ (x - centre)
    beyond = np.abs(y) - half
    d = np.where(beyond > 0.0, beyond, 0.0) * np.sign(y)
    inside = np.max(beyond) <= 0.0
    out = np.where(np.arange(3) == np.argmax(beyond), np.where(y >= 0.0, 1.0, -1.0), 0.0)
    distance = np.sqrt(np.where(inside, 1.0, dot(d, d)))
    n = np.where(inside, out, d / distance)
    return _ball(x, r, np.where(inside, dot(out, y) - dot(np.abs(out), half), distance) - r, axes @ n)


def parts_of_lines(np, a, b, p, q):
    """(s, t): the points a + s (b - a) and p + t (q - p) of two lines are nearest, where they are perpendicular to both.

    d·(x - y) = 0 and e·(x - y) = 0 are two linear equations in s and t.
    """
    d, e, between = b - a, q - p, a - p
    dd, de, ee = dot(d, d), dot(d, e), dot(e, e)
    det = dd * ee - de * de
    return (de * dot(e, between) - ee * dot(d, between)) / det, (dd * dot(e, between) - de * dot(d, between)) / det


def line(np, ends, r, others, thick, sign):
    """Two lines that cross at a distance: n = ± d × e/|d × e|, gap = n·(a - p) - r - thick, c half way between the surfaces."""
    (a, b), (p, q) = ends, others
    n = sign * unit(np, np.cross(b - a, q - p))
    s, t = parts_of_lines(np, a, b, p, q)
    gap = dot(n, a - p) - r - thick
    x, y = a + s * (b - a), p + t * (q - p)
    return gap, n, 0.5 * (x - r * n + y + thick * n)


def rim(np, ends, r, at, n):
    """The deepest point of a circle of radius r round the end of an axis, over a plane."""
    a = unit(np, ends[1] - ends[0])
    return face(np, ends[1] - r * unit(np, n - a * dot(a, n)), 0.0, at, n)


def edge_to_point(np, ends, r, p, thick):
    """An edge and a point: (gap, n, share of the second node), n = (x - p)/|x - p|."""
    s = np.clip(part(np, p, *ends), 0.0, 1.0)
    d = ends[0] + s * (ends[1] - ends[0]) - p
    distance = np.sqrt(dot(d, d))
    return distance - r - thick, d / distance, s


def edge_to_line(np, ends, r, others, thick, sign):
    """An edge and an endless line, likewise: along n = ± d × e/|d × e|, or from the edge's end that is nearest."""
    (a, b), (p, q) = ends, others
    s, _ = parts_of_lines(np, a, b, p, q)
    inside, share = (s > 0.0) & (s < 1.0), np.clip(s, 0.0, 1.0)
    n = sign * unit(np, np.cross(b - a, q - p))
    x = a + share * (b - a)
    d = x - p - part(np, x, p, q) * (q - p)
    distance = np.sqrt(dot(d, d))
    gap = np.where(inside, dot(n, a - p), distance)
    return gap - r - thick, np.where(inside, n, d / distance), share


def edge_to_segment(np, ends, r, others, thick, sign):
    """An edge and a capsule: its axis, or where the nearest point of that lies beyond an end, the end."""
    beside = edge_to_line(np, ends, r, others, thick, sign)
    x = ends[0] + beside[2] * (ends[1] - ends[0])
    t = part(np, x, *others)
    end = edge_to_point(np, ends, r, np.where(t > 1.0, others[1], others[0]), thick)
    return tuple(np.where((t < 0.0) | (t > 1.0), y, z) for y, z in zip(end, beside, strict=True))


def triangle_to_point(np, x, r, p, thick, sign):
    """A triangle x (3, 3) and a point: (gap, n, shares of the three nodes); n = ± that of its plane, or from its nearest side.

    In the plane y = Σ β_i x_i with (y - p)·(x₁ - x₀) = (y - p)·(x₂ - x₀) = 0.
    """
    u, v, d = x[1] - x[0], x[2] - x[0], p - x[0]
    n = np.cross(u, v)
    square = dot(n, n)
    second, third = dot(np.cross(d, v), n) / square, dot(np.cross(u, d), n) / square
    shares = np.stack([1.0 - second - third, second, third])
    n = sign * n / np.sqrt(square)
    gap, best = dot(n, x[0] - p) - r - thick, None
    for i, j in ((0, 1), (1, 2), (2, 0)):
        of_side, n_side, s = edge_to_point(np, (x[i], x[j]), r, p, thick)
        side = (of_side, n_side, (1.0 - s) * np.eye(3)[i] + s * np.eye(3)[j])
        nearer = best is None or of_side < best[0]
        best = side if best is None else tuple(np.where(nearer, y, z) for y, z in zip(side, best, strict=True))
    inside = np.min(shares) >= 0.0
    return tuple(np.where(inside, y, z) for y, z in zip((gap, n, shares), best, strict=True))


def meet(kinds, c, ends, others, axes, r, thick, half):
    """(gap, n, c, shares of the three nodes) of a contact whose kind is one of `kinds` (names), numbers from jax.numpy."""
    sign, out = c["sign"], axes[:, 2]
    made = {
        "face": lambda: face(jnp, ends[0], r, others[0], out),
        "segment": lambda: segment(jnp, ends[0], r, *others, thick),
        "box": lambda: box(jnp, ends[0], r, others[0], axes, half),
        "line": lambda: line(jnp, ends[:2], r, others, thick, sign),
        "rim": lambda: rim(jnp, ends[:2], r, others[0], out),
        "edge to point": lambda: edge_to_point(jnp, ends[:2], r, others[0], thick),
        "edge to line": lambda: edge_to_line(jnp, ends[:2], r, others, thick, sign),
        "edge to segment": lambda: edge_to_segment(jnp, ends[:2], r, others, thick, sign),
        "triangle to point": lambda: triangle_to_point(jnp, ends, r, others[0], thick, sign),
    }
    results = []
    for kind in kinds:
        gap, n, last = made[kind]()
        if kind.startswith("edge"):
            last = jnp.stack([1.0 - last, last, 0.0 * last])
        # the contact point of solids, shares of nodes
        on_nodes = KINDS.index(kind) >= ON_NODES
        results.append((gap, n, jnp.zeros(3) if on_nodes else last, last if on_nodes else jnp.zeros(3)))
    which = [c["kind"] == KINDS.index(kind) for kind in kinds]
    return tuple(jnp.select(which, [x[k] for x in results]) for k in range(4))


def positive_part(z, area):
    """φ(z) = (z + √(z² + 4 area))/2, the positive root of φ (φ - z) = area."""
    root = jnp.sqrt(z * z + 4.0 * area)
    return jnp.where(z < 0.0, 2.0 * area / (root - jnp.minimum(z, 0.0)), 0.5 * (z + root))


def law(w0, v_n, v_t, n, friction, kappa, step, rho):
    """(F, p): F = w₀ - φ(w₀ - ρ v_n) [N·s], zero where w₀ v_n = κ, and the impulse p = w₀ n + μ w̄ [N·s] on the first solid.

    w̄ follows from w₀: with s̄ = σ v_t and s₀ w̄ + w₀ s̄ = 0, s₀ w₀ + s̄·w̄ = κ,
    w̄ = -2 w₀² s̄/(κ + √(κ² + 4 |s̄|² w₀²)). step: of the scene [s], which σ = √(μ² + μ₀²)/ε follows.
    """
    slip = jnp.hypot(friction, LEAST_SLIP) / sharpness(step) * v_t
    w = -2.0 * w0 * w0 * slip / (kappa + jnp.sqrt(kappa**2 + 4.0 * dot(slip, slip) * w0 * w0))
    return w0 - positive_part(w0 - rho * v_n, rho * kappa), w0 * n + friction * w


def all_meet(kinds, contacts, frames, theta):
    """(gap, n, c, shares) of all contacts (arrays with a row each) where the frames (m, 3, 4) are; `rot`: turns of both solids by θ."""
    one = jnp.concatenate([jnp.ones(1), theta])

    def each(c):
        pivot, rot = c["pivot"] @ one, c["rot"]
        of_a = jax.vmap(lambda frame: solids.turned(jnp, rot[0], frame, pivot[0]))(frames[c["frames"]])
        of_b = solids.turned(jnp, rot[1], frames[c["other"]], pivot[1])
        ends = jnp.einsum("kij,kj->ki", of_a[:, :, :3], c["points"] @ one) + of_a[:, :, 3]
        others = (c["others"] @ one) @ of_b[:, :3].T + of_b[:, 3]
        return meet(kinds, c, ends, others, of_b[:, :3] @ c["axes"], c["radius"] @ one, c["thick"] @ one, c["half"] @ one)

    return jax.vmap(each)(contacts)
