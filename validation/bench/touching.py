"""The timed work on bodies that touch: the cable and an arm that pushes a box, as pliant scenes and for MuJoCo.

*cable*: 18 capsules on ball joints, 0.375 m long, curled, fall 2 cm onto a floor and come to rest. *arm_box*: an arm of two
links with position drives pushes a box over a floor with the ball at its end (8 degrees of freedom).
Steps of 1/240 s, 200 of them. MuJoCo is given the same bodies, springs, drives and coefficients of friction, with its own soft
contacts at their defaults.
"""

import tomllib
from pathlib import Path

import mujoco
import numpy as np

from validation.bench import bodies
from validation.bench.peers import MujocoRun
from validation.bodies.contact import Cable, Setting

SCENES = Path(__file__).resolve().parents[2] / "tests" / "scenes"
CASES = ("cable", "arm_box")
DROP = 0.02  # m
FRICTION = 0.5


def scene_text(case: str) -> str:
    """The TOML scene pliant times."""
    if case == "cable":
        setting = Setting(step=bodies.STEP, duration=bodies.STEPS * bodies.STEP, floor=FRICTION)
        lowest = Cable(seed=1).radius
        return setting.text() + Cable(seed=1, height=0.15 + lowest + DROP).text()
    return (SCENES / "arm_pushes.toml").read_text(encoding="utf-8")


def _numbers(values) -> str:
    return " ".join(repr(float(x)) for x in values)


def _geom(name: str, shape: dict) -> str:
    sizes = {
        "sphere": lambda: [shape["radius"]],
        "capsule": lambda: [shape["radius"], shape["half_length"]],
        "box": lambda: shape["half_extents"],
    }[shape["kind"]]()
    place = _numbers(shape.get("position", (0, 0, 0)))
    return f'<geom name="{name}" type="{shape["kind"]}" size="{_numbers(sizes)}" pos="{place}"/>'


def _joint(joint: dict) -> str:
    if joint["kind"] == "free":
        return f'<freejoint name="{joint["name"]}"/>'
    kind = {"ball": "ball", "revolute": "hinge"}[joint["kind"]]
    axis = f' axis="{_numbers(joint["axis"])}"' if "axis" in joint else ""
    laws = " ".join(f'{key}="{joint[key]}"' for key in ("stiffness", "damping") if key in joint)
    anchor = _numbers(joint.get("anchor", (0, 0, 0)))
    return f'<joint name="{joint["name"]}" type="{kind}" pos="{anchor}"{axis} {laws}/>'


def mjcf(text: str, step: float) -> str:
    """A scene of this module in MuJoCo's language; contacts as pairs with pliant's coefficients (the mean of both)."""
    scene = tomllib.loads(text)
    children: dict[str | None, list[dict]] = {}
    for body in scene["body"]:
        children.setdefault(body.get("parent"), []).append(body)
    rough: dict[str, tuple[str, float]] = {}
    parents = {body["name"]: body.get("parent") for body in scene["body"]}

    def write(body: dict) -> str:
        name = body["name"]
        out = f'<body name="{name}" pos="{_numbers(body["position"])}" quat="{_numbers(body.get("quaternion", (1, 0, 0, 0)))}">'
        out += "".join(map(_joint, body["joint"]))
        center = _numbers(body.get("center_of_mass", (0, 0, 0)))
        out += f'<inertial mass="{body["mass"]}" pos="{center}" fullinertia="{_numbers(body["inertia"])}"/>'
        for k, shape in enumerate(body.get("shape", [])):
            rough[f"{name}_{k}"] = (name, shape["friction"])
            out += _geom(f"{name}_{k}", shape)
        return out + "".join(map(write, children.get(name, []))) + "</body>"

    world = "".join(map(write, children[None]))
    floor = scene["plane"][0]["friction"]
    pairs = [("floor", geom, (floor + mu) / 2) for geom, (_, mu) in rough.items()]
    geoms = list(rough.items())
    for k, (first, (a, mu)) in enumerate(geoms):
        for second, (b, nu) in geoms[k + 1 :]:
            if a != b and parents[a] != b and parents[b] != a:
                pairs.append((first, second, (mu + nu) / 2))
    contacts = "".join(
        f'<pair geom1="{a}" geom2="{b}" condim="3" friction="{mu} {mu} 0.005 0.0001 0.0001"/>' for a, b, mu in pairs
    )
    drives = "".join(
        f'<position name="{m["name"]}" joint="{m["joint"]}" kp="{m["stiffness"]}" kv="{m["damping"]}"/>'
        for m in scene.get("actuator", [])
    )
    return f"""<mujoco><compiler angle="radian"/><option timestep="{step}" integrator="implicitfast"/>
<default><geom contype="0" conaffinity="0"/></default>
<worldbody><geom name="floor" type="plane" size="5 5 1"/>{world}</worldbody>
<contact>{contacts}</contact><actuator>{drives}</actuator></mujoco>"""


def _controls(scene: dict) -> np.ndarray:
    """What the motors are told in every step, at its end."""
    t = bodies.STEP * np.arange(1, bodies.STEPS + 1)
    out = np.zeros((bodies.STEPS, len(scene.get("actuator", []))))
    for k, motor in enumerate(scene.get("actuator", [])):
        c = motor["command"]
        out[:, k] = c["mean"] + c["amplitude"] * np.sin(2 * np.pi * c["frequency"] * t + c["phase"])
    return out


class MujocoTouching(MujocoRun):
    """MuJoCo's implicitfast on one of these cases."""

    def __init__(self, case: str):
        text = scene_text(case)
        model = mujoco.MjModel.from_xml_string(mjcf(text, bodies.STEP))
        start = model.qpos0.copy()
        for body in tomllib.loads(text)["body"]:
            for joint in body["joint"]:
                if "start" in joint:
                    start[model.joint(joint["name"]).qposadr] = joint["start"]
        super().__init__(model, start, _controls(tomllib.loads(text)))

