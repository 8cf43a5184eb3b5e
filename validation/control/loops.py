"""Closed loops: a controller, a plant, disturbances, and what came of it."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pliant

from validation.control.tasks import MPPI_SAMPLES, Instance

DISTURBANCE = 0.003 * 0.02  # m, radius of the ball of a step's disturbance in the release
NOISE, DELAY = 1e-3, 2  # standard deviation of each coordinate of a node [m], and steps that it comes late: those of a depth camera


@dataclass
class Outcome:
    """A closed loop, run to its end."""

    error: float
    clearance: float
    updates: list  # wall time of each update [s]
    processor: list  # processor time of all its threads [s]
    evaluations: int
    failures: int


def disturbed(model, x, rng) -> np.ndarray:
    """The state with its free nodes moved by a random vector in the release's ball."""
    free = model.masses() > 0
    w = rng.normal(size=3 * int(free.sum()))
    w *= DISTURBANCE * rng.uniform() ** (1 / len(w)) / np.linalg.norm(w)
    dx = np.zeros(model.ndx)
    dx[: 3 * len(free)].reshape(-1, 3)[free] = w.reshape(-1, 3)
    return model.displaced(x, dx)


def run(instance: Instance, controller: Callable, task: pliant.Task, theta, steps: int, rng=None) -> Outcome:
    """Steps of the plant, the model at theta, under the controller; disturbed if `rng` is given."""
    model, x = task.model, task.x0
    clearance, updates, processor, evaluations, failures = np.inf, [], [], 0, 0
    for _ in range(steps):
        begin, used = time.perf_counter(), time.process_time()
        u, rollouts = controller(x)
        updates.append(time.perf_counter() - begin)
        processor.append(time.process_time() - used)
        evaluations += rollouts
        failures += u is None
        x = model.step(x, np.zeros(model.nu) if u is None else u, theta)
        if rng is not None:
            x = disturbed(model, x, rng)
        clearance = min(clearance, instance.clearance(model, x))
    return Outcome(instance.error(model, x), clearance, updates, processor, evaluations, failures)


def gradient(task: pliant.Task, theta, horizon: int, tubes: bool) -> Callable:
    """One Gauss-Newton step an update, from inputs of zero; evaluations are rollouts times steps, a Jacobian counted as one."""
    mpc = task.mpc(np.zeros((horizon, task.model.nu)), theta, disturbance=DISTURBANCE if tubes else None)

    def control(x):
        u = mpc.update(x)
        return u, horizon * (tubes + sum(2 + step["rollouts"] + step["approaches"] for step in mpc.steps))

    return control


def reading(task: pliant.Task, theta, horizon: int, seed: int, tubes: bool) -> Callable:
    """The same from noisy, late readings of the object's nodes instead of the state; whether grippers hold something is read as well."""
    (span,) = {**task.model.ropes, **task.model.cloths}.values()
    sensing = pliant.Sensing(task.model, list(range(span.start, span.stop)), NOISE, delay=DELAY)
    first, tube = np.zeros((horizon, task.model.nu)), "exact" if tubes else None
    mpc = task.mpc(first, theta, disturbance=DISTURBANCE, sensing=sensing, tube=tube)
    seen, rng = deque(), np.random.default_rng([seed, 1])

    def control(x):
        seen.append(sensing.read(x) + sensing.noise * rng.normal(size=len(sensing.noise)))
        u = mpc.update(seen.popleft() if len(seen) > DELAY else None)
        # the filter's steps: one to its next time, then to the present
        steps = 1 + DELAY + horizon * (tubes + sum(2 + step["rollouts"] + step["approaches"] for step in mpc.steps))
        return u, steps

    return control


def sampling(task: pliant.Task, theta, horizon: int, name: str, seed: int, scaled: bool) -> Callable:
    """MPPI with the release's settings: one sigma for all inputs, or a tenth of each input's range."""
    lower, upper = task.bounds
    sigma = np.where(upper > lower, 0.1 * (upper - lower) if scaled else 0.1, 0.0)
    first = np.zeros((horizon, task.model.nu))
    mppi = task.mppi(np.clip(first, lower, upper), sigma, theta, samples=MPPI_SAMPLES[name], seed=seed)

    def control(x):
        return mppi.update(x), horizon * MPPI_SAMPLES[name]

    return control
