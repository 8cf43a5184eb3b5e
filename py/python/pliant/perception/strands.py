"""From a mask to ordered pixel paths along the middle of a rope: skeleton, branches, crossings.

1. Specks and holes that are smaller than the rope is wide are noise, and filled or dropped.
2. The skeleton is a graph of pixels with eight neighbours, without diagonals that two straight steps replace. Pixels with three or
   more neighbours are junctions; what lies between is a branch.
3. Branches that end freely and are shorter than the rope is wide are spurs of the outline, and are removed.
4. Junctions that a branch shorter than the rope is wide connects are one: there the rope crosses itself, and the skeleton has
   drawn the crossing apart. Of four branches those two continue each other that turn least in total (the least bending energy; Choi et
   al., "mBEST: Realtime Deformable Linear Object Detection Through Minimal Bending Energy Skeleton Pixel Traversals", RA-L 2023).
5. Each strand is moved to the middle of the mask across it, to a fraction of a pixel, and continued at its ends to where the mask
   ends.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._pliant import InputError
from ._libraries import library
from .camera import Array, Mask

Pixels = NDArray[np.intp]

# Lengths in units of the rope's width in the image.
SPUR = 1.5
CROSSING = 1.5
# Across so many widths from a crossing the other strand may hide this one, and the middle of the mask is not that of one strand.
NEAR_CROSSING = 1.0
# Parts of the mask smaller than this part of its largest are noise.
SPECK = 0.01
# A piece shorter than so many widths has no direction.
SHORTEST = 1.5


@dataclass(frozen=True)
class Strand:
    """A path through the mask: pixels (n, 2) as (u, v), about one apart; which of them lie on one strand alone (n,)."""

    pixels: Array
    clear: Mask


@dataclass(frozen=True)
class Strands:
    """All paths of a mask, its width across them [px], and the cleaned mask."""

    strands: list[Strand]
    width: float
    mask: Mask


def strands(mask: Mask) -> Strands:
    """Ordered paths of all pieces of a mask, the longest first."""
    mask = _without_specks(mask)
    box = library("scipy.ndimage").find_objects(mask.astype(np.uint8))[0]
    margin = 2
    rows, cols = (slice(max(0, s.start - margin), s.stop + margin) for s in box)
    offset = np.array([cols.start, rows.start], float)
    cropped, width, inside = _cleaned(mask[rows, cols])
    graph = _Graph(_skeleton(cropped), width, offset)
    found = []
    for pixels, crossings in graph.strands():
        if len(pixels) >= 2 and _length(pixels) + width >= SHORTEST * width:
            found.append(_centred(pixels, crossings, cropped, inside, width))
    if not found:
        text = "a rope is longer than wide: the mask is of something else, or the camera too far away"
        raise InputError(f"mask has no piece longer than {SHORTEST:g} of its width ({width:.1f} px): {text}")
    found.sort(key=lambda s: -len(s.pixels))
    full = np.zeros_like(mask)
    full[rows, cols] = cropped
    return Strands([Strand(s.pixels + offset, s.clear) for s in found], width, full)


def _without_specks(mask: Mask) -> Mask:
    """Without parts that are far smaller than the largest: single pixels all over an image would make all of it worth looking at."""
    labels, count = library("scipy.ndimage").label(mask, np.ones((3, 3)))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    return (sizes > SPECK * sizes.max())[labels]


def _cleaned(mask: Mask) -> tuple[Mask, float, Array]:
    """The mask without specks and pinholes, its width [px], and each pixel's distance to the outside."""
    ndimage, morphology = library("scipy.ndimage"), library("skimage.morphology")
    width = _width(mask)
    hole = max(1, int(width**2))
    filled = morphology.remove_small_holes(mask, max_size=hole)
    # a pixel goes with the majority around it: smooths an outline of single pixels without moving it, but would eat a thin line
    if width >= 3.0:
        filled = ndimage.uniform_filter(filled.astype(np.float32), 3) > 0.5
    kept = morphology.remove_small_objects(filled, max_size=hole, connectivity=2)
    if not kept.any():
        text = "it is noise, or an object as wide as long; clean the mask, or come closer"
        raise InputError(f"mask has {int(mask.sum())} pixels, but no piece larger than its own width of {width:.1f} px squared: {text}")
    kept = np.pad(kept[1:-1, 1:-1], 1)
    inside = ndimage.distance_transform_edt(kept)
    return kept, _width(kept), inside


def _width(mask: Mask) -> float:
    """Width of a strip [px], of the distances of its skeleton to the nearest pixel outside, which are half a pixel more than to its edge."""
    skeleton = library("skimage.morphology").skeletonize(mask)
    inside = library("scipy.ndimage").distance_transform_edt(mask)
    return max(1.0, 2.0 * float(np.median(inside[skeleton])) - 1.0)


def _skeleton(mask: Mask) -> Mask:
    return library("skimage.morphology").skeletonize(mask)


class _Graph:
    """Branches of a skeleton between junctions and free ends."""

    def __init__(self, skeleton: Mask, width: float, offset: Array):
        self.width, self.offset = width, offset
        self.skeleton = np.pad(skeleton, 1)
        # the shortest spur of each junction goes first: what continues the line there may be short as well, but is then no spur any more
        while True:
            self._trace()
            shortest: dict[int | None, _Branch] = {}
            for branch in filter(self._is_spur, self.branches):
                end = branch.ends[0] if branch.ends[1] is None else branch.ends[1]
                if end not in shortest or len(branch.pixels) < len(shortest[end].pixels):
                    shortest[end] = branch
            if not shortest:
                break
            for branch in shortest.values():
                self.skeleton.flat[branch.pixels] = False

    def _is_spur(self, branch: "_Branch") -> bool:
        free = [end is None for end in branch.ends]
        return sum(free) == 1 and len(branch.pixels) < SPUR * self.width

    def _trace(self) -> None:
        """Branches and clusters of junction pixels."""
        stride = self.skeleton.shape[1]
        pixels = np.flatnonzero(self.skeleton)
        near = _neighbours(self.skeleton, pixels, stride)
        junctions = {p for p in near if len(near[p]) >= 3}
        self.cluster = _components(junctions, near)
        self.branches: list[_Branch] = []
        done: set[int] = set()
        for start in near:
            if start in junctions or start in done:
                continue
            path = [start]
            done.add(start)
            ends: list[int | None] = []
            for direction in (0, 1):
                path.reverse()
                at = path[-1]
                while True:
                    onward = [p for p in near[at] if p not in done and p not in junctions]
                    # the first pixel has two ways; the first pass takes one of them
                    if not onward:
                        break
                    at = onward[0]
                    done.add(at)
                    path.append(at)
                touching = list(dict.fromkeys(self.cluster[p] for p in near[at] if p in junctions))
                if len(path) == 1 and direction == 1:
                    touching = touching[1:]
                ends.append(touching[0] if touching else None)
            closed = len(path) > 2 and ends == [None, None] and path[0] in near[path[-1]]
            self.branches.append(_Branch(path, (ends[0], ends[1]), closed))

    def place(self, pixel: int) -> Array:
        """(u, v) of a pixel in the cropped image."""
        row, col = divmod(pixel, self.skeleton.shape[1])
        return np.array([col - 1.0, row - 1.0])

    def where(self, pixel: int) -> str:
        u, v = self.place(pixel) + self.offset
        return f"(u, v) = ({u:.0f}, {v:.0f})"

    def strands(self) -> list[tuple[Array, Array]]:
        """Paths (n, 2) with the places of crossings on them (m, 2)."""
        joined = self._joined()
        middles = {c: np.mean([self.place(p) for p in joined[c].pixels], axis=0) for c in joined}
        following = self._following(joined)
        out, done = [], set()
        bridges = {id(b) for junction in joined.values() for b in junction.bridges}
        for k, branch in enumerate(self.branches):
            if branch.closed:
                text = "a rope with two ends has none in its mask alone; for a ring, cut the mask where a node is known"
                raise InputError(f"mask has a closed ring through {self.where(branch.pixels[0])}: {text}")
            for side in (0, 1):
                if id(branch) in bridges or k in done or following.get((k, side)) is not None:
                    continue
                path, crossings = self._follow(k, side, following, joined, middles, done)
                out.append((path, np.array(crossings).reshape(-1, 2)))
        lost = [b for k, b in enumerate(self.branches) if k not in done and id(b) not in bridges]
        if lost:
            text = "the mask there has no end of a rope; separate what touches"
            raise InputError(f"mask has a closed loop through {self.where(lost[0].pixels[0])} that no strand leads into: {text}")
        return out

    def _follow(self, k: int, side: int, following: Any, joined: Any, middles: Any, done: set[int]) -> tuple[Array, list[Array]]:
        """The path that begins at a side of a branch."""
        pieces: list[Array] = []
        crossings: list[Array] = []
        while True:
            done.add(k)
            pixels = [self.place(p) for p in self.branches[k].pixels]
            pieces.append(np.array(pixels if side == 0 else pixels[::-1]))
            onward = following.get((k, 1 - side))
            if onward is None or onward[0] in done:
                return np.concatenate(pieces), crossings
            cluster = self._of(joined, self.branches[k].ends[1 - side])
            if len(joined[cluster].sides) > 2:
                crossings.append(middles[cluster])
            k, side = onward

    def _of(self, joined: Any, cluster: int | None) -> int:
        return next(c for c in joined if cluster in joined[c].clusters)

    def _joined(self) -> dict[int, "_Junction"]:
        """Clusters that short branches connect, as one, with the sides of branches that leave them."""
        group = {c: c for c in set(self.cluster.values())}

        def root(c: int) -> int:
            while group[c] != c:
                c = group[c]
            return c

        bridges = [b for b in self.branches if None not in b.ends and len(b.pixels) < CROSSING * self.width]
        for branch in bridges:
            a, b = branch.ends
            group[root(a)] = root(b)  # type: ignore[index,arg-type]
        joined = {root(c): _Junction([], set(), [], []) for c in group}
        for c in group:
            joined[root(c)].clusters.add(c)
        for pixel, c in self.cluster.items():
            joined[root(c)].pixels.append(pixel)
        for k, branch in enumerate(self.branches):
            if any(branch is b for b in bridges):
                joined[root(branch.ends[0])].bridges.append(branch)  # type: ignore[arg-type]
                continue
            for side, end in enumerate(branch.ends):
                if end is not None:
                    joined[root(end)].sides.append((k, side))
        return joined

    def _following(self, joined: dict[int, "_Junction"]) -> dict[tuple[int, int], tuple[int, int]]:
        """Which side of which branch continues a side of a branch."""
        out = {}
        for junction in joined.values():
            sides = junction.sides
            if len(sides) in (0, 1):
                continue
            if len(sides) == 3 or len(sides) > 4:
                what = "a branch" if len(sides) == 3 else f"{len(sides)} branches that meet"
                text = "the rope touches itself end-on, or the mask has a part of something else; separate them or remove that part"
                raise InputError(f"mask has {what} at {self.where(junction.pixels[0])}: {text}")
            away = [self._direction(k, side) for k, side in sides]
            pairings = [((0, 1),)] if len(sides) == 2 else [((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2))]
            # two directions away from a crossing belong to a straight strand where they are opposite
            best = min(pairings, key=lambda pairs: sum(float(away[i] @ away[j]) for i, j in pairs))
            for i, j in best:
                out[sides[i]], out[sides[j]] = sides[j], sides[i]
        return out

    def _direction(self, k: int, side: int) -> Array:
        """Unit direction in which a branch leaves a junction, beyond where the strands merge."""
        pixels = self.branches[k].pixels if side == 0 else self.branches[k].pixels[::-1]
        first = min(int(0.5 * self.width), max(0, len(pixels) - 2))
        last = min(len(pixels) - 1, first + max(2, int(2.0 * self.width)))
        way = self.place(pixels[last]) - self.place(pixels[first])
        return way / max(1e-9, float(np.linalg.norm(way)))


@dataclass(frozen=True)
class _Branch:
    pixels: list[int]
    ends: tuple[int | None, int | None]
    closed: bool


@dataclass(frozen=True)
class _Junction:
    pixels: list[int]
    clusters: set[int]
    sides: list[tuple[int, int]]
    bridges: list[_Branch]


def _neighbours(skeleton: Mask, pixels: Pixels, stride: int) -> dict[int, list[int]]:
    """Neighbours of each pixel, without diagonals that two straight steps replace."""
    flat = skeleton.ravel()
    near: dict[int, list[int]] = {int(p): [] for p in pixels}
    for step, beside in ((1, ()), (stride, ()), (stride + 1, (1, stride)), (stride - 1, (-1, stride))):
        linked = flat[pixels + step]
        for b in beside:
            linked = linked & ~flat[pixels + b]
        for p in pixels[linked].tolist():
            near[p].append(p + step)
            near[p + step].append(p)
    return near


def _components(pixels: set[int], near: dict[int, list[int]]) -> dict[int, int]:
    """A number of its connected part for each pixel."""
    out: dict[int, int] = {}
    for pixel in pixels:
        if pixel in out:
            continue
        stack = [pixel]
        while stack:
            at = stack.pop()
            if at not in out:
                out[at] = pixel
                stack += [p for p in near[at] if p in pixels and p not in out]
    return out


def _length(pixels: Array) -> float:
    return float(np.linalg.norm(np.diff(pixels, axis=0), axis=1).sum())


def directions(pixels: Array, reach: float) -> Array:
    """Unit tangents (n, 2) of a path of pixels, by differences over about `reach` pixels to both sides."""
    k = max(1, round(reach))
    index = np.arange(len(pixels))
    ahead, back = np.minimum(index + k, len(pixels) - 1), np.maximum(index - k, 0)
    way = pixels[ahead] - pixels[back]
    return way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)


def _centred(pixels: Array, crossings: Array, mask: Mask, inside: Array, width: float) -> Strand:
    """A strand in the middle of the mask across it, continued to the mask's ends."""
    half = 0.5 * width
    trim = round(half)
    if len(pixels) > 2 * trim + 4 and trim > 0:
        # within half a width of its end a skeleton turns to a corner of the mask
        pixels = pixels[trim:-trim]
    pixels = _shifted(pixels, mask, width)
    pixels = np.concatenate([_extension(pixels[::-1], mask, width)[::-1], pixels, _extension(pixels, mask, width)])
    clear = np.ones(len(pixels), bool)
    for crossing in crossings:
        clear &= np.linalg.norm(pixels - crossing, axis=1) > NEAR_CROSSING * width + 1.0
    # where the mask is much wider than a strand, two lie beside each other
    v, u = np.clip(np.round(pixels.T[::-1]).astype(int), 0, np.array(mask.shape)[:, None] - 1)
    clear &= inside[v, u] < 0.8 * width + 1.5
    return Strand(pixels, clear)


def _shifted(pixels: Array, mask: Mask, width: float) -> Array:
    """Path whose points are in the middle of the mask along their normals."""
    smooth = library("scipy.ndimage").gaussian_filter1d(pixels, max(1.0, 0.25 * width), axis=0, mode="nearest")
    smooth[0], smooth[-1] = pixels[0], pixels[-1]
    along = directions(smooth, max(2.0, 0.5 * width))
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    reach = np.arange(-1.2 * width - 1.0, 1.2 * width + 1.0, 0.25)
    at = smooth[:, None, :] + reach[:, None] * normal[:, None, :]
    line = library("scipy.ndimage").map_coordinates(mask.astype(np.float32), [at[..., 1], at[..., 0]], order=1, mode="constant")
    solid = line > 0.5
    # the run of the mask through the path; another strand beside it is not part of it
    middle = len(reach) // 2
    upper = np.where(solid[:, middle:].all(axis=1), 0, np.argmin(solid[:, middle:], axis=1))
    lower = np.where(solid[:, : middle + 1].all(axis=1), 0, np.argmin(solid[:, : middle + 1][:, ::-1], axis=1))
    both = (upper > 0) & (lower > 0)
    shift = np.where(both, 0.125 * (upper - lower), 0.0)
    shift = np.clip(shift, -0.5 * width, 0.5 * width)
    return smooth + shift[:, None] * normal


def _extension(pixels: Array, mask: Mask, width: float) -> Array:
    """Points beyond a path's last one, straight on to where the mask ends."""
    if len(pixels) < 3:
        return np.empty((0, 2))
    back = pixels[max(0, len(pixels) - 1 - max(3, round(1.5 * width)))]
    way = (pixels[-1] - back) / max(1e-9, float(np.linalg.norm(pixels[-1] - back)))
    steps = np.arange(0.25, 2.0 * width + 2.0, 0.25)
    at = pixels[-1] + steps[:, None] * way
    line = library("scipy.ndimage").map_coordinates(mask.astype(np.float32), [at[:, 1], at[:, 0]], order=1, mode="constant")
    count = int(np.argmin(line > 0.5)) if not (line > 0.5).all() else 0
    # one a pixel, and the last where the mask ends
    chosen = at[3:count:4]
    return np.concatenate([chosen, at[count - 1 : count]]) if count and (count - 1) % 4 != 3 else chosen
