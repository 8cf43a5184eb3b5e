"""The reference model of a scene of bodies: a tree of joints, θ, motors, friction, stops and couplings.

State x = [q, v]: joint by joint, parents before children; a ball has a quaternion (w first) in q and
its angular velocity in the body's axes in v [rad/s]. A change of state δx = [δq, δv] has a turn in
the body's axes instead of the quaternion.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import formulas
from .parameters import Table


@dataclass(frozen=True, eq=False)
class Joint:
    """One axis or a ball; `q`, `v` are its parts of coordinates and velocities, `theta` positions in θ."""

    kind: str  # "revolute" | "prismatic" | "ball"
    axis: np.ndarray
    anchor: np.ndarray
    q: slice
    v: slice
    theta: dict  # armature; but for free bodies damping, quadratic_damping, stiffness, cubic_stiffness, and rest of one axis


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body; `frame` (4, 4) is its frame in its parent's with all joints at zero."""

    name: str
    parent: int | None
    frame: np.ndarray
    joints: list
    theta: np.ndarray | None  # mass, centre (3), spread (6)
    drag: int | float | None = None  # area that meets the air [m²]: a number, or its position in θ


@dataclass(frozen=True, eq=False)
class Motor:
    """An actuator at a joint of one axis."""

    kind: str  # "torque" | "position" | "velocity"
    joint: Joint
    theta: dict


@dataclass(frozen=True, eq=False)
class Coupling:
    """A joint of one axis whose coordinate is a polynomial of another's, or a constant."""

    joint: Joint
    lead: Joint | None
    coefficients: np.ndarray  # positions in θ, the constant first
    reference: int | None  # position in θ
    compliance: int | None  # position in θ


@dataclass(frozen=True, eq=False)
class BodyModel:
    """Everything about a scene of bodies that does not change with x, u, θ."""

    h: float
    integrator: str
    rest_gap: float
    paths: list
    theta: np.ndarray
    magnitude: int
    tilt: np.ndarray
    wind: np.ndarray
    medium: list | None  # positions in θ of density and viscosity
    bodies: list
    motors: list
    frictions: list  # (joint, θ positions of friction, stiction, stribeck_velocity)
    stops: list  # (joint, θ position of the limit, +1 above it or -1 below)
    coggings: list  # (joint, cycles per turn, θ positions of sine and cosine)
    couplings: list
    forces: list  # `formulas.Force`s
    q0: np.ndarray
    v0: np.ndarray

    @property
    def joints(self):
        """All joints in the order of their coordinates."""
        return [joint for body in self.bodies for joint in body.joints]

    @property
    def links(self):
        """Frames in order, one per joint and one per body without: (the frame before or -1 for the world, the constant
        transform (4, 4) from it, the joint or -1), arrays; and the last frame of each body."""
        before, constant, joint, last, n = [], [], [], [], 0
        for body in self.bodies:
            at = -1 if body.parent is None else last[body.parent]
            for k in range(max(1, len(body.joints))):
                before.append(at)
                constant.append(np.eye(4) if k else body.frame)
                joint.append(n if body.joints else -1)
                n, at = n + bool(body.joints), len(before) - 1
            last.append(at)
        return np.array(before), np.array(constant), np.array(joint), np.array(last)

    @property
    def nq(self):
        """Number of coordinates."""
        return len(self.q0)

    @property
    def nv(self):
        """Number of velocities."""
        return len(self.v0)

    @property
    def nx(self):
        """Numbers of a state."""
        return self.nq + self.nv

    @property
    def ndx(self):
        """Numbers of a change of state."""
        return 2 * self.nv

    @property
    def nu(self):
        """One control per motor."""
        return len(self.motors)

    def index(self, path):
        """Position of a path in θ."""
        return self.paths.index(path)

    def initial_state(self):
        """x0 (nx,) of the scene."""
        return np.concatenate([self.q0, self.v0])


def load(path):
    """Model of a scene file."""
    return loads(Path(path).read_text())


def loads(text):
    """Model of a scene text (TOML) without ropes."""
    scene = tomllib.loads(text)
    table, build = Table(), _Builder()
    gravity, time = scene.get("gravity", {}), scene["time"]
    magnitude = table.add("gravity.magnitude", gravity.get("magnitude", 9.81))
    tilt = table.add_vector("gravity.tilt", gravity.get("tilt", [0.0, 0.0]))
    air = scene.get("air", {})
    wind = table.add_vector("air.wind", air.get("wind", [0.0, 0.0, 0.0]))
    massive = any("inertia" in entry for entry in scene["body"])
    medium = [table.add(f"air.{key}", air.get(key, 0.0)) for key in ("density", "viscosity")] if massive else None
    for entry in _parents_first(scene["body"]):
        build.add_body(entry, table)
    motors = [build.motor(entry, table) for entry in scene.get("actuator", [])]
    couplings = [build.coupling(entry, table) for entry in scene.get("coupling", [])]
    forces = [build.force(entry, table) for entry in scene.get("force", [])]
    return BodyModel(
        h=time["step"],
        integrator=time.get("integrator", "midpoint"),
        rest_gap=scene.get("contact", {}).get("rest_gap", 1e-9),
        paths=table.paths,
        theta=np.array(table.values),
        magnitude=magnitude,
        tilt=tilt,
        wind=wind,
        medium=medium,
        bodies=build.bodies,
        motors=motors,
        frictions=build.frictions,
        stops=build.stops,
        coggings=build.coggings,
        couplings=couplings,
        forces=forces,
        q0=np.array(build.q0, dtype=float),
        v0=np.array(build.v0, dtype=float),
    )


def _parents_first(bodies):
    """Bodies in the scene's order, but none before its parent."""
    out, left = [], list(bodies)
    while left:
        names = {body["name"] for body in out}
        for body in list(left):
            if body.get("parent") is None or body["parent"] in names:
                out.append(body)
                names.add(body["name"])
                left.remove(body)
    return out


def spread_of(mass, inertia):
    """U (xx, yy, zz, xy, xz, yz) [m], upper triangular, with m U Uᵀ = ∫ (r - c)(r - c)ᵀ dm = ½ tr(I) 1 - I."""
    xx, yy, zz, xy, xz, yz = inertia
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second = (0.5 * np.trace(moments) * np.eye(3) - moments) / mass
    u = np.linalg.cholesky(second[::-1, ::-1])[::-1, ::-1]  # lower of the reversed is upper
    return [u[0, 0], u[1, 1], u[2, 2], u[0, 1], u[0, 2], u[1, 2]]


def shown_area(mass, inertia):
    """Mean area [m²] of the box with this mass and inertia, over all directions from which it is seen."""
    xx, yy, zz, xy, xz, yz = inertia
    principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    # I_a = m (b² + c²)/3 for half edges b, c
    a, b, c = np.sqrt(np.maximum(1.5 * (principal.sum() - 2.0 * principal) / mass, 0.0))
    return float(2.0 * (a * b + b * c + c * a))


class _Builder:
    """Gathers bodies in the order of their coordinates."""

    def __init__(self):
        self.bodies, self.frictions, self.stops, self.coggings = [], [], [], []
        self.q0, self.v0 = [], []
        self.by_name = {}

    def add_body(self, entry, table):
        name, joints = entry["name"], entry.get("joint", [])
        inertia, drag = None, None
        if "inertia" in entry:
            mass = table.add(f"{name}.mass", entry["mass"])
            centre = table.add_vector(f"{name}.center_of_mass", entry.get("center_of_mass", [0.0] * 3))
            spread = table.add_vector(f"{name}.spread", spread_of(entry["mass"], entry["inertia"]))
            inertia = np.array([mass, *centre, *spread])
            drag = shown_area(entry["mass"], entry["inertia"])
        if "drag_area" in entry:
            drag = table.add(f"{name}.drag_area", entry["drag_area"])
        position = np.array(entry.get("position", [0.0] * 3), dtype=float)
        quaternion = np.array(entry.get("quaternion", [1.0, 0.0, 0.0, 0.0]), dtype=float)
        quaternion /= np.linalg.norm(quaternion)
        if any(joint["kind"] == "free" for joint in joints):
            start = [*position, *quaternion]
            position, rotation = np.zeros(3), np.eye(3)
        else:
            start, rotation = [1.0, 0.0, 0.0, 0.0], _matrix(quaternion)
        parts = [part for joint in joints for part in self._joint(joint, start, table)]
        parent = next((k for k, b in enumerate(self.bodies) if b.name == entry.get("parent")), None)
        frame = np.block([[rotation, position[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
        self.bodies.append(Body(name, parent, frame, parts, inertia, drag))

    def _joint(self, entry, ball_start, table):
        kind, name = entry["kind"], entry["name"]
        keys = ["armature"] if kind == "free" else ["armature", "damping", "quadratic_damping", "stiffness", "cubic_stiffness"]
        keys += ["rest"] if kind in ("revolute", "prismatic", "universal") else []
        theta = {key: table.add(f"{name}.{key}", entry.get(key, 0.0)) for key in keys}
        axes = {
            "revolute": [("revolute", entry.get("axis", [0, 0, 1]))],
            "prismatic": [("prismatic", entry.get("axis", [0, 0, 1]))],
            "universal": [("revolute", entry.get("axis")), ("revolute", entry.get("second_axis"))],
            "ball": [("ball", [0, 0, 1])],
            "free": [*(("prismatic", list(e)) for e in np.eye(3)), ("ball", [0, 0, 1])],
        }[kind]
        anchor = np.zeros(3) if kind == "free" else np.array(entry.get("anchor", [0.0] * 3), dtype=float)
        parts, q, v = [], len(self.q0), len(self.v0)
        for part, axis in axes:
            axis = np.array(axis, dtype=float)
            nq, nv = (4, 3) if part == "ball" else (1, 1)
            parts.append(Joint(part, axis / np.linalg.norm(axis), anchor, slice(q, q + nq), slice(v, v + nv), theta))
            q, v = q + nq, v + nv
        start = ball_start if kind in ("ball", "free") else entry.get("start", [0.0] * len(parts))
        self.q0 += list(start)
        self.v0 += entry.get("velocity") or [0.0] * (v - len(self.v0))
        self.by_name[name] = parts[0]
        if "cogging" in entry:
            cogging = entry["cogging"]
            where = [table.add(f"{name}.cogging_{key}", cogging.get(key, 0.0)) for key in ("sine", "cosine")]
            self.coggings.append((parts[0], cogging["cycles"], where))
        if kind in ("revolute", "prismatic", "universal"):
            self._friction_and_stops(entry, parts, table)
        return parts

    def _friction_and_stops(self, entry, parts, table):
        name, defaults = entry["name"], {"friction": 0.0, "stiction": 0.0, "stribeck_velocity": 0.1}
        where = np.array([table.add(f"{name}.{key}", entry.get(key, value)) for key, value in defaults.items()])
        self.frictions += [(part, where) for part in parts]
        if "limits" in entry:
            low, high = table.add_vector(f"{name}.limit", entry["limits"])
            self.stops += [stop for part in parts for stop in ((part, low, 1.0), (part, high, -1.0))]

    def motor(self, entry, table):
        """The motor of one [[actuator]]."""
        own = {"torque": ["gain"], "position": ["stiffness", "damping"], "velocity": ["damping"]}[entry["kind"]]
        defaults = {"gain": 1.0, "gear": 1.0}
        keys = [*own, "offset", "gear"]
        theta = {k: table.add(f"{entry['name']}.{k}", entry.get(k, defaults.get(k, 0.0))) for k in keys}
        return Motor(entry["kind"], self.by_name[entry["joint"]], theta)

    def force(self, entry, table):
        """The force of one [[force]]."""
        joint = self.by_name[entry["joint"]]
        ball = ("qx", "qy", "qz", "vx", "vy", "vz")
        return formulas.read(entry, table, ball if joint.kind == "ball" else ("q", "v"), joint)

    def coupling(self, entry, table):
        """The coupling of one [[coupling]]."""
        name, to = entry["name"], entry.get("to")
        coefficients = [table.add(f"{name}.coefficient[{k}]", c) for k, c in enumerate(entry["coefficients"])]
        reference = None if to is None else table.add(f"{name}.reference", entry.get("reference", 0.0))
        compliance = table.add(f"{name}.compliance", entry["compliance"]) if "compliance" in entry else None
        lead = None if to is None else self.by_name[to]
        return Coupling(self.by_name[entry["joint"]], lead, np.array(coefficients), reference, compliance)


def _matrix(a):
    w, u = a[0], a[1:]
    hat = np.cross(np.eye(3), u)  # rows e_i × u: the matrix of u ×
    return np.eye(3) + 2.0 * w * hat + 2.0 * hat @ hat
