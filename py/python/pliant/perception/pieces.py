"""Seen pieces of a rope as curves in space, and their order along it."""

from dataclasses import dataclass

import numpy as np

from .._pliant import InputError
from ._libraries import library
from .camera import Array, Camera, Mask
from .strands import Strand, directions

# Half the window in which depths are taken [px]: half the rope's width, within these.
WINDOW = (1, 4)
# Depths are taken from the middle of the rope, to this part of its radius: beyond, they mix with what lies behind.
MIDDLE = 0.75
# Sine of the angle between rope and view below which the surface is taken no further from the middle: there the rope is seen from its end.
END_ON = 0.3
# Valid depths in a window, below which it is not used.
FEW = 2
# Noise of an averaged point across the rope [px], and of its depth [m], at least: pixels are squares, and depths are rounded.
PIXEL_NOISE, DEPTH_NOISE = 0.05, 2e-5
# Errors that do not average out: of a mask's middle [px], and of the surface's offset [radii].
MIDDLE_BIAS, SURFACE_BIAS = 0.15, 0.08
# Samples of a curve per averaged point.
SAMPLES = 6
# Pieces that are put in order without an estimate from before: more make more orders than a frame has time for.
MOST_PIECES = 8


@dataclass(frozen=True)
class Piece:
    """A curve in the world: points (m, 3) [m], the standard deviation of their distance from the rope (m,) [m], and a pixel there [m]."""

    points: Array
    sigma: Array
    pixel: float

    def reversed(self) -> "Piece":
        return Piece(self.points[::-1], self.sigma[::-1], self.pixel)

    def cut(self, begin: float, end: float) -> "Piece":
        """Without its parts before the arc length `begin` and after `end` [m]."""
        s = arc(self.points)
        begin, end = max(0.0, begin), min(float(s[-1]), end)
        inner = s[(s > begin) & (s < end)]
        at = np.concatenate([[begin], inner, [end]])
        points = np.stack([np.interp(at, s, c) for c in self.points.T], axis=1)
        return Piece(points, np.interp(at, s, self.sigma), self.pixel)

    @property
    def length(self) -> float:
        """[m]"""
        return float(arc(self.points)[-1])

    def direction(self, last: bool, over: float) -> Array:
        """Unit tangent at an end, in the order of the points: that of a parabola through points over a length [m] from the end."""
        points = self.points[::-1] if last else self.points
        s = arc(points)
        near = s <= max(over, s[min(len(s) - 1, 3)])
        order = 2 if near.sum() > 4 else 1
        slope = np.polyfit(s[near], points[near], order)[-2]
        return (-slope if last else slope) / max(1e-12, float(np.linalg.norm(slope)))


def arc(points: Array) -> Array:
    """Arc lengths (m,) of points (m, 3)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def piece(strand: Strand, mask: Mask, depth: Array, camera: Camera, radius: float, width: float, depth_noise: float) -> Piece | None:
    """The smoothed curve of a strand's middle; None if too few of its depths are valid."""
    half = int(np.clip(round(0.5 * width), *WINDOW))
    surface, scatter = _depths(strand.pixels, mask, depth, camera, radius, half)
    good = strand.clear & np.isfinite(surface)
    if good.sum() < 4:
        return None
    middle = surface + _to_middle(strand.pixels, surface, good, camera, radius, width)
    t = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strand.pixels, axis=0), axis=1)))
    data = np.column_stack([strand.pixels, middle])
    t_bin, mean, count = _averaged(t[good], data[good], 2 * half + 1)
    if len(mean) < 2:
        return None
    noise = _noise(mean, scatter, count)
    curve, freedom = _spline(t_bin, mean, noise)
    at = np.linspace(t[0], t[-1], SAMPLES * max(4, len(mean)))
    value = curve(np.clip(at, t_bin[0], t_bin[-1]))
    # averages end before the strand does: from there straight on
    slopes = curve(np.array([t_bin[0], t_bin[-1]]), 1)
    value += np.where((at < t_bin[0])[:, None], (at - t_bin[0])[:, None] * slopes[0], 0.0)
    value += np.where((at > t_bin[-1])[:, None], (at - t_bin[-1])[:, None] * slopes[1], 0.0)
    pixel = float(np.median(value[:, 2])) / camera.f
    across = pixel**2 * (noise[0] ** 2 * freedom + MIDDLE_BIAS**2)
    along_ray = noise[2] ** 2 * freedom + (SURFACE_BIAS * radius) ** 2 + depth_noise**2
    sigma = np.full(len(at), np.sqrt(across + along_ray))
    return Piece(camera.lift(value[:, :2], value[:, 2]), sigma, pixel)


def _depths(pixels: Array, mask: Mask, depth: Array, camera: Camera, radius: float, half: int) -> tuple[Array, float]:
    """Depth (n,) [m] of the rope's nearest line at each point of a strand, and the scatter of one pixel [m].

    Each pixel of the window is moved by r − r √(1 − t²) from where the round surface falls away to the side.
    """
    along = directions(pixels, 2.0 * half + 1.0)
    step = np.arange(-half, half + 1)
    dv, du = (d.ravel() for d in np.meshgrid(step, step, indexing="ij"))
    at = np.round(pixels).astype(int)[:, None, :] + np.stack([du, dv], axis=-1)
    u = np.clip(at[..., 0], 0, mask.shape[1] - 1)
    v = np.clip(at[..., 1], 0, mask.shape[0] - 1)
    z = np.where(mask[v, u], depth[v, u], np.nan)
    away = at - pixels[:, None, :]
    side = away[..., 1] * along[:, None, 0] - away[..., 0] * along[:, None, 1]
    rough = float(np.nanmedian(z)) if np.isfinite(z).any() else np.nan
    across = side * rough / (camera.f * radius)
    # a rope thinner than a pixel has no pixel within its middle but the nearest
    usable = (np.abs(across) < MIDDLE) | (np.abs(side) < 0.5)
    z = np.where(usable, z - radius * (1.0 - np.sqrt(1.0 - np.minimum(np.abs(across), MIDDLE) ** 2)), np.nan)
    enough = np.isfinite(z).sum(axis=1) >= FEW
    median = np.full(len(z), np.nan)
    if enough.any():
        median[enough] = np.nanmedian(z[enough], axis=1)
    spread = np.abs(z[enough] - median[enough, None])
    return median, 1.4826 * float(np.nanmedian(spread)) if enough.any() else 0.0


def _to_middle(pixels: Array, surface: Array, good: Mask, camera: Camera, radius: float, width: float) -> Array:
    """Depth from the nearest line of the surface to the rope's middle (n,) [m], r/sin α along the ray."""
    index = np.arange(len(pixels))
    filled = np.interp(index, index[good], surface[good])
    smooth = library("scipy.ndimage").gaussian_filter1d(filled, max(2.0, width), mode="nearest")
    points = camera.lift(pixels, smooth)
    k = max(2, round(2.0 * width))
    way = points[np.minimum(index + k, len(index) - 1)] - points[np.maximum(index - k, 0)]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    rays = camera.rays(pixels)
    size = np.linalg.norm(rays, axis=1)
    cosine = np.einsum("ij,ij->i", way @ camera.rotation, rays) / size
    return radius / (np.sqrt(np.maximum(1.0 - cosine**2, END_ON**2)) * size)


def _averaged(t: Array, data: Array, step: int) -> tuple[Array, Array, int]:
    """Means over stretches of `step` pixels of the path, so that their noises are about independent."""
    group = np.floor((t - t[0]) / step).astype(int)
    count = np.bincount(group)
    kept = count >= max(1, step // 2)
    kept |= count.max() < max(1, step // 2)
    sums = [np.bincount(group, c)[kept] / count[kept] for c in (t, *data.T)]
    return sums[0], np.stack(sums[1:], axis=1), step


def _noise(mean: Array, scatter: float, count: int) -> Array:
    """Standard deviations (3,) of averaged (u, v, depth): of third differences, to which a smooth curve adds little."""
    floor = np.array([PIXEL_NOISE, PIXEL_NOISE, DEPTH_NOISE])
    if len(mean) < 8:
        # too few to tell noise from bends: that of squares of one pixel, and of medians of the window
        return np.maximum(floor, [0.2, 0.2, 1.25 * scatter / count])
    third = np.abs(np.diff(mean, 3, axis=0))
    noise = 1.4826 * np.median(third, axis=0) / np.sqrt(20.0)
    noise[:2] = np.sqrt((noise[:2] ** 2).mean())
    return np.maximum(floor, noise)


def _spline(t: Array, mean: Array, noise: Array):
    """The smoothing spline, and the part of the noise's variance that it keeps."""
    order = min(3, len(mean) - 1)
    # the residual of m points that the curve has not used up
    budget = max(0.0, 3.0 * (len(mean) - np.sqrt(2.0 * len(mean)))) if len(mean) > order + 1 else 0.0
    spline, _ = library("scipy.interpolate").make_splprep((mean / noise).T, u=t, k=order, s=budget)

    def curve(at: Array, derivative: int = 0) -> Array:
        # coordinates come first, points second
        return spline(at, nu=derivative).T * noise

    freedom = min(1.0, (len(spline.t) - order - 1) / len(mean))
    return curve, freedom


def ordered(pieces: list[Piece], begin: Array | None, end: Array | None, known: Array) -> list[Piece]:
    """The pieces along the rope, each in its direction.

    begin, end: where the rope's ends are held. known (m, 3): the last estimate's nodes, or one point near the first.
    """
    if len(known) > 1:
        return _by_reference(pieces, known)
    if len(pieces) > MOST_PIECES:
        text = "clean the mask, or give the nodes of the last estimate as `reference`"
        raise InputError(f"the mask has {len(pieces)} pieces, but at most {MOST_PIECES} can be put in order: {text}")
    chain = _shortest_chain(pieces, begin, end)
    if begin is None and end is None:
        ends = [np.linalg.norm(p - known[0]) for p in (chain[0].points[0], chain[-1].points[-1])]
        if ends[1] < ends[0]:
            chain = [p.reversed() for p in reversed(chain)]
    return chain


def _by_reference(pieces: list[Piece], known: Array) -> list[Piece]:
    s = arc(known)
    placed = []
    for p in pieces:
        at = along_reference(p.points[:: max(1, len(p.points) // 12)], known, s)
        slope = np.polyfit(np.linspace(0.0, 1.0, len(at)), at, 1)[0]
        placed.append((float(np.mean(at)), p if slope >= 0.0 else p.reversed()))
    return [p for _, p in sorted(placed, key=lambda pair: pair[0])]


def along_reference(points: Array, known: Array, s: Array) -> Array:
    """Arc lengths (m,) [m] of the places on a polyline that are nearest to points."""
    edges = np.diff(known, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", edges, edges), 1e-18)
    way = points[:, None] - known[:-1]
    part = np.clip(np.einsum("kij,ij->ki", way, edges) / square, 0.0, 1.0)
    distance = np.linalg.norm(way - part[..., None] * edges, axis=2)
    best = np.argmin(distance, axis=1)
    rows = np.arange(len(points))
    return s[best] + part[rows, best] * np.sqrt(square[best])


def _shortest_chain(pieces: list[Piece], begin: Array | None, end: Array | None) -> list[Piece]:
    """Order and directions with the least sum of gaps, each the longer the more the rope must turn in it (Held and Karp's recursion)."""
    ways = [w for p in pieces for w in (p, p.reversed())]
    n = len(ways)
    tangent = [(w.direction(False, 8 * w.pixel), w.direction(True, 8 * w.pixel)) for w in ways]

    def gap(a: Array, ta: Array | None, b: Array, tb: Array | None) -> float:
        chord = b - a
        size = float(np.linalg.norm(chord))
        way = chord / max(1e-9, size)
        turn = sum(0.5 * (1.0 - float(t @ way)) for t in (ta, tb) if t is not None)
        return size * (1.0 + turn)

    best = {(1 << (k // 2), k): (0.0 if begin is None else gap(begin, None, w.points[0], tangent[k][0]), -1) for k, w in enumerate(ways)}
    join = [
        [0.0 if i // 2 == j // 2 else gap(ways[i].points[-1], tangent[i][1], ways[j].points[0], tangent[j][0]) for j in range(n)]
        for i in range(n)
    ]
    full = (1 << len(pieces)) - 1
    for used in range(1, full + 1):
        for i in range(n):
            if (used, i) not in best:
                continue
            for j in range(n):
                more = used | 1 << (j // 2)
                cost = best[used, i][0] + join[i][j]
                if more != used and (more, j) not in best or more != used and cost < best[more, j][0]:
                    best[more, j] = (cost, i)
    last = [best[full, k][0] + (0.0 if end is None else gap(w.points[-1], tangent[k][1], end, None)) for k, w in enumerate(ways)]
    k, used, out = int(np.argmin(last)), full, []
    while k >= 0:
        out.append(ways[k])
        used, k = used & ~(1 << (k // 2)), best[used, k][1]
    return out[::-1]
