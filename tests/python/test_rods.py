"""Rods that twist, against closed forms; states that carry material axes."""

import math
from itertools import pairwise

import numpy as np
import pliant
import pytest

from validation.rods import buckles_at, helix, ring

pytestmark = pytest.mark.long


@pytest.mark.parametrize("ratio", [1.0, 0.5])
def test_michells_ring_leaves_its_plane_at_the_critical_turn(ratio: float) -> None:
    errors = [buckles_at(edges, ratio) - 1.0 for edges in (40, 80, 160)]
    orders = [math.log2(a / b) for a, b in pairwise(errors)]
    assert abs(errors[1]) < 0.006
    assert all(1.7 < order < 2.3 for order in orders), (errors, orders)


def test_a_rod_twisted_too_far_curls_up_into_a_localised_helix() -> None:
    # the best published discrete rods: 0.32 at 40 edges, 0.044 at 180
    errors = [helix(edges, duration=80.0)["error"] for edges in (40, 80, 120)]
    assert errors[0] < 0.34 and errors[1] < 0.145 and errors[2] < 0.085, errors


def test_states_move_with_their_axes() -> None:
    model, u = ring(20, 1.0, 2.0)
    x = model.initial_state()
    axes = model.material_axes(x)
    assert axes.shape == (22, 3)
    rng = np.random.default_rng(3)
    dx = 1e-3 * rng.standard_normal(model.ndx)
    moved = model.displaced(x, dx)
    np.testing.assert_allclose(model.difference(moved, x), dx, atol=1e-15)
    edge = np.diff(moved[: 3 * model.n_nodes].reshape(-1, 3), axis=0)
    assert np.abs(np.einsum("ij,ij->i", edge, model.material_axes(moved))).max() < 1e-15
    by_hand = x.copy()
    by_hand[: 3 * model.n_nodes] = moved[: 3 * model.n_nodes]
    with pytest.raises(pliant.InputError, match="reference axis of twist of edge -1 of `rod`"):
        model.step(by_hand, u)


def test_a_clamp_without_direction_across_is_refused() -> None:
    model, u = ring(20, 1.0, 2.0)
    u[6:9] = [3.0, 0.0, 0.0]  # along the axis
    with pytest.raises(pliant.InputError, match="first.*no part across the axis"):
        model.step(model.initial_state(), u)
