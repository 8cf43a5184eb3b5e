"""Scene families of the blind tests: one nominal rope, its grippers, markers and excitations each.

A family fixes everything but the hidden effect and the noise, so that its sensitivities are
computed once and serve every seed. All motions start at rest:

    d(t) = ramp(t / t_r) Σ_k A_k sin(2π f_k t + φ_k),    ramp(s) = s³ (10 - 15 s + 6 s²)  for s < 1

(displacement [m] of a gripper; t_r = 0.6 s), so that d, ḋ and d̈ vanish at t = 0 and a record
begins in the static equilibrium that a scene with `start = "equilibrium"` assumes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

RAMP_TIME = 0.6  # s


@dataclass(frozen=True)
class Motion:
    """Motion of one gripper: waves (direction·amplitude [m], frequency [Hz], phase [rad]) and a
    pitch wave (amplitude [rad], frequency, phase) about the y axis through its first node."""

    waves: tuple[tuple[tuple[float, float, float], float, float], ...] = ()
    pitch: tuple[float, float, float] = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Gripper:
    """A prescribed gripper; `nodes` in the order of the log's columns, `at` their rest positions [m]."""

    name: str
    nodes: tuple[int, ...]
    at: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class Family:
    """Nominal scene and records. Units as in the scene file (SI)."""

    name: str
    n: int
    length: float
    grippers: tuple[Gripper, ...]
    records: tuple[tuple[Motion, ...], ...]  # per record, one motion per gripper
    roles: tuple[str, ...]
    markers: tuple[int, ...]
    nominal: dict[str, float] = field(default_factory=dict, hash=False)
    free: tuple[str, ...] = ("EI",)  # declared free parameters: nuisance directions
    duration: float = 3.0
    rate: float = 200.0  # Hz, of the log
    step: float = 0.005  # s, of the fitter
    magnet: tuple[float, float, float] = (0.3, 0.25, -0.3)  # m, centre of the pull (not in library)

    @property
    def driven(self) -> list[int]:
        return [node for gripper in self.grippers for node in gripper.nodes]

    @property
    def free_nodes(self) -> slice:
        """The free nodes; grippers hold the ends only, so these are consecutive."""
        loose = [i for i in range(self.n) if i not in self.driven]
        assert loose == list(range(loose[0], loose[-1] + 1))
        return slice(loose[0], loose[-1] + 1)

    @property
    def times(self) -> np.ndarray:
        return np.arange(round(self.duration * self.rate) + 1) / self.rate


def driven_positions(family: Family, record: int, t: np.ndarray) -> np.ndarray:
    """Commanded positions of the driven nodes, (3, n_driven, len(t)) [m], in gripper order."""
    s = np.clip(t / RAMP_TIME, 0.0, 1.0)
    ramp = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    nodes = []
    for gripper, motion in zip(family.grippers, family.records[record], strict=True):
        shift = np.zeros((3, len(t)))
        for amplitude, frequency, phase in motion.waves:
            wave = np.sin(2.0 * np.pi * frequency * t + phase)
            shift += np.asarray(amplitude)[:, None] * (ramp * wave)
        size, frequency, phase = motion.pitch
        angle = size * ramp * np.sin(2.0 * np.pi * frequency * t + phase)
        cos, sin = np.cos(angle), np.sin(angle)
        first = np.asarray(gripper.at[0])
        for place in gripper.at:
            x, y, z = np.asarray(place) - first
            arm = np.stack([cos * x + sin * z, np.full_like(t, y), -sin * x + cos * z])
            nodes.append(first[:, None] + arm + shift)
    return np.stack(nodes, axis=1)


CABLE = {
    "rho": 0.05,  # kg/m
    "EA": 120.0,  # N
    "cs": 0.03,  # N·s
    "EI": 1.5e-3,  # N·m²
    "cb": 4.0e-5,  # N·m²·s
    "c1": 0.08,  # kg/(m·s)
    "c2": 0.005,  # kg/m²
    "tip": 0.0,  # kg
}

_L = 0.6
_EDGE_ONE = _L / 11

ONE_END = Family(
    name="one_end",
    n=12,
    length=_L,
    grippers=(Gripper("left", (0, 1), ((0.0, 0.0, 0.0), (_EDGE_ONE, 0.0, 0.0))),),
    records=(
        (Motion((((0.05, 0.0, 0.0), 0.8, 0.0), ((0.0, 0.04, 0.0), 0.5, 1.0)), (0.15, 0.6, 0.0)),),
        (Motion((((0.0, 0.0, 0.04), 0.9, 0.4), ((0.0, 0.04, 0.0), 1.0, 0.0)), (0.2, 0.4, 1.0)),),
        (Motion((((0.04, 0.0, 0.03), 0.5, 0.0), ((0.0, 0.04, 0.0), 0.9, 0.3)), (0.12, 0.8, 0.5)),),
    ),
    roles=("fit", "fit", "held_out"),
    markers=(3, 5, 7, 9, 11),
    nominal=CABLE,
)

_SPAN = 0.42
_EDGE_TWO = 0.7 / 12

TWO_ENDS = Family(
    name="two_ends",
    n=13,
    length=0.7,
    grippers=(
        Gripper("left", (0, 1), ((0.0, 0.0, 0.0), (_EDGE_TWO, 0.0, 0.0))),
        Gripper("right", (12,), ((_SPAN, 0.05, 0.02),)),
    ),
    records=(
        (
            Motion((((0.04, 0.0, 0.0), 0.8, 0.0), ((0.0, 0.05, 0.0), 1.2, 0.5)), (0.3, 0.6, 0.0)),
            Motion((((0.0, 0.0, 0.05), 1.1, 0.0), ((0.03, 0.0, 0.0), 0.5, 0.7))),
        ),
        (
            Motion((((0.0, 0.05, 0.0), 1.2, 0.0), ((0.0, 0.0, 0.04), 0.9, 0.2)), (0.2, 1.2, 0.5)),
            Motion((((0.0, 0.05, 0.0), 0.6, 1.0), ((0.04, 0.0, 0.0), 1.3, 0.0))),
        ),
        (
            Motion((((0.03, 0.05, 0.0), 1.0, 0.3),), (0.25, 0.9, 0.0)),
            Motion((((0.0, 0.0, 0.06), 0.7, 0.0), ((0.0, 0.04, 0.0), 1.4, 0.0))),
        ),
    ),
    roles=("fit", "fit", "held_out"),
    markers=(3, 5, 7, 9, 11),
    nominal=CABLE,
    magnet=(0.21, 0.25, -0.35),
)

PENDANT = Family(
    name="pendant",
    n=10,
    length=0.5,
    grippers=(Gripper("hand", (0,), ((0.0, 0.0, 0.0),)),),
    records=(
        (Motion((((0.05, 0.0, 0.0), 1.1, 0.0), ((0.0, 0.05, 0.0), 0.8, 0.6))),),
        (Motion((((0.0, 0.05, 0.0), 1.2, 0.0), ((0.0, 0.0, 0.05), 1.1, 0.0))),),
        (Motion((((0.05, 0.03, 0.0), 1.0, 0.8),)),),
    ),
    roles=("fit", "fit", "held_out"),
    markers=(2, 4, 6, 8, 9),
    nominal=CABLE,
    magnet=(0.2, 0.2, -0.5),
)

FAMILIES = {family.name: family for family in (ONE_END, TWO_ENDS, PENDANT)}
