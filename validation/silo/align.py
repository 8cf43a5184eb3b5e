"""Stiffness and damping of an arm's position drives from a log: random search over parallel simulations, and gradients.

    python -m validation.silo.align [--simulations 8192] [--seed 0]

SILO aligns the controller of its simulated arm with the real one before anything is learnt: actions are steps of the joints' targets,
cut to [−1, 1] and scaled to ±0.1 rad, and the stiffness and damping of each joint are found by random search over many simulations
run side by side. Here the real arm is one of seven joints made by MuJoCo (RK4 at 0.5 ms; encoders with noise), and what is simulated
is pliant's, where such an action is `delta_scale`. Both fits see the same log, minimise the same squared error over the same box, and
start from the same guess, its middle.

The search draws a first batch over the whole box (all numbers by their logarithms) and each further one around the best so far, in a
box that becomes smaller when a batch brings nothing better. The other fit is Gauss–Newton with bounds (`scipy.optimize.least_squares`)
with the Jacobian from `Rollout.jvp`, one tangent per parameter on the factorizations of the rollout.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field

import mujoco
import numpy as np
import pliant
from scipy.optimize import least_squares

RATE = 240  # steps of the simulation per second
HOLD = 12  # steps per action: 20 Hz
SCALE = 0.1  # rad per unit of action
FINE = 5e-4  # s, step of the real arm
SIGMA = 1e-4  # rad, noise of the encoders
# link by link: axis, place in the link before [m], mass [kg], centre of mass [m], moments about it [kg·m²]
LINKS = (
    ((0, 0, 1), (0, 0, 0.33), 3.0, (0, 0, -0.08), (0.02, 0.02, 0.008)),
    ((0, 1, 0), (0, 0, 0), 3.0, (0, 0, 0.1), (0.02, 0.02, 0.008)),
    ((0, 0, 1), (0, 0, 0.32), 2.5, (0.03, 0, -0.05), (0.015, 0.015, 0.006)),
    ((0, 1, 0), (0.08, 0, 0), 2.5, (-0.03, 0, 0.1), (0.015, 0.015, 0.006)),
    ((0, 0, 1), (-0.08, 0, 0.38), 2.0, (0, 0.02, -0.1), (0.012, 0.012, 0.004)),
    ((0, 1, 0), (0, 0, 0), 1.5, (0.05, 0, 0.02), (0.004, 0.004, 0.003)),
    ((0, 0, 1), (0.09, 0, 0.1), 0.7, (0, 0.01, 0.06), (0.002, 0.002, 0.001)),
)
JOINTS = len(LINKS)
ARMATURE = 0.05  # kg·m², known
STIFFNESS = np.array([620.0, 540.0, 480.0, 430.0, 210.0, 160.0, 90.0])  # N·m/rad, of the real arm
DAMPING = np.array([42.0, 55.0, 21.0, 30.0, 9.0, 6.5, 4.0])  # N·m·s/rad
LOW, HIGH = np.log([20.0] * JOINTS + [1.0] * JOINTS), np.log([2000.0] * JOINTS + [100.0] * JOINTS)
TRUTH = np.log(np.concatenate([STIFFNESS, DAMPING]))


def actions(seconds: float, seed: int) -> np.ndarray:
    """Actions, one row per HOLD steps: towards targets that move smoothly and sometimes leap, so that some are cut."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE / HOLD)
    t = np.arange(1, n + 1) * HOLD / RATE
    wanted = np.zeros((n, JOINTS))
    for j in range(JOINTS):
        for _ in range(3):
            wanted[:, j] += 0.2 * np.sin(2 * np.pi * rng.uniform(0.2, 1.2) * t + rng.uniform(0, 2 * np.pi))
        wanted[:, j] += np.repeat(rng.uniform(-0.3, 0.3, -(-n // 20)), 20)[:n]
    target, out = np.zeros(JOINTS), np.empty_like(wanted)
    for k in range(n):
        out[k] = (wanted[k] - target) / SCALE
        target += SCALE * np.clip(out[k], -1, 1)
    return out


def real(commands: np.ndarray, seed: int) -> np.ndarray:
    """What the encoders of the real arm read after each step of 1/RATE."""
    bodies, drives = "", ""
    for j, (axis, place, mass, center, about) in enumerate(LINKS):
        words = [" ".join(map(str, row)) for row in (axis, place, center, about)]
        bodies += f"""<body pos="{words[1]}" gravcomp="1"><joint name="joint_{j}" axis="{words[0]}" armature="{ARMATURE}"/>
            <inertial pos="{words[2]}" mass="{mass}" diaginertia="{words[3]}"/>"""
        drives += f'<position joint="joint_{j}" kp="{STIFFNESS[j]}" kv="{DAMPING[j]}"/>'
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{FINE}" integrator="RK4"><flag contact="disable"/></option>
        <worldbody>{bodies}{"</body>" * JOINTS}</worldbody><actuator>{drives}</actuator></mujoco>""")
    data = mujoco.MjData(model)
    steps = len(commands) * HOLD
    times, q = [0.0], [data.qpos.copy()]
    while times[-1] < steps / RATE - 0.5 * FINE:
        k = int((times[-1] + 0.5 * FINE) * RATE / HOLD)
        data.ctrl[:] = SCALE * np.clip(commands[: k + 1], -1, 1).sum(axis=0)
        mujoco.mj_step(model, data)
        times.append(data.time)
        q.append(data.qpos.copy())
    read = np.stack([np.interp(np.arange(1, steps + 1) / RATE, times, column) for column in np.array(q).T], axis=1)
    return read + SIGMA * np.random.default_rng(seed + 1).standard_normal(read.shape)


def scene() -> str:
    """The same arm with drives of unknown stiffness and damping."""
    text = f'schema_version = 1\n[time]\nstep = {1 / RATE!r}\nduration = 1.0\nintegrator = "midpoint"\n'
    for j, (axis, place, mass, center, about) in enumerate(LINKS):
        above = f'parent = "link_{j - 1}"\n' if j else ""
        text += f"""
[[body]]
name = "link_{j}"
{above}position = {list(place)}
mass = {mass}
center_of_mass = {list(center)}
inertia = [{", ".join(map(str, about))}, 0, 0, 0]
[[body.joint]]
name = "joint_{j}"
kind = "revolute"
axis = {list(axis)}
armature = {ARMATURE}
gravity_compensation = 1.0
"""
    for j in range(JOINTS):
        text += f"""
[[actuator]]
name = "motor_{j}"
joint = "joint_{j}"
kind = "position"
stiffness = 100.0
damping = 10.0
delta_scale = {SCALE}
"""
    return text


@dataclass
class Arm:
    """pliant's arm beside a log, and how often it was simulated."""

    commands: np.ndarray
    log: np.ndarray
    model: pliant.Model = field(init=False)
    simulations: int = 0
    tangents: int = 0

    def __post_init__(self):
        self.model = pliant.loads(scene())
        paths = [f"motor_{j}.{what}" for what in ("stiffness", "damping") for j in range(JOINTS)]
        self.places = [self.model.param_index(path) for path in paths]
        # an action counts in the first of the steps it is held for
        self.u = np.zeros((len(self.log), JOINTS))
        self.u[::HOLD] = self.commands
        self.x0 = self.model.initial_state()

    def theta(self, p: np.ndarray) -> np.ndarray:
        """Parameters of the model for the logarithms p."""
        theta = self.model.theta
        theta[self.places] = np.exp(p)
        return theta

    def residual(self, p: np.ndarray) -> np.ndarray:
        """Simulated less read [rad]."""
        self.simulations += 1
        self.last = self.model.rollout(self.x0, self.u, self.theta(p))
        return (self.last.x[1:, :JOINTS] - self.log).ravel()

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        """Its derivatives by p, of the rollout that the residual was taken from."""
        columns = []
        for place, value in zip(self.places, np.exp(p), strict=True):
            direction = np.zeros(self.model.n_params)
            direction[place] = value
            columns.append(self.last.jvp(theta_dot=direction)[1:, :JOINTS].ravel())
        self.tangents += len(columns)
        return np.stack(columns, axis=1)

    def errors(self, batch: np.ndarray) -> np.ndarray:
        """Root mean square error of each row of a batch [rad]."""
        self.simulations += len(batch)
        thetas = np.stack([self.theta(p) for p in batch])
        x = self.model.rollout_batch(np.tile(self.x0, (len(batch), 1)), self.u, thetas, record=False).x
        return np.sqrt(np.mean((x[:, 1:, :JOINTS] - self.log) ** 2, axis=(1, 2)))


def search(arm: Arm, simulations: int, batch: int, seed: int) -> tuple[np.ndarray, list[tuple[int, float]]]:
    """Best logarithms found by random search, and its error [rad] after each batch."""
    rng = np.random.default_rng(seed)
    best = 0.5 * (LOW + HIGH)
    error, width, history = float(arm.errors(best[None])[0]), 1.0, []
    while arm.simulations + batch <= simulations:
        half = 0.5 * width * (HIGH - LOW)
        drawn = np.clip(best + half * rng.uniform(-1, 1, (batch, len(best))), LOW, HIGH)
        errors = arm.errors(drawn)
        if errors.min() < error:
            best, error = drawn[errors.argmin()], float(errors.min())
        else:
            width *= 0.7
        history.append((arm.simulations, error))
    return best, history


def descend(arm: Arm) -> np.ndarray:
    """Best logarithms found with gradients."""
    start = 0.5 * (LOW + HIGH)
    return least_squares(arm.residual, start, arm.jacobian, bounds=(LOW, HIGH), x_scale=1.0, xtol=1e-8, ftol=1e-10).x


def rms(arm: Arm, p: np.ndarray) -> float:
    """Root mean square error [rad], not counted as a simulation of the fit."""
    return float(np.sqrt(np.mean(Arm(arm.commands, arm.log).residual(p) ** 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulations", type=int, default=8192)
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    fitted, other = (actions(args.seconds, seed) for seed in (args.seed, args.seed + 1))
    log, unseen = real(fitted, args.seed), real(other, args.seed + 1)
    cut = np.mean(np.abs(fitted) > 1)
    print(f"{JOINTS} joints, {args.seconds} s at {RATE} Hz, {100 * cut:.0f} % of the actions cut; noise {1e3 * SIGMA:.3f} mrad")

    def report(name: str, arm: Arm, p: np.ndarray, seconds: float) -> None:
        off = 100 * np.abs(np.expm1(p - TRUTH))
        on_others = 1e3 * rms(Arm(other, unseen), p)
        print(
            f"{name}: {1e3 * rms(arm, p):.4f} mrad, on other actions {on_others:.4f} mrad; stiffness off by {off[:JOINTS].max():.2f} %, "
            f"damping by {off[JOINTS:].max():.2f} % at most; {arm.simulations} simulations, {arm.tangents} tangents, {seconds:.1f} s"
        )

    arm = Arm(fitted, log)
    report("guess", arm, 0.5 * (LOW + HIGH), 0.0)
    report("the real values", arm, TRUTH, 0.0)
    for name, fit in (
        ("gradients", descend),
        ("random search", lambda arm: search(arm, args.simulations, args.batch, args.seed)[0]),
    ):
        arm = Arm(fitted, log)
        clock = time.perf_counter()
        p = fit(arm)
        report(name, arm, p, time.perf_counter() - clock)


if __name__ == "__main__":
    main()
