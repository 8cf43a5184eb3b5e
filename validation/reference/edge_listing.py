"""Which features of a fixed shape an edge of a rope may touch within a stage: docs/theory/contact.md, "Edges and triangles".

An edge is listed with a feature if its inside is nearest to it where the stage begins or where its nodes' velocities lead; its nodes
touch by themselves. NumPy; nothing is differentiated.
"""

from dataclasses import dataclass, replace

import numpy as np

from . import touching
from .listing import LEAN, PARALLEL_EDGE, SLIVER, Contact, reach
from .solids import Feature


@dataclass(frozen=True, eq=False)
class Group:
    """The edges of a rope and a fixed shape."""

    name: str
    nodes: list  # of each edge two nodes
    frame: int  # of node 0
    radius: np.ndarray  # affine in θ
    solid: object
    friction: np.ndarray
    kappas: list  # of each edge [J]
    rest_gap: float

    @property
    def kinds(self):
        """Kinds of contacts that may be listed."""
        return {"ball": {"edge to point"}, "capsule": {"edge to segment"}, "box": {"edge to point", "edge to line"}}[self.solid.kind]

    def features(self):
        """(kind, feature) of the shape."""
        if self.solid.kind == "box":
            return [("edge to line", f) for f in self.solid.lines()] + [("edge to point", f) for f in self.solid.tips()]
        whole = self.solid.whole()
        return [("edge to point" if self.solid.kind == "ball" else "edge to segment", whole)]

    def edge(self, k):
        """An edge as a feature."""
        zero, frames = np.zeros_like(self.solid.centre), tuple(self.frame + node for node in self.nodes[k])
        return Feature("edge", self.name, ("edge", k), frames, (zero, zero), self.radius, np.eye(3), zero)

    def contacts(self, now, ahead, way, h, fall):
        """Contacts listed, for velocities `way` (nv,) of which the nodes' come first; fall: g h² [m]."""
        out = []
        for k, ends in enumerate(self.nodes):
            edge, x = self.edge(k), now.points(self.edge(k))
            speed = max(np.linalg.norm(way[3 * node : 3 * node + 3]) for node in ends)
            margin = reach(self.rest_gap) + 1.5 * h * speed + 4.0 * fall
            apart = self._distance(now, x.mean(axis=0))
            if apart > margin + 0.5 * np.linalg.norm(x[1] - x[0]) + edge.radius @ now.one:
                continue
            for kind, feature in self.features():
                if any(self._meets(at, kind, edge, feature, margin) for at in (now, ahead)):
                    sign = self._sign(now, edge, feature)
                    out.append(Contact(kind, edge, feature, self.friction, None, self.kappas[k], sign))
        return out

    def _distance(self, at, x):
        """From a point to the shape, 0 inside a box."""
        if self.solid.kind == "box":
            return np.linalg.norm(np.maximum(np.abs(at.local(self.solid, x)) - at.sizes(self.solid), 0.0))
        return -at.depth(self.solid, x)

    def _sign(self, at, edge, feature):
        """±1 that makes d × e point out of the shape there."""
        ends, others = at.points(edge), at.points(feature)
        n = np.cross(ends[1] - ends[0], others[1] - others[0])
        way = others.mean(axis=0) - at.middle(self.solid) if self.solid.kind == "box" else ends[0] - others[0]
        return 1.0 if n @ way >= 0.0 else -1.0

    def _meets(self, at, kind, edge, feature, margin):
        ends, others, r = at.points(edge), at.points(feature), edge.radius @ at.one
        thick, sign = feature.radius @ at.one, self._sign(at, edge, feature)
        if kind == "edge to point":
            gap, n, share = touching.edge_to_point(np, ends, r, others[0], thick)
        else:
            measure = touching.edge_to_line if kind == "edge to line" else touching.edge_to_segment
            gap, n, share = measure(np, ends, r, others, thick, sign)
        if not (0.0 < share < 1.0 and gap <= margin):
            return False
        x = ends[0] + share * (ends[1] - ends[0])
        if kind == "edge to segment":
            t = touching.part(np, x, *others)
            return not 0.0 <= t <= 1.0 or self._crosses(ends, others)
        if self.solid.kind == "ball":
            return True
        if gap <= -np.min(at.sizes(self.solid)):
            return False
        if kind == "edge to line":
            t = touching.part(np, x, *others)
            normals = at.axes(feature, feature.frames[0])[:, 1:].T
            return abs(2.0 * t - 1.0) <= 1.0 + SLIVER and np.all(normals @ n >= -LEAN) and self._crosses(ends, others)
        sides = np.array(feature.name[1:])
        return np.all(sides * (at.axes(self.solid, self.solid.frame).T @ n) >= -LEAN)

    def _crosses(self, ends, others):
        d, e = ends[1] - ends[0], others[1] - others[0]
        return np.linalg.norm(np.cross(d, e)) >= PARALLEL_EDGE * np.linalg.norm(d) * np.linalg.norm(e)


def groups(model, scene, colliders, masses):
    """The groups of a scene whose pairs are known; masses: of frames as the scene begins [kg]."""
    out, world = [], model.n_bodies
    for rope, where, own in zip(scene.get("rope", []), model.nodes.ropes, model.nodes.rope_nodes, strict=True):
        if rope.get("contact", "nodes") != "edges":
            continue
        free = {node for node in own if not model.nodes.driven[node]}
        edges = [(a, b) for a, b in zip(own[:-1], own[1:], strict=True) if free & {a, b}]
        lightest = [min(masses[world + 1 + node] for node in free & set(edge)) for edge in edges]
        for solid in colliders:
            if solid.frame != world or solid.kind not in ("ball", "capsule", "box"):
                continue
            of_rope = lambda first, second: rope["name"] in (first.rsplit(".node", 1)[0], second.rsplit(".node", 1)[0])
            frictions = [c.friction for c in model.always if c.second.of == solid.name and of_rope(c.first.of, "")]
            frictions += [p.friction for p in model.pairs if solid in (p.first, p.second) and of_rope(p.first.name, p.second.name)]
            if frictions:
                kappas = [model.rest_gap * 10.0 * m for m in lightest]
                radius = solid.affine(model.of_nodes[where["radius"]])
                out.append(Group(rope["name"], edges, world + 1, radius, solid, frictions[0], kappas, model.rest_gap))
    return replace(model, edges=out)
