"""The oracle: what a tool could know, from the generator's own finite-difference sensitivities.

    s_j = ∂y/∂θ_j   central differences of the noise-free ODE (initial equilibria included)
    w(·)            AR(1) whitening: (x_k - φ x_{k-1})/(σ √(1-φ²)), first row x_0/σ
    u_j = w(s_j) with the nuisance directions (declared free parameters) projected out
    λ = |U_j d|² θ²  for an effect of size θ along the unit direction d of cause j
    ρ_jk = |P_k U_j d| / |U_j d|, P_k the projector on the span of cause k (a cosine if k is scalar)

y stacks the fit records' markers (T, 3, m) [m]. The initial state is the static equilibrium, hence
known ("rest"). Sensitivities are cached per family under /validation/out (not in the repository).
"""

from __future__ import annotations

import functools
import hashlib
import inspect
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2, norm

from validation.blind import families, rope_ode
from validation.blind.families import Family
from validation.blind.fitter_step import midpoint_rollout

CACHE = Path(__file__).resolve().parents[1] / "out" / "blind_cache"
ALPHA = 0.05

# Physical directions: key -> (generator parameter, component, difference step, path in pliant)
PHYSICAL = {
    "EI": ("EI", None, 3.0e-5, "cable.bend_stiffness"),
    "c1": ("c1", None, 2.0e-3, "cable.drag_linear"),
    "c2": ("c2", None, 5.0e-4, "cable.drag_quadratic"),
    "cb": ("cb", None, 5.0e-6, "cable.bend_damping"),
    "EA": ("EA", None, 2.0e-4, "cable.stretch_stiffness"),  # in compliance 1/EA [1/N]
    "tip": ("tip", None, 2.0e-5, "cable.tip_mass"),
    "wind0": ("wind", 0, 1.0e-2, "air.wind[0]"),
    "wind1": ("wind", 1, 1.0e-2, "air.wind[1]"),
    "wind2": ("wind", 2, 1.0e-2, "air.wind[2]"),
    "tilt0": ("tilt", 0, 1.0e-3, "gravity.tilt[0]"),
    "tilt1": ("tilt", 1, 1.0e-3, "gravity.tilt[1]"),
}
OUTSIDE_STEP = {
    "magnet": 2.0e-4,
    "hardening": 2.0e-2,
    "gradient": 2.0e-2,
    "curvature": 5.0e-3,
    "friction": 1.0e-6,
    "lag": 2.0e-3,
}
SENSOR = ("bias0", "bias1", "bias2", "rotation0", "rotation1", "rotation2", "scale", "delay")
SENSOR_PATH = {"bias": "sensor.bias", "rotation": "sensor.rotation"}


def causes(family: Family) -> dict[str, tuple[str, list[str]]]:
    """Candidates: key -> (pliant's name, its directions). One gripper_offset per gripper."""
    out = {
        "linear_drag": ("linear_drag", ["c1"]),
        "quadratic_drag": ("quadratic_drag", ["c2"]),
        "wind": ("wind", ["wind0", "wind1", "wind2"]),
        "gravity_tilt": ("gravity_tilt", ["tilt0", "tilt1"]),
        "extensibility": ("extensibility", ["EA"]),
        "internal_damping": ("internal_damping", ["cb"]),
        "sensor_bias": ("sensor_bias", ["bias0", "bias1", "bias2"]),
        "frame_rotation": ("frame_rotation", ["rotation0", "rotation1", "rotation2"]),
        "length_scale": ("length_scale", ["scale"]),
        "time_offset": ("time_offset", ["delay"]),
    }
    if family.n - 1 not in family.driven:
        out["tip_mass"] = ("tip_mass", ["tip"])
    for gripper in family.grippers:
        keys = [f"{gripper.name}.offset{i}" for i in range(3)]
        out[f"gripper_offset:{gripper.name}"] = ("gripper_offset", keys)
    return out


def path_of(key: str) -> str:
    """pliant's parameter path of a direction."""
    if key in PHYSICAL:
        return PHYSICAL[key][3]
    if key == "scale" or key == "delay":
        return {"scale": "sensor.scale", "delay": "sensor.time_offset"}[key]
    stem, index = key[:-1], key[-1]
    return f"{SENSOR_PATH.get(stem, stem)}[{index}]"


def change(family: Family, key: str, size: float) -> dict[str, float | list[float]]:
    """Generator parameters (absolute) when direction `key` is `size` off its nominal value."""
    if key in PHYSICAL:
        name, component, _, _ = PHYSICAL[key]
        if key == "EA":
            return {"EA": 1.0 / (1.0 / family.nominal["EA"] + size)}
        if component is None:
            return {name: family.nominal[name] + size}
        vector = [0.0] * {"wind": 3, "tilt": 2}[name]
        vector[component] = size
        return {name: vector}
    if ".offset" in key:
        name, index = key.split(".offset")
        vector = []
        for gripper in family.grippers:
            for _ in gripper.nodes:
                vector += [size if gripper.name == name and i == int(index) else 0.0 for i in range(3)]
        return {"offset": vector}
    return {key: size}


@dataclass
class Sensitivity:
    """Noise-free records and their derivatives; arrays (record, T, 3, marker)."""

    family: Family
    shape: np.ndarray  # (3, n) nominal rest shape
    y: np.ndarray
    y_dot: np.ndarray
    columns: dict[str, np.ndarray]  # direction -> ∂y/∂θ
    mismatch: np.ndarray  # fitter's midpoint minus ODE


@functools.cache
def sensitivity(family: Family) -> Sensitivity:
    """Sensitivities of a family, from the cache where the generator's source is unchanged."""
    text = repr(family) + inspect.getsource(rope_ode) + inspect.getsource(families.driven_positions)
    text += repr((PHYSICAL, OUTSIDE_STEP))
    path = CACHE / f"{family.name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.npz"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **_compute(family))
    data = dict(np.load(path))
    core = {key: data.pop(key) for key in ("shape", "y", "y_dot", "mismatch")}
    y, y_dot = core["y"], core["y_dot"]
    for i in range(3):
        data[f"bias{i}"] = np.broadcast_to(np.eye(3)[i][:, None], y.shape)
        data[f"rotation{i}"] = np.moveaxis(np.cross(np.eye(3)[i], np.moveaxis(y, 2, -1)), -1, 2)
    data["scale"], data["delay"] = y, -y_dot
    return Sensitivity(family, core["shape"], y, y_dot, data, core["mismatch"])


def _compute(family: Family) -> dict[str, np.ndarray]:
    """One batch: the nominal records, then ± each direction, record by record."""
    steps = {key: row[2] for key, row in PHYSICAL.items()}
    if family.n - 1 in family.driven:
        del steps["tip"]
    offsets = [k for name, (_, ks) in causes(family).items() if name.startswith("gripper") for k in ks]
    steps |= dict.fromkeys(offsets, 1.0e-4) | OUTSIDE_STEP
    one_sided = {"lag", "tip", "friction", "hardening"}
    variants: list[dict] = [{}]
    for key, step in steps.items():
        variants += [change(family, key, step), change(family, key, 0.5 * step if key in one_sided else -step)]
    n_records = len(family.records)
    shape = rope_ode.relaxed_shape(family)
    p = rope_ode.parameters(family, [v for v in variants for _ in range(n_records)])
    records = np.tile(np.arange(n_records), len(variants))
    q, v = rope_ode.simulate(family, p, records, shape)
    q, v = (by_record(family, x, n_records) for x in (q, v))  # (variant, record, T, 3, m)
    out = {"shape": shape, "y": q[0], "y_dot": v[0]}
    for j, (key, step) in enumerate(steps.items()):
        ahead, other = q[1 + 2 * j], q[2 + 2 * j]
        if key in one_sided:  # second order from θ = 0, step/2, step
            out[key] = (4.0 * other - ahead - 3.0 * q[0]) / step
        else:
            out[key] = (ahead - other) / (2.0 * step)
    nominal = rope_ode.parameters(family, [{}] * n_records)
    fitter = midpoint_rollout(family, nominal, np.arange(n_records), shape)
    out["mismatch"] = by_record(family, fitter, n_records)[0] - q[0]
    return out


def by_record(family: Family, x: np.ndarray, n_records: int) -> np.ndarray:
    """(T, 3, n, variants·records) -> (variant, record, T, 3, marker)."""
    x = x[:, :, list(family.markers)]
    x = x.reshape(*x.shape[:3], -1, n_records)
    return np.ascontiguousarray(x.transpose(3, 4, 0, 1, 2))


def whiten(x: np.ndarray, phi: float, sigma: float) -> np.ndarray:
    """AR(1) whitening along the time axis (axis 1) of (record, T, 3, m), flattened."""
    out = np.empty(x.shape)
    out[:, 0] = x[:, 0] / sigma
    out[:, 1:] = (x[:, 1:] - phi * x[:, :-1]) / (sigma * np.sqrt(1.0 - phi**2))
    return out.reshape(-1)


class Oracle:
    """Whitened, projected directions of one family under one noise law, on the fit records."""

    def __init__(self, known: Sensitivity, phi: float, sigma: float, quantum: float = 0.0):
        self.family, self.phi = known.family, phi
        self.sigma = float(np.hypot(sigma, quantum / np.sqrt(12.0)))
        self.fit = [i for i, role in enumerate(known.family.roles) if role == "fit"]
        nuisance = np.stack([self.whitened(known.columns[k]) for k in known.family.free], axis=1)
        self.nuisance, _ = np.linalg.qr(nuisance)
        self.u = {key: self.project(self.whitened(s)) for key, s in known.columns.items()}
        self.raw = {key: float(np.linalg.norm(self.whitened(s))) for key, s in known.columns.items()}
        self.basis = {name: orthonormal([self.u[k] for k in ks]) for name, (_, ks) in causes(self.family).items()}
        self.mismatch = self.project(self.whitened(known.mismatch))

    def whitened(self, x: np.ndarray) -> np.ndarray:
        return whiten(np.asarray(x)[self.fit], self.phi, self.sigma)

    def project(self, x: np.ndarray) -> np.ndarray:
        return x - self.nuisance @ (self.nuisance.T @ x)

    def direction(self, weights: dict[str, float]) -> np.ndarray:
        """u of a hidden effect: Σ weight · u_key (weights scaled so that θ is the size)."""
        return sum(weight * self.u[key] for key, weight in weights.items())

    def cosines(self, u: np.ndarray) -> dict[str, float]:
        """ρ of a response with every candidate's span."""
        size = np.linalg.norm(u)
        return {name: float(np.linalg.norm(b.T @ u) / size) for name, b in self.basis.items()}

    def mismatch_t2(self) -> dict[str, float]:
        """|P_k m|² of the generator-fitter mismatch along every candidate; a null needs all < 1."""
        return {name: float(np.sum((b.T @ self.mismatch) ** 2)) for name, b in self.basis.items()}

    def allows_name(self, u: np.ndarray, own: str, theta: float) -> tuple[bool, float, list[str]]:
        """The naming rule in expectation: (allowed, margin of the worst rival [σ], rivals not beaten).

        Significant: λ above the χ²_k threshold at α/(number of candidates). Beats rival k if
        √(λ (1-ρ)/2) > Φ⁻¹(1 - α/m), m rivals, the same cause at another gripper among them.
        """
        table = causes(self.family)
        lam = float(u @ u) * theta**2
        rho = {k: c for k, c in self.cosines(u).items() if k != own}
        gate = norm.ppf(1.0 - ALPHA / len(rho))
        margins = {k: float(np.sqrt(0.5 * lam * max(1.0 - c, 0.0)) - gate) for k, c in rho.items()}
        significant = lam > chi2.ppf(1.0 - ALPHA / len(table), len(table[own][1]))
        lost = sorted((k for k, m in margins.items() if m <= 0.0), key=lambda k: margins[k])
        return bool(significant and not lost), float(min(margins.values())), lost


def orthonormal(columns: list[np.ndarray]) -> np.ndarray:
    """Orthonormal basis of a span; columns below 1e-6 of the largest singular value dropped."""
    left, values, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return left[:, values > 1.0e-6 * max(values[0], 1.0e-300)]
