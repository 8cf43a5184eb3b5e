"""Which features may meet within a stage, from where it begins: docs/theory/contact.md, "Listing". NumPy; nothing is differentiated.

Feature pairs are listed where the stage begins and where its velocities lead, in the pair's order: a solid that is thought of as points
and lines comes first. Contacts listed keep their features through the stage.
"""

from dataclasses import dataclass, field

import numpy as np

from . import solids, touching

DEEP = 10.0  # [m/s²] R: deeper than R h² a contact is pushed out over several steps
LEANING = 0.05  # sine of a cylinder's lean on a face from which its rim touches by its deepest point
PARALLEL = 1e-3  # sine between lines that do not cross
PARALLEL_EDGE = 0.02  # the same between an edge of a rope and a line
LEAN = 1e-3  # by which a normal may lean out of those of the faces at an edge
SLIVER = 1e-9  # part of a size by which a point may be beside it: rounding


def reach(rest_gap):
    """Distance from which on all features are listed  [m]."""
    return min(1e6 * rest_gap, max(1e3 * rest_gap, 0.01))


@dataclass(frozen=True, eq=False)
class Pair:
    """Two solids that may touch; numbers affine in θ as in `solids`."""

    first: object
    second: object
    friction: np.ndarray  # [-]
    compliance: np.ndarray | None  # [m/N]
    kappa: float  # [J]


@dataclass(frozen=True, eq=False)
class Contact:
    """A feature of one solid (or an edge of a rope) at a feature of another one."""

    kind: str  # one of touching.KINDS
    first: object
    second: object
    friction: np.ndarray
    compliance: np.ndarray | None
    kappa: float
    sign: float = 1.0
    node: int = -1  # whose mass follows θ in κ, in place of `kappa`
    deep: bool = False

    @property
    def identity(self):
        """What tells it from other contacts of a scene."""
        return self.first.of, self.first.name, self.second.of, self.second.name


@dataclass(eq=False)
class Instant:
    """Frames (m, 3, 4) at one instant and θ, and where features are then."""

    frames: np.ndarray
    theta: np.ndarray
    one: np.ndarray = field(init=False)
    turns: dict = field(default_factory=dict)  # frames of solids that turn, as far as they were needed

    def __post_init__(self):
        self.one = np.concatenate([[1.0], self.theta])

    def frame(self, of, k):
        """Frame k (3, 4) with the turn of a feature's solid, or of a solid."""
        if not of.turn:
            return self.frames[k]
        if (of.turn, k) not in self.turns:
            rot = solids.rotation(solids.quaternion(self.theta[list(of.turn)]))
            self.turns[of.turn, k] = solids.turned(np, rot, self.frames[k], of.pivot @ self.one)
        return self.turns[of.turn, k]

    def points(self, feature):
        """Its first two points (2, 3)  [m]."""
        return self.nodes(feature)[:2]

    def nodes(self, feature):
        """Its three points (3, 3)  [m]."""
        frames = [self.frame(feature, k) for k in feature.frames]
        return np.array([f[:, :3] @ (p @ self.one) + f[:, 3] for f, p in zip(frames, feature.points, strict=True)])

    def axes(self, feature_or_solid, frame):
        return self.frame(feature_or_solid, frame)[:, :3] @ feature_or_solid.axes

    def middle(self, solid):
        """Where the origin of a solid is."""
        frame = self.frame(solid, solid.frame)
        return frame[:, :3] @ (solid.centre @ self.one) + frame[:, 3]

    def sizes(self, solid):
        """Radius and half a length, or half extents; of a hull half its least width."""
        if solid.kind == "hull":
            return np.array([solid.hull.half_width])
        if solid.kind == "box":
            return solid.half @ self.one
        ends = solid.ends @ self.one
        return np.array([solid.radius @ self.one, 0.5 * np.linalg.norm(ends[1] - ends[0])])

    def extent(self, solid):
        """Radius of the ball about its origin that holds a solid."""
        sizes = self.sizes(solid)
        if solid.kind == "half space":
            return np.inf
        if solid.kind == "hull":
            return solid.hull.extent
        return np.sum(sizes) if solid.kind in ("ball", "capsule") else np.linalg.norm(sizes)

    def support(self, solid, n):
        """How far a solid reaches from its origin along a unit vector."""
        along = self.axes(solid, solid.frame).T @ n
        if solid.kind == "hull":
            return np.max(solid.hull.corners @ along)
        sizes, along = self.sizes(solid), np.abs(along)
        if solid.kind == "box":
            return sizes @ along
        if solid.kind == "cylinder":
            return sizes[0] * np.sqrt(max(0.0, 1.0 - along[2] ** 2)) + sizes[1] * along[2]
        a, b = self.points(solid.whole())
        return sizes[0] + 0.5 * abs((b - a) @ n)

    def local(self, solid, x):
        """A point in the axes of a box, cylinder or half space, from its origin."""
        return self.axes(solid, solid.frame).T @ (x - self.middle(solid))

    def depth(self, solid, x):
        """How deep a point is in a solid, < 0 outside."""
        y, sizes = self.local(solid, x), self.sizes(solid)
        if solid.kind == "box":
            return np.min(sizes - np.abs(y))
        if solid.kind == "cylinder":
            return min(sizes[0] - np.hypot(y[0], y[1]), sizes[1] - abs(y[2]))
        a, b = self.points(solid.whole())
        t = np.clip(touching.part(np, x, a, b), 0.0, 1.0)
        return sizes[0] - np.linalg.norm(x - a - t * (b - a))

    def meeting(self, kind, first, second, sign):
        """(gap, n, c) of a contact of two solids."""
        ends, others, n = self.points(first), self.points(second), self.axes(second, second.frames[0])
        r, thick = first.radius @ self.one, second.radius @ self.one
        return {
            "face": lambda: touching.face(np, ends[0], r, others[0], n[:, 2]),
            "segment": lambda: touching.segment(np, ends[0], r, *others, thick),
            "box": lambda: touching.box(np, ends[0], r, others[0], n, second.half @ self.one),
            "line": lambda: touching.line(np, ends, r, others, thick, sign),
            "rim": lambda: touching.rim(np, ends, r, others[0], n[:, 2]),
        }[kind]()


def near(at, pair, rates, h, rest_gap, fall):
    """Margin  [m] within which features of a pair are listed; None if the solids are farther apart.

    reach + 1.5 h u + 4 g h², u a bound of how fast they approach: along the normal of a half space, else |v| of the origin of the
    smaller one; with |ω| times its extent. rates (m, 3, 4): of the frames [m/s, 1/s]; fall: g h² [m].
    """
    a, b = pair.first, pair.second
    first_is_small = b.kind == "half space" or (a.kind != "half space" and at.extent(a) < at.extent(b))
    small, large = (a, b) if first_is_small else (b, a)
    x = at.middle(small)
    v, spin = [], []
    for s in (small, large):
        frame, rate = at.frames[s.frame], rates[s.frame]
        hat = rate[:, :3] @ frame[:, :3].T
        v.append(rate[:, 3] + hat @ (x - frame[:, 3]))
        spin.append(np.array([hat[2, 1], hat[0, 2], hat[1, 0]]))
    v, turn = v[0] - v[1], np.linalg.norm(spin[0] - spin[1]) * at.extent(small)
    apart = x - at.middle(large)
    if large.kind == "half space":
        n = at.axes(large, large.frame)[:, 2]
        speed, distance = max(0.0, -n @ v) + turn, n @ apart - at.extent(small)
    else:
        speed, distance = np.linalg.norm(v) + turn, np.linalg.norm(apart) - at.extent(small) - at.extent(large)
    margin = reach(rest_gap) + 1.5 * h * speed + 4.0 * fall
    return margin if distance <= margin else None


CROSSING = ("capsule", "box", "hull")  # kinds whose lines may cross


def meetings(at, pair, margin):
    """(kind, first feature, second feature, sign, gap) of the pair at an instant, as far as their gap is below the margin."""
    a, b = pair.first, pair.second
    if a.rank > b.rank:
        a, b = b, a
    out = []
    for tip in a.tips():
        out.append(_tip(at, tip, a, b))
    if a.kind == "cylinder" and b.kind == "half space":
        out += [_rim(at, rim, a, b) for rim in a.rims()]
    elif a.kind in CROSSING and b.kind in CROSSING:
        out += [_crossing(at, x, y, a, b, margin) for x in _near_lines(at, a, b, margin) for y in _near_lines(at, b, a, margin)]
        out += [_tip(at, tip, b, a) for tip in b.tips()]
    elif "cylinder" in (a.kind, b.kind) and a.kind != "ball":
        raise ValueError("the reference knows cylinders at planes and balls only")
    found = []
    for meeting in filter(None, out):
        gap = at.meeting(*meeting)[0]
        if gap <= margin:
            found.append((*meeting, gap))
    return found


def _tip(at, tip, a, b):
    """A point of `a` at `b`: what is round at all of it, what is sharp at the face under it."""
    round_tip = a.kind in ("ball", "capsule")
    if b.kind == "half space":
        return None if _rolls(at, a, b, tip) else ("face", tip, b.faces()[0], 1.0)
    if round_tip or b.kind in ("ball", "capsule"):
        if b.kind in ("cylinder", "hull"):
            raise ValueError("the reference knows no ball at a cylinder or hull")
        whole = b.whole()
        return whole.kind, tip, whole, 1.0
    y, half = at.local(b, at.points(tip)[0]), at.sizes(b)
    if b.kind == "hull":
        face, _, beside = b.hull.over(y)
        return None if beside > SLIVER * b.hull.extent else ("face", tip, b.faces()[face], 1.0)
    beyond = np.abs(y) - half
    k = 2 - np.argmax(beyond[::-1])
    beside = np.delete(beyond - SLIVER * half, k)
    if np.any(beside > 0.0):
        return None
    side = 1 if y[k] >= 0.0 else -1
    return "face", tip, next(f for f in b.faces() if f.name[1:] == (k, side)), 1.0


def _lean(at, a, face):
    return np.linalg.norm(np.cross(at.axes(a, a.frame)[:, 2], at.axes(face, face.frames[0])[:, 2]))


def _rolls(at, a, b, tip):
    return tip.name[0] == "rim point" and _lean(at, a, b.faces()[0]) > LEANING


def _rim(at, rim, a, b):
    face = b.faces()[0]
    return ("rim", rim, face, 1.0) if _lean(at, a, face) > LEANING else None


def _near_lines(at, a, b, margin):
    """Lines of `a`: of edges those that reach the ball round `b`."""
    out = []
    for line in a.lines():
        p, q = at.points(line)
        near_enough = np.linalg.norm(0.5 * (p + q) - at.middle(b)) <= 0.5 * np.linalg.norm(q - p) + at.extent(b) + margin
        if line.name[0] == "axis" or near_enough:
            out.append(line)
    return out


def _crossing(at, first, second, a, b, margin):
    """Two lines that cross between their ends, face each other and, where they penetrate, do so within both solids."""
    ends, others = at.points(first), at.points(second)
    d, e = (x[1] - x[0] for x in (ends, others))
    if np.linalg.norm(np.cross(d, e)) < PARALLEL * np.linalg.norm(d) * np.linalg.norm(e):
        return None
    s, t = touching.parts_of_lines(np, *ends, *others)
    if max(abs(2.0 * s - 1.0), abs(2.0 * t - 1.0)) > 1.0 + SLIVER:
        return None
    n = np.cross(d, e)
    if second.name[0] == "edge":
        way = _outward(at, second, b)
    elif first.name[0] == "edge":
        way = -_outward(at, first, a)
    else:
        way = ends[0] - others[0]
    meeting = ("line", first, second, 1.0 if n @ way >= 0.0 else -1.0)
    gap, n, c = at.meeting(*meeting)
    if not -min(at.sizes(a)[0], at.sizes(b)[0]) < gap <= margin:
        return None
    for line, way in ((first, -n), (second, n)):
        if line.name[0] == "edge" and np.any(at.axes(line, line.frames[0])[:, 1:].T @ way < -LEAN):
            return None
    outside = -LEAN * gap + SLIVER * min(at.extent(a), at.extent(b))
    if gap < 0.0 and any(s.kind != "hull" and at.depth(s, c) < -outside for s in (a, b)):
        return None  # of hulls the least width says enough
    return meeting


def shown(at, pair, found, most):
    """Those of a pair's meetings that are no deeper than the solids overlap, by the least overlap along a normal listed or of a flat side."""
    if all(gap >= -most for *_, gap in found):
        return found

    def overlap(a, b, n):
        return at.support(a, -n) + at.support(b, n) - (at.middle(a) - at.middle(b)) @ n

    a, b = pair.first, pair.second
    solids, overlaps = {a.name: a, b.name: b}, []
    for kind, x, y, sign, _ in found:
        overlaps.append(overlap(solids[x.of], solids[y.of], at.meeting(kind, x, y, sign)[1]))
    for solid in (a, b):
        normals = [at.axes(face, solid.frame)[:, 2] for face in solid.faces()]
        overlaps += [overlap(a, b, side * n) for n in normals for side in (-1.0, 1.0)]
    depth = max(0.0, min(overlaps))
    return [meeting for meeting in found if meeting[-1] >= -depth - most]


def _outward(at, edge, solid):
    """A direction out of a solid at its edge."""
    if solid.kind == "hull":
        return at.axes(edge, solid.frame)[:, 1:].sum(axis=1)
    return at.points(edge).mean(axis=0) - at.middle(solid)


def contacts(now, ahead, rates, pairs, h, rest_gap, gravity):
    """Contacts of pairs of solids for a stage of length h that begins `now` and would end `ahead` if nothing changed the motion."""
    out, most = [], DEEP * h * h
    for pair in pairs:
        margin = near(now, pair, rates, h, rest_gap, abs(gravity) * h * h)
        if margin is None:
            continue
        found = meetings(now, pair, margin)
        if "half space" not in (pair.first.kind, pair.second.kind):
            found = shown(now, pair, found, most)
        seen = {(a.of, a.name, b.name) for _, a, b, *_ in found}
        for kind, a, b, sign, _ in meetings(ahead, pair, margin):
            gap = now.meeting(kind, a, b, sign)[0]
            if gap >= -most and (a.of, a.name, b.name) not in seen:
                found.append((kind, a, b, sign, gap))
        for kind, a, b, sign, gap in found:
            deep = gap < -most and pair.compliance is None
            out.append(Contact(kind, a, b, pair.friction, pair.compliance, pair.kappa, sign, deep=deep))
    return out
