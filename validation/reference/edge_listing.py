"""Which features of a fixed shape an edge or triangle may touch within a stage: docs/theory/contact.md, "Edges and triangles".

One is listed with a feature if its inside is nearest to it where the stage begins or where its nodes' velocities lead; its nodes
touch by themselves. NumPy; nothing is differentiated.
"""

from dataclasses import dataclass, replace

import numpy as np

from . import solids, touching
from .listing import DEEP, LEAN, PARALLEL_EDGE, SLIVER, Contact, reach


@dataclass(frozen=True, eq=False)
class Group:
    """The edges of a rope, or edges and triangles of a sheet, and a fixed shape."""

    name: str
    nodes: list  # of each edge two nodes, of each triangle three
    thirds: list  # of each edge the third nodes of the triangles at it
    frame: int  # of node 0
    radius: np.ndarray  # affine in θ
    solid: object
    friction: np.ndarray
    kappas: list  # of each edge or triangle [J]
    rest_gap: float

    @property
    def kinds(self):
        """Kinds of contacts that may be listed."""
        out = {kind for kind, _ in self.features(2)}
        return out | {"triangle to point"} if any(len(nodes) == 3 for nodes in self.nodes) else out

    def features(self, count):
        """(kind, feature) of the shape for an edge or triangle."""
        if count == 3:
            whole = self.solid.kind == "ball"
            return [("triangle to point", f) for f in ([self.solid.whole()] if whole else self.solid.tips())]
        if self.solid.kind == "box":
            return [("edge to line", f) for f in self.solid.lines()] + [("edge to point", f) for f in self.solid.tips()]
        return [("edge to point" if self.solid.kind == "ball" else "edge to segment", self.solid.whole())]

    def element(self, k):
        """An edge or triangle as a feature."""
        zero, nodes = np.zeros_like(self.solid.centre), self.nodes[k]
        frames = tuple(self.frame + node for node in (*nodes, nodes[-1])[:3])
        kind = "edge" if len(nodes) == 2 else "triangle"
        return solids.Feature(kind, self.name, (kind, k), frames, (zero,) * 3, self.radius, np.eye(3), zero, (), zero)

    def contacts(self, now, ahead, way, h, fall):
        """Contacts listed, for velocities `way` (nv,) of which the nodes' come first; fall: g h² [m]."""
        out = []
        for k, nodes in enumerate(self.nodes):
            element, count = self.element(k), len(nodes)
            x = now.nodes(element)[:count]
            speed = max(np.linalg.norm(way[3 * node : 3 * node + 3]) for node in nodes)
            margin = reach(self.rest_gap) + 1.5 * h * speed + 4.0 * fall
            middle = x.mean(axis=0)
            size = np.linalg.norm(x - middle, axis=1).max()
            if self._distance(now, middle) > margin + size + element.radius @ now.one:
                continue
            for kind, feature in self.features(count):
                if any(self._meets(at, kind, k, element, feature, margin) for at in (now, ahead)):
                    sign = self._sign(now, kind, element, feature)
                    deep = self._meeting(now, kind, element, feature)[0] < -DEEP * h * h
                    out.append(Contact(kind, element, feature, self.friction, None, self.kappas[k], sign, deep=deep))
        return out

    def _distance(self, at, x):
        """From a point to the shape, 0 inside a box."""
        if self.solid.kind == "box":
            return np.linalg.norm(np.maximum(np.abs(at.local(self.solid, x)) - at.sizes(self.solid), 0.0))
        return -at.depth(self.solid, x)

    def _sign(self, at, kind, element, feature):
        """±1 that makes the normal, d × e of two lines or that of the triangle's plane, point out of the shape there."""
        x, others = at.nodes(element), at.points(feature)
        n = np.cross(x[1] - x[0], x[2] - x[0] if kind == "triangle to point" else others[1] - others[0])
        way = others.mean(axis=0) - at.middle(self.solid) if self.solid.kind == "box" else x[0] - others[0]
        if feature.name[0] == "corner":
            way = at.axes(self.solid, self.solid.frame) @ np.array(feature.name[1:])
        return 1.0 if n @ way >= 0.0 else -1.0

    def _meeting(self, at, kind, element, feature):
        """(gap, n, shares of the nodes in the nearest point)."""
        x, others, r = at.nodes(element), at.points(feature), element.radius @ at.one
        thick, sign = feature.radius @ at.one, self._sign(at, kind, element, feature)
        if kind == "triangle to point":
            return touching.triangle_to_point(np, x, r, others[0], thick, sign)
        if kind == "edge to point":
            gap, n, share = touching.edge_to_point(np, x[:2], r, others[0], thick)
        else:
            measure = touching.edge_to_line if kind == "edge to line" else touching.edge_to_segment
            gap, n, share = measure(np, x[:2], r, others, thick, sign)
        return gap, n, np.array([1.0 - share, share])

    def _meets(self, at, kind, k, element, feature, margin):
        x, others = at.nodes(element), at.points(feature)
        gap, n, shares = self._meeting(at, kind, element, feature)
        if not (np.all(shares > 0.0) and gap <= margin):
            return False
        point = shares @ x[: len(shares)]
        t = touching.part(np, point, *others)
        if kind == "edge to segment":
            return self._crosses(x, others) if 0.0 <= t <= 1.0 else self._over_none(at, k, x, n)
        if self.solid.kind != "box":
            return self._over_none(at, k, x, n)
        if gap <= -np.min(at.sizes(self.solid)):
            return False
        if kind == "edge to line":
            normals = at.axes(feature, feature.frames[0])[:, 1:].T
            return abs(2.0 * t - 1.0) <= 1.0 + SLIVER and np.all(normals @ n >= -LEAN) and self._crosses(x, others)
        sides = np.array(feature.name[1:])
        return np.all(sides * (at.axes(self.solid, self.solid.frame).T @ n) >= -LEAN) and self._over_none(at, k, x, n)

    def _crosses(self, ends, others):
        d, e = ends[1] - ends[0], others[1] - others[0]
        return np.linalg.norm(np.cross(d, e)) >= PARALLEL_EDGE * np.linalg.norm(d) * np.linalg.norm(e)

    def _over_none(self, at, k, x, n):
        """Whether n leads over none of the triangles at an edge, whose inside is then nearer."""
        edge = x[1] - x[0]
        for third in self.thirds[k]:
            inward = at.frames[self.frame + third][:, 3] - x[0]
            inward -= edge * (inward @ edge) / (edge @ edge)
            if inward @ n < -LEAN * np.linalg.norm(inward):
                return False
        return True


def _elements(nodes, triangles):
    """(nodes of every edge and triangle, third nodes at every edge)."""
    if triangles is None:
        return list(zip(nodes[:-1], nodes[1:], strict=True)), [()] * (len(nodes) - 1)
    thirds = {}
    for a, b, c in triangles:
        for i, j, third in ((a, b, c), (b, c, a), (c, a, b)):
            thirds.setdefault((min(i, j), max(i, j)), []).append(third)
    return [*thirds, *map(tuple, triangles)], [*thirds.values(), *[()] * len(triangles)]


def groups(model, objects, colliders, masses):
    """The model with its groups; objects: (name, nodes, triangles or None, position of the radius in θ) of those that touch with edges;
    masses: of frames as the scene begins [kg]."""
    out, world = [], model.n_bodies
    for name, own, triangles, radius in objects:
        every, thirds = _elements(own, triangles)
        free = {node for node in own if not model.nodes.driven[node]}
        kept = [k for k, nodes in enumerate(every) if free & set(nodes)]
        lightest = [min(masses[world + 1 + node] for node in free & set(every[k])) for k in kept]
        of = lambda solid_name: solid_name.rsplit(".node", 1)[0] == name
        for solid in colliders:
            if solid.frame != world or solid.kind not in ("ball", "capsule", "box"):
                continue
            frictions = [c.friction for c in model.always if c.second.of == solid.name and of(c.first.of)]
            frictions += [p.friction for p in model.pairs if solid in (p.first, p.second) and (of(p.first.name) or of(p.second.name))]
            if frictions:
                kappas = [model.rest_gap * solids.WEIGHT * m for m in lightest]
                picked = [[x[k] for k in kept] for x in (every, thirds)]
                thick = solid.affine(radius)
                out.append(Group(name, *picked, world + 1, thick, solid, frictions[0], kappas, model.rest_gap))
    return replace(model, edges=out)
