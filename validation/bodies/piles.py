"""Piles, stacks and pushes in pliant and in MuJoCo: the same bodies, step and friction, and what two contact models must share.

    python -m validation.bodies.piles [--piles 12] [--shapes sphere,capsule,box] [--step 0.004]

Things fall into a pit of four inclined planes, so that round ones come to rest too. Where they end is chance: small differences grow at
every impact. Their energy is not: it may never exceed that of the start, in the end nothing may move, and the heights of many piles at
rest must be alike on average. MuJoCo's own collision detection judges penetration in the states of both.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from validation.bodies.contact import Free, G, Setting, Solid, normalized

SLOPE = 0.5  # of the pit's planes [rad]
FRICTION = 0.4


@dataclass(frozen=True)
class World:
    """Free bodies and fixed planes through the origin, by their normals; a pusher along x besides, if it has a speed."""

    bodies: Sequence[Free]
    normals: Sequence[tuple[float, float, float]] = ((0.0, 0.0, 1.0),)
    step: float = 0.004
    duration: float = 3.0
    pusher: Pusher | None = None
    finer: int = 1  # steps of MuJoCo in one of pliant
    spring: float = 2.0  # time constant of MuJoCo's contact, in steps of MuJoCo; 2 is the least

    def text(self) -> str:
        """The scene of pliant."""
        planes = "".join(
            f'[[plane]]\nname = "plane_{k}"\nnormal = {list(normal)}\nfriction = {FRICTION}\n' for k, normal in enumerate(self.normals)
        )
        setting = Setting(step=self.step, duration=self.duration, floor=None, extra=planes)
        parts = [setting.text(), *(body.text() for body in self.bodies)]
        return "".join(parts) + (self.pusher.text() if self.pusher else "")

    def mjcf(self) -> str:
        """The model of MuJoCo: contact without rebound, as stiff as the step allows; friction of sliding alone."""
        planes = "".join(f'<geom type="plane" size="5 5 1" zaxis="{" ".join(map(str, normal))}"/>' for normal in self.normals)
        bodies = "".join(_mj_body(body.name, body.solid, body.position, body.quaternion, "<freejoint/>") for body in self.bodies)
        pusher = self.pusher.mjcf() if self.pusher else ""
        actuator = self.pusher.mj_actuator() if self.pusher else ""
        return f"""<mujoco><compiler angle="radian" inertiafromgeom="false"/>
<option timestep="{self.step / self.finer}" cone="elliptic" impratio="100" gravity="0 0 {-G}" integrator="implicitfast" iterations="200"/>
<default><geom friction="{FRICTION}" condim="3" solref="{self.spring * self.step / self.finer} 1"/></default>
<worldbody>{planes}{bodies}{pusher}</worldbody>{actuator}</mujoco>"""


@dataclass(frozen=True)
class Pusher:
    """A ball on a rail along x, driven at a speed that rises and falls as a half sine and is zero then."""

    start: tuple[float, float, float]
    speed: float  # at most [m/s]
    time: float  # of the push [s]
    solid: Solid = Solid("sphere", (0.02,), 5.0)
    gain: float = 1e5  # N·s/m

    def commands(self, step: float, steps: int) -> np.ndarray:
        """Of each step [m/s]."""
        at = step * (1 + np.arange(steps))
        return np.where(at < self.time, self.speed * np.sin(math.pi * at / self.time), 0.0)

    def text(self) -> str:
        return f"""
[[body]]
name = "pusher"
position = {list(self.start)}
mass = {self.solid.mass}
inertia = {[*self.solid.inertia, 0.0, 0.0, 0.0]}
[[body.joint]]
name = "rail"
kind = "prismatic"
axis = [1, 0, 0]
[[body.shape]]
{self.solid.shape()}friction = {FRICTION}
[[actuator]]
name = "motor"
joint = "rail"
kind = "velocity"
damping = {self.gain}
"""

    def mjcf(self) -> str:
        return _mj_body("pusher", self.solid, self.start, (1, 0, 0, 0), '<joint name="rail" type="slide" axis="1 0 0"/>')

    def mj_actuator(self) -> str:
        return f'<actuator><velocity joint="rail" kv="{self.gain}"/></actuator>'


def _mj_body(name: str, solid: Solid, position: Sequence[float], quaternion: Sequence[float], joint: str) -> str:
    words = {key: " ".join(str(float(x)) for x in value) for key, value in
             (("pos", position), ("quat", quaternion), ("size", solid.sizes), ("inertia", solid.inertia))}  # fmt: skip
    return (
        f'<body name="{name}" pos="{words["pos"]}" quat="{words["quat"]}">{joint}'
        f'<inertial pos="0 0 0" mass="{solid.mass}" diaginertia="{words["inertia"]}"/>'
        f'<geom type="{solid.kind}" size="{words["size"]}"/></body>'
    )


@dataclass
class Motion:
    """What is compared: of each state the energy [J], the kinetic part, the deepest penetration [m], and centres of free bodies [m]."""

    energy: np.ndarray
    kinetic: np.ndarray
    depth: np.ndarray
    centers: np.ndarray  # (T + 1, n, 3)
    q: np.ndarray
    halvings: int = 0


class Judge:
    """MuJoCo's model of a world, which measures energies and penetration of any motion."""

    def __init__(self, world: World):
        import mujoco

        self._mj, self.world = mujoco, world
        self.model = mujoco.MjModel.from_xml_string(world.mjcf())
        self.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY

    def _start(self) -> Any:
        data = self._mj.MjData(self.model)
        for k, body in enumerate(self.world.bodies):
            data.qvel[6 * k : 6 * k + 6] = body.velocity
        return data

    def measure(self, q: np.ndarray, v: np.ndarray, every: int = 5, halvings: int = 0) -> Motion:
        """Of states; penetration at some of them."""
        data, n = self._start(), len(self.world.bodies)
        energy, kinetic, depth = [], [], []
        for k, (qk, vk) in enumerate(zip(q, v, strict=True)):
            data.qpos[:], data.qvel[:] = qk, vk
            self._mj.mj_fwdPosition(self.model, data)
            self._mj.mj_sensorVel(self.model, data)
            self._mj.mj_fwdVelocity(self.model, data)
            self._mj.mj_energyPos(self.model, data)
            self._mj.mj_energyVel(self.model, data)
            energy.append(data.energy.sum())
            kinetic.append(data.energy[1])
            if k % every == 0 or k == len(q) - 1:
                depth.append(max((-c.dist for c in data.contact[: data.ncon]), default=0.0))
        return Motion(np.array(energy), np.array(kinetic), np.array(depth), q[:, : 7 * n].reshape(len(q), n, 7)[:, :, :3], q, halvings)

    def mujoco(self) -> Motion:
        """MuJoCo's motion."""
        data, world = self._start(), self.world
        steps = round(world.duration / world.step)
        commands = world.pusher.commands(world.step, steps) if world.pusher else None
        q, v = [data.qpos.copy()], [data.qvel.copy()]
        for k in range(steps):
            if commands is not None:
                data.ctrl[0] = commands[k]
            self._mj.mj_step(self.model, data, world.finer)
            q.append(data.qpos.copy())
            v.append(data.qvel.copy())
        return self.measure(np.array(q), np.array(v))

    def pliant(self) -> Motion:
        """pliant's motion."""
        import pliant

        world = self.world
        model = pliant.loads(world.text())
        u = model.controls()
        if world.pusher:
            u[:, 0] = world.pusher.commands(world.step, len(u))
        roll = model.rollout(model.initial_state(), u, record=False)
        nq = self.model.nq
        return self.measure(roll.x[:, :nq], roll.x[:, nq:], halvings=int(roll.trace["retries"].sum()))


PIT = tuple((math.sin(SLOPE) * x, math.sin(SLOPE) * y, math.cos(SLOPE)) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)))


SHAPES = ("sphere", "capsule", "cylinder", "box")


def pile(seed: int, shapes: Sequence[str] = SHAPES, step: float = 0.004) -> World:
    """Three to eight bodies of these shapes that fall into the pit one after another."""
    rng = np.random.default_rng([seed, 11])
    bodies, z = [], 0.12
    for k in range(int(rng.integers(3, 9))):
        kind = shapes[rng.integers(len(shapes))]
        sizes = rng.uniform(0.025, 0.05, {"sphere": 1, "box": 3}.get(kind, 2))
        solid = Solid(kind, tuple(map(float, sizes)), float(rng.uniform(0.5, 1.5)))
        reach = float(np.linalg.norm(sizes)) if kind != "capsule" else float(sizes.sum())
        z += reach
        x, y = rng.uniform(-0.02, 0.02, 2)
        bodies.append(Free(f"it_{k}", solid, (x, y, z), normalized(rng.normal(size=4)), friction=FRICTION))
        z += reach + 0.01
    return World(bodies, PIT, step)


def stack(kinds: Sequence[str] = ("box", "cylinder", "box"), step: float = 0.004) -> World:
    """Boxes and standing cylinders that are let down on each other a millimetre apart."""
    bodies, z = [], 0.0
    for k, kind in enumerate(kinds):
        side = 0.05 - 0.008 * k
        solid = Solid(kind, (side, side, 0.04) if kind == "box" else (side, 0.04), 1.0)
        z += 0.041
        bodies.append(Free(f"it_{k}", solid, (0.002 * k, 0.0, z), friction=FRICTION))
        z += 0.04
    return World(bodies, step=step, duration=1.5)


PUSH = Pusher((-0.07 - 1e-6, 0.0, 0.03), 0.8, 0.3)  # the ball touches the box as it starts: an impact would throw the box ahead of it


def push(offset: float = 0.0, step: float = 0.002) -> World:
    """A ball that pushes a box over the floor, beside its centre by the offset [m], and stops; the box slides on.

    At steps of milliseconds MuJoCo's contact, whose springs are as soft as the step is long, throws the box ahead of the ball. So it takes
    shorter ones.
    """
    box = Free("box", Solid("box", (0.05, 0.06, 0.04), 0.8), (0.0, 0.0, 0.04 + 4e-9), friction=FRICTION)
    return World([box], step=step, duration=0.8, pusher=replace(PUSH, start=(PUSH.start[0], offset, PUSH.start[2])), finer=20)


def pushed_way() -> float:
    """How far the box goes that is pushed at its centre [m]: with the ball until that brakes harder than friction, then by itself."""
    v, time, brake = PUSH.speed, PUSH.time, FRICTION * G
    angle = math.pi - math.acos(brake * time / (math.pi * v))
    return v * time / math.pi * (1.0 - math.cos(angle)) + (v * math.sin(angle)) ** 2 / (2.0 * brake)


def yaw(q: np.ndarray) -> float:
    """Angle about z of the first free body at the end [rad]."""
    w, x, y, z = q[-1, 3:7]
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def pushed(motion: Motion) -> np.ndarray:
    """Where a pushed box comes to rest: x, y [m] and yaw [rad]."""
    return np.array([*motion.centers[-1, 0, :2], yaw(motion.q)])


def mujoco_pushes(offset: float) -> np.ndarray:
    """The same by MuJoCo at nine pairs of steps (0.2, 0.1, 0.05 ms) and contact springs (5, 10, 20 steps): (9, 3).

    Its results scatter with both; they do not tend to a limit as the steps alone are refined.
    """
    settings = [(finer, spring) for finer in (10, 20, 40) for spring in (5.0, 10.0, 20.0)]
    return np.array([pushed(Judge(replace(push(offset), finer=f, spring=s)).mujoco()) for f, s in settings])


def main() -> None:
    """Prints energies and depths of piles in both engines, and pushes."""
    parser = argparse.ArgumentParser(prog="python -m validation.bodies.piles", description=__doc__.splitlines()[0])
    parser.add_argument("--piles", type=int, default=12)
    parser.add_argument("--shapes", default=",".join(SHAPES), help="of sphere, capsule, cylinder, box")
    parser.add_argument("--step", type=float, default=0.004, help="[s]")
    options = parser.parse_args()
    ratios = []
    print("energies over that of the start: most, at rest; kinetic energy at the end [J]; deepest penetration, at the end [mm]")
    for seed in range(options.piles):
        judge = Judge(pile(seed, options.shapes.split(","), options.step))
        rests = []
        for name in ("pliant", "mujoco"):
            m = getattr(judge, name)()
            rests.append(m.energy[-1])
            energies = f"{m.energy.max() / m.energy[0]:.3f} {m.energy[-1] / m.energy[0]:.3f}; {m.kinetic[-1]:.0e}"
            depths = f"{1e3 * m.depth.max():.2f} {1e3 * m.depth[-1]:.3f}"
            print(f"pile {seed}, {len(judge.world.bodies)} bodies, {name:6}: {energies}; {depths}", flush=True)
        ratios.append(rests[0] / rests[1])
    print(f"energy at rest, pliant over MuJoCo: {np.mean(ratios):.3f}, scatter {np.std(ratios):.3f}")
    print(f"pushed at the centre: closed form {pushed_way():.5f} m")
    for offset in (0.0, 0.02):
        theirs = mujoco_pushes(offset)
        for name, figures in (("pliant", pushed(Judge(push(offset)).pliant())), ("MuJoCo, median", np.median(theirs, axis=0))):
            print(f"pushed at {offset} m, {name}: x, y, yaw {np.round(figures, 5)}")
        print(f"   MuJoCo from {np.round(theirs.min(axis=0), 5)} to {np.round(theirs.max(axis=0), 5)}")


if __name__ == "__main__":
    main()
