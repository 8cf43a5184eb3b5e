"""A cable of capsules on ball joints that a gantry swings, as a system of the blind batch; motions by MuJoCo (RK4).

`LINKS` capsules hang from a carriage that two position servos move along x and y:

    servo          f = k_p (u - x) - k_v ẋ         of every slide [N]
    ball joint     τ = -k q - d ω                  q the rotation vector of the link in its parent [rad], ω its rate [rad/s]

Sizes, commands, rates and noise are of the seed. A record begins at rest under its first command, so that nothing about its beginning is
unknown. Commands are linear between the samples that the log has, but where a null asks for smooth ones. Forces that MuJoCo does not have
are those of `cable_forces.py`: with them every step calls back to Python, so that they cost four times as much. MuJoCo's own laws make
the cubic springs, the quadratic damping of slides and dry friction.
"""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from validation.blind import cable_forces, cable_midpoint
from validation.blind.cable_forces import Forces
from validation.blind.system import Cause, Changes, Job, Knob, Setup, sensor_causes, sensor_knobs, shown_area, turned

LINKS = 4
BALLS = tuple(f"joint_{k}" for k in range(LINKS))
BODIES = tuple(f"link_{k}" for k in range(LINKS))
SLIDES, MOTORS = ("slide_x", "slide_y"), ("motor_x", "motor_y")
MARKED = (0, 1, 3)  # links whose far ends are seen
AXES = "xyz"
G = 9.81  # m/s²
STEPS = 40  # of the truth in a sample
SEEN = ("scale", "rotation", "bias", "delay", "drift")  # changes of the sensor, not of the motion
HARD = 2.5  # time constant of MuJoCo's dry friction over the step, as short as it may be
FORCES = ("square", "creep", "slack", "stiction", "load", "drag", "gust", "pull")  # changes that call back to Python
SPEEDS = (0.01, 0.04, 0.15)  # m/s, at which friction at rest may fade


class CableSetup(Setup):
    """See `Setup`."""

    system = "cable"

    def __init__(self, rng: np.random.Generator, jitter: float = 0.0, smooth: bool = False) -> None:
        self.smooth, self.substeps, self.roles = smooth, 4, ("fit",) * 3 + ("held_out",)
        self.rate = 40.0 if smooth else float(rng.choice([80.0, 100.0]))
        self.duration = float(rng.choice([1.5, 2.0]))
        self.link, self.radius = float(np.round(rng.uniform(0.06, 0.08), 4)), float(np.round(rng.uniform(0.012, 0.016), 4))
        self.mass, self.carriage = float(np.round(rng.uniform(0.02, 0.04), 4)), float(np.round(rng.uniform(0.4, 0.8), 3))
        self.stiffness = float(np.round(np.exp(rng.uniform(np.log(8e-3), np.log(3e-2))), 5))
        self.damping = float(np.round(rng.uniform(0.04, 0.1) * self.stiffness, 6))
        self.servo = (float(np.round(rng.uniform(1500.0, 2500.0))), float(np.round(rng.uniform(40.0, 70.0), 1)))
        self.sigma = float(np.exp(rng.uniform(np.log(2e-4), np.log(8e-4))))
        across, along = self.mass * (self.link**2 / 12 + self.radius**2 / 4), 0.5 * self.mass * self.radius**2
        # roots of ∫ x², y², z² dm over the mass [m]
        self.spread = np.sqrt(np.array([0.5 * along, 0.5 * along, across - 0.5 * along]) / self.mass)
        # the carriage's area over a link's: its inertia is that of a cube
        self.carriage_shows = shown_area(np.full(3, math.sqrt(0.5e-3 / self.carriage))) / shown_area(self.spread)
        self.records(rng, jitter)
        self.free, self.values = ("stiffness",), {}
        self.knobs, self.causes, self.outside = sensor_knobs(4 * self.link), {}, {}
        self.may_be_hidden()

    # ---- Excitations ---------------------------------------------------------------------------------------------------

    def records(self, rng: np.random.Generator, jitter: float) -> None:
        """Waves, stamps and logged commands of all records."""
        self.waves, self.logged = [], []
        for _ in self.roles:
            frequency = rng.uniform(0.4, 2.5, (2, 3))
            size = rng.uniform(0.6, 1.4) * 0.06 / (1.0 + frequency)
            self.waves.append((size, frequency, rng.uniform(0.0, 2 * np.pi, (2, 3))))
            t = np.arange(round(self.duration * self.rate) + 1) / self.rate
            shaken = np.round(t + jitter * np.clip(rng.standard_normal(len(t)), -3, 3) * (t > 0), 6)
            self.logged.append((shaken, np.round(self.command(len(self.logged), shaken), 7)))

    def command(self, record: int, t: np.ndarray) -> np.ndarray:
        """Commanded places of the carriage (times, 2) [m], from rest."""
        size, frequency, phase = self.waves[record]
        t = np.maximum(t, 0.0)
        wave = np.einsum("jk,tjk->tj", size, np.sin(2 * np.pi * frequency * t[:, None, None] + phase))
        return wave * (1.0 - np.exp(-((t / 0.3) ** 2)))[:, None]

    def told(self, record: int, changes: Changes, h: float, steps: int, linear: bool) -> np.ndarray:
        """What the servos get over each step of h (steps, 2) [m]: its value in the middle, the first sample's before."""
        stamps, samples = self.logged[record]
        out = np.empty((steps, 2))
        for j, motor in enumerate(MOTORS):
            at = (np.arange(steps) + 0.5) * h - changes.get(f"late:{motor}", 0.0)
            out[:, j] = np.interp(at, stamps, samples[:, j]) if linear else self.command(record, at)[:, j]
            if lag := changes.get(f"lag:{motor}", 0.0) + changes.get("lag", 0.0):
                # the mean over a step of y, T ẏ = u - y, u constant in a step
                decay = math.exp(-h / lag)
                end = lfilter([1.0 - decay], [1.0, -decay], out[:, j] - out[0, j]) + out[0, j]
                begin = np.concatenate([out[:1, j], end[:-1]])
                out[:, j] += (begin - out[:, j]) * (1.0 - decay) * lag / h
            out[:, j] += changes.get(f"offset:{motor}", 0.0) / self.gain(motor, changes)
        return out

    def gain(self, motor: str, changes: Changes) -> float:
        """k_p of a servo [N/m]."""
        return self.servo[0] + changes.get(f"kp:{motor}", 0.0)

    # ---- What may be hidden --------------------------------------------------------------------------------------------

    def add(self, name: str, at: str, knob: str, made: Knob, **more) -> None:
        """A knob and the cause that frees it alone."""
        self.knobs[knob] = made
        cause = Cause(name, at, (knob,), **more)
        self.causes[cause.key] = cause

    def may_be_hidden(self) -> None:
        self.knobs["stiffness"] = Knob(0.02 * self.stiffness, 0.8 * self.stiffness, "joint_*.stiffness", self.stiffness, positive=True)
        for j in BALLS:
            self.of_ball(j)
        for j, m in zip(SLIDES, MOTORS, strict=True):
            self.of_slide(j, m)
        self.add("actuator_lag", "", "lag", Knob(5e-4, 0.03, "*.lag", one_sided=True), hidden=False)
        for b in ("carriage", *BODIES):
            self.of_body(b)
        self.add("gravity_magnitude", "", "gravity", Knob(0.02, 2.0, "gravity.magnitude", G))
        self.knobs |= {f"tilt{k}": Knob(1e-3, 0.2, f"gravity.tilt[{k}]") for k in range(2)}
        own = [Cause("gravity_tilt", "", ("tilt0", "tilt1")), *sensor_causes()]
        self.causes |= {cause.key: cause for cause in own}
        per_unit = 0.5 * shown_area(self.spread)  # of a link: N·s²/m² by kg/m³
        self.add("quadratic_drag", "", "drag", Knob(2e-3, 0.1, "air.density", one_sided=True, value=lambda x: x / per_unit))
        # outside the library: largest sizes in N a link, N·m, m
        beyond = {"gust0": 0.05, "gust1": 0.05, "pull": 0.02, "drift": 0.01}
        self.knobs |= {key: Knob(0.02 * x, x) for key, x in beyond.items()}
        self.outside |= {"gust": ("gust0", "gust1"), "pull": ("pull",), "drift": ("drift",)}

    def of_ball(self, j: str) -> None:
        k, d = self.stiffness, self.damping
        self.add("joint_stiffness", j, f"stiffness:{j}", Knob(0.02 * k, 2.0 * k, f"{j}.stiffness", k, positive=True))
        self.add("viscous_friction", j, f"damping:{j}", Knob(0.02 * d, 2.0 * d, f"{j}.damping", d, positive=True))
        self.add("quadratic_damping", j, f"square:{j}", Knob(0.02 * d, 0.5 * d, f"{j}.quadratic_damping", one_sided=True))
        inertia = self.mass * self.link**2
        self.add("armature", j, f"armature:{j}", Knob(2e-3 * inertia, 0.5 * inertia, f"{j}.armature", one_sided=True))
        self.add("cubic_stiffness", j, f"cubic:{j}", Knob(0.1 * k, 30.0 * k, f"{j}.cubic_stiffness", one_sided=True))
        creep = Knob(0.05, 5.0, f"{j}.plastic_time", one_sided=True, value=lambda x: 1.0 / max(x, 1e-9))  # 1/s, of no yield
        self.add("joint_plasticity", j, f"creep:{j}", creep)
        self.knobs[f"slack:{j}"] = Knob(0.01, 0.3, one_sided=True)  # rad
        self.outside[f"slack:{j}"] = (f"slack:{j}",)

    def of_slide(self, j: str, motor: str) -> None:
        k, d = self.servo
        force = 0.5 * (self.carriage + LINKS * self.mass)  # N at 0.5 m/s²
        self.add("viscous_friction", j, f"damping:{j}", Knob(0.01 * d, 0.5 * d, f"{j}.damping", one_sided=True))
        self.add("quadratic_damping", j, f"square_slide:{j}", Knob(0.02 * d, 2.0 * d, f"{j}.quadratic_damping", one_sided=True))
        self.add("coulomb_friction", j, f"friction:{j}", Knob(0.05 * force, 3.0 * force, f"{j}.friction", one_sided=True))
        points = tuple({f"stiction:{j}": 0.1 * force, f"speed:{j}": x} for x in SPEEDS)
        stiction = Knob(0.05 * force, 3.0 * force, f"{j}.stiction", one_sided=True)
        self.add("stribeck", j, f"stiction:{j}", stiction, points=points, hidden=False)
        self.add("load_friction", j, f"load:{j}", Knob(0.01, 0.3, f"{j}.load_friction", one_sided=True))
        self.add("joint_stiffness", j, f"stiffness:{j}", Knob(0.005 * k, 0.2 * k, f"{j}.stiffness", one_sided=True))
        self.add("cubic_stiffness", j, f"cubic:{j}", Knob(1.0 * k, 60.0 * k, f"{j}.cubic_stiffness", one_sided=True))
        self.add("armature", j, f"armature:{j}", Knob(0.01 * self.carriage, 2.0 * self.carriage, f"{j}.armature", one_sided=True))
        self.add("drive_stiffness", motor, f"kp:{motor}", Knob(0.01 * k, 0.5 * k, f"{motor}.stiffness", k))
        self.add("torque_offset", motor, f"offset:{motor}", Knob(0.02 * force, 20.0 * force, f"{motor}.offset"))
        self.add("actuator_delay", motor, f"late:{motor}", Knob(5e-4, 0.025, f"{motor}.delay", one_sided=True))
        self.add("actuator_lag", motor, f"lag:{motor}", Knob(5e-4, 0.03, f"{motor}.lag", one_sided=True))

    def of_body(self, b: str) -> None:
        mass = self.carriage if b == "carriage" else self.mass
        name = "payload" if b == BODIES[-1] else "link_mass"
        self.add(name, b, f"mass:{b}", Knob(0.01 * mass, 0.6 * mass, f"{b}.mass", mass, positive=True))
        if b == "carriage":
            return  # it does not turn
        com = (0.0, 0.0, -0.5 * self.link)
        self.knobs |= {f"com{a}:{b}": Knob(5e-3 * self.link, 0.2 * self.link, f"{b}.center_of_mass[{a}]", com[a]) for a in range(3)}
        self.knobs |= {f"spread{a}:{b}": Knob(0.01 * s, 0.6 * s, f"{b}.spread[{a}]", float(s)) for a, s in enumerate(self.spread)}
        for cause, stem in (("center_of_mass", "com"), ("link_inertia", "spread")):
            own = Cause(cause, b, tuple(f"{stem}{a}:{b}" for a in range(3)))
            self.causes[own.key] = own

    # ---- Motion --------------------------------------------------------------------------------------------------------

    def xml(self, changes: Changes, h: float) -> str:
        """The cable hanging straight down from its carriage, in MuJoCo's format."""
        get = changes.get
        numbers = lambda x: " ".join(repr(float(v)) for v in x)

        def joint(name: str, kind: str, stiffness: float, damping: float) -> str:
            replaced = f"creep:{name}" in changes or f"slack:{name}" in changes
            spring = 0.0 if replaced else stiffness + get(f"stiffness:{name}", 0.0)
            own = {"stiffness": (spring, 0.0, get(f"cubic:{name}", 0.0)), "armature": (get(f"armature:{name}", 0.0),)}
            own |= {"damping": (damping + get(f"damping:{name}", 0.0), get(f"square_slide:{name}", 0.0), 0.0)}
            own |= {"frictionloss": (get(f"friction:{name}", 0.0),)}
            more = " ".join(f'{key}="{numbers(x)}"' for key, x in own.items())
            return f'<joint name="{name}" {kind} solreffriction="{HARD * h} 1" solimpfriction="0.999 0.9999 0.001" {more}/>'

        def body(k: int) -> str:
            b, mass = BODIES[k], self.mass + get(f"mass:{BODIES[k]}", 0.0)
            com = np.array([get(f"com{a}:{b}", 0.0) for a in range(3)]) - [0.0, 0.0, 0.5 * self.link]
            s = (self.spread + [get(f"spread{a}:{b}", 0.0) for a in range(3)]) ** 2
            ball = joint(BALLS[k], 'type="ball"', self.stiffness + get("stiffness", 0.0), self.damping)
            return f"""<body name="{b}" pos="0 0 {-self.link if k else 0.0}">{ball}
                <inertial pos="{numbers(com)}" mass="{mass!r}" diaginertia="{numbers(mass * (s.sum() - s))}"/>"""

        slides = "".join(joint(j, f'type="slide" axis="{axis}"', 0.0, 0.0) for j, axis in zip(SLIDES, ("1 0 0", "0 1 0"), strict=True))
        gains = {j: self.gain(m, changes) for j, m in zip(SLIDES, MOTORS, strict=True)}
        servos = "".join(f'<position joint="{j}" kp="{gain}" kv="{self.servo[1]}"/>' for j, gain in gains.items())
        tilt = Rotation.from_euler("y", get("tilt1", 0.0)) * Rotation.from_euler("x", get("tilt0", 0.0))
        g = numbers(tilt.apply([0.0, 0.0, -(G + get("gravity", 0.0))]))
        carriage = self.carriage + get("mass:carriage", 0.0)
        return f"""<mujoco><option timestep="{h!r}" integrator="RK4" gravity="{g}" tolerance="1e-14"><flag contact="disable"/></option>
            <worldbody><body name="carriage">{slides}<inertial pos="0 0 0" mass="{carriage!r}" diaginertia="1e-3 1e-3 1e-3"/>
            {"".join(body(k) for k in range(LINKS))}{"</body>" * LINKS}</body></worldbody><actuator>{servos}</actuator></mujoco>"""

    def forces(self, changes: Changes) -> Forces:
        """What MuJoCo does not have."""
        at = lambda what, names: {k: changes[f"{what}:{j}"] for k, j in enumerate(names) if f"{what}:{j}" in changes}
        stiction = {k: (x, changes[f"speed:{SLIDES[k]}"]) for k, x in at("stiction", SLIDES).items()}
        return Forces(
            creep=at("creep", BALLS), slack=at("slack", BALLS), square=at("square", BALLS), stribeck=stiction, load=at("load", SLIDES),
            drag=changes.get("drag", 0.0), drag_carriage=changes.get("drag", 0.0) * self.carriage_shows, gust=(changes.get("gust0", 0.0), changes.get("gust1", 0.0)), pull=changes.get("pull", 0.0),
        )  # fmt: skip

    def motion(self, record: int, changes: Changes) -> CubicSpline | None:
        """Places of the markers (markers, 3) [m] over the time; None of a motion that runs away."""
        h, half = 1.0 / self.rate / STEPS, STEPS // 2
        steps = STEPS * round((self.duration + 0.01) * self.rate + 0.5)
        told = self.told(record, changes, h, steps, linear=not self.smooth)
        with cable_forces.alone():
            model = mujoco.MjModel.from_xml_string(self.xml(changes, h))
            data = mujoco.MjData(model)
            own = self.forces(changes)
            stiffness = self.stiffness + changes.get("stiffness", 0.0)
            acting = cable_forces.Acting(own, stiffness, h)
            if not own.none:
                mujoco.set_mjcb_passive(acting)
            cable_forces.settle(model, data, self.told(record, changes | {"lag": 0.0}, h, 1, linear=not self.smooth)[0])
            if own.none:
                begun = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
                mujoco.mj_getState(model, data, begun, mujoco.mjtState.mjSTATE_FULLPHYSICS)
                states, _ = rollout.rollout(model, data, begun[None], told[None])
                q = np.concatenate([begun[None], states[0, half - 1 :: half]])[:, 1 : 1 + model.nq]
            else:
                q = np.empty((steps // half + 1, model.nq))
                q[0] = data.qpos
                for k in range(steps):
                    data.ctrl[:] = told[k]
                    mujoco.mj_step(model, data)
                    acting.advance(data)
                    if (k + 1) % half == 0:
                        q[(k + 1) // half] = data.qpos
            return through(np.arange(len(q)) * half * h, self.places(model, data, q))

    def midpoint(self, record: int, changes: Changes) -> CubicSpline | None:
        """The same by the implicit midpoint rule at the scene's step, with the logged commands."""
        h, steps = 1.0 / self.rate / self.substeps, self.substeps * round((self.duration + 0.01) * self.rate + 0.5)
        told = self.told(record, changes, h, steps, linear=True)
        with cable_forces.alone():
            model = mujoco.MjModel.from_xml_string(self.xml(changes, h))
            data = mujoco.MjData(model)
            cable_forces.settle(model, data, told[0])
            q, v = [data.qpos.copy()], np.zeros(model.nv)
            k, d = (np.array([self.servo[i]] * 2 + [x] * (3 * LINKS)) for i, x in enumerate((self.stiffness, self.damping)))
            for u in told:
                data.ctrl[:] = u
                at, v = cable_midpoint.step(model, data, q[-1], v, h, k, d)
                q.append(at)
            return through(np.arange(len(q)) * h, self.places(model, data, np.array(q)))

    def places(self, model: mujoco.MjModel, data: mujoco.MjData, q: np.ndarray) -> np.ndarray:
        """Ends of the marked links (times, markers, 3) [m]."""
        out, bodies = np.empty((len(q), len(MARKED), 3)), [2 + k for k in MARKED]
        for k, x in enumerate(q):
            data.qpos[:] = x
            mujoco.mj_kinematics(model, data)
            out[k] = data.xpos[bodies] - self.link * data.xmat[bodies].reshape(-1, 3, 3)[:, :, 2]
        return out

    def readings(self, jobs: list[Job], rule: str = "true") -> list[np.ndarray]:
        paths: dict[str, CubicSpline | None] = {}  # faults of the sensor alone need no new motion
        out = []
        for record, changes in jobs:
            moving = {key: x for key, x in changes.items() if x and not key.startswith(SEEN)}
            key = repr((record, sorted(moving.items())))
            if key not in paths:
                paths[key] = (self.midpoint if rule == "scene" else self.motion)(record, moving)
            stamps, path = self.logged[record][0], paths[key]
            if path is None:
                out.append(np.full((len(stamps), 3 * len(MARKED)), np.nan))
                continue
            y = path(np.maximum(stamps - changes.get("delay", 0.0), 0.0))
            y = turned(y, changes) + changes.get("drift", 0.0) * (stamps / self.duration)[:, None, None]
            out.append(y.reshape(len(stamps), -1))
        return out

    # ---- Scene ---------------------------------------------------------------------------------------------------------

    def write(self, folder: Path, read: list[np.ndarray], guess: dict[str, float], missing: bool) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        header = ",".join(["t", *(f"m{k}_{axis}" for k in MARKED for axis in AXES), "u_x", "u_y"])
        for r, (y, (t, u)) in enumerate(zip(read, self.logged, strict=True)):
            np.savetxt(folder / f"run{r + 1}.csv", np.column_stack([t, y, u]), "%.8g", ",", header=header, comments="")
        path = folder / "scene.toml"
        path.write_text(self.scene(guess, missing), encoding="utf-8")
        return path

    def scene(self, guess: dict[str, float], missing: bool) -> str:
        """What is believed: everything but the effect."""
        stiffness = guess.get("joint_*.stiffness", self.stiffness)
        out = ["# Written by validation/blind/cable_setup.py with MuJoCo.", "schema_version = 1", "[time]"]
        out += [f"step = {1.0 / self.rate / self.substeps!r}", f"duration = {self.duration}", 'integrator = "midpoint"']
        out += ["[[body]]", 'name = "carriage"', f"mass = {self.carriage!r}", "inertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]"]
        for j, axis in zip(SLIDES, ([1, 0, 0], [0, 1, 0]), strict=True):
            out += ["[[body.joint]]", f'name = "{j}"', 'kind = "prismatic"', f"axis = {axis}"]
        s = self.spread**2
        moments = [*(self.mass * (s.sum() - s)).tolist(), 0.0, 0.0, 0.0]
        for k, b in enumerate(BODIES):
            out += ["[[body]]", f'name = "{b}"', f'parent = "{BODIES[k - 1] if k else "carriage"}"']
            out += [f"position = [0, 0, {-self.link if k else 0.0}]", f"mass = {self.mass!r}"]
            out += [f"center_of_mass = [0, 0, {-0.5 * self.link}]", f"inertia = {moments}", "[[body.joint]]", f'name = "{BALLS[k]}"', 'kind = "ball"']
            out += [f"stiffness = {stiffness!r}", f"damping = {self.damping!r}"]
        for j, m in zip(SLIDES, MOTORS, strict=True):
            out += ["[[actuator]]", f'name = "{m}"', f'joint = "{j}"', 'kind = "position"']
            out += [f"stiffness = {self.servo[0]!r}", f"damping = {self.servo[1]!r}"]
        out += ["[experiment]", 'initial = "rest"', 'time = { column = "t" }']
        for k in MARKED:
            columns = str([f"m{k}_{axis}" for axis in AXES]).replace("'", '"')
            out += ["[[experiment.marker]]", f'body = "{BODIES[k]}"', f"point = [0, 0, {-self.link}]", f"columns = {columns}"]
            out += ["may_be_missing = true"] if missing else []
        for m, axis in zip(MOTORS, AXES, strict=False):
            out += ["[[experiment.input]]", f'actuator = "{m}"', f'columns = ["u_{axis}"]']
        for r, role in enumerate(self.roles):
            out += ["[[experiment.record]]", f'file = "run{r + 1}.csv"', f'role = "{role}"']
        free = [f'{{ path = "{path}", lower = {0.1 * x!r}, upper = {10.0 * x!r} }}' for path, x in guess.items()]
        return "\n".join([*out, "[experiment.fit]", f"free = [{', '.join(free)}]", ""])


def through(t: np.ndarray, x: np.ndarray) -> CubicSpline | None:
    """A curve through x (times, …), if there is one."""
    return CubicSpline(t, x, axis=0) if np.isfinite(x).all() else None
