"""Chains of links as a pliant scene and as a MuJoCo model, from one description.

Link i is a rod of length 0.1 m along x, hanging on the end of link i − 1; joint axes alternate between y and z.
"""

from dataclasses import dataclass

import numpy as np

LENGTH, MASS, RADIUS = 0.1, 0.2, 0.01


@dataclass(frozen=True)
class Chain:
    """What a chain is made of, in SI units."""

    links: int
    joint: str = "revolute"  # or "ball"
    stiffness: float = 0.0  # N·m/rad
    damping: float = 0.01  # N·m·s/rad
    armature: float = 0.0  # kg·m²
    start: float = 0.3  # rad; revolute joints
    motors: bool = False  # a torque motor at every revolute joint, at rest

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Of a solid rod about its centre, axis x [kg·m²]."""
        across = MASS * (3 * RADIUS**2 + LENGTH**2) / 12
        return MASS * RADIUS**2 / 2, across, across


def scene(chain: Chain, *, integrator: str, step: float, duration: float) -> str:
    """The chain as a scene."""
    text = f'schema_version = 1\n[time]\nstep = {step}\nduration = {duration}\nintegrator = "{integrator}"\n'
    for i in range(chain.links):
        above = f'parent = "link_{i - 1}"\nposition = [{LENGTH}, 0, 0]\n' if i else ""
        start = f"start = [{chain.start}]\n" if chain.joint == "revolute" else ""
        text += f"""
[[body]]
name = "link_{i}"
{above}mass = {MASS}
center_of_mass = [{LENGTH / 2}, 0, 0]
inertia = [{", ".join(map(repr, chain.inertia))}, 0, 0, 0]
[[body.joint]]
name = "joint_{i}"
kind = "{chain.joint}"
axis = {list(axis(i))}
stiffness = {chain.stiffness}
damping = {chain.damping}
armature = {chain.armature}
{start}"""
    for i in range(chain.links if chain.motors else 0):
        text += f'\n[[actuator]]\nname = "motor_{i}"\njoint = "joint_{i}"\nkind = "torque"\n'
    return text


def mjcf(chain: Chain, *, integrator: str, step: float) -> str:
    """The chain as MJCF."""
    kind = {"revolute": "hinge", "ball": "ball"}[chain.joint]
    bodies, ends, motors = "", "", ""
    for i in range(chain.links):
        along = " ".join(map(str, axis(i)))
        passive = f'stiffness="{chain.stiffness}" damping="{chain.damping}" armature="{chain.armature}"'
        bodies += f"""
<body pos="{LENGTH if i else 0} 0 0"><joint name="joint_{i}" type="{kind}" axis="{along}" {passive}/>
<inertial pos="{LENGTH / 2} 0 0" mass="{MASS}" diaginertia="{" ".join(map(repr, chain.inertia))}"/>"""
        ends += "</body>"
        motors += f'<motor joint="joint_{i}"/>' if chain.motors else ""
    return f"""<mujoco><option timestep="{step}" integrator="{integrator}" gravity="0 0 -9.81"><flag contact="disable"/></option>
<worldbody>{bodies}{ends}</worldbody><actuator>{motors}</actuator></mujoco>"""


def axis(i: int) -> tuple[int, int, int]:
    """Axis of joint i."""
    return (0, 1, 0) if i % 2 == 0 else (0, 0, 1)


def start(chain: Chain) -> np.ndarray:
    """The joints' coordinates where the scene begins."""
    if chain.joint == "ball":
        return np.tile([1.0, 0.0, 0.0, 0.0], chain.links)
    return np.full(chain.links, chain.start)
