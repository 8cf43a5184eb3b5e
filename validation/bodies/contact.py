"""Scenes of bodies that touch, and what their motions are measured by.

Bodies are free and of uniform density; a shape is its kind and sizes, as scenes have them. Scenes run with implicit Euler, the
integrator for impacts, unless they say otherwise.
"""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

G = 9.81
REST_GAP = 1e-9
FLOOR = "floor"


@dataclass(frozen=True)
class Solid:
    """A shape of uniform density: its kind, its sizes [m] and its mass [kg]."""

    kind: str
    sizes: tuple[float, ...]
    mass: float = 1.0

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Principal moments about the centre [kg·m²], by the textbook."""
        if self.kind == "sphere":
            moment = 0.4 * self.mass * self.sizes[0] ** 2
            return moment, moment, moment
        if self.kind == "box":
            a, b, c = (x * x for x in self.sizes)
            return (
                self.mass * (b + c) / 3,
                self.mass * (a + c) / 3,
                self.mass * (a + b) / 3,
            )
        r, h = self.sizes
        if self.kind == "cylinder":
            across = self.mass * (r * r / 4 + h * h / 3)
            return across, across, self.mass * r * r / 2
        balls = 4 / 3 * r / (2 * h + 4 / 3 * r)
        across = (1 - balls) * (r * r / 4 + h * h / 3) + balls * (
            0.4 * r * r + h * h + 0.75 * r * h
        )
        along = (1 - balls) * r * r / 2 + balls * 0.4 * r * r
        return self.mass * across, self.mass * across, self.mass * along

    def shape(self) -> str:
        """The keys of `[[body.shape]]`."""
        if self.kind == "box":
            return f'kind = "box"\nhalf_extents = {list(self.sizes)}\n'
        names = ("radius", "half_length")
        sizes = "".join(f"{n} = {x}\n" for n, x in zip(names, self.sizes, strict=False))
        return f'kind = "{self.kind}"\n{sizes}'

    def lowest(self, quaternion: Sequence[float]) -> float:
        """How far its lowest point is below its centre [m], turned by a unit quaternion."""
        down = matrix(quaternion)[2]
        if self.kind == "sphere":
            return self.sizes[0]
        if self.kind == "box":
            return float(np.abs(down) @ np.array(self.sizes))
        r, h = self.sizes
        across = 1.0 if self.kind == "capsule" else math.hypot(down[0], down[1])
        return r * across + h * abs(down[2])


BALL = Solid("sphere", (0.05,))
CAPSULE = Solid("capsule", (0.04, 0.06))
CYLINDER = Solid("cylinder", (0.05, 0.06))
BOX = Solid("box", (0.05, 0.06, 0.04))
SOLIDS = {"sphere": BALL, "capsule": CAPSULE, "cylinder": CYLINDER, "box": BOX}


@dataclass(frozen=True)
class Free:
    """A free body of one shape: where it starts, how fast, and how rough it is."""

    name: str
    solid: Solid
    position: Sequence[float]
    quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    velocity: Sequence[float] = (0.0,) * 6
    friction: float | None = 0.4

    def text(self) -> str:
        friction = "" if self.friction is None else f"friction = {self.friction}\n"
        return f"""
[[body]]
name = "{self.name}"
position = {list(map(float, self.position))}
quaternion = {list(map(float, self.quaternion))}
mass = {self.solid.mass}
inertia = {[*self.solid.inertia, 0.0, 0.0, 0.0]}
[[body.joint]]
name = "{self.name}_free"
kind = "free"
velocity = {list(map(float, self.velocity))}
[[body.shape]]
{self.solid.shape()}{friction}"""


@dataclass(frozen=True)
class Setting:
    """Everything but the objects."""

    step: float = 1 / 240
    duration: float = 1.0
    tilt: float = 0.0  # of gravity about y [rad]: downhill is −x
    rest_gap: float = REST_GAP
    floor: float | None = 0.4  # its friction; none without a floor
    extra: str = ""
    integrator: str = "euler"

    def text(self) -> str:
        floor = (
            "" if self.floor is None else f'[[plane]]\nname = "{FLOOR}"\nfriction = {self.floor}\n'
        )
        return f"""schema_version = 1
[time]
step = {self.step}
duration = {self.duration}
integrator = "{self.integrator}"
[gravity]
tilt = [0.0, {self.tilt}]
[contact]
rest_gap = {self.rest_gap}
{floor}{self.extra}"""


def scene(setting: Setting, *objects: Free) -> str:
    """A scene of free bodies."""
    return setting.text() + "".join(o.text() for o in objects)


def normalized(q: Sequence[float]) -> list[float]:
    """A unit quaternion."""
    return list(np.array(q) / np.linalg.norm(q))


TILTED = normalized((0.9, 0.3, 0.1, 0.3))


def matrix(q: Sequence[float]) -> np.ndarray:
    """Axes of a unit quaternion as columns."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclass
class Run:
    """A motion: states of every step, and the energy of bodies and nodes at each [J]."""

    model: Any
    x: np.ndarray
    scene: dict[str, Any] = field(repr=False)

    def joints(self) -> list[tuple[str, dict[str, Any], slice, slice]]:
        """Body, joint, and where its coordinates and velocities are, of all joints in order."""
        q = v = 3 * self.model.n_nodes
        out = []
        for body in self.scene["body"]:
            for joint in body.get("joint", []):
                nq, nv = {"free": (7, 6), "ball": (4, 3), "universal": (2, 2)}.get(
                    joint["kind"], (1, 1)
                )
                out.append((body["name"], joint, slice(q, q + nq), slice(v, v + nv)))
                q, v = q + nq, v + nv
        return out

    @property
    def nq(self) -> int:
        """Number of coordinates."""
        return self.joints()[-1][2].stop

    @property
    def q(self) -> np.ndarray:
        """Coordinates, (T + 1, nq)."""
        return self.x[:, : self.nq]

    @property
    def v(self) -> np.ndarray:
        """Velocities, (T + 1, nv)."""
        return self.x[:, self.nq : self.nq + self.joints()[-1][3].stop]

    def free(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A free body's positions [m], quaternions and velocities over time."""
        q, v = next((q, v) for body, _, q, v in self.joints() if body == name)
        return self.q[:, q.start : q.start + 3], self.q[:, q.start + 3 : q.stop], self.v[:, v]

    def energies(self) -> np.ndarray:
        """Kinetic energy, weight and springs of ball joints, (T + 1,) [J]; ropes: kinetic energy and weight only."""
        theta = dict(zip(self.model.param_paths, self.model.theta, strict=True))
        tilt = self.scene.get("gravity", {}).get("tilt", [0.0, 0.0])
        down = np.array([-math.sin(tilt[1]), 0.0, -math.cos(tilt[1])]) * theta["gravity.magnitude"]
        assert tilt[0] == 0.0
        n = 3 * self.model.n_nodes
        masses = self.model.masses() if n else np.zeros(0)
        out = []
        for q, v in zip(self.q, self.v, strict=True):
            w = v[n:]
            energy = 0.5 * w @ self.model.mass_matrix(q) @ w
            nodes = q[:n].reshape(-1, 3)
            energy += 0.5 * masses @ (v[:n].reshape(-1, 3) ** 2).sum(axis=1) - masses @ (
                nodes @ down
            )
            positions, quaternions = self.model.body_poses(q)
            for body, p, r in zip(self.scene["body"], positions, quaternions, strict=True):
                center = p + matrix(r) @ np.array(body.get("center_of_mass", [0.0] * 3))
                energy -= body.get("mass", 0.0) * center @ down
            energy += self.springs(q)
            out.append(energy)
        return np.array(out)

    def springs(self, q: np.ndarray) -> float:
        """Energy of the springs of ball joints [J]: half the stiffness times the squared angle from zero."""
        energy = 0.0
        for _, joint, at, _ in self.joints():
            if joint["kind"] == "ball":
                w, *xyz = q[at]
                angle = 2 * math.atan2(float(np.linalg.norm(xyz)), abs(w))
                energy += 0.5 * joint.get("stiffness", 0.0) * angle**2
        return energy


def run(model: Any, text: str, steps: int | None = None) -> Run:
    """Simulates a scene from its start."""
    roll = model.rollout(model.initial_state(), model.controls(steps), record=False)
    return Run(model, np.asarray(roll.x), tomllib.loads(text))


@dataclass(frozen=True)
class Cable:
    """A chain of capsules on ball joints that lies curled above a floor."""

    links: int = 18
    length: float = 0.375
    radius: float = 0.003
    stiffness: float = 1e-2  # N·m/rad
    damping: float = 1e-3  # N·m·s/rad
    density: float = 1200.0
    height: float = 0.3
    curl: float = 0.25  # largest bend of a joint about each axis [rad]
    seed: int = 0

    def text(self) -> str:
        """Its bodies; capsules span their link less a radius at each end, so that links beyond the next never start in contact."""
        rng = np.random.default_rng(self.seed)
        link = self.length / self.links
        half = link / 2 - self.radius
        solid = Solid("capsule", (self.radius, half))
        volume = math.pi * self.radius**2 * (2 * half + 4 / 3 * self.radius)
        solid = Solid(solid.kind, solid.sizes, self.density * volume)
        out = Free(
            "link_0", solid, (0, 0, self.height), normalized((1, 0, 1, 0)), friction=0.5
        ).text()
        for k in range(1, self.links):
            bend = rng.uniform(-self.curl, self.curl, 2)
            q = normalized((math.sqrt(1 - bend @ bend / 4), bend[0] / 2, bend[1] / 2, 0.0))
            # the bend is about the joint, half a link below the centre
            center = np.array([0, 0, link / 2]) + matrix(q) @ np.array([0, 0, link / 2])
            out += f"""
[[body]]
name = "link_{k}"
parent = "link_{k - 1}"
position = {list(map(float, center))}
quaternion = {list(map(float, q))}
mass = {solid.mass}
inertia = {[*solid.inertia, 0.0, 0.0, 0.0]}
[[body.joint]]
name = "joint_{k}"
kind = "ball"
anchor = [0.0, 0.0, {-link / 2}]
stiffness = {self.stiffness}
damping = {self.damping}
[[body.shape]]
{solid.shape()}friction = 0.5
"""
        return out


def drop_cable(pliant: Any, seed: int, step: float, duration: float = 1.0) -> Run:
    """Drops a cable; raises what the rollout raises."""
    text = Setting(step=step, duration=duration, floor=0.5).text() + Cable(seed=seed).text()
    return run(pliant.loads(text), text)


def sweep_cables(
    seeds: int = 100, steps: Sequence[float] = (1 / 240, 1 / 120, 1 / 60)
) -> list[str]:
    """Drops that many cables at each step; what went wrong, in words. By hand: python -m validation.bodies.contact [seeds]"""
    import pliant

    wrong = []
    for step in steps:
        shares = []
        for seed in range(seeds):
            try:
                motion = drop_cable(pliant, seed, step)
            except pliant.NumericsError as error:
                wrong.append(f"seed {seed} at {step:.5f} s: {str(error).splitlines()[0]}")
                continue
            energy = motion.energies()
            shares.append(np.maximum(np.diff(energy), 0).sum() / energy[0])
            if not np.isfinite(motion.x).all() or energy.max() > energy[0]:
                wrong.append(f"seed {seed} at {step:.5f} s: energy above that of the start")
        text = ", ".join(f"{p} %: {np.percentile(shares, p):.1e}" for p in (50, 90, 100))
        print(
            f"step {step:.5f} s: {len(shares)} of {seeds} through; rises of energy, of that of the start: {text}",
            flush=True,
        )
    return wrong


if __name__ == "__main__":
    print("\n".join(sweep_cables(int(sys.argv[1]) if len(sys.argv) > 1 else 100)) or "all well")
