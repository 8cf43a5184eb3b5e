"""A closed form of contact, the scene that should meet it, and how far off the scene and its derivatives are.

A *measure* is a function of the states of a run. Its derivative is pliant's: the tangent of the rollout (`Rollout.jvp`), put through the
measure by a complex step, f(x + iε ẋ) = f(x) + iε f′ẋ with ε = 1e-30, which is exact to rounding. A measure therefore takes real and
complex states alike and has no absolute value, norm or comparison of them. Closed forms are differentiated in the same way.
"""

from __future__ import annotations

import functools
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

EPSILON = 1e-30  # of the complex step
WIDTHS = {"free": (7, 6), "ball": (4, 3), "universal": (2, 2)}  # numbers of q and v of a joint; 1 and 1 of others


class States:
    """States x_0 … x_T of a run, or of one displaced along a tangent by a complex step."""

    def __init__(self, model: Any, scene: Mapping[str, Any], x: np.ndarray, tangent: np.ndarray | None = None):
        self.h, self.rest_gap = model.step_length, model.rest_gap
        nodes, nv = 3 * model.n_nodes, model.ndx // 2
        nq = model.nx - nv
        self._q, self._v = {}, {}
        q = v = nodes
        for body in scene.get("body", []):
            for joint in body.get("joint", []):
                width = WIDTHS.get(joint["kind"], (1, 1))
                # a quaternion's tangent is a turn, not a change of its numbers: measures read positions and velocities only
                part = 3 if joint["kind"] == "free" else width[1]
                self._q[joint["name"]] = slice(q, q + part), slice(v, v + part)
                self._v[joint["name"]] = slice(nq + v, nq + v + width[1]), slice(nv + v, nv + v + width[1])
                q, v = q + width[0], v + width[1]
        self._nodes = slice(0, nodes), slice(0, nodes)
        self._node_velocities = slice(nq, nq + nodes), slice(nv, nv + nodes)
        self._x, self._tangent = x, tangent

    def _take(self, where: tuple[slice, slice]) -> np.ndarray:
        x = self._x[:, where[0]]
        return x if self._tangent is None else x + 1j * EPSILON * self._tangent[:, where[1]]

    def position(self, joint: str) -> np.ndarray:
        """Coordinates of a joint, (T + 1, n); of a free body its origin [m]."""
        return self._take(self._q[joint])

    def velocity(self, joint: str) -> np.ndarray:
        """Velocities of a joint, (T + 1, n); of a free body that of its origin [m/s], then its angular velocity in its own axes."""
        return self._take(self._v[joint])

    def nodes(self) -> np.ndarray:
        """Positions of nodes [m], (T + 1, n, 3)."""
        return self._take(self._nodes).reshape(len(self._x), -1, 3)

    def node_velocities(self) -> np.ndarray:
        """Their velocities [m/s]."""
        return self._take(self._node_velocities).reshape(len(self._x), -1, 3)


Move = Callable[[Any, int], dict[str, np.ndarray]]
"""How a number of a closed form moves a model that takes so many steps: the tangents that `Rollout.jvp` takes."""


def parameter(*paths: str) -> Move:
    """The number is the value of these parameters."""

    def move(model: Any, _: int) -> dict[str, np.ndarray]:
        out = np.zeros(model.n_params)
        out[[model.param_index(path) for path in paths]] = 1.0
        return {"theta_dot": out}

    return move


def start_speed(dofs: Mapping[str, float] | None = None, nodes: Sequence[float] | None = None) -> Move:
    """The number is an initial speed: that of joints' degrees of freedom, by name, or of every node along a direction."""

    def move(model: Any, _: int) -> dict[str, np.ndarray]:
        out, first = np.zeros(model.ndx), model.ndx // 2
        for name, rate in (dofs or {}).items():
            out[first + 3 * model.n_nodes + model.dof_names.index(name)] = rate
        if nodes is not None:
            out[first : first + 3 * model.n_nodes] = np.tile(nodes, model.n_nodes)
        return {"x0_dot": out}

    return move


def start_position(dofs: Mapping[str, float]) -> Move:
    """The number shifts the start of joints' degrees of freedom, by name."""

    def move(model: Any, _: int) -> dict[str, np.ndarray]:
        out = np.zeros(model.ndx)
        for name, rate in dofs.items():
            out[3 * model.n_nodes + model.dof_names.index(name)] = rate
        return {"x0_dot": out}

    return move


def control(*names: str) -> Move:
    """The number is added to these inputs at all times."""

    def move(model: Any, steps: int) -> dict[str, np.ndarray]:
        row = np.array([float(name in names) for name in model.control_names])
        return {"u_dot": np.tile(row, (steps, 1))}

    return move


@dataclass(frozen=True)
class Case:
    """A scene, a measure of its run, and the closed form of the measure."""

    name: str
    says: str  # the closed form in words and signs
    unit: str
    at: Mapping[str, float]  # arguments of the closed form
    exact: Callable[..., Any]
    scene: Callable[[float, float, str], str]  # text from step [s], rest gap [m] and integrator
    measure: Callable[[States], Any]
    moves: Mapping[str, Move] = field(default_factory=dict)  # of the arguments by which to differentiate
    scale: float | None = None  # of errors, where the closed form is zero; its own value otherwise
    integrators: tuple[str, ...] = ("euler", "sdirk2")
    refine: bool = True  # whether steps shorter than 0.5 ms are worth their time at the largest rest gap

    def derivative(self, name: str) -> float:
        """Of the closed form by an argument."""
        at = dict(self.at) | {name: self.at[name] + 1j * EPSILON}
        return float(np.imag(self.exact(**at))) / EPSILON

    def value(self) -> float:
        """Of the closed form."""
        return float(np.real(self.exact(**self.at)))


@dataclass(frozen=True)
class Found:
    """What a run gave: the measure and its derivatives, and the same with the closed form taken off, over its scale."""

    value: float
    error: float
    derivatives: dict[str, float]
    derivative_errors: dict[str, float]


@functools.lru_cache(maxsize=16)
def _roll(text: str) -> tuple[Any, Any]:
    # cases that measure one scene follow each other
    import pliant

    model = pliant.loads(text)
    return model, model.rollout(model.initial_state(), model.controls())


def solve(case: Case, step: float, rest_gap: float, integrator: str = "euler") -> Found:
    """Runs a case and differentiates its measure."""
    text = case.scene(step, rest_gap, integrator)
    model, roll = _roll(text)
    scene = tomllib.loads(text)
    value = float(case.measure(States(model, scene, roll.x)))
    exact = case.value()
    scale = case.scale if case.scale is not None else abs(exact)
    derivatives, errors = {}, {}
    for name, move in case.moves.items():
        tangent = roll.jvp(**move(model, len(roll)))
        derivatives[name] = float(np.imag(case.measure(States(model, scene, roll.x, tangent)))) / EPSILON
        true = case.derivative(name)
        errors[name] = (derivatives[name] - true) / (abs(true) if true else scale / abs(case.at[name]))
    return Found(value, (value - exact) / scale, derivatives, errors)


def orders(errors: Sequence[float]) -> list[float]:
    """log₂ of the ratios of errors at steps that are halved one after another."""
    return [math.log2(abs(a / b)) if a and b else math.nan for a, b in zip(errors, errors[1:], strict=False)]
