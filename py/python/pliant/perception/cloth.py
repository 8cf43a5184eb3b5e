"""Nodes of a sheet that is folded over once, from a mask and a depth image."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .._pliant import InputError
from ._libraries import library
from .camera import Array, Camera, Mask, images, numbers, positive
from .hidden import hidden_stretch
from .pieces import arc

# Width of a bin across the fold [px].
BIN = 2.0
# Points in a bin, below which it is not used.
FEW = 8
# Part of the sheet's width about its middle that is used: at the sides rows are least straight.
INNER = 0.8
# Part of points beyond which a sheet's extent is not sought: pixels of the background in the mask.
OUTLIERS = 0.005
# Strips along the sheet in which its ends are sought, and how many of their outermost points count as noise.
STRIPS, OUTERMOST = 24, 2
# Part of the length that may be missing or too much without a fold.
FLAT = 0.04
# Part of the length that must be seen.
SEEN = 0.3
# The free edge of the upper layer is sought within this part of the length from where the known length puts it.
EDGE_SEARCH = 0.12
# A step is at least this part of the profile's height; a bin whose height is further than this from both layers, in steps, holds both.
STEP, MIXED = 0.3, 0.15
# Errors of places on an outline [px], of a seen length as a part of it, and of heights [m].
OUTLINE, SEEN_ERROR, HEIGHT = 1.0, 0.005, 5e-4
# How far a hidden stretch strays typically, in half widths of the ellipse that its length leaves it.
STRAY = 0.25
# Cosine of the angle between view and `up` that is still from above.
VIEW = 0.7
# Nodes of the hidden bend, and places tried for where it leaves the layer below.
BEND_NODES, TRIALS = 17, 7


@dataclass(frozen=True)
class ClothEstimate:
    """Nodes of a sheet, and how well they are known.

    nodes (n, m, 3): positions in the world [m]; row i is across the fold at the arc length i/(n − 1) from the first edge.
    sigma (n,): standard deviation of the distance of a row's nodes from the true ones [m].
    visible (n,): whether the row is seen.
    seen_length: of the profile [m]. fold: arc length at the fold's outermost line [m]; None if the sheet is not folded.
    settled: whether the hidden bend is an equilibrium.
    """

    nodes: Array
    sigma: Array
    visible: Mask
    seen_length: float
    fold: float | None
    settled: bool


def cloth(
    mask: ArrayLike,
    depth: ArrayLike,
    camera: Camera,
    *,
    nodes: tuple[int, int],
    size: tuple[float, float],
    edge: ArrayLike,
    thickness: float = 0.0,
    up: ArrayLike = (0.0, 0.0, 1.0),
) -> ClothEstimate:
    """Nodes of a rectangular sheet that lies open or is folded over once, seen from above.

    mask (height, width) and depth [m] as in `rope`. nodes (n, m): rows along the sheet, columns. size: its lengths along and across
    [m]. edge (2, 3): the ends of the first row [m], from a gripper, the last estimate, or the place where it lies; they give the
    direction of the rows, and the place of the first row where the upper layer hides it. thickness: of the sheet [m]; nodes are half
    of it below the seen surface. up (3,): out of the table.

    A row has the same place x along the sheet and height z for all of its nodes, so that the sheet is a profile (x, z) times a width,
    as the sheets of a fold are in CORD-SLS (arXiv:2606.14188). The profile is the median height over bins of x. Of its length S the
    known length L leaves L − S hidden: the lower layer from below the free edge of the upper one to the fold's outermost line, and the
    bend. The free edge is the step in height near to where that length puts it. The hidden part lies flat until it bends up to
    the outermost line with the tangent of the view; the bend is an equilibrium (`hidden_stretch`), and leaves the layer below where its
    energy is least, which is where its curvature vanishes.

    Limits: one fold, along the rows; a view from within about 30° of `up`; nothing hides the seen layer but small things. InputError
    says what is wrong and what to do.
    """
    mask, depth = images(mask, depth)
    n, m = _counts(nodes)
    along, across = positive("size[0]", size[0], "m"), positive("size[1]", size[1], "m")
    ends, up = numbers("edge", edge, (2, 3)), numbers("up", up, (3,))
    thickness = numbers("thickness", thickness, ()).item()
    frame, points, pixel = _points(mask, depth, camera, ends, up)
    if -frame[2] @ camera.rotation[:, 2] < VIEW:
        text = "place it above the sheet, within 45° of `up`"
        raise InputError(f"the camera looks at the sheet from {np.degrees(np.arccos(-frame[2] @ camera.rotation[:, 2])):.0f}° off: {text}")
    middle = 0.5 * (np.quantile(points[:, 1], OUTLIERS) + np.quantile(points[:, 1], 1.0 - OUTLIERS))
    inner = points[np.abs(points[:, 1] - middle) < 0.5 * INNER * across]
    x, z, noise = _profile(inner, pixel)
    z = z - 0.5 * thickness * np.sqrt(1.0 + np.gradient(z, x) ** 2).clip(1.0, 3.0)
    row0 = float((0.5 * (ends[0] + ends[1]) @ frame.T)[0])
    profile = _folded(x, z, inner, along, row0, pixel)
    return _rows(profile, frame, middle, (n, m), across, noise, pixel)


def _counts(nodes: tuple[int, int]) -> tuple[int, int]:
    if len(nodes) != 2 or any(not isinstance(k, int | np.integer) or k < 2 for k in nodes):
        raise InputError(f"nodes is {nodes!r}, but must be two whole numbers of at least 2: rows along the sheet, columns")
    return int(nodes[0]), int(nodes[1])


def _points(mask: Mask, depth: Array, camera: Camera, ends: Array, up: Array) -> tuple[Array, Array, float]:
    """Axes (3, 3) of the sheet as rows (along, across, up), the mask's points in them, and the size of a pixel there [m]."""
    labels, _ = library("scipy.ndimage").label(mask)
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    mask = sizes[labels] > 0.1 * sizes.max()
    v, u = np.nonzero(mask & np.isfinite(depth))
    points = camera.lift(np.column_stack([u, v]), depth[v, u])
    z = up / np.linalg.norm(up)
    y = ends[1] - ends[0]
    y = y - z * (z @ y)
    if np.linalg.norm(y) < 1e-6:
        raise InputError("edge has two ends at the same place, or one above the other: give both ends of the first row")
    y /= np.linalg.norm(y)
    x = np.cross(y, z)
    if x @ (np.median(points, axis=0) - 0.5 * (ends[0] + ends[1])) < 0.0:
        x = -x
    frame = np.stack([x, y, z])
    return frame, points @ frame.T, float(np.median(depth[v, u])) / camera.f


def _profile(points: Array, pixel: float) -> tuple[Array, Array, float]:
    """Places along the sheet and median heights, and the noise of those [m]."""
    low, high = _extent(points)
    count = max(4, int((high - low) / (BIN * pixel)))
    group = np.clip(np.floor((points[:, 0] - low) / (high - low) * count).astype(int), -1, count)
    order = np.argsort(group, kind="stable")
    edges = np.searchsorted(group[order], np.arange(count + 1))
    x, z, scatter = [], [], []
    for a, b in pairwise(edges):
        if b - a < FEW:
            continue
        inside = points[order[a:b]]
        x.append(inside[:, 0].mean())
        z.append(np.median(inside[:, 2]))
        scatter.append(1.4826 * np.median(np.abs(inside[:, 2] - z[-1])) * 1.25 / np.sqrt(b - a))
    if len(x) < 4:
        text = "the mask is too small, or hardly any depths in it are valid"
        raise InputError(f"the sheet has heights at {len(x)} places along it, but at least 4 are needed: {text}")
    x, z = np.array(x), np.array(z)
    # the ends themselves, with the heights of the bins there
    return np.concatenate([[low], x, [high]]), np.concatenate([[z[0]], z, [z[-1]]]), float(np.median(scatter))


def _extent(points: Array) -> tuple[float, float]:
    """Places along the sheet where it begins and ends [m]: medians over strips along it, each without its outermost points."""
    strip = np.floor((points[:, 1] - points[:, 1].min()) / (np.ptp(points[:, 1]) + 1e-12) * STRIPS).astype(int).clip(0, STRIPS - 1)
    sides = [np.sort(points[strip == k, 0]) for k in range(STRIPS)]
    sides = [s for s in sides if len(s) > 4 * OUTERMOST]
    if not sides:
        raise InputError(f"the sheet has only {len(points)} valid depths: the mask is too small, or the depth image is empty there")
    return float(np.median([s[OUTERMOST] for s in sides])), float(np.median([s[-1 - OUTERMOST] for s in sides]))


@dataclass(frozen=True)
class _Profile:
    """Points (k, 2) of the profile from the first row on, whether they are seen, and standard deviations that come with being hidden."""

    points: Array
    seen: Mask
    stray: Array
    doubt: float
    fold: float | None
    settled: bool
    seen_length: float


def _folded(x: Array, z: Array, inner: Array, length: float, row0: float, pixel: float) -> _Profile:
    """The whole profile, of the seen one and the known length."""
    seen = _surface_length(x, z)
    if seen < SEEN * length or seen > length * (1.0 + FLAT):
        text = "`size`, the camera's intrinsics and the unit of depths must fit, and the mask must be of the sheet alone"
        raise InputError(f"{seen:.3g} m of the sheet's {length:.3g} m are seen along it, but from {SEEN:.0%} to 100 % can be: {text}")
    doubt = float(np.hypot(OUTLINE * pixel, SEEN_ERROR * seen))
    points = np.column_stack([x, z])
    if seen > length * (1.0 - FLAT):
        return _Profile(points, np.ones(len(x), bool), np.zeros(len(x)), doubt, None, True, seen)
    tip = x[-1]
    step = _free_edge(x, z, tip - (length - seen), EDGE_SEARCH * length)
    if step is None:
        # the upper layer hides the first row
        lower, upper = np.array([[row0, z.min()]]), points
    else:
        # the step lies between two bins, and both layers go on to it
        last, first = step
        place = _step_place(inner, x[last], x[first], 0.5 * (z[last] + z[first]))
        lower = np.vstack([points[: last + 1], [place, np.median(z[max(0, last - 3) : last + 1])]])
        upper = np.vstack([[place, np.median(z[first : first + 4])], points[first:]])
    start = lower[-1]
    peak = float(upper[-max(2, len(upper) // 8) :, 1].max())
    # the outermost line of a bend that is as round above as below lies in the middle of its height
    end = np.array([tip, min(float(upper[-1, 1]), 0.5 * (peak + start[1]))])
    upper = np.vstack([upper[:-1], end])
    below = _surface_length(lower[:, 0], lower[:, 1]) if len(lower) > 1 else 0.0
    seen = below + _surface_length(upper[:-1, 0], upper[:-1, 1]) + float(np.linalg.norm(upper[-1] - upper[-2]))
    hidden = length - seen
    bend, settled, flat = _bend(start, end, hidden)
    chord = float(np.linalg.norm(end - bend[0]))
    stray = STRAY * 0.5 * np.sqrt(max(0.0, (hidden - flat + doubt) ** 2 - chord**2))
    s = np.linspace(0.0, 1.0, len(bend))
    whole = np.concatenate([lower, bend, upper[::-1]])
    inside = np.concatenate([np.zeros(len(lower)), stray * 4.0 * s * (1.0 - s), np.zeros(len(upper))])
    visible = np.concatenate([np.full(len(lower), step is not None), np.zeros(len(bend), bool), np.ones(len(upper), bool)])
    fold = float(arc(np.concatenate([lower, bend]))[-1])
    return _Profile(whole, visible, inside, doubt, fold, settled, seen)


def _surface_length(x: Array, z: Array) -> float:
    """Length of a profile without its noise [m]: steps in height count where they are larger than the noise's."""
    smooth = library("scipy.ndimage").gaussian_filter1d(z, 1.5, mode="nearest") if len(z) > 6 else z
    return float(np.hypot(np.diff(x), np.diff(smooth)).sum())


def _free_edge(x: Array, z: Array, place: float, within: float) -> tuple[int, int] | None:
    """Indices of the last bin of the lower layer and the first of the upper one; None if there is no step near to `place` [m].

    `place` is where the free edge is if what is hidden is as long as the upper layer is wide; the bend adds little to that.
    """
    near = np.flatnonzero(np.abs(0.5 * (x[1:] + x[:-1]) - place) < within)
    if not len(near):
        return None
    # over three bins, of which the one in the middle may hold both layers
    ahead, back = np.minimum(near + 2, len(z) - 1), np.maximum(near - 1, 0)
    rise = z[ahead] - z[back]
    k = int(np.argmax(rise))
    below, above = z[back[k]], z[ahead[k]]
    if above - below < STEP * np.ptp(z):
        return None
    part = (z[back[k] : ahead[k] + 1] - below) / (above - below)
    last = int(back[k] + np.flatnonzero(part < MIXED)[-1])
    later = np.flatnonzero(z[last + 1 : ahead[k] + 1] > below + (1.0 - MIXED) * (above - below))
    return last, last + 1 + int(later[0])


def _step_place(inner: Array, begin: float, end: float, height: float) -> float:
    """Where the lower layer ends between two bins [m]: it takes the part of the way there that it has of the points."""
    between = inner[(inner[:, 0] > begin) & (inner[:, 0] < end), 2]
    return begin + (end - begin) * (float(np.mean(between < height)) if len(between) else 0.5)


def _bend(start: Array, end: Array, length: float) -> tuple[Array, bool, float]:
    """Profile (k, 2) from below the free edge to the fold's outermost line, whether it is an equilibrium, and its flat length [m]."""
    reach, rise = end[0] - start[0], max(1e-4, end[1] - start[1])
    # from no flat part to as much as leaves the bend its chord
    most = reach - max(0.0, (rise**2 - (length - reach) ** 2) / max(2.0 * (length - reach), 1e-9)) if length > reach else reach
    flats = np.clip(np.linspace(0.0, max(0.0, most * 0.999), TRIALS), 0.0, None)
    best = None
    for flat in flats:
        out = _bent(start, end, length, float(flat))
        if out is not None and (best is None or out[1] < best[1]):
            best = (*out, float(flat))
    if best is None:
        # the length is that of a straight line or less, by an error of measurement
        return np.linspace(start, end, BEND_NODES), False, 0.0
    step = flats[1] - flats[0]
    for flat in (best[3] - 0.5 * step, best[3] + 0.5 * step, best[3] - 0.25 * step, best[3] + 0.25 * step):
        out = _bent(start, end, length, float(flat)) if 0.0 < flat < most else None
        if out is not None and out[1] < best[1]:
            best = (*out, float(flat))
    points, _, settled, flat = best
    return np.concatenate([start[None], points]) if flat > 0.0 else points, settled, flat


def _bent(start: Array, end: Array, length: float, flat: float):
    """Points, ½ ∫ κ² ds and whether it is at rest, of a bend that begins after a flat part; None if it is too long for its length."""
    a, rest = np.array([start[0] + flat, 0.0, start[1]]), length - flat
    b = np.array([end[0], 0.0, end[1]])
    if rest <= np.linalg.norm(b - a) * 1.0005:
        return None
    points, settled = hidden_stretch(a, (1.0, 0.0, 0.0), b, (0.0, 0.0, 1.0), rest, BEND_NODES)
    edges = np.vstack([[1.0, 0.0, 0.0], np.diff(points, axis=0) / (rest / (BEND_NODES - 1)), [0.0, 0.0, 1.0]])
    energy = 0.5 * float((np.diff(edges, axis=0) ** 2).sum()) / (rest / (BEND_NODES - 1))
    return points[:, [0, 2]], energy, settled


def _rows(
    profile: _Profile, frame: Array, middle: float, nodes: tuple[int, int], across: float, noise: float, pixel: float
) -> ClothEstimate:
    """The grid at equal arc lengths."""
    s = arc(profile.points)
    at = np.linspace(0.0, s[-1], nodes[0])
    x, z = (np.interp(at, s, c) for c in profile.points.T)
    y = middle + across * (np.linspace(0.0, 1.0, nodes[1]) - 0.5)
    local = np.stack(np.broadcast_arrays(x[:, None], y, z[:, None]), axis=-1)
    index = np.clip(np.searchsorted(s, at), 1, len(s) - 1)
    visible = profile.seen[index] & profile.seen[index - 1]
    # places along: of the outline and of the seen length; across: of the outline; heights
    base = np.sqrt(profile.doubt**2 + (0.5 * OUTLINE * pixel) ** 2 + noise**2 + HEIGHT**2)
    sigma = np.hypot(base, np.interp(at, s, profile.stray))
    return ClothEstimate(local @ frame, sigma, visible, profile.seen_length, profile.fold, profile.settled)
