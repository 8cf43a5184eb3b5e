"""Scenes of bodies, ropes and fixed shapes that touch, for the JAX reference, and one compiled stage per scene."""

from functools import cache, cached_property

import jax
import numpy as np
from reference_cases import scene_text, traced_once, wiggle

from validation.reference import touching, touching_model, touching_step
from validation.reference.touching_solve import Stepper


def head(step=0.004, rest_gap=1e-6, integrator="euler", extra=""):
    return f"""schema_version = 1
[time]
step = {step}
duration = 1.0
integrator = "{integrator}"
[contact]
rest_gap = {rest_gap}
{extra}"""


def floor(friction=0.5, normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, 0.0)):
    return f'[[plane]]\nname = "floor"\nnormal = {list(normal)}\npoint = {list(point)}\nfriction = {friction}\n'


def free(name, position, shape, velocity=(0.0,) * 6, quaternion=(1.0, 0.0, 0.0, 0.0), mass=1.0, friction=0.4, place=(0.0,) * 3):
    """A free body with one shape, the text of its sizes, whose centre of mass is not where the shape's centre is."""
    rough = "" if friction is None else f"friction = {friction}\n"
    return f"""
[[body]]
name = "{name}"
position = {list(position)}
quaternion = {list(quaternion)}
mass = {mass}
center_of_mass = [0.002, -0.001, 0.003]
inertia = [{0.0021 * mass}, {0.0024 * mass}, {0.0018 * mass}, {0.0001 * mass}, 0.0, 0.0]
[[body.joint]]
name = "{name}_free"
kind = "free"
velocity = {list(velocity)}
[[body.shape]]
{shape}
position = {list(place)}
{rough}"""


BALL = 'kind = "sphere"\nradius = 0.05'
BOX = 'kind = "box"\nhalf_extents = [0.05, 0.06, 0.04]'
CAPSULE = 'kind = "capsule"\nradius = 0.03\nhalf_length = 0.06'
CYLINDER = 'kind = "cylinder"\nradius = 0.05\nhalf_length = 0.06'
STONE = """kind = "hull"
points = [[0.05, 0.04, -0.05], [-0.05, 0.05, -0.05], [-0.04, -0.05, -0.05], [0.05, -0.04, -0.05],
  [0.04, 0.03, 0.05], [-0.03, 0.04, 0.04], [-0.04, -0.03, 0.05], [0.02, -0.05, 0.03], [0.0, 0.0, 0.07]]"""
LYING = (0.7071067811865476, 0.0, 0.7071067811865476, 0.0)  # own z axis along x
SLOPE = (0.1, -0.05, 1.0)


def turned(angle, axis=(0.0, 0.0, 1.0)):
    """Unit quaternion."""
    axis = np.array(axis) / np.linalg.norm(axis)
    return [float(np.cos(angle / 2)), *(float(x) for x in np.sin(angle / 2) * axis)]


def fixed_box():
    """Its upper face at z = 0.05 m, turned."""
    return f"""[[box]]
name = "table"
position = [0.0, 0.0, 0.0]
quaternion = {turned(0.2)}
half_extents = [0.05, 0.1, 0.05]
friction = 0.5
"""


def fixed_bar(a, b, radius):
    return f'[[capsule]]\nname = "bar"\na = {list(a)}\nb = {list(b)}\nradius = {radius}\nfriction = 0.3\n'


def edited(name, *changes):
    """The text of a scene of tests/scenes with each (old, new) replaced."""
    text = scene_text(name)
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


def arm_pushes():
    """A moment before the arm meets the box, which stands aslant."""
    where = f"position = [0.1, 0.01, 0.050001]\nquaternion = {turned(0.1)}"
    return edited(
        "arm_pushes",
        ("1e-8", "1e-6"),
        ("position = [0.1, 0, 0.0500001]\nquaternion = [1, 0, 0, 0]", where),
        ("start = [1.75]", "start = [1.7]\nvelocity = [-1.0]"),
    )


def rope_on_box():
    """A rope falls over a box that slides on the floor."""
    whole = scene_text("rope_on_box")
    return edited(
        "rope_on_box",
        (whole[whole.index("[[cylinder]]") : whole.index("[[body]]")], ""),
        ("nodes = 9", "nodes = 6"),
        ("from = [-0.2, 0.01, 0.16]", "from = [-0.25, 0.01, 0.1055]"),
        ("radius = 0.004\n", "radius = 0.004\nvelocity = [0.0, 0.0, -0.2]\n"),
    )


def rope_edges():
    """A moment before edges of a rope meet the bar, the box and the ball."""
    return edited(
        "rope_edges",
        ("nodes = 7", "nodes = 6"),
        ("0.012, 0.075]", "0.012, 0.0705]"),
        ("[0.1, 0.0, 0.0]", "[0.1, 0.0, 0.005]"),
        ("0.05, 0.02]", "0.05, 0.035]"),
        ('contact = "edges"', 'contact = "edges"\nvelocity = [0.0, 0.0, -0.2]'),
    )


def sheet_edges():
    """A coarse sheet a moment before its triangles meet a corner of the box, the ball and the bar's end."""
    return edited(
        "cloth_edges",
        ("nodes = [4, 4], size = [0.4, 0.4]", "nodes = [3, 3], size = [0.36, 0.36]"),
        ("origin = [-0.2, -0.2, 0.095]", "origin = [-0.2, -0.2, 0.0945]\nvelocity = [0.0, 0.0, -0.2]"),
        ("-0.02, 0.02]", "-0.03, 0.0305]"),
        ("-0.12, 0.06]", "-0.12, 0.0715]"),
    )


# name -> (scene, steps)
SCENES = {
    "ball_rolls": (  # falls on a slope, slides, rolls
        lambda: head() + floor(0.3, SLOPE) + free("ball", (0.0, 0.0, 0.0510), BALL, (0.4, 0.0, 0.0, 0.0, 2.0, 3.0), mass=0.4),
        12,
    ),
    "box_slides": (
        lambda: head() + floor() + free("box", (0.0, 0.0, 0.040001), BOX, (0.6, 0.2, 0.0, 0.0, 0.0, 1.5)),
        10,
    ),
    "box_tips": (  # over two corners in front
        lambda: head() + floor(0.9) + free("box", (0.0, 0.0, 0.0601), BOX.replace("[0.05, 0.06, 0.04]", "[0.02, 0.04, 0.06]"),
                                       (0.8, 0.0, 0.0, 0.0, 3.0, 0.0), friction=0.9),
        10,
    ),
    "capsule_rolls": (
        lambda: head() + floor(0.4, SLOPE) + free("capsule", (0.0, 0.0, 0.04), CAPSULE, (0.2, 0.3, 0.0, -4.0, 0.0, 1.0), LYING),
        12,
    ),
    "cylinder_rolls": (
        lambda: head() + floor(0.4) + free("roll", (0.0, 0.0, 0.0505), CYLINDER, (0.1, 0.3, 0.0, -3.0, 0.0, 0.5), LYING),
        10,
    ),
    "cylinder_stands": (
        lambda: head() + floor(0.4) + free("can", (0.0, 0.0, 0.0601), CYLINDER, (0.2, 0.0, 0.0, 0.0, 0.0, 2.0)),
        10,
    ),
    "deep_ball": (  # set 3 mm into the floor: pushed out over several steps
        lambda: head() + floor(0.3)
        + free("ball", (0.0, 0.0, 0.0501), BALL, (0.2, 0.0, 0.0, 0.0, 0.0, 1.0), place=(0.01, 0.0, 0.0)),
        10,
    ),
    "box_at_fixed": (  # falls on the edge of a fixed box and on a fixed capsule across it
        lambda: head() + fixed_box() + fixed_bar((0.075, -0.2, 0.033), (0.07, 0.2, 0.037), 0.02)
        + free("box", (0.0, 0.0, 0.0934), BOX, (0.1, 0.1, 0.0, 0.0, 0.2, 0.0), turned(0.05, (0.3, 1.0, 0.1))),
        12,
    ),
    "capsule_at_fixed": (  # tips over a box's edge onto a fixed capsule
        lambda: head() + fixed_box() + fixed_bar((0.125, -0.2, 0.015), (0.12, 0.2, 0.02), 0.02)
        + free("capsule", (0.065, 0.0, 0.0788), CAPSULE, (0.1, 0.2, 0.0, -1.0, 0.5, 0.0), turned(1.7, (0.0, 1.0, 0.1))),
        12,
    ),
    "corner_at_capsule": (  # a box's corner on a fixed capsule
        lambda: head() + fixed_bar((-0.1, -0.05, 0.0), (0.15, 0.03, 0.01), 0.03)
        + free("box", (0.0, 0.0, 0.1195), BOX, (0.1, 0.2, -0.2, 0.0, 0.0, 0.0), turned(0.9, (1.0, -0.8, 0.3))),
        10,
    ),
    "ball_at_fixed": (  # rolls from a fixed box over its edge onto a fixed ball
        lambda: head() + fixed_box() + '[[sphere]]\nname = "stone"\ncenter = [0.1, 0.0, 0.0]\nradius = 0.05\nfriction = 0.4\n'
        + free("ball", (0.035, 0.01, 0.1002), BALL, (0.35, 0.05, 0.0, -1.0, 7.0, 0.0)),
        28,
    ),
    "box_on_box": (
        lambda: head() + floor() + free("lower", (0.0, 0.0, 0.0401), BOX, (0.2, 0.0, 0.0, 0.0, 0.0, 0.3), mass=2.0)
        + free("upper", (0.03, 0.02, 0.1203), BOX, (-0.3, 0.1, 0.0, 0.0, 0.0, 1.0), turned(0.4), friction=0.2),
        10,
    ),
    "ball_on_ball": (  # rolls off one that rolls; the rule between them gives way and has its own friction
        lambda: head(extra='[[contact.pair]]\nbetween = ["lower", "upper"]\nfriction = 0.25\ncompliance = 1e-4\n') + floor()
        + free("lower", (0.0, 0.0, 0.0801), BALL.replace("0.05", "0.08"), (0.2, 0.0, 0.0, 0.0, 2.0, 1.0), mass=2.0)
        + free("upper", (0.03, 0.01, 0.2065), BALL, (0.0, 0.1, 0.0, 0.0, 3.0, 0.0), mass=0.5),
        12,
    ),
    "edge_on_edge": (  # a leaning box slides down the edge of another
        lambda: head() + floor() + free("lower", (0.0, 0.0, 0.0401), BOX, (0.0,) * 6, mass=2.0)
        + free("upper", (0.095, 0.0, 0.0967), BOX, (0.0, 0.3, 0.0, 0.0, 0.0, 0.0), turned(0.7, (0.1, 1.0, 0.2))),
        10,
    ),
    "stones": (  # hulls: one tumbles over another on the floor
        lambda: head() + floor() + free("lower", (0.0, 0.0, 0.0501), STONE, (0.1, 0.0, 0.0, 0.0, 0.0, 0.2), mass=2.0)
        + free("upper", (0.03, 0.02, 0.1763), STONE, (0.0, 0.3, -0.2, 1.0, 0.0, 0.0), turned(0.8, (0.3, 1.0, 0.2)), friction=0.2),
        12,
    ),
    "capsules_cross": (  # one lies across another
        lambda: head() + floor() + free("lower", (0.0, 0.0, 0.0301), CAPSULE, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0), LYING)
        + free("upper", (0.01, 0.005, 0.0902), CAPSULE, (0.0, 0.2, 0.0, 0.0, 0.0, 1.0), turned(np.pi / 2, (1.0, 0.2, 0.0))),
        10,
    ),
    "rope_on_box": (rope_on_box, 10),
    "rope_edges": (rope_edges, 12),
    "sheet_edges": (sheet_edges, 8),
    "box_slides_sdirk2": (
        lambda: head(integrator="sdirk2") + floor() + free("box", (0.0, 0.0, 0.040001), BOX, (0.6, 0.2, 0.0, 0.0, 0.0, 1.5)),
        10,
    ),
    "ball_rolls_sdirk2": (  # its fall ends in a step of two halves
        lambda: head(integrator="sdirk2") + floor(0.3, SLOPE)
        + free("ball", (0.0, 0.0, 0.0510), BALL, (0.4, 0.0, 0.0, 0.0, 2.0, 3.0), mass=0.4),
        12,
    ),
    "arm_pushes": (arm_pushes, 9),
}

# scene -> another one, with turns of planes, boxes and shapes of bodies by rotation vectors [rad] in place of the scene's zeros, and by
# how much (coordinates of the state) its start is higher [m]
TURNED = {
    "box_at_fixed_turned": (
        "box_at_fixed", {"table.rotation": (0.1, -0.05, 0.08), "box.shape[0].rotation": (0.05, 0.1, -0.1)}, {2: 0.0068}
    ),
    "capsule_rolls_turned": (
        "capsule_rolls", {"floor.rotation": (0.05, -0.1, 0.1), "capsule.shape[0].rotation": (0.1, 0.06, -0.05)}, {2: -0.007}
    ),
    "stones_turned": (
        "stones",
        {"floor.rotation": (0.03, 0.02, 0.1), "lower.shape[0].rotation": (0.02, 0.05, 0.1), "upper.shape[0].rotation": (0.1, 0.06, -0.05)},
        {2: 0.0019, 9: 0.0056},
    ),
    # an edge begins in the box and is pushed out over several steps
    "rope_edges_turned": ("rope_edges", {"table.rotation": (0.1, -0.05, 0.08)}, {}),
}
SCENES |= {name: (SCENES[of][0], 8) for name, (of, _, _) in TURNED.items()}

# contacts that a stage may list, where it is not 16
SIZES = {"rope_edges": 20, "rope_edges_turned": 20, "rope_on_box": 12, "sheet_edges": 24}


def width(model):
    """Entries of θ of the compiled stage: scenes of the same bodies with different shapes share it."""
    return -(-len(model.theta) // 64) * 64


def structure(model, text):
    """What a compiled stage holds of a scene, and kinds of contacts that it knows: of one free body, or two, all."""
    own = model.bodies
    if model.nodes is not None or touching_step.n_rows(model) or own.motors:
        return text, model.kinds
    joints = [(j.kind, j.axis.tolist(), j.anchor.tolist(), j.q, j.v, j.theta) for j in own.joints]
    of = [(b.parent, b.frame.tolist(), len(b.joints), b.theta.tolist()) for b in own.bodies]
    return (joints, of, model.of_bodies.tolist(), model.h, width(model)), touching.KINDS[:5]


@cache
def compiled(key, size):
    """One stage for all scenes of a structure."""
    model, kinds = STRUCTURES[key]
    stage = touching_step.make_stage(model, kinds)

    def slopes(directions, *at):
        value, along = jax.linearize(lambda z: stage(z, *at), np.zeros(directions.shape[1]))
        return value, jax.vmap(along)(directions).T

    return traced_once(slopes, key, size)


STRUCTURES = {}


def stage_of(model, text, size):
    """The compiled stage for a scene."""
    about, kinds = structure(model, text)
    key = repr(about)
    STRUCTURES.setdefault(key, (model, kinds))
    return compiled(key, size)


# at the default rest gap: the ball lands with its spin, and rolls about the point that it stands on
SPINNING = (
    head(rest_gap=1e-9)
    + """
[[plane]]
name = "floor"
friction = 0.33
[[body]]
name = "ball"
position = [0.0, 0.0, 0.060002]
quaternion = [-0.877, -0.319, -0.03, 0.359]
mass = 1.4
center_of_mass = [0.002, -0.001, 0.003]
inertia = [0.003, 0.0034, 0.0025, 0.0001, 0.0, 0.0]
[[body.joint]]
name = "free"
kind = "free"
velocity = [-0.22, -0.06, -0.21, -0.09, 0.42, 2.1]
[[body.shape]]
kind = "sphere"
radius = 0.06
"""
)


def stepper_of(text, size=16):
    """(model, steps of it) of a scene text."""
    model = touching_model.loads(text)
    return model, Stepper(model, stage_of(model, text, size), size, width(model))


class Case:
    """A scene with its reference model, its compiled stage, and its start."""

    def __init__(self, name):
        text, self.steps = SCENES[name]
        self.text = text()
        self.model, self.stepper = stepper_of(self.text, SIZES.get(name, 16))
        model, rng = self.model, np.random.default_rng(2)
        self.x0, self.u = model.initial_state(), rng.uniform(-0.5, 0.5, (self.steps, model.nu))
        if model.nodes is not None and model.nodes.nu:
            self.u = wiggle(model.nodes, model.nodes.q0, self.steps)
        self.theta = model.theta.copy()
        _, turns, higher = TURNED.get(name, (name, {}, {2: -0.003} if name == "deep_ball" else {}))
        for entry, vector in turns.items():
            self.theta[[model.index(f"{entry}[{k}]") for k in range(3)]] = vector
        for k, by in higher.items():
            self.x0[k] += by

    @cached_property
    def rollout(self):
        """(x (T + 1, nx), largest last Newton step, [(A, B, C)] of each step)."""
        xs, slopes = self.stepper.rollout(self.x0, self.u, self.theta)
        return xs, self.stepper.largest, slopes


@cache
def case(name):
    """The case, built once per test process."""
    return Case(name)
