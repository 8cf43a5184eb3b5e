"""Sheets of cloth in Python: nodes, triangles, a gradient."""

from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

SCENES = Path(__file__).resolve().parents[1] / "scenes"


def test_nodes_and_triangles():
    model = pliant.load(SCENES / "cloth_hung.toml")
    assert model.ropes == {} and list(model.cloths) == ["sheet"]
    triangles = model.triangles["sheet"]
    assert triangles.shape == (2 * 8 * 5, 3) and triangles.dtype == np.int64
    q = model.initial_state()[: 3 * model.n_nodes].reshape(-1, 3)[model.cloths["sheet"]]
    grid = q.reshape(9, 6, 3)
    np.testing.assert_allclose(grid[8, 5], [0.4, 0.0, -0.25], atol=1e-15)
    a, b, c = (q[triangles[:, k]] for k in range(3))
    areas = 0.5 * np.cross(b - a, c - a)
    np.testing.assert_allclose(areas.sum(axis=0), [0.0, 0.1, 0.0], atol=1e-15)
    assert model.theta[model.param_index("sheet.area")] == pytest.approx(0.1)
    assert model.masses().sum() == pytest.approx(200.0 * 1e-3 * 0.1)


def test_gradient_by_stiffness():
    model = pliant.load(SCENES / "cloth_hung.toml")
    x0, u, k = model.initial_state(), model.controls(10), model.param_index("sheet.bend_stiffness")

    def loss(theta):
        return model.rollout(x0, u, theta).x[-1].sum()

    roll = model.rollout(x0, u)
    x_bar = np.zeros((11, model.ndx))
    x_bar[-1] = 1.0
    gradient = roll.vjp(x_bar)[2][k]
    h = 1e-4 * model.theta[k]
    step = np.zeros(model.n_params)
    step[k] = h
    difference = (loss(model.theta + step) - loss(model.theta - step)) / (2 * h)
    assert gradient == pytest.approx(difference, rel=1e-5)
