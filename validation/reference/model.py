"""The reference model of a scene: nodes, elements, grippers, shapes, θ.

Nodes of all ropes are consecutive, those of sheets of cloth come after them; a clamped end edge inserts a
massless ghost node before (after) its rope. State x = [q, v, z], q and v of shape (nq,): of all nodes in m and m/s, then of the twists of
rods in rad and rad/s; z is what sections of rods remember, then what `rods` carries along.
"""

import itertools
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import formulas, rods, sheets
from .parameters import Table, add_rod, add_rope, add_shape, add_sheet


@dataclass(frozen=True)
class Gripper:
    """A clamp. `nodes` are the real nodes it drives; an end clamp also drives `ghost`."""

    name: str
    mode: str  # "prescribed" | "velocity"
    nodes: np.ndarray
    ghost: int | None
    fraction: float  # rest length of the clamped end edge / rope length
    rope: int | None
    offset: np.ndarray  # positions in θ
    inputs: slice  # its part of u
    held: list  # `rods.Held` edges whose axes it holds
    roll: np.ndarray  # positions in θ of the roll and its slopes by direction and by place; none without held edges


@dataclass(frozen=True, eq=False)
class Model:
    """Everything about a scene that does not change with x, u, θ. Index arrays are per element."""

    h: float
    duration: float
    integrator: str
    law: str
    rest_gap: float
    paths: list
    theta: np.ndarray
    tilt: np.ndarray
    wind: np.ndarray
    magnitude: int
    ropes: list  # θ positions per rope
    n_nodes: int
    rope_nodes: list  # real nodes of each rope, in order
    node_rope: np.ndarray  # of the ropes' nodes, which come first
    node_voronoi: np.ndarray  # Voronoi length / rope length; 0 for ghosts
    sheets: sheets.Sheets | None
    sheet_nodes: dict  # of the sheets' nodes: fraction of the area; positions in θ of area, density and radius
    edges: np.ndarray  # (E, 2)
    edge_rope: np.ndarray
    edge_fraction: np.ndarray
    stencils: np.ndarray  # (S, 3)
    stencil_rope: np.ndarray
    stencil_voronoi: np.ndarray
    grippers: list
    driven: np.ndarray  # (n_nodes,) bool
    rods: rods.Rods | None
    shapes: list  # (kind, θ positions, constants)
    forces: list  # `formulas.Force`s
    nu: int
    control_names: list
    q0: np.ndarray  # (n_nodes, 3)
    v0: np.ndarray

    @property
    def nq(self):
        """Numbers of q: three of each node, one of each twist."""
        return 3 * self.n_nodes + (0 if self.rods is None else len(self.rods.edges))

    @property
    def n_memory(self):
        """Numbers that rods' sections remember."""
        return 0 if self.rods is None else self.rods.memory.count

    @property
    def nx(self):
        return self.ndx + (0 if self.rods is None else len(self.rods.frames0))

    @property
    def ndx(self):
        """Numbers of a change of state."""
        return 2 * self.nq + self.n_memory

    @property
    def driven_rows(self):
        """(nq,) bool: rows of q that a gripper drives."""
        twists = np.zeros(self.nq - 3 * self.n_nodes, dtype=bool)
        twists[[held.edge for g in self.grippers for held in g.held]] = True
        return np.concatenate([np.repeat(self.driven, 3), twists])

    @property
    def free(self):
        """Indices of the nodes that no gripper drives."""
        return np.flatnonzero(~self.driven)

    def index(self, path):
        """Position of a path in θ."""
        return self.paths.index(path)

    def initial_state(self):
        """x0 (nx,) of the scene as given (no equilibrium is solved here)."""
        if self.rods is None:
            return np.concatenate([self.q0.ravel(), self.v0.ravel()])
        still = np.zeros_like(self.rods.twist0)
        memory = np.zeros(self.n_memory)
        return np.concatenate([self.q0.ravel(), self.rods.twist0, self.v0.ravel(), still, memory, self.rods.frames0])

    def hold(self, q=None):
        """The input (nu,) that keeps every gripper where it is in q (n_nodes, 3)."""
        q = self.q0 if q is None else np.asarray(q).reshape(-1, 3)
        u = np.zeros(self.nu)
        for g in self.grippers:
            if g.mode != "prescribed":
                continue
            target = [q[i] - self.theta[g.offset] for i in g.nodes]
            if g.ghost is not None:
                axis = q[g.nodes[0]] - q[g.ghost]
                target.append(axis / np.linalg.norm(axis))
                target += [held.start[1] for held in g.held]
            u[g.inputs] = np.concatenate(target)
        return u


def load(path):
    """Model of a scene file."""
    return loads(Path(path).read_text())


def loads(text):
    """Model of a scene text (TOML)."""
    scene = tomllib.loads(text)
    table = Table()
    gravity, air = scene.get("gravity", {}), scene.get("air", {})
    magnitude = table.add("gravity.magnitude", gravity.get("magnitude", 9.81))
    tilt = table.add_vector("gravity.tilt", gravity.get("tilt", [0.0, 0.0]))
    wind = table.add_vector("air.wind", air.get("wind", [0.0, 0.0, 0.0]))
    if any("inertia" in body for body in scene.get("body", [])):
        for key in ("density", "viscosity"):  # these act on the bodies, of the other model
            table.add(f"air.{key}", air.get(key, 0.0))
    ropes, cloths = scene.get("rope", []), scene.get("cloth", [])
    for rope in ropes:
        given = rope.get("edge_fractions") or np.ones(rope["nodes"] - 1)
        rope["fractions"] = np.asarray(given, dtype=float) / np.sum(given)
    where = [add_rope(table, rope) for rope in ropes]
    of_sheets = [add_sheet(table, cloth) for cloth in cloths]
    mesh = _mesh(ropes, scene.get("gripper", []))
    q0, v0 = _initial(ropes, mesh)
    cloth, sheet_nodes = sheets.build(cloths, of_sheets, len(q0))
    spans = _spans(ropes, mesh, cloths, len(q0))
    of_rods = []
    for r, (rope, w) in enumerate(zip(ropes, where, strict=True)):
        first, last = ((r, end) in mesh["ghosts"] for end in ("first", "last"))
        numbers = range(0 if first else 1, len(rope["fractions"]) + last)
        of_rods.append(add_rod(table, rope, w, numbers) if "twist" in rope else {})
    twisting = rods.build(ropes, where, mesh, q0, of_rods)
    grippers = _grippers(scene.get("gripper", []), ropes, mesh, table, twisting, q0, spans)
    if cloth is not None:
        q0, v0 = np.concatenate([q0, sheet_nodes.pop("q0")]), np.concatenate([v0, sheet_nodes.pop("v0")])
    driven = np.zeros(len(q0), dtype=bool)
    for g in grippers:
        driven[g.nodes] = True
        if g.ghost is not None:
            driven[g.ghost] = True
    names = _control_names(grippers, scene.get("gripper", []))
    time, contact = scene["time"], scene.get("contact", {})
    shapes = _shapes(scene, table)
    extents = _extents(ropes, where, mesh, cloths, sheet_nodes)
    forces = formulas.on_nodes(scene.get("force", []), table, spans, extents)
    del mesh["ghosts"]
    return Model(
        h=time["step"],
        duration=time.get("duration", 0.0),
        integrator=time.get("integrator", "midpoint"),
        law=contact.get("law", "coulomb"),
        rest_gap=contact.get("rest_gap", 1e-9),
        shapes=shapes,
        forces=forces,
        paths=table.paths,
        theta=np.array(table.values),
        tilt=tilt,
        wind=wind,
        magnitude=magnitude,
        ropes=where,
        n_nodes=len(driven),
        grippers=grippers,
        rods=twisting,
        sheets=cloth,
        sheet_nodes=sheet_nodes,
        driven=driven,
        nu=len(names),
        control_names=names,
        q0=q0,
        v0=v0,
        **mesh,
    )


def _mesh(ropes, grippers):
    """Nodes, edges and bending stencils of all ropes; `ghosts[(rope, end)]` the ghost nodes."""
    ends = {(g["rope"], g["end"]) for g in grippers if "end" in g}
    out = {k: [] for k in ("rope_nodes", "node_rope", "node_voronoi", "edges", "edge_rope")}
    out |= {k: [] for k in ("edge_fraction", "stencils", "stencil_rope", "stencil_voronoi")}
    ghosts, base = {}, 0
    for r, rope in enumerate(ropes):
        fractions = rope["fractions"]
        half = np.concatenate([[0.0], fractions, [0.0]]) / 2
        voronoi = list(half[:-1] + half[1:])
        first, last = (rope["name"], "first") in ends, (rope["name"], "last") in ends
        nodes = base + first + np.arange(len(voronoi))
        if first:
            ghosts[r, "first"] = base
            out["stencils"].append((base, nodes[0], nodes[1]))
            out["stencil_voronoi"].append(fractions[0] / 2)
        for i in range(1, len(nodes) - 1):
            out["stencils"].append((nodes[i - 1], nodes[i], nodes[i + 1]))
            out["stencil_voronoi"].append(voronoi[i])
        if last:
            ghosts[r, "last"] = nodes[-1] + 1
            out["stencils"].append((nodes[-2], nodes[-1], nodes[-1] + 1))
            out["stencil_voronoi"].append(fractions[-1] / 2)
        if "twist" in rope:  # its bending knows directions: `rods`
            kept = len(out["stencil_rope"])
            del out["stencils"][kept:], out["stencil_voronoi"][kept:]
        out["stencil_rope"] += [r] * (len(out["stencils"]) - len(out["stencil_rope"]))
        out["edges"] += list(itertools.pairwise(nodes))
        out["edge_rope"] += [r] * len(fractions)
        out["edge_fraction"] += list(fractions)
        out["node_voronoi"] += [0.0] * first + voronoi + [0.0] * last
        out["node_rope"] += [r] * (first + len(nodes) + last)
        out["rope_nodes"].append(nodes)
        base += first + len(nodes) + last
    keep = {k: np.array(v) for k, v in out.items() if k != "rope_nodes"}
    keep["edges"] = keep["edges"].reshape(-1, 2).astype(int)
    keep["stencils"] = keep["stencils"].reshape(-1, 3).astype(int)
    for key in ("node_rope", "edge_rope", "stencil_rope"):
        keep[key] = keep[key].astype(int)
    return keep | {"rope_nodes": out["rope_nodes"], "ghosts": ghosts}


def _spans(ropes, mesh, cloths, first):
    """Name -> nodes of every rope and sheet."""
    out = {rope["name"]: nodes for rope, nodes in zip(ropes, mesh["rope_nodes"], strict=True)}
    for cloth in cloths:
        count = int(np.prod(cloth["grid"]["nodes"]))
        out[cloth["name"]] = first + np.arange(count)
        first += count
    return out


def _extents(ropes, where, mesh, cloths, sheet_nodes):
    """Name -> of every node of the rope or sheet its part of the length or area, and that one's position in θ."""
    out, first = {}, 0
    for rope, w, nodes in zip(ropes, where, mesh["rope_nodes"], strict=True):
        out[rope["name"]] = mesh["node_voronoi"][nodes], np.full(len(nodes), w["length"])
    for cloth in cloths:
        part = slice(first, first + int(np.prod(cloth["grid"]["nodes"])))
        out[cloth["name"]] = sheet_nodes["fraction"][part], sheet_nodes["area"][part]
        first = part.stop
    return out


def _grippers(entries, ropes, mesh, table, twisting, q0, spans):
    """The grippers in scene order, with their inputs laid out in u."""
    names, out, start = [rope["name"] for rope in ropes], [], 0
    for g in entries:
        r, mode = names.index(g["rope"]) if "rope" in g else None, g.get("mode", "prescribed")
        real = spans[g["cloth"] if r is None else g["rope"]]
        ghost, fraction = None, 0.0
        if "end" in g:
            first = g["end"] == "first"
            nodes = real[:1] if first else real[-1:]
            ghost = int(mesh["ghosts"][r, g["end"]])
            fraction = float(ropes[r]["fractions"][0 if first else -1])
        else:
            nodes = real[np.array(g["nodes"])]
        size = 6 if ghost is not None else (3 * len(nodes) if mode == "prescribed" else 3)
        offset = table.add_vector(f"{g['name']}.offset", g.get("offset", [0.0, 0.0, 0.0]))
        if ghost is None:
            held = rods.held_edges(twisting, q0, nodes)
        else:
            held = rods.held_edges(twisting, q0, [nodes[0], ghost], nodes[0])
        rolls, roll = held and mode == "prescribed", []
        if rolls:
            roll = [table.add(f"{g['name']}.roll", g.get("roll", 0.0))]
            for key in ("roll_by_direction", "roll_by_position"):
                roll += list(table.add_vector(f"{g['name']}.{key}", g.get(key, [0.0, 0.0, 0.0])))
        size += 3 if rolls and ghost is not None else 0
        inputs = slice(start, start + size)
        out.append(Gripper(g["name"], mode, nodes, ghost, fraction, r, offset, inputs, held, np.array(roll, dtype=int)))
        start += size
    return out


def _control_names(grippers, entries):
    """Names of u's entries, e.g. `left.node[0].x`."""
    names = []
    for g, entry in zip(grippers, entries, strict=True):
        if g.mode == "prescribed":
            second = "axis"
            first = [f"node[{i}]" for i in entry["nodes"]] if g.ghost is None else ["position"]
        else:
            first, second = ["velocity"], "angular_velocity"
        groups = first + ([second] if g.ghost is not None else [])
        groups += ["director"] * (g.ghost is not None and g.mode == "prescribed" and bool(g.held))
        names += [f"{g.name}.{group}.{c}" for group in groups for c in "xyz"]
    return names


def _shapes(scene, table):
    """(kind, θ positions, constants) of every shape: planes, then spheres, then capsules."""
    out = []
    for kind in ("plane", "sphere", "capsule"):
        for shape in scene.get(kind, []):
            constants = {}
            if kind == "plane":
                normal = np.array(shape.get("normal", [0.0, 0.0, 1.0]), dtype=float)
                constants["normal"] = normal / np.linalg.norm(normal)
                constants["point"] = np.array(shape.get("point", [0.0, 0.0, 0.0]), dtype=float)
            out.append((kind, add_shape(table, kind, shape), constants))
    return out


def _initial(ropes, mesh):
    """Positions and velocities (n_nodes, 3) as the scene gives them."""
    q = np.zeros((len(mesh["node_rope"]), 3))
    v = np.zeros_like(q)
    for r, rope in enumerate(ropes):
        nodes, initial = mesh["rope_nodes"][r], rope["initial"]
        arc = np.concatenate([[0.0], np.cumsum(rope["fractions"])])[:, None]
        if initial["shape"] == "straight":
            direction = np.array(initial["direction"], dtype=float)
            direction /= np.linalg.norm(direction)
            q[nodes] = np.array(initial["from"]) + arc * rope["length"] * direction
        elif initial["shape"] == "points":
            q[nodes] = np.array(initial["points"], dtype=float)
        else:
            raise ValueError(f"the reference knows straight and points, not {initial['shape']!r}")
        v[mesh["node_rope"] == r] = rope.get("velocity", [0.0, 0.0, 0.0])
        for end, node, step in (("first", nodes[0], 1), ("last", nodes[-1], -1)):
            if (r, end) in mesh["ghosts"]:
                axis = q[node + step] - q[node]
                rest = rope["length"] * rope["fractions"][0 if end == "first" else -1]
                q[mesh["ghosts"][r, end]] = q[node] - rest * axis / np.linalg.norm(axis)
    return q, v
