"""Grippers that grasp, from Python: controls, memory, surrogates; the tasks of CORD-SLS."""

from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

from validation import cord_tasks

SCENES = Path(__file__).resolve().parents[1] / "scenes"


def test_controls_and_memory():
    model = pliant.load(SCENES / "grasp_rope.toml")
    assert model.control_names[-4:] == ["hand.velocity.x", "hand.velocity.y", "hand.velocity.z", "hand.closing"]
    assert model.control_units[-1] == "-"
    assert model.memory_names[:3] == ["hand.held", "hand.held_weight[1]", "hand.held_offset.x"]
    roll = model.rollout(model.initial_state(), model.controls())
    held = roll.x[:, -len(model.memory_names)]
    assert held[0] == 0 and held[20] == 6 and held[-1] == 0  # seizes the sixth edge, and lets go
    units = dict(zip(model.param_paths, model.param_units, strict=True))
    assert units["hand.stiffness"] == "N/m" and units["hand.radius"] == "m"


def far_away(z=0.1):
    """A closed gripper at that height above the middle of a free rope without weight, and its rollout's arguments."""
    text = f"""schema_version = 1
    [time]
    step = 0.02
    duration = 0.2
    integrator = "quasi_static"
    [gravity]
    magnitude = 0.0
    [[rope]]
    name = "rope"
    nodes = 5
    length = 0.2
    linear_density = 0.02
    stretch_stiffness = 50.0
    initial = {{ shape = "straight", from = [-0.1, 0, 0], direction = [1, 0, 0] }}
    [[gripper]]
    name = "hand"
    rope = "rope"
    mode = "velocity"
    grasp = {{ at = [0.003, 0.01, {z}], radius = 0.015, stiffness = 100.0 }}
    """
    model = pliant.loads(text)
    return model, (model.initial_state(), model.controls())


def test_out_of_reach_only_a_surrogate_has_a_gradient():
    model, inputs = far_away()
    hard = model.rollout(*inputs)
    x_bar = np.zeros((len(hard) + 1, model.ndx))
    x_bar[-1, 8] = 1.0  # height of the middle node
    assert not hard.surrogate and not np.any(hard.vjp(x_bar)[1])
    along = model.rollout(*inputs, grasp="smooth", states="hard")
    assert along.surrogate and (along.grasp, along.states, along.rest_gap) == ("smooth", "hard", model.rest_gap)
    assert np.array_equal(along.x, hard.x)
    u_bar = along.vjp(x_bar)[1]
    assert np.all(u_bar[:-3, 2] < 0)  # downwards, to the rope: its pull grows on approach
    smooth = model.rollout(*inputs, grasp="smooth")
    assert smooth.states == "smooth" and smooth.x[-1][8] > 0
    batch = model.rollout_batch(inputs[0][None], inputs[1][None], grasp="smooth")
    assert np.array_equal(batch.x[0], smooth.x)
    with pytest.raises(pliant.InputError, match='grasp is "soft"'):
        model.rollout(*inputs, grasp="soft")
    with pytest.raises(pliant.InputError, match="rest_gap"):
        model.rollout(*inputs, states="hard")


@pytest.mark.parametrize("task", cord_tasks.TASKS)
def test_tasks(task):
    result = cord_tasks.outcome(task, repeats=1)
    assert all(result["held"]) and result["retries"] <= 0.05 * result["steps"]
    assert result["error_after"] < 0.5 * result["error_before"]
    assert 0 < result["gradient"] < np.inf
