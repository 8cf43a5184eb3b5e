"""Solids that touch, and their features: points, lines and faces, as far as θ says where they are.

A solid is carried by a *frame*: a body, the world, or a node (a ball that does not turn). In its frame every point of a feature, every
radius and every coefficient of friction is affine in θ: p = P (1, θ), P (3, 1 + n), but for the turn of the whole solid by a rotation
vector r of θ about a pivot c = C (1, θ), which turns its axes too: a point p is at c + rot(r) (p - c), which a frame (R, x) carries as
(R rot(r), x + R (c - rot(r) c)) carries p. So a list of contacts is numbers, and one compiled program serves all scenes of the same bodies.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from . import hulls

WEIGHT = 10.0  # [m/s²]: makes a weight of a mass, in what smooths a contact
RIM_POINTS = 8  # of a cylinder's rim, on a face that it stands on


@dataclass(frozen=True, eq=False)
class Feature:
    """A part of a solid that may touch. Affine maps have a column for 1, then one for each entry of θ."""

    kind: str  # "point" | "segment" | "line" | "box" | "face" | "rim"
    of: str  # its solid
    name: tuple  # which one of that
    frames: tuple  # of its three points: the same of a solid, nodes of an edge (the second twice) or a triangle
    points: tuple  # three (3, 1 + n) [m]: first of a line or segment its ends, of a rim the centres of the other end and its own
    radius: np.ndarray  # (1 + n,) [m]
    axes: np.ndarray  # (3, 3) columns: of a face the last is its outward normal
    half: np.ndarray  # (3, 1 + n) [m] half extents of a box
    turn: tuple  # its solid's
    pivot: np.ndarray  # its solid's


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape with its frame; kinds in the order in which the one that is thought of as points and lines comes first."""

    kind: str  # one of KINDS
    name: str
    owner: str  # the object of the scene that it belongs to
    frame: int
    axes: np.ndarray  # (3, 3) columns, in the frame's
    centre: np.ndarray  # (3, 1 + n)
    ends: np.ndarray  # (2, 3, 1 + n) of the axis of a capsule or cylinder; the centre twice of others
    sizes: tuple  # positions in θ: radius, then half a length; or three half extents
    friction: int | None  # position in θ
    hull: hulls.Hull | None = None
    turn: tuple = ()  # positions in θ of the rotation vector  [rad], in the frame's axes; none of what does not turn
    about: np.ndarray | None = None  # (3, 1 + n) the point that it turns about, where that is not the centre  [m]

    @property
    def rank(self):
        """Which of two solids comes first."""
        return KINDS[self.kind]

    def affine(self, place):
        """The number at a position of θ, (1 + n,)."""
        out = np.zeros(self.centre.shape[1])
        if place is not None:
            out[1 + place] = 1.0
        return out

    @property
    def pivot(self):
        """The point that it turns about (3, 1 + n)."""
        return self.centre if self.about is None else self.about

    @property
    def radius(self):
        """Of what is round  [m]; zero of a box and a half space."""
        return self.affine(self.sizes[0] if self.kind in ("ball", "capsule", "cylinder") else None)

    @property
    def half(self):
        """Half extents of a box (3, 1 + n)."""
        return np.array([self.affine(k) for k in self.sizes]) if self.kind == "box" else np.zeros_like(self.centre)

    def feature(self, kind, name, points, radius=None, axes=None):
        """A feature of this solid."""
        radius = self.affine(None) if radius is None else radius
        axes = self.axes if axes is None else axes
        frames, points = (self.frame,) * 3, (*points, points[1])
        return Feature(kind, self.name, name, frames, points, radius, axes, self.half, self.turn, self.pivot)

    def along(self, k, side):
        """±half extent k along its axis (3, 1 + n)."""
        return side * np.outer(self.axes[:, k], self.half[k])

    def fixed(self, y):
        """A point of its own axes (3, 1 + n)."""
        out = self.centre.copy()
        out[:, 0] += self.axes @ y
        return out

    def tips(self):
        """Its points: the centre of a ball, the ends of a capsule, corners, points of both rims."""
        if self.kind == "hull":
            return [self.feature("point", ("corner", k), (self.fixed(y),) * 2) for k, y in enumerate(self.hull.corners)]
        if self.kind == "ball":
            return [self.feature("point", ("whole",), (self.centre,) * 2, self.radius)]
        if self.kind == "capsule":
            return [self.feature("point", ("end", k), (self.ends[k],) * 2, self.radius) for k in (0, 1)]
        if self.kind == "box":
            at = lambda s: self.centre + sum(self.along(k, s[k]) for k in range(3))
            return [self.feature("point", ("corner", *s), (at(s),) * 2) for s in itertools.product((-1, 1), repeat=3)]
        turns = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
        across = [np.outer(self.axes[:, 0] * np.cos(t) + self.axes[:, 1] * np.sin(t), self.radius) for t in turns]
        rim = itertools.product((0, 1), range(RIM_POINTS))
        return [self.feature("point", ("rim point", e, k), (self.ends[e] + across[k],) * 2) for e, k in rim]

    def lines(self):
        """The axis of a capsule or cylinder, or the edges of a box with the outward normals of their faces in `axes`."""
        if self.kind == "hull":
            out = []
            for k, ((a, b), across) in enumerate(self.hull.edges):
                axes = self.axes @ np.column_stack([b - a, *across])
                out.append(self.feature("line", ("edge", k), (self.fixed(a), self.fixed(b)), axes=axes))
            return out
        if self.kind != "box":
            return [self.feature("line", ("axis",), tuple(self.ends), self.radius)]
        out = []
        for k, (s, t) in itertools.product(range(3), itertools.product((-1, 1), repeat=2)):
            i, j = (k + 1) % 3, (k + 2) % 3
            middle, half = self.centre + self.along(i, s) + self.along(j, t), self.along(k, 1)
            normals = np.column_stack([self.axes[:, k], s * self.axes[:, i], t * self.axes[:, j]])
            out.append(self.feature("line", ("edge", k, s, t), (middle - half, middle + half), axes=normals))
        return out

    def faces(self):
        """Flat sides, each with its outward normal last in `axes`."""
        if self.kind == "half space":
            return [self.feature("face", ("face",), (self.centre,) * 2)]
        if self.kind == "cylinder":
            turned = [-self.axes, self.axes]
            return [self.feature("face", ("face", k), (self.ends[k],) * 2, axes=turned[k]) for k in (0, 1)]
        if self.kind == "hull":
            planes = zip(self.hull.normals, self.hull.heights, strict=True)
            axes = lambda n: np.column_stack([np.zeros((3, 2)), self.axes @ n])
            return [self.feature("face", ("face", k), (self.fixed(h * n),) * 2, axes=axes(n)) for k, (n, h) in enumerate(planes)]
        out = []
        for k, side in itertools.product(range(3), (-1, 1)):
            axes = side * np.column_stack([self.axes[:, (k + 1) % 3], self.axes[:, (k + 2) % 3], self.axes[:, k]])
            out.append(self.feature("face", ("face", k, side), (self.centre + self.along(k, side),) * 2, axes=axes))
        return out

    def rims(self):
        """The two rims of a cylinder."""
        return [self.feature("rim", ("rim", k), (self.ends[1 - k], self.ends[k]), self.radius) for k in (0, 1)]

    def whole(self):
        """All of a ball, capsule or box, to which the distance of a point has one form."""
        if self.kind == "box":
            return self.feature("box", ("whole",), (self.centre,) * 2)
        return self.feature("segment", ("whole",), tuple(self.ends), self.radius)


KINDS = {"ball": 0, "capsule": 1, "cylinder": 2, "box": 3, "hull": 3, "half space": 4}


def rotation(quaternion):
    """R (3, 3) of a quaternion (w, x, y, z) of any length."""
    w, *u = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    hat = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    return np.eye(3) + 2.0 * w * hat + 2.0 * hat @ hat


def quaternion(t):
    """Of turning by |t| [rad] about t: (cos(|t|/2), sin(|t|/2) t/|t|)."""
    half = 0.5 * np.linalg.norm(t)
    return np.array([np.cos(half), *(0.5 * np.sinc(half / np.pi) * np.asarray(t))])


def turned(np, rot, frame, pivot):
    """The frame (3, 4) that carries a solid's points as they are without its turn, where `frame` carries them turned by rot about pivot."""
    r = frame[:, :3] @ rot
    return np.concatenate([r, (frame[:, 3] + frame[:, :3] @ pivot - r @ pivot)[:, None]], axis=1)


def _across(z):
    """Axes whose third is along z; a half space does not know the others."""
    z = np.asarray(z, dtype=float) / np.linalg.norm(z)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


SIZES = {
    "sphere": ("ball", ["radius"]),
    "capsule": ("capsule", ["radius", "half_length"]),
    "cylinder": ("cylinder", ["radius", "half_length"]),
    "box": ("box", ["half_extent[0]", "half_extent[1]", "half_extent[2]"]),
    "hull": ("hull", []),
}


def entries(scene, table):
    """Adds the entries of θ of all shapes but those whose entries `table` has; then (solid kind, entry, owner, where) of each."""
    out = []
    for body in scene.get("body", []):
        for k, shape in enumerate(body.get("shape", [])):
            name = f"{body['name']}.shape[{k}]"
            out.append((shape["kind"], shape, name, body["name"], _places(table, name, shape, shape["kind"])))
    for kind in ("plane", "sphere", "capsule", "box", "cylinder"):
        for shape in scene.get(kind, []):
            name, where = shape["name"], {}
            if kind in ("box", "cylinder"):
                where = _places(table, name, {"friction": 0.0} | shape, kind)
            else:
                where = {path[len(name) + 1 :]: k for k, path in enumerate(table.paths) if path.startswith(name + ".")}
            out.append((kind, shape, name, None, where))
    return out


def _places(table, name, shape, kind):
    where = {"position": table.add_vector(f"{name}.position", shape.get("position", [0.0] * 3))}
    if kind != "sphere":
        where["rotation"] = table.add_vector(f"{name}.rotation", [0.0] * 3)
    values = [] if kind == "hull" else shape.get("half_extents") or [shape.get("radius"), shape.get("half_length")]
    for entry, value in zip(SIZES[kind][1], values, strict=False):
        where[entry] = table.add(f"{name}.{entry}", value)
    if "friction" in shape:
        where["friction"] = table.add(f"{name}.friction", shape["friction"])
    return where


def solid(kind, shape, name, owner, where, frame, n):
    """The solid of one of :func:`entries` in a frame; n: entries of θ."""

    def vector(places):
        out = np.zeros((3, 1 + n))
        out[range(3), 1 + np.asarray(places)] = 1.0
        return out

    owner, friction = owner or name, where.get("friction")
    if kind == "plane":
        axes, centre = _across(shape.get("normal", [0.0, 0.0, 1.0])), np.zeros((3, 1 + n))
        centre[:, 0] = shape.get("point", [0.0, 0.0, 0.0])
        point = centre.copy()
        centre[:, 1 + where["height"]] = axes[:, 2]
        turn = tuple(where[f"rotation[{k}]"] for k in range(3))
        return Solid("half space", name, owner, frame, axes, centre, np.array([centre, centre]), (), friction, turn=turn, about=point)
    if "a[0]" in where:
        ends = np.array([vector([where[f"{e}[{k}]"] for k in range(3)]) for e in "ab"])
        return Solid("capsule", name, owner, frame, np.eye(3), ends.mean(axis=0), ends, (where["radius"],), friction)
    places = where["position"] if "position" in where else [where[f"center[{k}]"] for k in range(3)]
    form, sizes = SIZES[kind]
    sizes, axes, centre = tuple(where[s] for s in sizes), rotation(shape.get("quaternion", [1.0, 0, 0, 0])), vector(places)
    half = np.zeros(1 + n)
    if form in ("capsule", "cylinder"):
        half[1 + sizes[1]] = 1.0
    ends = np.array([centre - np.outer(axes[:, 2], half), centre + np.outer(axes[:, 2], half)])
    of = hulls.hull(shape["points"]) if form == "hull" else None
    return Solid(form, name, owner, frame, axes, centre, ends, sizes, friction, of, tuple(where.get("rotation", ())))


def ball(name, owner, frame, radius, n):
    """A node of a rope, a ball of the entry `radius` of θ."""
    zero = np.zeros((3, 1 + n))
    return Solid("ball", name, owner, frame, np.eye(3), zero, np.array([zero, zero]), (radius,), None)
