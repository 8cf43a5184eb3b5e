"""A pliant grid of cloth as MuJoCo 4.0's two-dimensional flex, on the same nodes and triangles.

* **membrane**: both have St. Venant and Kirchhoff's energy of constant strain in plane stress, with Y, ν and t: the same force.
* **bending**: MuJoCo's is a hinge at every inner edge, quadratic in the nodes' positions, with Y t³/(12 (1 − ν²)) and no other ν; a
  pliant triangle asks what a plate with its folds costs (docs/theory/cloth.md). Where a sheet bends like a cylinder both are a plate's;
  a hinge per edge besides couples bending with twist on a grid whose cells are cut alike. `rows=True` lets each row of nodes only
  move as a whole in the plane x–z, so that the sheet can but bend like a cylinder.
* **mass**: a third of its triangles' at each node, as pliant's (`flexcomp` would give every node the same).
* **held nodes**: bodies without joints; MuJoCo refuses mocap bodies in a flex with elasticity.
* **integrator**: `discrete`, first order in the step; no damping unless `drag` [1/s] is set, a force −drag · mass · velocity.

SI units; positions are (nodes, 3) arrays in metres, z up.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from validation import mujoco_rope  # noqa: F401  # MuJoCo's warnings become Python's


@dataclass(frozen=True)
class Sheet:
    """Quantities of a pliant `[[cloth]]` grid; node (i, j) has the number i · nodes[1] + j."""

    nodes: tuple = (11, 3)
    size: tuple = (0.4, 0.1)
    u_axis: tuple = (1.0, 0.0, 0.0)
    v_axis: tuple = (0.0, 1.0, 0.0)
    origin: tuple = (0.0, 0.0, 0.0)
    diagonal: str = "up"
    thickness: float = 1e-3
    area_density: float = 0.2
    youngs_modulus: float = 2e4
    poisson_ratio: float = 0.3
    held: tuple = ()
    gravity: float = 9.81

    @property
    def stiffness(self) -> float:
        """Y t³/(12 (1 − ν²)) [N·m]."""
        return self.youngs_modulus * self.thickness**3 / (12.0 * (1.0 - self.poisson_ratio**2))

    def points(self) -> np.ndarray:
        """Nodes at rest [m]."""
        i, j = np.meshgrid(*(np.linspace(0.0, s, n) for n, s in zip(self.nodes, self.size, strict=True)), indexing="ij")
        return np.asarray(self.origin) + np.outer(i.ravel(), self.u_axis) + np.outer(j.ravel(), self.v_axis)

    def triangles(self) -> np.ndarray:
        """Triangles (n, 3)."""
        out = []
        for i in range(self.nodes[0] - 1):
            for j in range(self.nodes[1] - 1):
                a = i * self.nodes[1] + j
                b, d = a + self.nodes[1], a + 1
                up = self.diagonal == "up" or (self.diagonal == "alternating" and (i + j) % 2 == 0)
                out += [(a, b, b + 1), (a, b + 1, d)] if up else [(a, b, d), (b, b + 1, d)]
        return np.array(out)

    def masses(self) -> np.ndarray:
        """Masses of the nodes [kg]."""
        x, faces = self.points(), self.triangles()
        areas = 0.5 * np.linalg.norm(np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]]), axis=1)
        out = np.zeros(len(x))
        np.add.at(out, faces, (self.area_density * areas / 3.0)[:, None])
        return out


def scene(sheet: Sheet, step: float = 0.01, integrator: str = "midpoint", rest: str = "") -> str:
    """The TOML scene of the sheet; `rest` is added."""
    hand = f'[[gripper]]\nname = "hand"\ncloth = "sheet"\nnodes = {list(sheet.held)}\n' if sheet.held else ""
    return f"""schema_version = 1
[time]
step = {step!r}
integrator = "{integrator}"
[gravity]
magnitude = {sheet.gravity!r}
[[cloth]]
name = "sheet"
grid = {{ nodes = {list(sheet.nodes)}, size = {list(map(float, sheet.size))}, diagonal = "{sheet.diagonal}" }}
origin = {list(map(float, sheet.origin))}
u_axis = {list(map(float, sheet.u_axis))}
v_axis = {list(map(float, sheet.v_axis))}
thickness = {sheet.thickness!r}
area_density = {sheet.area_density!r}
youngs_modulus = {sheet.youngs_modulus!r}
poisson_ratio = {sheet.poisson_ratio!r}
{hand}{rest}"""


class Flex:
    """The compiled sheet: `model`, `data`, and nodes as positions."""

    def __init__(self, sheet: Sheet, step: float, drag: float = 0.0, rows: bool = False, floor: str = "", tolerance: float = 1e-12):
        self.sheet, self.rows = sheet, rows
        self.model = mujoco.MjSpec.from_string(mjcf(sheet, step, rows, floor, tolerance)).compile()
        self.data = mujoco.MjData(self.model)
        self.model.dof_damping[:] = drag * self.model.body_mass[self.model.dof_bodyid]
        mujoco.mj_forward(self.model, self.data)

    def advance(self, steps: int = 1):
        """Take `steps` steps in C."""
        mujoco.mj_step(self.model, self.data, steps)

    def positions(self) -> np.ndarray:
        """Node positions [m] of the current state."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        return self.data.flexvert_xpos.copy()

    def settle(self, change: float = 1e-9, most: int = 100_000) -> np.ndarray:
        """Positions when a hundred steps move no node by more than `change` [m]."""
        before = self.positions()
        for _ in range(0, most, 100):
            self.advance(100)
            now = self.positions()
            if np.abs(now - before).max() < change:
                return now
            before = now
        raise RuntimeError(f"MuJoCo's sheet still moves by {np.abs(now - before).max():.1e} m a hundred steps")


def mjcf(sheet: Sheet, step: float, rows: bool, floor: str, tolerance: float) -> str:
    """The MJCF text."""
    x, m = sheet.points(), sheet.masses()
    groups = [[k] for k in range(len(x))]
    if rows:
        groups = np.arange(len(x)).reshape(sheet.nodes).tolist()
    bodies = "".join(_body(k, x[g].mean(axis=0), m[g].sum(), rows, set(g) <= set(sheet.held)) for k, g in enumerate(groups))
    places = [(k, x[n] - x[g].mean(axis=0)) for k, g in enumerate(groups) for n in g]
    names = " ".join(f"n{k}" for k, _ in places)
    local = " ".join(f"{c!r}" for _, at in places for c in map(float, at))
    elements = " ".join(str(n) for face in sheet.triangles() for n in face)
    touch = int(bool(floor))
    return f"""<mujoco model="sheet">
  <option timestep="{step!r}" integrator="discrete" solver="Newton" tolerance="{tolerance!r}" gravity="0 0 {-sheet.gravity!r}"/>
  <worldbody>{floor}{bodies}</worldbody>
  <deformable>
    <flex name="sheet" dim="2" radius="{0.5 * sheet.thickness!r}" body="{names}" vertex="{local}" element="{elements}">
      <contact selfcollide="none" contype="{touch}" conaffinity="{touch}"/>
      <elasticity young="{sheet.youngs_modulus!r}" poisson="{sheet.poisson_ratio!r}" thickness="{sheet.thickness!r}"
                  elastic2d="both" damping="0"/>
    </flex>
  </deformable>
</mujoco>"""


def _body(k, at, mass, rows, held):
    """A body of one node, or of a row of them, at rest at `at`."""
    place = f'name="n{k}" pos="{" ".join(repr(float(c)) for c in at)}"'
    if held:
        return f"<body {place}/>"
    slides = [("x", "1 0 0"), ("z", "0 0 1")] if rows else [("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")]
    joints = "".join(f'<joint name="n{k}{name}" type="slide" axis="{axis}"/>' for name, axis in slides)
    # never excited: the body has no rotation
    return f'<body {place}><inertial pos="0 0 0" mass="{float(mass)!r}" diaginertia="1e-6 1e-6 1e-6"/>{joints}</body>'
