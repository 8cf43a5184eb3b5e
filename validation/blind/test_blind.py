"""The generator against its own energy, a stiffer integrator and finite differences."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.blind import (
    fitter_step,
    measure,
    oracle,
    rope_ode,
)
from validation.blind.families import ONE_END, TWO_ENDS

SHORT = replace(ONE_END, name="short", n=6, duration=0.3, markers=(2, 3, 5))
SHORT = replace(SHORT, grippers=(replace(SHORT.grippers[0], at=((0.0, 0.0, 0.0), (0.12, 0.0, 0.0))),))


@pytest.fixture(scope="module")
def rest_shape() -> np.ndarray:
    return rope_ode.relaxed_shape(SHORT)


def potential(family, p, q: np.ndarray) -> float:
    """½ Σ EA l0 ε² + 2 Σ (EI/l_v)(1-c)/(1+c) - Σ m g·q [J], one variant."""
    e = np.diff(q[:, :, 0], axis=1)
    length = np.linalg.norm(e, axis=0)
    l0 = family.length / (family.n - 1)
    t = e / length
    c = np.sum(t[:, 1:] * t[:, :-1], axis=0)
    stretch = 0.5 * p["EA"][0] * l0 * np.sum((length / l0 - 1.0) ** 2)
    bend = 2.0 * p["EI"][0] / l0 * np.sum((1.0 - c) / (1.0 + c))
    weight = rope_ode.masses(family, p)[:, 0] @ (rope_ode.gravity(p)[:, 0, 0] @ q[:, :, 0])
    return stretch + bend - weight


def random_state(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = np.cumsum(np.array([0.11, 0.0, 0.03])[:, None] + 0.04 * rng.standard_normal((3, SHORT.n)), axis=1)
    return q[:, :, None], rng.standard_normal((3, SHORT.n, 1))


def test_conservative_forces_are_the_energys_gradient():
    change = {"cs": 0.0, "cb": 0.0, "c1": 0.0, "c2": 0.0, "tip": 0.01, "tilt": [0.1, -0.2]}
    p = rope_ode.parameters(SHORT, [change])
    q, v = random_state(1)
    f = rope_ode.forces(SHORT, p, q, v)
    for i in range(3):
        for j in range(SHORT.n):
            shift = np.zeros_like(q)
            shift[i, j] = 1.0e-6
            slope = (potential(SHORT, p, q + shift) - potential(SHORT, p, q - shift)) / 2.0e-6
            assert f[i, j, 0] == pytest.approx(-slope, rel=1e-6, abs=1e-7)


def test_bending_damping_is_the_specified_form():
    """R of the closed form (a, b, m, N) has -∂R/∂v as force; force is linear, so P = -2 R."""
    elastic = rope_ode.parameters(SHORT, [{"cb": 0.0}])
    p = rope_ode.parameters(SHORT, [{"cb": 2.0e-3}])
    q, v = random_state(2)
    f = rope_ode.forces(SHORT, p, q, v) - rope_ode.forces(SHORT, elastic, q, v)
    e, w = np.diff(q[:, :, 0]), np.diff(v[:, :, 0])
    length = np.linalg.norm(e, axis=0)
    t = e / length
    t_dot = (w - t * np.sum(t * w, axis=0)) / length
    t1, t2, d1, d2 = t[:, :-1], t[:, 1:], t_dot[:, :-1], t_dot[:, 1:]
    a, b, c = ((x * y).sum(0) for x, y in ((t1, d2), (t2, d1), (t1, t2)))
    n = ((d2 - d1) ** 2).sum(0)
    s2 = 2.0 * (1.0 + c)
    size = 4.0 / s2 * (n + (2.0 * (a + b) ** 2 - (a - b) ** 2) / s2 + (1 - c) / (1 + c) * (a + b) ** 2 / s2)
    dissipation = 0.5 * 2.0e-3 / (SHORT.length / (SHORT.n - 1)) * size.sum()
    assert np.sum(f * v) == pytest.approx(-2.0 * dissipation, rel=1e-10)
    spin = np.array([0.3, -0.2, 0.5])
    turning = np.cross(spin, q[:, :, 0].T).T[:, :, None]
    spun = rope_ode.forces(SHORT, p, q, turning) - rope_ode.forces(SHORT, elastic, q, turning)
    assert np.abs(f.sum(axis=1)).max() < 1e-10  # no net force
    assert np.sum(spun * turning) <= 0.0


def test_integrators_agree(rest_shape):
    p = rope_ode.parameters(SHORT, [{}])
    coarse, _ = rope_ode.simulate(SHORT, p, np.array([0]), rest_shape)
    tight = rope_ode.simulate_dop853(SHORT, p, 0, rest_shape)
    assert np.abs(coarse[..., 0] - tight).max() < 2.0e-8


def test_midpoint_converges_in_second_order_to_the_ode(rest_shape):
    p = rope_ode.parameters(SHORT, [{}])
    truth, _ = rope_ode.simulate(SHORT, p, np.array([0]), rest_shape)
    error = []
    for rate in (100.0, 200.0):
        family = replace(SHORT, rate=rate, step=1.0 / rate)
        rough = fitter_step.midpoint_rollout(family, p, np.array([0]), rest_shape)
        error.append(np.abs(rough[-1] - truth[-1]).max())
    assert 3.0 < error[0] / error[1] < 5.5


def test_noise_has_its_colour_and_is_whitened():
    noise = measure.Noise(phi=0.8, sigma=2.0e-3)
    x = measure.coloured(noise, (2000, 3, 8), np.random.default_rng(0))
    assert x.std() == pytest.approx(2.0e-3, rel=0.05)
    w = oracle.whiten(x[None], 0.8, 2.0e-3).reshape(2000, -1)
    assert w.var() == pytest.approx(1.0, rel=0.03)
    assert abs(np.mean(w[1:] * w[:-1])) < 0.02


def test_scene_is_valid_toml_with_its_columns(tmp_path: Path):
    family = TWO_ENDS
    shape = np.zeros((3, family.n))
    scene = tomllib.loads(measure.scene_text(family, shape, [("run1.csv", "fit")], 1e-3, "A comment."))
    reading = np.zeros((len(family.times), 3, len(family.markers)))
    measure.write_log(tmp_path / "run1.csv", family, 0, reading, family.times)
    header = (tmp_path / "run1.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    wanted = [c for m in scene["experiment"]["marker"] + scene["experiment"]["input"] for c in m["columns"]]
    assert header == ["t", *wanted]
    assert len(scene["gripper"]) == 2


def test_symmetric_causes_have_cosine_one_and_are_not_nameable():
    """One gripper's offset and the sensor's bias: the same readings, whatever the size."""
    path = list(oracle.CACHE.glob("one_end-*.npz"))
    if not path:
        pytest.skip("sensitivities not cached; run validation.blind.make_example once")
    judge = oracle.Oracle(oracle.sensitivity(ONE_END), 0.7, 1e-3)
    u = judge.direction({"bias0": 1.0})
    assert judge.cosines(u)["gripper_offset:left"] > 0.9999
    assert not judge.allows_name(u, "sensor_bias", 1.0)[0]
