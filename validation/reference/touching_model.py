"""Scenes in which bodies, ropes and fixed shapes touch: one model of ropes and bodies, its θ and the pairs that may touch.

State x = [q, v]: nodes first (3 each), then the bodies' coordinates. Frames are numbered: bodies, the world, then nodes.
"""

import tomllib
from dataclasses import dataclass, replace

import numpy as np

from . import body_model, edge_listing, forces, listing, solids, touching
from . import model as rope_model
from .parameters import Table, add_shape


@dataclass(frozen=True, eq=False)
class TouchingModel:
    """A scene's constants. `of_nodes`, `of_bodies`: positions in θ of the entries of the two models."""

    h: float
    integrator: str
    rest_gap: float
    paths: list
    theta: np.ndarray
    magnitude: int
    nodes: rope_model.Model | None
    of_nodes: np.ndarray
    bodies: body_model.BodyModel | None
    of_bodies: np.ndarray
    pairs: list  # listing.Pair
    always: list  # listing.Contact of nodes with fixed planes, spheres and capsules, which are always listed
    edges: list  # edge_listing.Group
    q0: np.ndarray
    v0: np.ndarray

    @property
    def n_nodes(self):
        return 0 if self.nodes is None else self.nodes.n_nodes

    @property
    def n_bodies(self):
        return 0 if self.bodies is None else len(self.bodies.bodies)

    @property
    def nq(self):
        return len(self.q0)

    @property
    def nv(self):
        return len(self.v0)

    @property
    def ndx(self):
        return 2 * self.nv

    @property
    def nu(self):
        return sum(0 if m is None else m.nu for m in (self.nodes, self.bodies))

    @property
    def kinds(self):
        """Kinds of contacts that may be listed, in the order of `touching.KINDS`."""
        out = {c.kind for c in self.always}
        for pair in self.pairs:
            first, second = sorted((pair.first.kind, pair.second.kind), key=solids.KINDS.get)
            if second in ("ball", "capsule"):
                out.add("segment")
            elif second == "half space" or first in ("box", "hull"):
                out.add("face")
            if second == "box" and first in ("ball", "capsule"):
                out.add("box")
            if first in listing.CROSSING and second in listing.CROSSING:
                out |= {"line"} | ({"segment"} if first == "capsule" else set())
            if first == "cylinder":
                out.add("rim")
        for group in self.edges:
            out |= group.kinds
        return tuple(kind for kind in touching.KINDS if kind in out)

    def initial_state(self):
        return np.concatenate([self.q0, self.v0])

    def index(self, path):
        return self.paths.index(path)


def loads(text):
    """Model of a scene text (TOML)."""
    scene, table = tomllib.loads(text), Table()
    if scene.get("contact", {}).get("law", "coulomb") != "coulomb":
        raise ValueError("contact of bodies and edges is Coulomb's here")
    nodes = rope_model.loads(text) if scene.get("rope") or scene.get("cloth") else None
    bodies = body_model.loads(text) if scene.get("body") else None
    of = []
    for part in (nodes, bodies):
        known = set(table.paths)
        for path, value in zip(part.paths, part.theta, strict=True) if part else ():
            if path not in known:
                table.add(path, value)
        of.append(np.array([table.paths.index(p) for p in part.paths]) if part else np.zeros(0, dtype=int))
    if nodes is None:
        for kind in ("plane", "sphere", "capsule"):
            for shape in scene.get(kind, []):
                add_shape(table, kind, shape)
    listed = solids.entries(scene, table)
    rules = [_rule(table, k, rule) for k, rule in enumerate(scene.get("contact", {}).get("pair", []))]
    smooth = [where for *_, where in listed if "friction" not in where]
    unrough = table.add("contact.friction", 0.0) if len(smooth) > (nodes is None) else None
    n = len(table.paths)
    names = [b.name for b in bodies.bodies] if bodies else []
    frame = lambda owner: names.index(owner) if owner else len(names)
    colliders = [solids.solid(kind, s, name, owner, where, frame(owner), n) for kind, s, name, owner, where in listed]
    first_node, balls = len(names) + 1, []
    objects = _objects(scene, nodes, of[0])
    for name, own, _, radius, _ in objects:
        loose = [(k, node) for k, node in enumerate(own) if not nodes.driven[node]]
        balls += [solids.ball(f"{name}.node[{k}]", name, first_node + node, radius, n) for k, node in loose]
    theta = np.array(table.values)
    model = TouchingModel(
        h=scene["time"]["step"],
        integrator=scene["time"].get("integrator", "midpoint"),
        rest_gap=scene.get("contact", {}).get("rest_gap", 1e-9),
        paths=table.paths,
        theta=theta,
        magnitude=table.paths.index("gravity.magnitude"),
        nodes=nodes,
        of_nodes=of[0],
        bodies=bodies,
        of_bodies=of[1],
        pairs=[],
        always=[],
        edges=[],
        q0=np.concatenate([x.q0.ravel() for x in (nodes, bodies) if x]),
        v0=np.concatenate([x.v0.ravel() for x in (nodes, bodies) if x]),
    )
    pairs, always = _pairs(model, colliders, balls, rules, unrough)
    model = replace(model, pairs=pairs, always=always)
    with_edges = [(name, own, faces, radius) for name, own, faces, radius, contact in objects if contact == "edges"]
    return edge_listing.groups(model, with_edges, colliders, _masses(model)) if with_edges else model


def _objects(scene, nodes, places):
    """(name, nodes, triangles or None, position of the radius in θ, "nodes" or "edges") of ropes and sheets."""
    out, ropes = [], zip(scene.get("rope", []), nodes.ropes, nodes.rope_nodes, strict=True) if nodes else ()
    for rope, where, own in ropes:
        out.append((rope["name"], list(own), None, places[where["radius"]], rope.get("contact", "nodes")))
    counts = [int(np.prod(cloth["grid"]["nodes"])) for cloth in scene.get("cloth", [])]
    firsts = (nodes.n_nodes if nodes else 0) - np.cumsum(counts[::-1])[::-1]
    for cloth, first, count in zip(scene.get("cloth", []), firsts, counts, strict=True):
        own = range(first, first + count)
        faces = [tuple(face) for face in nodes.sheets.triangles if face[0] in own]
        radius = places[nodes.paths.index(f"{cloth['name']}.radius")]
        out.append((cloth["name"], list(own), faces, radius, cloth.get("contact", "nodes")))
    return out


@dataclass(frozen=True)
class Rule:
    """A [[contact.pair]]; positions in θ."""

    between: tuple
    ignore: bool
    friction: int | None
    compliance: int | None


def _rule(table, k, entry):
    places = [table.add(f"contact.pair[{k}].{key}", entry[key]) if key in entry else None for key in ("friction", "compliance")]
    return Rule(tuple(sorted(entry["between"])), entry.get("ignore", False), *places)


def _masses(model):
    """Mass of every frame's carrier as the scene begins  [kg]: of a body without, that of all it carries; infinite of the world."""
    own, parents = [], []
    for body in model.bodies.bodies if model.bodies else ():
        own.append(0.0 if body.theta is None else model.bodies.theta[body.theta[0]])
        parents.append(body.parent)
    carried = list(own)
    for k in reversed(range(len(own))):
        if parents[k] is not None:
            carried[parents[k]] += carried[k]
    of_nodes = [] if model.nodes is None else np.asarray(forces.masses(model.nodes, model.nodes.theta))
    return np.array([*(m or c for m, c in zip(own, carried, strict=True)), np.inf, *of_nodes])


def _carriers(model):
    """For every frame the body or node that it is fixed to, and the carrier of that one's parent; the world is its own."""
    count = model.n_bodies
    joined, above = [], []
    for k, body in enumerate(model.bodies.bodies if model.bodies else ()):
        up = count if body.parent is None else joined[body.parent]
        joined.append(k if body.joints else up)
        above.append(up if body.joints else (count if body.parent is None else above[body.parent]))
    nodes = list(range(count + 1, count + 1 + model.n_nodes))
    return [*joined, count, *nodes], [*above, None, *([None] * len(nodes))]


def _pairs(model, colliders, balls, rules, unrough):
    """(pairs of solids that may touch, contacts of nodes that are always listed)."""
    masses, world, (joined, above) = _masses(model), model.n_bodies, _carriers(model)
    pairs, always, everything = [], [], colliders + balls
    for i, a in enumerate(everything):
        for b in everything[i + 1 :]:
            x, y = joined[a.frame], joined[b.frame]
            neighbours = world not in (x, y) and (above[a.frame] == y or above[b.frame] == x)
            if x == y or neighbours or min(a.frame, b.frame) > world:
                continue
            rule = next((r for r in rules if r.between == tuple(sorted((a.owner, b.owner)))), None)
            if rule and rule.ignore:
                continue
            own = [s.friction for s in (a, b) if s.friction is not None] or [unrough]
            own = own if rule is None or rule.friction is None else [rule.friction]
            friction = sum(a.affine(k) for k in own) / len(own)
            plain = a.frame == world and b.frame > world and a.kind in ("half space", "ball", "capsule")
            if plain:
                node = b.frame - world - 1
                second = a.faces()[0] if a.kind == "half space" else a.whole()
                kind = "face" if a.kind == "half space" else "segment"
                always.append(listing.Contact(kind, b.tips()[0], second, friction, None, 0.0, node=node))
                continue
            compliance = a.affine(rule.compliance) if rule and rule.compliance is not None else None
            kappa = model.rest_gap * solids.WEIGHT * min(masses[a.frame], masses[b.frame])
            pairs.append(listing.Pair(a, b, friction, compliance, kappa))
    return pairs, always
