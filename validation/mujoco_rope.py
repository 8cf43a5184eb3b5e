"""The rope of a pliant scene as a MuJoCo 4.0 one-dimensional flex (discrete elastic rod).

Both sides use the same bending energy per node, 2 (EI / l_v) tan²(θ/2), and gravity on
the same point masses. What MuJoCo offers for the rest, and how it is matched here:

* **stretch**: a 1-D flex has none of its own. `stretch="spring"` adds a spatial tendon per
  edge with stiffness EA / l0: exactly pliant's ½ EA l0 ε². `stretch="equality"` is MuJoCo's
  own edge constraint, a regularized row whose compliance depends on `solref`, `solimp` and
  the nodes' masses, not on EA.
* **mass**: `flexcomp` gives every node mass / n. `lumping="voronoi"` gives the end nodes
  half of an inner node's share, as pliant does; `lumping="equal"` keeps MuJoCo's habit.
* **clamped end**: pinning two nodes clamps the whole edge between them. `ghost=True`
  instead adds a massless point `GHOST` edge lengths behind node 0, which makes the clamp's
  Voronoi length half an edge: pliant's `end = "first"`.
* **twist**: `twist=True` adds MuJoCo's hinge per edge, torsional stiffness GJ with
  shear modulus E / 3 (isotropic, Poisson ratio 0.5) unless `shear` says otherwise; pliant's
  rope carries no twist angle. In a straight circular rod bending does not depend on it.
* **integrator**: `discrete`, first order in the step, implicit in position through a positive
  semi-definite Hessian; no damping unless `drag_linear` is set (slide-joint damping).

SI units; positions are (nodes, 3) arrays in metres, z up.
"""

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np

# MuJoCo's warnings as Python's, instead of a MUJOCO_LOG.TXT wherever one happens to work
mujoco.set_mju_user_warning(lambda text: warnings.warn(text, RuntimeWarning, stacklevel=2))

GHOST = 1e-4  # length of the clamp's auxiliary edge in units of the rest edge


@dataclass(frozen=True)
class Rope:
    """Quantities of a pliant `[[rope]]`, in SI units and pliant's names."""

    nodes: int = 20
    length: float = 1.0
    linear_density: float = 0.05
    stretch_stiffness: float = 1.0e4
    bend_stiffness: float = 1.0e-3
    drag_linear: float = 0.0
    radius: float = 0.003
    gravity: float = 9.81

    @property
    def edge(self) -> float:
        """Rest length of one edge [m]."""
        return self.length / (self.nodes - 1)

    def voronoi(self) -> np.ndarray:
        """Voronoi lengths of the nodes [m]."""
        lengths = np.full(self.nodes, self.edge)
        lengths[[0, -1]] /= 2
        return lengths


@dataclass(frozen=True)
class Options:
    """How the rope is put to MuJoCo; see the module's text."""

    step: float = 0.01
    fixed: tuple[int, ...] = (0,)
    ghost: bool = False
    stretch: str = "spring"
    lumping: str = "voronoi"
    twist: bool = False
    shear: float | None = None
    solref: str = "0.02 1"
    solimp: str = "0.9 0.95 0.001"
    floor: float | None = None
    friction: float = 0.5
    tolerance: float = 1e-10
    integrator: str = "discrete"
    sensors: tuple[int, ...] = ()  # nodes with a position sensor "node<i>"


class Rod:
    """A compiled rod: `model`, `data`, and nodes in and out as positions."""

    def __init__(self, rope: Rope, options: Options):
        self.rope, self.options = rope, options
        self.spec = mujoco.MjSpec.from_string(mjcf(rope, options))
        self.model = self.spec.compile()
        self.data = mujoco.MjData(self.model)
        self.bodies = [self.model.body(f"n{i}").id for i in range(rope.nodes)]
        self._rest = self.model.body_pos[self.bodies].copy()
        self._free = [i for i in range(rope.nodes) if i not in options.fixed]
        ids = [self.bodies[i] for i in self._free]
        self._q = self.model.jnt_qposadr[self.model.body_jntadr[ids]][:, None] + np.arange(3)
        self._v = self.model.jnt_dofadr[self.model.body_jntadr[ids]][:, None] + np.arange(3)
        drag = rope.drag_linear * rope.voronoi()[self._free]
        self.model.dof_damping[self._v] = drag[:, None]  # the compiler refuses it on a flex

    def reset(self, positions: np.ndarray, velocities: np.ndarray | None = None):
        """Start at rest, or with `velocities` [m/s], from `positions` [m]."""
        mujoco.mj_resetData(self.model, self.data)
        self.place(positions)
        self.data.qpos[self._q] = (positions - self._rest)[self._free]
        if velocities is not None:
            self.data.qvel[self._v] = velocities[self._free]
        mujoco.mj_forward(self.model, self.data)

    def place(self, positions: np.ndarray):
        """Move the driven nodes; the ghost keeps to the first edge's clamp axis +x."""
        for i in self.options.fixed:
            self.data.mocap_pos[self.model.body_mocapid[self.bodies[i]]] = positions[i]
        if self.options.ghost:
            ghost = self.model.body_mocapid[self.model.body("ghost").id]
            self.data.mocap_pos[ghost] = positions[0] - [GHOST * self.rope.edge, 0, 0]

    def advance(self, steps: int = 1):
        """Take `steps` steps in C."""
        mujoco.mj_step(self.model, self.data, steps)

    def positions(self) -> np.ndarray:
        """Node positions [m] of the current state (not of the last step's kinematics)."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xpos[self.bodies].copy()

    def speed(self) -> float:
        """Largest node velocity component [m/s]."""
        return float(np.abs(self.data.qvel[self._v]).max())


def mjcf(rope: Rope, options: Options) -> str:
    """The MJCF text of the rope, straight along +x from the origin."""
    n, edge = rope.nodes, rope.edge
    mass = rope.linear_density * rope.voronoi()
    if options.lumping == "equal":
        mass = np.full(n, rope.linear_density * rope.length / n)
    bodies = [_node(rope, options, i, float(mass[i])) for i in range(n)]
    names = [f"n{i}" for i in range(n)]
    if options.ghost:
        bodies.insert(0, f'<body name="ghost" mocap="true" pos="{-GHOST * edge!r} 0 0"/>')
        names.insert(0, "ghost")
    if options.twist:
        bodies += _twist_bodies(rope, len(names))
    elements = " ".join(f"{e} {e + 1}" for e in range(len(names) - 1))
    young = 4 * rope.bend_stiffness / (np.pi * rope.radius**4)
    shear = young / 3 if options.shear is None else options.shear
    touch = int(options.floor is not None)
    floor = ""
    if touch:
        floor = f'<geom name="floor" type="plane" size="50 50 1" pos="0 0 {options.floor!r}" '
        floor += f'friction="{options.friction}"/>'
    contact = f'contype="{touch}" conaffinity="{touch}" friction="{options.friction}"'
    sensors = "".join(
        f'<framepos name="node{i}" objtype="body" objname="n{i}"/>' for i in options.sensors
    )
    equality = f'<flex flex="rope" solref="{options.solref}" solimp="{options.solimp}"/>'
    return f"""<mujoco model="rope">
  <option timestep="{options.step!r}" integrator="{options.integrator}" solver="Newton"
          tolerance="{options.tolerance!r}" gravity="0 0 {-rope.gravity!r}"/>
  <worldbody>{floor}{"".join(bodies)}</worldbody>
  <deformable>
    <flex name="rope" dim="1" radius="{rope.radius!r}" body="{" ".join(names)}"
          element="{elements}">
      <contact selfcollide="none" {contact}/>
      <elasticity young="{float(young)!r}" shear="{float(shear)!r}"/>
    </flex>
  </deformable>
  {_springs(rope) if options.stretch == "spring" else ""}
  {f"<equality>{equality}</equality>" if options.stretch == "equality" else ""}
  {f"<sensor>{sensors}</sensor>" if sensors else ""}
</mujoco>"""


def _node(rope, options, i, mass):
    """A driven (mocap) or free (three slides) point mass at its rest position."""
    place = f'name="n{i}" pos="{rope.edge * i!r} 0 0"'
    site = f'<site name="s{i}"/>' if options.stretch == "spring" else ""
    if i in options.fixed:
        return f'<body {place} mocap="true">{site}</body>'
    slides = "".join(
        f'<joint name="n{i}{name}" type="slide" axis="{axis}"/>'
        for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
    )
    inertia = f"{mass * rope.radius**2!r} " * 3  # never excited: the node has no rotation
    return (
        f'<body {place}><inertial pos="0 0 0" mass="{mass!r}" diaginertia="{inertia}"/>'
        f"{slides}{site}</body>"
    )


def _twist_bodies(rope, points):
    """MuJoCo's carriers of the edges' twist angles, one hinge per edge, as `flexcomp` makes them.

    Driven nodes sit on separate mocap bodies, so no edge counts as clamped in twist.
    """
    inertia = f"{0.5 * rope.linear_density * rope.edge * rope.radius**2!r} " * 3
    names = [f"rope_twist_{e}" for e in range(points - 2)] + ["rope_twist"]
    return [
        f'<body name="{name}"><inertial pos="0 0 0" mass="1e-9" diaginertia="{inertia}"/>'
        f'<joint name="{name}" axis="1 0 0"/></body>'
        for name in names
    ]


def _springs(rope):
    """One tendon per edge: ½ (EA / l0)(|e| - l0)²."""
    stiffness = f'stiffness="{rope.stretch_stiffness / rope.edge!r}"'
    return "<tendon>{}</tendon>".format(
        "".join(
            f'<spatial name="t{e}" {stiffness} springlength="{rope.edge!r}">'
            f'<site site="s{e}"/><site site="s{e + 1}"/></spatial>'
            for e in range(rope.nodes - 1)
        )
    )


def straight(rope: Rope, start=(0.0, 0.0, 0.0), direction=(1.0, 0.0, 0.0)) -> np.ndarray:
    """Nodes of the unstretched rope from `start` [m] along `direction`."""
    axis = np.asarray(direction, float) / np.linalg.norm(direction)
    return np.asarray(start, float) + np.outer(np.arange(rope.nodes) * rope.edge, axis)


def arch(rope: Rope, start, end, tries: int = 60) -> np.ndarray:
    """A parabola of the rope's length from `start` to `end` [m]: a guess for `hanging`."""
    start, end, s = np.asarray(start, float), np.asarray(end, float), np.linspace(0, 1, rope.nodes)
    low, high = 0.0, rope.length
    for _ in range(tries):
        sag = (low + high) / 2
        nodes = start + np.outer(s, end - start) - np.outer(4 * sag * s * (1 - s), [0, 0, 1])
        long = np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum() > rope.length
        low, high = (low, sag) if long else (sag, high)
    return nodes


def hanging(rope: Rope, start, end, speed=1e-10, most=200_000, **options) -> np.ndarray:
    """Static shape of the rope with both end nodes held at `start` and `end` [m].

    Relaxed by linear drag 2 ω m, ω = √(g / L), which leaves the equilibrium alone, until
    the largest node velocity is below `speed` [m/s].
    """
    relaxed = _with_drag(rope)
    rod = Rod(relaxed, Options(fixed=(0, rope.nodes - 1), **options))
    rod.reset(arch(rope, start, end))
    return settle(rod, speed, most)


def cantilever(rope: Rope, speed=1e-10, most=200_000, **options) -> np.ndarray:
    """Static shape of the rope clamped along +x at node 0 under its own weight."""
    options = {"ghost": True, "fixed": (0,)} | options
    rod = Rod(_with_drag(rope), Options(**options))
    rod.reset(straight(rope))
    return settle(rod, speed, most)


def swinging(rope: Rope, duration: float, every: int = 1, start=None, **options):
    """Motion of a rope held at node 0 (ghost=True: clamped along +x) and let go.

    Returns times [s] and positions (records, nodes, 3) [m], one record each `every` steps;
    `start` are the initial positions, a horizontal straight rope unless given. `floor=z`
    adds a plane at height z [m].
    """
    rod = Rod(rope, Options(**options))
    rod.reset(straight(rope) if start is None else start)
    records = [rod.positions()]
    for _ in range(round(duration / (rod.options.step * every))):
        rod.advance(every)
        records.append(rod.positions())
    return np.arange(len(records)) * every * rod.options.step, np.array(records)


def _with_drag(rope):
    drag = 2 * np.sqrt(rope.gravity / rope.length) * rope.linear_density
    return Rope(**{**rope.__dict__, "drag_linear": float(drag)})


def settle(rod: Rod, speed: float, most: int) -> np.ndarray:
    """Step until no node moves faster than `speed` [m/s]; the positions there."""
    for _ in range(0, most, 100):
        rod.advance(100)
        if rod.speed() < speed:
            return rod.positions()
    raise RuntimeError(f"MuJoCo's rope still moves at {rod.speed():.1e} m/s after {most} steps")
