"""The comparisons of `validation.control`: what they compute is right, and their main results come out again in short runs."""

import json
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
pytest.importorskip("scipy")

from validation.control import discovery, growth, linearization, pushing, table, tasks
from validation.control.smoothed import WIDTHS, SmoothedMpc

SEED = 60_000


@pytest.mark.parametrize(("kind", "start"), [(kind, start) for kind, starts in (("rope", discovery.ROPE_STARTS), ("cloth", discovery.CLOTH_STARTS)) for start in starts])
def test_grippers_begin_where_the_start_says(kind, start):
    task = discovery.instance(kind, start, SEED).load()
    q = task.x0[: 3 * task.model.n_nodes].reshape(-1, 3)
    (span,) = {**task.model.ropes, **task.model.cloths}.values()
    hands = np.delete(q, np.arange(span.start, span.stop), axis=0)
    nearest = np.linalg.norm(hands[:, None] - q[span], axis=2).min(axis=1)
    moved = np.linalg.norm((discovery.ROPE_STARTS if kind == "rope" else discovery.CLOTH_STARTS)[start], axis=1)
    assert discovery.held(task.model, task.x0) == 0 and (nearest > 0.017).all()
    assert (nearest <= moved + 1e-3).all()
    if start.startswith(("5 cm", "10 cm", "12 cm")):
        np.testing.assert_allclose(moved, float(start.split()[0]) / 100, atol=2e-3)


@pytest.mark.parametrize("widths", WIDTHS)
def test_the_smoothed_baseline_differentiates_the_smoothed_steps(widths):
    """Its condensed Jacobian against the surrogate rollout's vjp, and its widths are those of the scene it differentiates."""
    drawn = discovery.instance("rope", "5 cm above", SEED)
    task = drawn.load()
    mpc = SmoothedMpc(task.model, task.model.theta, drawn.goal, 5, *task.bounds, widths=widths)
    assert mpc.theta[task.model.param_index("left.smoothing")] == WIDTHS[widths][0]
    roll = task.model.rollout(task.x0, mpc.u, mpc.theta, **mpc.smooth)
    assert roll.surrogate and np.array_equal(roll.x, task.model.rollout(task.x0, mpc.u, record=False).x)
    x_bar = np.zeros((6, task.model.ndx))
    x_bar[1:, mpc.rows] = np.random.default_rng(SEED).normal(size=(5, 63))
    by_vjp = roll.vjp(x_bar)[1]
    by_jacobian = (x_bar[1:, mpc.rows].ravel() @ mpc.jacobian(roll)).reshape(mpc.shape)
    assert np.abs(by_vjp).max() > 0
    np.testing.assert_allclose(by_jacobian, by_vjp, atol=1e-9 * np.abs(by_vjp).max())


def test_a_pushers_cost_is_that_of_irs_mpc():
    """The residuals' derivatives, and the cost of a box that is not touched, but for the rest gap's force at 0.1 m."""
    rest = pushing.row("rest", None, 1)
    assert rest["cost"] == pytest.approx(60 * (1.5 + 1.2 * (np.pi / 4) ** 2), rel=1e-5)
    x, u = np.random.default_rng(SEED).normal(size=12), np.array([0.3, -0.2])
    terms = pushing.evaluate(3, 60, x, u)
    value = 0.5 * np.sum(np.square(terms["residuals"]))
    assert value == pytest.approx(np.sum(pushing.Q * (x[2:5] - pushing.GOAL) ** 2) + 10 * np.sum((0.04 * u) ** 2), rel=1e-12)
    dx = 1e-6 * np.random.default_rng(1).normal(size=12)
    moved = pushing.evaluate(3, 60, x + dx, u)["residuals"]
    np.testing.assert_allclose(moved - terms["residuals"], terms["residuals_by_x"] @ dx, atol=1e-14)


@pytest.mark.long
def test_a_box_that_is_not_touched_is_pushed_by_annealed_gradients_alone():
    exact, annealed = (pushing.row("rest", gap, 60) for gap in (None, 0.1))
    assert exact["cost"] == pytest.approx(exact["cost_by_iteration"][0], rel=1e-12)
    assert annealed["cost"] < 0.3 * exact["cost"]
    assert annealed["rest_gap_by_iteration"][0] == 0.1


def test_an_arm_with_a_cable_is_the_same_problem_in_both_engines():
    """Costs before and after agree to the difference of the integrators; so do the steps."""
    pytest.importorskip("mujoco", minversion="4.0")
    from validation.control import arm_cable

    ours, theirs, ratios = arm_cable.compare(links=3, steps=40, iterations=2)
    assert theirs["first_cost"] == pytest.approx(ours["first_cost"], rel=1e-3)
    assert ours["cost"] < 0.5 * ours["first_cost"] and theirs["cost"] == pytest.approx(ours["cost"], rel=0.05)
    assert max(ours["cost_in_other"], theirs["cost_in_other"]) < 0.01 * ours["first_cost"] and ratios["seconds"] > 0


def test_mujocos_derivatives_of_the_arm_are_those_of_its_cost():
    pytest.importorskip("mujoco", minversion="4.0")
    from validation.control import arm_cable

    arm = arm_cable.Mujoco(links=3, steps=12)
    u = 0.2 * np.random.default_rng(SEED).normal(size=(12, 7))
    r, j = arm.jacobian(u)
    slope = j.T @ r + 2 * arm_cable.EFFORT * u.ravel()
    direction = np.random.default_rng(1).normal(size=u.shape)
    difference = (arm.cost(u + 1e-4 * direction) - arm.cost(u - 1e-4 * direction)) / 2e-4
    assert slope @ direction.ravel() == pytest.approx(difference, rel=1e-3)


def test_an_update_splits_into_parts_that_add_up():
    sizes = {"horizon": 8, "nodes": 7, "grippers": 2}
    row = growth.row(3, **sizes)
    assert row["inputs"] == 6 and row["nx"] == 42
    assert row["update_s"] > 0 and row["rollout_s"] > 0
    assert row["rollout_s"] + row["derivatives_s"] + row["limits_s"] == pytest.approx(row["update_s"], rel=1e-9)
    made = [{"horizon": n, "nodes": 21, "grippers": 2} | dict.fromkeys(growth.PARTS, 1e-3 * n**1.5) for n in (10, 20, 40)]
    assert growth.exponents(made, "horizon")["update_s"] == pytest.approx(1.5)


def test_conformal_bounds_need_enough_moves():
    pytest.importorskip("mujoco", minversion="4.0")
    pytest.importorskip("skimage")
    from validation.control import reality

    scores = np.random.default_rng(SEED).permutation(np.arange(1.0, 101.0))
    assert reality.conformal(scores, 0.1) == 91.0  # of rank ceil(101 * 0.9)
    assert reality.conformal(scores[:9], 0.1) == scores[:9].max()
    with pytest.raises(ValueError, match="8 scores bound nothing.*at least 9"):
        reality.conformal(scores[:8], 0.1)


def test_the_moved_capsules_are_drawn_as_new_ones():
    pytest.importorskip("mujoco", minversion="4.0")
    pytest.importorskip("skimage")
    from validation import camera
    from validation.control import reality

    if (why := camera.unavailable()) is not None:
        pytest.skip(f"MuJoCo cannot render here: {why}")
    nodes = reality.hanging((0.1, 0.0, 0.45))
    nodes[:, 0] += 0.05 * np.sin(np.linspace(0, 3, len(nodes)))
    for shift in (0.0, 0.05):
        fresh = camera.render(camera.Scene(rope=nodes + shift, radius=reality.MODEL.radius, table=None), reality.EYE)
        moved = reality.renderer()(nodes + shift)
        assert np.array_equal(fresh[0], moved[0]) and fresh[0].sum() > 500
        np.testing.assert_allclose(moved[1][fresh[0]], fresh[1][fresh[0]], atol=1e-3)


def test_the_record_of_the_four_tasks_has_the_agreed_form():
    """validation/results/control.json: rows of all tasks, with the commit; docs/control.md quotes it."""
    record = json.loads((table.RESULTS / "control.json").read_text(encoding="utf-8"))
    assert len(record["commit"]) == 40 and record["dirty"] is False and record["command"].startswith("python -m validation.control")
    rows = record["figures"]["rows"]
    assert {row["task"] for row in rows} == set(tasks.STEPS)
    page = (Path(__file__).parents[2] / "docs" / "control.md").read_text(encoding="utf-8")
    for row in rows:
        assert set(row) >= {"task", "method", "goal_error_m", "safety", "runs", "update_s", "threads", "evaluations", "published"}
        assert row["published"] == tasks.PUBLISHED[row["task"]]
        assert f"| {row['task']} | {row['method']} | {1e3 * row['goal_error_m']:.1f} mm |" in page


def test_a_row_of_the_table_is_measured():
    """A short run of the least task gives a row of the agreed form."""
    row = table.row("LiftRope", "nominal", 1)
    assert row["runs"] == 1 and row["update_s"] > 0 and row["evaluations"] > 20
    assert abs(row["goal_error_m"] - 0.0549) < 2e-3 and row["clearance_m"] is None and row["safety"] == 1


def test_rows_of_other_tasks_stay_where_one_is_written():
    record = json.loads((table.RESULTS / "control.json").read_text(encoding="utf-8"))
    before = record["figures"]["rows"]
    new = {"task": "DragRope", "method": "tubes", "runs": 7}
    rows = table.merged([new], "of this run")
    assert len(rows) == len(before) and [row["task"] for row in rows] == sorted((row["task"] for row in rows), key=list(tasks.STEPS).index)
    assert new | {"commit": "of this run"} in rows
    assert all(len(row["commit"]) == 40 for row in rows if row["runs"] != 7)


def test_without_contact_the_linearization_predicts_rows():
    (row,) = linearization.measure("RopeOver", [6e-5], (3,))
    assert row["exact_m"] == pytest.approx(row["tightening_m"], rel=1e-3) and row["tightening_m"] > 6e-5
    assert 0 <= row["error_m"] < 1e-8 and row["beyond_m"] < 0
