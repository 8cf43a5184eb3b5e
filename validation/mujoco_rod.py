"""A pliant rod that twists as MuJoCo 4.0's one-dimensional flex with a hinge per edge.

`validation.mujoco_rope` says how stretch, masses and bending are matched. Here both nodes of the first edge (and of the last one, if
it is held) are driven, so that both sides clamp whole edges and have the same joints; and MuJoCo's hinges, of which none is clamped on
bodies of their own, are held at such an edge by a stiff spring, whose rest angle turns the end. MuJoCo's angle of an edge is counted from
axes carried along in time, pliant's from those of its own start: the angles are not compared, only what they do.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from validation import mujoco_rope as mj
from validation.mujoco_rope import Options, Rod, Rope

HOLD = 1e4  # stiffness of a held hinge in units of a joint's GJ/l: its angle gives way by 1/HOLD of a joint's


@dataclass(frozen=True)
class Twist:
    """Quantities of pliant's `[rope.twist]` of a round rod [N·m², kg·m]."""

    stiffness: float = 1.0e-3
    inertia: float = 2.25e-7


class TwistingRod:
    """A rod with its first edge held, and its last one too if `both`; `turn` [rad] of the last edge's axes."""

    def __init__(self, rope: Rope, twist: Twist, both: bool, step: float, damping: float = 0.0, tolerance: float = 1e-10):
        n = rope.nodes
        held = (0, 1, n - 2, n - 1) if both else (0, 1)
        shear = 2.0 * twist.stiffness / (np.pi * rope.radius**4)
        self.rod = Rod(rope, Options(step=step, fixed=held, twist=True, shear=shear, tolerance=tolerance))
        model = self.model = self.rod.model
        hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        assert len(hinges) == n - 1
        self.angles, dofs = model.jnt_qposadr[hinges], model.jnt_dofadr[hinges]
        ends = hinges[[0, -1]] if both else hinges[:1]
        model.jnt_stiffness[ends] = HOLD * twist.stiffness / rope.edge
        model.dof_damping[dofs] = damping
        model.body_inertia[model.jnt_bodyid[hinges]] = twist.inertia * rope.edge
        mujoco.mj_setConst(model, self.rod.data)

    def start(self, points: np.ndarray, angles: np.ndarray | None = None):
        """Begin at rest at `points`, edges turned by `angles` [rad]."""
        self.rod.reset(points)
        if angles is not None:
            self.rod.data.qpos[self.angles] = angles
            mujoco.mj_forward(self.model, self.rod.data)

    def turn(self, angle: float, steps: int = 400):
        """Turn the last edge little by little [rad]."""
        for k in range(steps):
            self.model.qpos_spring[self.angles[-1]] = angle * (k + 1) / steps
            self.rod.advance(5)

    def settle(self, change: float = 1e-10, most: int = 60_000) -> np.ndarray:
        """Positions when a hundred steps move no node by more than `change` [m]."""
        before = self.rod.positions()
        for _ in range(0, most, 100):
            self.rod.advance(100)
            now = self.rod.positions()
            if np.abs(now - before).max() < change:
                return now
            before = now
        raise RuntimeError(f"MuJoCo's rod still moves by {np.abs(now - before).max():.1e} m a hundred steps")

    def torque(self) -> float:
        """Moment [N·m] of the spring at the last edge."""
        model, at = self.model, self.angles[-1]
        joint = int(np.flatnonzero(model.jnt_qposadr == at)[0])
        return float(np.ravel(model.jnt_stiffness[joint])[0] * (model.qpos_spring[at] - self.rod.data.qpos[at]))


def between(rope: Rope, span: float) -> np.ndarray:
    """An arch [m] between two level edges, `span` from the first node to the last."""
    e, inner = rope.edge, Rope(nodes=rope.nodes - 2, length=rope.length - 2.0 * rope.edge)
    return np.vstack([[0.0, 0.0, 0.0], mj.arch(inner, (e, 0, 0), (span - e, 0, 0)), [span, 0.0, 0.0]])


def scene(rope: Rope, twist: Twist, points: np.ndarray, both: bool, step: float = 0.01, initial: float = 0.0) -> str:
    """The same rod as a pliant scene (midpoint), `initial` twist [rad] from its first edge to its last."""
    listed = ", ".join("[{!r}, {!r}, {!r}]".format(*map(float, p)) for p in points)
    hands = [("first", "[0, 1]")] + [("last", "[-2, -1]")] * both
    grippers = "".join(f'[[gripper]]\nname = "{name}"\nrope = "rod"\nnodes = {nodes}\n' for name, nodes in hands)
    return f"""schema_version = 1
[time]
step = {step!r}
integrator = "midpoint"
[gravity]
magnitude = {rope.gravity!r}
[[rope]]
name = "rod"
nodes = {rope.nodes}
length = {rope.length!r}
linear_density = {rope.linear_density!r}
stretch_stiffness = {rope.stretch_stiffness!r}
bend_stiffness = {rope.bend_stiffness!r}
radius = {rope.radius!r}
initial = {{ shape = "points", points = [{listed}] }}
[rope.twist]
stiffness = {twist.stiffness!r}
inertia = {twist.inertia!r}
director = [0.0, 0.0, 1.0]
initial = {initial!r}
{grippers}"""
