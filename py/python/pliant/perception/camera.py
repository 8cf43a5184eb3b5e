"""A pinhole camera, and the checks that every function of this package makes of masks and depth images."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._pliant import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion.

    fx, fy: focal lengths [px]; cx, cy: principal point [px], in coordinates in which the centre of the first pixel is (0, 0).
    rotation (3, 3): axes of the camera in the world, as columns: x to the right of the image, y down, z along the view.
    position (3,): the camera's centre in the world [m].

    Pixels are (u, v): column, row. Depth is the coordinate along the camera's z [m], as depth cameras and renderers return it, not
    the distance from the centre. Undistort images of a lens beforehand.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    rotation: Array
    position: Array

    def __post_init__(self) -> None:
        for name in ("fx", "fy", "cx", "cy"):
            value = _number(f"camera.{name}", getattr(self, name), "the intrinsics of the calibration")
            if name[0] == "f" and value <= 0.0:
                raise InputError(f"camera.{name} is {value:g} px, but a focal length must be positive")
            object.__setattr__(self, name, value)
        rotation = numbers("camera.rotation", self.rotation, (3, 3))
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "position", numbers("camera.position", self.position, (3,)))
        error = max(float(np.abs(rotation.T @ rotation - np.eye(3)).max()), abs(float(np.linalg.det(rotation)) - 1.0))
        if error > ROTATION_ERROR:
            text = "its columns must be the camera's right-handed axes x (right), y (down), z (forward) in the world"
            raise InputError(f"camera.rotation is no rotation (off by {error:.2g}): {text}")

    @classmethod
    def looking_at(cls, target: ArrayLike, position: ArrayLike, *, f: float, size: tuple[int, int], up: ArrayLike = (0.0, 0.0, 1.0)):
        """A camera at `position` [m] that sees `target` [m] in the middle of an image of size (width, height) [px].

        f: focal length [px]. up: direction that is upward in the image; if the view is along it, the world's y is.
        """
        position, forward = numbers("position", position, (3,)), numbers("target", target, (3,)) - numbers("position", position, (3,))
        if not np.linalg.norm(forward) > 0.0:
            raise InputError("target and position are the same point: a camera looks at something else than itself")
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, numbers("up", up, (3,)))
        if np.linalg.norm(right) < ALONG_UP:
            right = np.cross(forward, [0.0, 1.0, 0.0])
        right = right / np.linalg.norm(right)
        rotation = np.column_stack([right, np.cross(forward, right), forward])
        return cls(f, f, (size[0] - 1) / 2.0, (size[1] - 1) / 2.0, rotation, position)

    def rays(self, pixels: ArrayLike) -> Array:
        """Directions in the camera's frame through pixels (…, 2), (…, 3), scaled to a depth of 1."""
        u, v = np.moveaxis(np.asarray(pixels, float), -1, 0)
        return np.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy, np.ones_like(u)], axis=-1)

    def lift(self, pixels: ArrayLike, depth: ArrayLike) -> Array:
        """Points in the world [m], (…, 3), seen at pixels (…, 2) with depths (…) [m]."""
        return (self.rays(pixels) * np.asarray(depth, float)[..., None]) @ self.rotation.T + self.position

    def project(self, points: ArrayLike) -> tuple[Array, Array]:
        """Pixels (…, 2) and depths (…) [m] of points in the world (…, 3) [m]; points behind the camera have depths below 0."""
        x, y, z = np.moveaxis((np.asarray(points, float) - self.position) @ self.rotation, -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy], axis=-1), z

    @property
    def f(self) -> float:
        """The mean focal length [px]."""
        return float(np.sqrt(self.fx * self.fy))


# Rounding of a rotation that was printed with four digits.
ROTATION_ERROR = 1e-4
# Sine of the angle between view and `up` below which the image's upward direction is taken from the world's y.
ALONG_UP = 1e-6


def numbers(name: str, value: Any, shape: tuple[int | None, ...]) -> Array:
    """`value` as finite float64 of a shape, in which None is any size."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not an array of numbers: {error}") from None
    if len(array.shape) != len(shape) or any(s is not None and s != a for a, s in zip(array.shape, shape, strict=True)):
        needed = ", ".join("any" if s is None else str(s) for s in shape)
        raise InputError(f"{name} has shape {array.shape}, but ({needed}{',' if len(shape) == 1 else ''}) is needed")
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name}{list(where)} is {array[where]}, but must be finite")
    return array


def positive(name: str, value: float, unit: str) -> float:
    """`value` as a finite number above zero."""
    value = _number(name, value, f"a length [{unit}]")
    if value <= 0.0:
        raise InputError(f"{name} is {value:g} {unit}, but must be positive")
    return value


def _number(name: str, value: Any, source: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} is {value!r}, but must be a number: {source}") from None
    if not np.isfinite(number):
        raise InputError(f"{name} is {number}, but must be finite: take it from {source}")
    return number


def images(given_mask: ArrayLike, given_depth: ArrayLike) -> tuple[Mask, Array]:
    """A checked mask and depth image of the same shape (height, width); the mask is not empty and ends within the image."""
    mask: NDArray[Any] = np.asarray(given_mask)
    if mask.ndim != 2 or min(mask.shape) < 3:
        raise InputError(f"mask has shape {mask.shape}, but an image (height, width) of at least 3 × 3 is needed")
    if mask.dtype != np.bool_:
        values = np.unique(mask)
        if len(values) > 2 or not np.issubdtype(mask.dtype, np.number) or not np.isfinite(values.astype(float)).all():
            raise InputError(f"mask has {len(values)} different values of type {mask.dtype}: threshold it, for example `mask > 127`")
        if 0 not in values and len(values):
            raise InputError(f"mask has no pixel that is 0 (values: {values.tolist()}): what is not the object must be 0 or False")
        mask = mask != 0
    depth: NDArray[Any] = np.asarray(given_depth)
    if depth.shape != mask.shape:
        text = "both must be of the same camera; register the depth to the colour image first"
        raise InputError(f"depth has shape {depth.shape}, but the mask has {mask.shape}: {text}")
    if not (np.issubdtype(depth.dtype, np.floating)):
        raise InputError(f"depth is {depth.dtype}, but must be metres as floats: millimetres as integers are `depth * 1e-3`")
    if not mask.any():
        raise InputError("mask is empty: the segmentation found nothing; look at the image, or keep the last estimate")
    border = np.zeros_like(mask)
    border[[0, -1]], border[:, [0, -1]] = True, True
    touching = np.argwhere(mask & border)
    if len(touching):
        v, u = touching[0]
        text = "what lies outside of it is unseen. Move the camera, or clear the border's pixels: then that part counts as hidden"
        raise InputError(f"mask touches the image's border in {len(touching)} pixels, the first at (u, v) = ({u}, {v}): {text}")
    usable = np.isfinite(depth) & (depth > 0.0)
    if not (usable & mask).any():
        raise InputError("depth is finite and positive nowhere in the mask: no depth was measured, or images do not belong together")
    return mask, np.where(usable, depth, np.nan).astype(float)
