"""The rods whose logs the JAX reference makes; diagnoses of these logs are in `test_diagnoses.py`."""

import numpy as np
import pytest

pytest.importorskip("optimistix")
import pliant
from scipy.interpolate import CubicSpline

from validation.blind import rod_setup, rods

pytestmark = pytest.mark.long


def test_the_true_rod_begins_at_rest_and_ends_elsewhere():
    x = rods.motion({}, 0)
    assert np.abs(x[1] - x[0]).max() < 1e-3
    assert np.abs(x[-1] - x[0]).max() > 0.02
    held = [node for nodes in rods.HELD.values() for node in nodes]
    told = rods.commands(0, np.arange(rods.SAMPLES + 1) / rods.RATE).reshape(-1, len(held), 3)
    assert np.abs(x[:, held] - told).max() < 1e-12


# ---- The rods of the batch -------------------------------------------------------------------------------------------------

PART = 0.3  # of a knob's largest change


@pytest.fixture(scope="module")
def setup() -> rod_setup.RodSetup:
    return rod_setup.RodSetup(np.random.default_rng(700))


@pytest.fixture(scope="module")
def changed(setup) -> dict[str, tuple[dict, np.ndarray]]:
    """Changes and readings of the first record, without effect and with each knob off."""
    jobs = {"": {}} | {key: {key: PART * knob.largest} for key, knob in setup.knobs.items() if knob.path}
    jobs["across"] = jobs["rod.bend_stiffness_2"] | {"rod.section_roll": 0.25 * np.pi}
    read = setup.readings([(0, changes) for changes in jobs.values()])
    return {key: (changes, y) for (key, changes), y in zip(jobs.items(), read, strict=True)}


def by_pliant(setup: rod_setup.RodSetup, changes: dict, every: int = 16) -> np.ndarray:
    """Readings of the first record by pliant's midpoint rule, `every` steps a sample."""
    setup.substeps = every
    text = setup.text({}, open_all=bool(changes))
    if "flow" not in changes:  # bending beyond a yield is of first order in the step, even where nothing flows
        text = text.replace("[rope.plasticity]\nyield_curvature = 1.0\ntime = 1e9\n", "")
    model = pliant.loads(text)
    knobs = {key: setup.knobs[key] for key in changes if key in setup.knobs}
    true = {knob.path: knob.true(changes[key]) for key, knob in knobs.items() if not knob.path.startswith(("sensor", "marker"))}
    true |= {key: x for key, x in changes.items() if key not in setup.knobs}
    if "EI" in changes:
        true["rod.bend_stiffness_2"] = true["rod.bend_stiffness"]
    for cause in setup.causes.values():
        true |= cause.also if set(cause.knobs) & set(changes) else {}
    theta = model.theta_with(true)
    t, u = setup.logged[0]
    flat, h = u.reshape(len(t), -1), model.step_length
    told = np.stack([np.interp(np.arange(1, round(t[-1] / h) + 1) * h, t, x) for x in flat.T], axis=1)
    states = model.rollout(model.equilibrium(flat[0], theta).x, told, theta, record=False).x[:: every // 2]
    count = 3 * rod_setup.NODES
    x, d = states[:, :count].reshape(len(states), -1, 3), np.array([model.material_axes(s) for s in states])
    _, beside = setup.path((x, 0.0 * x, d))
    place = CubicSpline(np.arange(len(x)) * h * (every // 2), x[:, setup.marked], axis=0)
    return setup.seen(0, changes, (place, beside))


def test_a_rod_without_effect_moves_as_in_pliant(setup, changed):
    assert np.abs(changed[""][1] - by_pliant(setup, {})).max() < 0.02 * setup.sigma


def test_a_rod_that_runs_away_has_no_readings(setup):
    (y,) = setup.readings([(0, {"rod.bend_damping": 1.0})])
    assert y.shape == (len(setup.logged[0][0]), 15) and np.isnan(y).all()


def test_what_a_rod_hides_is_pliants_law(setup, changed):
    plain, same = changed.pop("")[1], by_pliant(setup, {})
    off = {}
    for key, (changes, y) in changed.items():
        error, effect = np.abs(y - plain - by_pliant(setup, changes) + same).max(), np.abs(y - plain).max()
        if error > max((0.03 if key == "flow" else 0.005) * effect, 5e-3 * setup.sigma):
            off[key] = (effect / setup.sigma, error / setup.sigma)
    assert not off
