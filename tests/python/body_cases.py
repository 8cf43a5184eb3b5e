"""Scenes of bodies for the JAX reference: every joint and law, and one compiled step per case."""

from functools import cache

import numpy as np
from reference_cases import scene_text, traced_once

from validation.reference import body_model, body_step

# Children before parents, joints that share a body, frames without mass, anchors, a tilted and weaker gravity, and wind in thick air.
CRANE = """
schema_version = 1
[time]
step = 0.004
duration = 0.02
integrator = "euler"
[contact]
rest_gap = 1e-6
[gravity]
magnitude = 6.0
tilt = [0.2, -0.1]
[air]
wind = [0.8, -1.5, 0.3]
density = 8.0
viscosity = 0.02

[[body]]
name = "hook"
parent = "yoke"
position = [0.1, 0.0, -0.05]
mass = 0.2
center_of_mass = [0.0, 0.02, -0.04]
inertia = [0.0004, 0.0005, 0.0003, 0.00002, 0.0, 0.00003]
[[body.joint]]
name = "sling"
kind = "ball"
anchor = [0.01, 0.0, 0.03]
armature = 0.0002
stiffness = 0.3
damping = 0.01
quadratic_damping = 0.003
velocity = [1.0, 2.0, -3.0]

[[body]]
name = "mast"
position = [0.2, 0.0, 0.5]
quaternion = [0.6, 0.0, 0.8, 0.0]
mass = 2.0
center_of_mass = [0.0, 0.1, 0.2]
inertia = [0.03, 0.04, 0.02, 0.002, -0.001, 0.003]
[[body.joint]]
name = "slew"
kind = "universal"
axis = [0, 0, 2]
second_axis = [1, 0.2, 0]
anchor = [0.0, 0.02, -0.1]
armature = 0.02
stiffness = 3.0
rest = 0.1
cubic_stiffness = 4.0
damping = 0.05
quadratic_damping = 0.2
friction = 0.15
start = [0.2, -0.3]
velocity = [0.6, -0.4]
# universal limits

[[body]]
name = "jib"
parent = "mast"
position = [0.0, 0.3, 0.1]
quaternion = [0.96, 0.28, 0.0, 0.0]
mass = 0.7
center_of_mass = [0.2, 0.0, 0.0]
inertia = [0.001, 0.01, 0.01, 0.0, 0.0, 0.0]

[[body]]
name = "trolley"
parent = "jib"
mass = 0.4
inertia = [0.001, 0.002, 0.0015, 0.0, 0.0, 0.0]
[[body.joint]]
name = "rail"
kind = "prismatic"
axis = [1, 0, 0.1]
friction = 1.5
stiction = 0.8
stribeck_velocity = 0.05
stiffness = 4.0
rest = 0.05
cubic_stiffness = 100.0
quadratic_damping = 3.0
start = [0.2]
velocity = [0.4]
armature = 0.1
# rail limits
[[body.joint]]
name = "winch"
kind = "revolute"
axis = [0, 1, 1]
anchor = [0.03, 0.0, 0.0]
friction = 0.4
start = [0.7]

[[body]]
name = "yoke"
parent = "trolley"
position = [0.0, 0.0, -0.1]
[[body.joint]]
name = "swivel"
kind = "revolute"
axis = [0, 0.1, 1]
armature = 0.003
quadratic_damping = 0.0002
velocity = [-4.0]
cogging = { cycles = 5, sine = 0.03, cosine = -0.02 }

[[body]]
name = "kite"
drag_area = 0.02
position = [1.0, 0.0, 2.0]
quaternion = [0.0, 0.6, 0.0, 0.8]
mass = 0.1
inertia = [0.001, 0.002, 0.0025, 0.0, 0.0, 0.0]
[[body.joint]]
name = "string"
kind = "free"
armature = 0.01
velocity = [1.0, 0.0, -2.0, 4.0, 0.2, -5.0]

[[actuator]]
name = "trolley_motor"
joint = "rail"
kind = "velocity"
damping = 6.0
gear = 2.0
offset = -0.3

[[actuator]]
name = "winch_servo"
joint = "winch"
kind = "position"
stiffness = 1.5
damping = 0.1
gear = 0.5
offset = 0.05

[[actuator]]
name = "swivel_motor"
joint = "swivel"
kind = "torque"
gain = 0.2
gear = -3.0

[[force]]
name = "tether"
joint = "sling"
formula = ["-k*qx*(1 + qy**2) - c*vx*abs(vx)", "k*sin(qz) - c*vy", "twist*qx*vz"]
parameters = { k = 0.2, c = 0.002, twist = 0.0 }

[[force]]
name = "grease"
joint = "rail"
formula = "-c*v/(1 + (v/speed)**2) + where(q > 0, a*exp(-q), a)"
parameters = { c = 0.5, speed = 0.3, a = 0.2 }
"""
LIMITS = {"universal": "limits = [-0.3005, 0.2015]", "rail": "limits = [-0.1, 0.2005]"}
STEPS = 4


class Case:
    """A scene with its reference model, compiled steps, start and controls."""

    def __init__(self, name, integrator):
        if name == "crane":
            text = CRANE.replace('"euler"', f'"{integrator}"')
            if integrator != "midpoint":
                for where, limits in LIMITS.items():
                    text = text.replace(f"# {where} limits", limits)
        else:
            text = scene_text(name.removesuffix("-resting"), integrator)
            # a disc without thickness has no spread along its axis: pliant gives it a little, the reference none
            text = text.replace("inertia = [0.001, 0.002, 0.001,", "inertia = [0.0012, 0.002, 0.0012,")
        self.text, self.model = text, body_model.loads(text)
        self.linearized = traced_once(body_step.make_linearized_step(self.model), text)
        self.x0 = self.model.initial_state()
        if name == "arm_stops":  # the shoulder slides, the elbow runs into its stop
            self.x0[1] = 0.6 - 0.01
            self.x0[3] = 3.0
        elif name == "arm_stops-resting":  # the shoulder sticks, the elbow lies on its stop
            self.x0[1] = 0.6 - 1e-6
            self.x0[2] = 0.0
        rng = np.random.default_rng(1)
        self.u = rng.uniform(-1.0, 1.0, (STEPS, self.model.nu))

    def rollout(self):
        """(x (T + 1, nx), largest last Newton step, [(A, B, C)] of each step)."""
        xs, errors, slopes = [self.x0], [], []
        for row in self.u:
            x, error, *abc = self.linearized(xs[-1], row, self.model.theta)
            xs.append(np.asarray(x))
            errors.append(float(error))
            slopes.append([np.asarray(s) for s in abc])
        return np.array(xs), max(errors), slopes


@cache
def case(name, integrator):
    """The case, built once per test process."""
    return Case(name, integrator)
