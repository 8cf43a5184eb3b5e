"""What a system of the blind batch is: a generator of readings, what may be hidden in it, and the scene that lacks it.

A system draws a *setup* from a seed: sizes, excitations, rates. A setup knows

    knobs       numbers of the generator that may be off; zero is what the scene says
    causes      the library's candidates, each a name, an object and the knobs it frees
    outside     effects that no candidate describes
    free        knobs that the scene declares free, and guesses wrongly

and simulates readings for any list of (record, changes of knobs). Everything else, the oracle, the draw and the score, is common.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

Changes = dict[str, float]
Job = tuple[int, Changes]


@dataclass(frozen=True)
class Knob:
    """A number of the generator.

    `step`: change to take differences with. `largest`: change that is still the physics meant. `path`, `scene`: pliant's name of the
    number and its value in the scene, whence its true value is scene + change, or `value(change)`.
    """

    step: float
    largest: float
    path: str = ""
    scene: float = 0.0
    one_sided: bool = False  # only positive changes exist
    positive: bool = False  # the true value is more than zero
    value: Callable[[float], float] | None = field(default=None, compare=False)

    @property
    def least(self) -> float:
        """The most negative change."""
        return 0.0 if self.one_sided else max(-self.largest, -0.9 * self.scene) if self.positive else -self.largest

    def true(self, change: float) -> float:
        return self.scene + change if self.value is None else self.value(change)


def shown_area(spread: np.ndarray) -> float:
    """Mean area [m²] that a box shows, a quarter of its surface, with these roots of second moments over the mass [m]: half edges √3 times them."""
    a, b, c = math.sqrt(3.0) * np.asarray(spread)
    return float(2.0 * (a * b + b * c + c * a))


def stokes(spread: np.ndarray) -> float:
    """6π r [m] of the sphere that shows as much: its drag by viscosity and speed."""
    return 6.0 * math.pi * math.sqrt(shown_area(spread) / math.pi)


@dataclass(frozen=True)
class Cause:
    """A candidate. `points`: whole changes that stand for it where it has no derivative, the best of which counts."""

    name: str
    object: str
    knobs: tuple[str, ...]
    points: tuple[Changes, ...] = ()
    also: dict[str, float] = field(default_factory=dict)  # true values of its further numbers, by path
    hidden: bool = True  # whether it is drawn as a hidden effect

    @property
    def key(self) -> str:
        return f"{self.name}:{self.object}" if self.object else self.name


class Setup:
    """A system drawn from a seed; its own kinds fill in these attributes."""

    system: str
    roles: tuple[str, ...]  # of the records
    knobs: dict[str, Knob]
    causes: dict[str, Cause]
    outside: dict[str, tuple[str, ...]]
    values: dict[str, tuple[str, ...]]  # wrong numbers of the scene that no candidate stands for
    free: tuple[str, ...]
    substeps: int  # steps of the scene in a sample
    coarse: int = 1  # those of a scene whose step is too long
    starts: int = 0  # unknown numbers of a record's beginning: knobs start:0 to start:n-1
    start_steps: tuple[float, ...] = ()
    sigma: float  # of the readings' noise, in their unit
    cache: Path | None = None  # where derivatives are kept, of setups that are the same for all seeds; `sources`: modules they depend on
    sources: tuple = ()

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        """Readings (samples, channels) without noise; by the fitter's step and interpolation where rule is "scene"."""
        raise NotImplementedError

    def refine(self) -> None:
        """A shorter step for the scene."""
        self.substeps *= 2

    def coarsen(self) -> None:
        """A step of the scene that is too long."""
        self.substeps = self.coarse

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        """Scene and logs; `guess`: values of the free paths in the scene; `missing`: whether readings may be NaN."""
        raise NotImplementedError

    @property
    def fitted(self) -> list[int]:
        return [r for r, role in enumerate(self.roles) if role == "fit"]


def turned(y: np.ndarray, changes: Changes) -> np.ndarray:
    """Markers' readings (samples, markers, 3) under faults of their sensor: knobs scale, rotation0 to 2, bias0 to 2."""
    from scipy.spatial.transform import Rotation

    rotation = np.array([changes.get(f"rotation{k}", 0.0) for k in range(3)])
    bias = np.array([changes.get(f"bias{k}", 0.0) for k in range(3)])
    if rotation.any():
        y = Rotation.from_rotvec(rotation).apply(y.reshape(-1, 3)).reshape(y.shape)
    return (1.0 + changes.get("scale", 0.0)) * y + bias


def sensor_knobs(radius: float) -> dict[str, Knob]:
    """Knobs of the markers' sensor; `radius` [m] of what it sees."""
    out = {"scale": Knob(1e-3, 0.2, "sensor.scale", 1.0), "delay": Knob(5e-4, 0.05, "sensor.time_offset")}
    out |= {f"rotation{k}": Knob(1e-3, 0.3, f"sensor.rotation[{k}]") for k in range(3)}
    return out | {f"bias{k}": Knob(1e-3 * radius, 0.3 * radius, f"sensor.bias[{k}]") for k in range(3)}


def sensor_causes() -> list[Cause]:
    three = lambda stem: tuple(f"{stem}{k}" for k in range(3))
    return [
        Cause("sensor_bias", "", three("bias")), Cause("frame_rotation", "", three("rotation")), Cause("length_scale", "", ("scale",)),
        Cause("time_offset", "", ("delay",)),
    ]  # fmt: skip
