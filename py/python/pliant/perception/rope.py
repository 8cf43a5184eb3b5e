"""Nodes of a rope from a mask and a depth image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._pliant import InputError
from .camera import Array, Camera, Mask, images, numbers, positive
from .hidden import hidden_stretch
from .pieces import Piece, along_reference, arc, ordered, piece
from .strands import strands

Held = tuple[Array | None, Array | None]

# Error of a tip [px].
TIP = 0.8
# Part of the length by which what is seen may differ from it where nothing may be hidden, or be longer than there is.
LENGTH_ERROR = 0.06
# Part of the length that must be seen.
SEEN = 0.15
# Directions at the ends of a hidden stretch are taken over so many widths of the rope.
ENDS = 4.0
# How far a hidden stretch strays typically, in half widths of the ellipse that its length leaves it.
STRAY = 0.2
# Error of the seen length: pixels at each cut end, and a part of the length.
CUT, SEEN_ERROR = 1.0, 0.004
# Share of more hidden length that goes to a straight stretch, relative to one that has its own length of slack.
STRAIGHT_SHARE = 0.01
# Nodes of a hidden stretch.
HIDDEN_NODES = 17


@dataclass(frozen=True)
class RopeEstimate:
    """Nodes of a rope, and how well they are known.

    nodes (n, 3): positions in the world [m], equally spaced along the curve, the first at the `start`.
    sigma (n,): standard deviation of a node's distance from the true one [m]: √(σ_x² + σ_y² + σ_z²).
    visible (n,): whether the node is seen; the others are reconstructed.
    reach (n,): radius [m] about the node that contains the true one if the seen ends of the hidden stretch are exact and its length is that
    found or at most two standard deviations more: at each length along it a rope is within two balls. 0 where the node is seen.
    seen_length: length of what is seen [m]. length: of the curve [m], which is the given one if that was given.
    settled: whether all hidden stretches are equilibria; if not, some are smooth curves of the right length alone.
    """

    nodes: Array
    sigma: Array
    visible: Mask
    reach: Array
    seen_length: float
    length: float
    settled: bool


def rope(
    mask: ArrayLike,
    depth: ArrayLike,
    camera: Camera,
    *,
    nodes: int,
    radius: float,
    length: float | None = None,
    reference: ArrayLike | None = None,
    start: ArrayLike | None = None,
    end: ArrayLike | None = None,
    round_ends: bool = True,
    load: ArrayLike = (0.0, 0.0, 0.0),
    depth_noise: float = 0.0,
) -> RopeEstimate:
    """Nodes of the rope that a mask shows, its hidden stretches reconstructed.

    mask (height, width): the rope's pixels, bool or two values. depth (height, width): metres along the camera's z; NaN, infinity and
    0 are no measurement. nodes: how many. radius: of the rope [m].

    length: the rope's [m]. Without it nothing may be hidden, and the curve's own is taken.
    reference: what tells the first node from the last: the position (3,) of the first [m] or of its gripper, or the nodes (m, 3)
    of the last estimate, which also order several pieces and share the hidden length out among them. Default: `start`, or `end`.
    start, end: positions (3,) [m] of the first and the last node where grippers hold them, or (2, 3) with the rope's direction there,
    from first to last. A held end may be hidden.
    round_ends: the mask goes on for one radius beyond free end nodes, as that of a capsule; False: it ends there.
    load (3,): ρA g/EI [1/m³], for hidden stretches that hang freely; zero on a table. See `hidden_stretch`.
    depth_noise: noise of depths that does not average out over a window [m].

    Steps: `strands` (skeleton, crossings, ends); the median of depths about each point, each moved from the surface to the middle,
    r √(1 − t²)/sin α along the ray with the lateral place t [radii] of the pixel and the angle α of ray and rope; a smoothing spline
    through (u, v, depth), where noises are independent, whose residual is that of the noise estimated from third differences
    (`scipy.interpolate.make_splprep`; Dierckx, "Curve and surface fitting with splines", 1993); the pieces in order; hidden
    stretches by `hidden_stretch`; nodes at equal arc lengths.

    Limits: no rings; the two strands at a crossing are taken to go straight on; the end of a rope that is hidden and not held is not
    found; nothing is known of contact in hidden stretches. InputError says what is wrong and what to do.
    """
    mask, depth = images(mask, depth)
    if not isinstance(nodes, int | np.integer) or nodes < 2:
        raise InputError(f"nodes is {nodes!r}, but must be a whole number of at least 2")
    radius = positive("radius", radius, "m")
    length = None if length is None else positive("length", length, "m")
    load = numbers("load", load, (3,))
    held = (_held("start", start), _held("end", end))
    known = _reference(reference, held)
    found = strands(mask)
    pieces = [p for s in found.strands if (p := piece(s, found.mask, depth, camera, radius, found.width, depth_noise)) is not None]
    if not pieces:
        text = "too few depths within the mask are valid, or its parts are too short to have a direction"
        raise InputError(f"the mask's {len(found.strands)} pieces have no curve: {text}")
    chain = ordered(pieces, _place(held[0]), _place(held[1]), known)
    chain = _trimmed(chain, held, radius if round_ends else 0.0, 2.0 * radius)
    curve = _assembled(chain, held, known, length, load, ENDS * 2.0 * radius)
    return curve.nodes(nodes, 0.0 if length is None else length)


def _held(name: str, value: ArrayLike | None) -> Array | None:
    """Position and, if given, direction of a held end, (1, 3) or (2, 3)."""
    if value is None:
        return None
    array = np.asarray(value, dtype=float)
    out = numbers(name, array, (3,) if array.ndim == 1 else (2, 3)).reshape(-1, 3)
    if len(out) == 2:
        if not np.linalg.norm(out[1]) > 0.0:
            raise InputError(f"{name}[1] is zero, but must be the rope's direction at the gripper; leave it out if it is not known")
        out[1] /= np.linalg.norm(out[1])
    return out


def _place(grip: Array | None) -> Array | None:
    return None if grip is None else grip[0]


def _reference(reference: ArrayLike | None, held: Held) -> Array:
    """Points (m, 3) that tell the direction; of one, the first node is the nearest."""
    if reference is not None:
        array = np.asarray(reference, dtype=float)
        return numbers("reference", array, (3,) if array.ndim == 1 else (None, 3)).reshape(-1, 3)
    if held[0] is None and held[1] is None:
        text = "give `start` or `end` (held ends), or `reference`: a point near the first node, or the nodes of the last estimate"
        raise InputError(f"nothing tells which end of the rope is the first: {text}")
    return np.empty((0, 3))


def _trimmed(chain: list[Piece], held: Held, cap: float, near: float) -> list[Piece]:
    """The chain with its outer ends at the rope's end nodes: before caps of the mask, or where a gripper holds it in sight."""
    out = list(chain)
    for side in (0, 1):
        k = -side
        grip = held[side]
        part = out[k] if side == 0 else out[k].reversed()
        if grip is None:
            cut = cap if part.length > 2.0 * cap else 0.0
        else:
            s = arc(part.points)
            distance = np.linalg.norm(part.points - grip[0], axis=1)
            nearest = int(np.argmin(distance))
            cut = float(s[nearest]) if distance[nearest] < near and s[nearest] < 0.5 * s[-1] else 0.0
        part = part.cut(cut, np.inf)
        out[k] = part if side == 0 else part.reversed()
    return out


@dataclass(frozen=True)
class _Stretch:
    """Part of the curve: points (m, 3), their standard deviations (m,), and whether they are seen; the length of a hidden one [m]."""

    points: Array
    sigma: Array
    seen: bool
    length: float


@dataclass(frozen=True)
class _Curve:
    stretches: list[_Stretch]
    settled: bool
    tips: float

    def nodes(self, n: int, length: float) -> RopeEstimate:
        """Equally spaced nodes, and what is known of them."""
        points = np.concatenate([s.points for s in self.stretches])
        sigma = np.concatenate([s.sigma for s in self.stretches])
        s = arc(points)
        total = float(s[-1])
        at = np.linspace(0.0, total, n)
        x = np.stack([np.interp(at, s, c) for c in points.T], axis=1)
        seen_length = sum(float(arc(p.points)[-1]) for p in self.stretches if p.seen)
        # places along the rope are as uncertain as its tips are, and as the length that was found differs from the known one
        along = np.hypot(self.tips, (total - length) / np.sqrt(12.0) if length else 0.0)
        visible, reach = np.zeros(n, bool), np.zeros(n)
        begin = 0.0
        for part in self.stretches:
            size = float(arc(part.points)[-1])
            inside = (at >= begin - 1e-9) & (at <= begin + size + 1e-9)
            if part.seen:
                visible |= inside
                reach[inside] = 0.0
            else:
                hidden = inside & ~visible
                reach[hidden] = _reach(x[hidden], (at[hidden] - begin) / max(size, 1e-12), part)
            begin += size
        return RopeEstimate(x, np.hypot(np.interp(at, s, sigma), along), visible, reach, seen_length, length or total, self.settled)


def _reach(x: Array, part: Array, stretch: _Stretch) -> Array:
    """Radius about x that contains every point within arc lengths part · ℓ of one end and (1 − part) · ℓ of the other."""
    a, b = stretch.points[0], stretch.points[-1]
    chord = float(np.linalg.norm(b - a))
    ra, rb = part * stretch.length, (1.0 - part) * stretch.length
    from_a, from_b = np.linalg.norm(x - a, axis=1) + ra, np.linalg.norm(x - b, axis=1) + rb
    # both balls meet in a circle at `along` from a; if that lies between the centres, their common part lies in the ball on that circle
    along = (chord**2 + ra**2 - rb**2) / max(2.0 * chord, 1e-12)
    circle = np.sqrt(np.maximum(ra**2 - along**2, 0.0))
    middle = a + along[:, None] * (b - a) / max(chord, 1e-12)
    lens = np.where((along >= 0.0) & (along <= chord), np.linalg.norm(x - middle, axis=1) + circle, np.inf)
    return np.minimum(lens, np.minimum(from_a, from_b))


def _assembled(chain: list[Piece], held: Held, known: Array, length: float | None, load: Array, over: float) -> _Curve:
    """Pieces and hidden stretches from the first node to the last."""
    seen = sum(p.length for p in chain)
    gaps = _gaps(chain, held, over)
    open_gaps = [g for g in gaps if g is not None]
    if length is None and open_gaps:
        text = "give its length as `length`, from which they are reconstructed"
        raise InputError(f"{len(open_gaps)} stretches of the rope are hidden, {sum(g.chord for g in open_gaps):.3g} m at least: {text}")
    if length is not None:
        _check_length(seen, length, open_gaps, len(chain))
    doubt = float(np.hypot(CUT * chain[0].pixel * np.sqrt(2.0 * len(open_gaps)), SEEN_ERROR * seen)) if open_gaps else 0.0
    lengths = iter(_shared(open_gaps, (length or 0.0) - seen, doubt, known))
    stretches: list[_Stretch] = []
    settled = True
    for k, gap in enumerate(gaps):
        if gap is not None:
            size = next(lengths)
            points, found = hidden_stretch(gap.a, gap.ta, gap.b, gap.tb, size, HIDDEN_NODES, load=load, aside=_aside(gap, known))
            settled &= found
            s = np.linspace(0.0, 1.0, HIDDEN_NODES)
            # a millimetre more of length bends a nearly straight stretch aside by many
            stray = STRAY * 0.5 * np.sqrt(max(0.0, (size + doubt) ** 2 - gap.chord**2)) * 4.0 * s * (1.0 - s)
            ends = np.interp(s, [0.0, 1.0], [gap.sigma[0], gap.sigma[1]])
            stretches.append(_Stretch(points, np.hypot(ends, stray), False, size + 2.0 * doubt))
        if k < len(chain):
            stretches.append(_Stretch(chain[k].points, chain[k].sigma, True, chain[k].length))
    return _Curve(stretches, settled, float(np.hypot(TIP * chain[0].pixel, doubt / 2.0)))


@dataclass(frozen=True)
class _Gap:
    """A hidden stretch from a to b with the rope's directions there, and the standard deviations of both ends [m]."""

    a: Array
    ta: Array
    b: Array
    tb: Array
    sigma: tuple[float, float]

    @property
    def chord(self) -> float:
        return float(np.linalg.norm(self.b - self.a))

    @property
    def natural(self) -> float:
        """Length of the arc of a circle that turns as much from end to end [m]."""
        half = 0.5 * float(np.arccos(np.clip(self.ta @ self.tb, -1.0, 1.0)))
        return self.chord * (half / np.sin(half) if half > 1e-6 else 1.0)


def _gaps(chain: list[Piece], held: Held, over: float) -> list[_Gap | None]:
    """What lies before, between and after the pieces; None where nothing is hidden."""
    out: list[_Gap | None] = []
    for k in range(len(chain) + 1):
        before = chain[k - 1] if k > 0 else None
        after = chain[k] if k < len(chain) else None
        if before is not None and after is not None:
            a, ta, sa = before.points[-1], before.direction(True, over), before.sigma[-1]
            b, tb, sb = after.points[0], after.direction(False, over), after.sigma[0]
        elif after is not None:
            if (grip := held[0]) is None:
                out.append(None)
                continue
            b, tb, sb = after.points[0], after.direction(False, over), after.sigma[0]
            a, sa = grip[0], 0.0
            ta = grip[1] if len(grip) == 2 else _mirrored(tb, b - a)
        else:
            assert before is not None
            if (grip := held[1]) is None:
                out.append(None)
                continue
            a, ta, sa = before.points[-1], before.direction(True, over), before.sigma[-1]
            b, sb = grip[0], 0.0
            tb = grip[1] if len(grip) == 2 else _mirrored(ta, b - a)
        gap = _Gap(a, ta, b, tb, (float(sa), float(sb)))
        # a piece that reaches a gripper to a pixel or two has nothing hidden before it
        pixel = (before or after).pixel  # type: ignore[union-attr]
        out.append(gap if gap.chord > 3.0 * pixel else None)
    return out


def _mirrored(t: Array, chord: Array) -> Array:
    """The direction at the other end of an arc of a circle over a chord."""
    way = chord / max(1e-12, float(np.linalg.norm(chord)))
    return 2.0 * float(t @ way) * way - t


def _aside(gap: _Gap, known: Array) -> Array | None:
    """The side to which the last estimate bent between the gap's ends."""
    if len(known) < 3:
        return None
    s = arc(known)
    begin, end = along_reference(np.stack([gap.a, gap.b]), known, s)
    middle = np.array([np.interp(0.5 * (begin + end), s, c) for c in known.T])
    return middle - 0.5 * (gap.a + gap.b)


def _check_length(seen: float, length: float, gaps: list[_Gap], pieces: int) -> None:
    text = "`length`, `radius`, the camera's intrinsics and the unit of depths must fit; is the mask of this rope alone?"
    if seen < SEEN * length:
        raise InputError(f"only {seen:.3g} m of {length:.3g} m are seen, less than {SEEN:.0%}: too little to know the shape from. {text}")
    least = seen + sum(g.chord for g in gaps)
    if least > length * (1.0 + LENGTH_ERROR):
        what = f"{seen:.3g} m are seen in {pieces} pieces" + (f", and gaps of {least - seen:.3g} m lie between" if gaps else "")
        raise InputError(f"{what}, but the rope is {length:.3g} m long: {text}")
    if not gaps and seen < length * (1.0 - LENGTH_ERROR):
        text = "an end is hidden. Give its gripper's position as `start` or `end`, or move the camera"
        raise InputError(f"{length - seen:.3g} m of {length:.3g} m are not seen, and no gap lies between pieces or held ends: {text}")


def _shared(gaps: list[_Gap], hidden: float, doubt: float, known: Array) -> list[float]:
    """The hidden length shared out among the gaps.

    Believed lengths are those of the last estimate, or of arcs of circles. They are changed by what the hidden length differs from
    their sum beyond its own doubt: within that, a smooth curve is the better guess.
    """
    if not gaps:
        return []
    if len(known) > 2:
        s = arc(known)
        believed = np.array([max(g.chord, float(np.ptp(along_reference(np.stack([g.a, g.b]), known, s)))) for g in gaps])
    else:
        believed = np.array([g.natural for g in gaps])
    chords = np.array([g.chord for g in gaps])
    more = hidden - float(believed.sum())
    more = np.sign(more) * max(0.0, abs(more) - doubt)
    slack = believed - chords
    if more < 0.0:
        kept = max(0.0, 1.0 + more / slack.sum()) if slack.sum() > 0.0 else 0.0
        return (chords + kept * slack).tolist()
    # a stretch that is believed straight stays nearly so: a millimetre too much bends it aside by many
    weight = slack + STRAIGHT_SHARE * believed
    return (believed + more * weight / weight.sum()).tolist()
