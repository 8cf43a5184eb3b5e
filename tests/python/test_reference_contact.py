"""pliant's contact of bodies and of edges against the independent JAX reference at equal κ: states and all derivatives.

Bars: state ≤ 1e-9, derivatives ≤ 1e-8, relative. A derivative is compared by blocks: positions and velocities of the state, one control,
one entry of θ, or a place (three entries: what moves along an edge has nothing along it but rounding). The reference lists which features
may meet on its own, by the rules of docs/theory/contact.md.
"""

import numpy as np
import pytest
from touching_cases import SCENES, SPINNING, case, stepper_of

pliant = pytest.importorskip("pliant")

pytestmark = pytest.mark.long


# what carries in a scene: kinds of the first and the second feature
CARRIED = {
    "ball_rolls": {("whole", "face")},
    "box_tips": {("corner", "face")},
    "capsule_rolls": {("end", "face")},
    "cylinder_rolls": {("rim", "face")},
    "cylinder_stands": {("rim point", "face")},
    "box_at_fixed": {("corner", "face"), ("edge", "edge")},
    "capsule_at_fixed": {("axis", "edge"), ("end", "whole")},
    "corner_at_capsule": {("corner", "whole")},
    "box_on_box": {("corner", "face"), ("edge", "edge")},
    "stones": {("corner", "face"), ("edge", "edge")},
    "capsules_cross": {("axis", "axis"), ("end", "face")},
    "ball_on_ball": {("whole", "whole")},
    "rope_on_box": {("whole", "whole"), ("corner", "face")},
    "rope_edges": {("edge", "edge"), ("edge", "whole")},
    "arm_pushes": {("whole", "whole"), ("corner", "face")},
    "box_at_fixed_turned": {("edge", "edge")},
    "capsule_rolls_turned": {("end", "face")},
    "stones_turned": {("corner", "face"), ("edge", "edge")},
    "rope_edges_turned": {("edge", "edge"), ("edge", "whole")},
}


def relative(a, b, floor=1e-300):
    """max |a - b| / max(|b|, floor)."""
    a, b = np.asarray(a), np.asarray(b)
    return np.abs(a - b).max(initial=0.0) / max(np.abs(b).max(initial=0.0), floor)


class Both:
    """A scene simulated by both programs."""

    def __init__(self, name):
        self.case = case(name)
        self.ours = self.case.model
        self.model = pliant.loads(self.case.text)
        self.xs, self.error, self.slopes = self.case.rollout
        # the entries of θ of both have their own orders
        self.places = [list(self.model.param_paths).index(path) for path in self.ours.paths]
        theta = self.model.theta.copy()
        theta[self.places] = self.case.theta
        self.roll = self.model.rollout(self.case.x0, self.case.u, theta=theta)


@pytest.fixture(scope="module", params=SCENES)
def both(request):
    return Both(request.param)


def test_parameters_and_start(both):
    model, ours = both.model, both.ours
    assert sorted(model.param_paths) == sorted(ours.paths)
    np.testing.assert_allclose(model.theta[both.places], ours.theta, rtol=1e-14)
    assert (model.nx, model.ndx, model.nu) == (len(both.case.x0), ours.ndx, ours.nu)
    np.testing.assert_allclose(model.initial_state(), ours.initial_state(), rtol=1e-12, atol=1e-15)


def test_states(both):
    assert both.error < 1e-11  # gaps of 1e-6 m are known to 1e-11 of themselves
    # under sdirk2 both take two half steps where something lands
    assert np.flatnonzero(both.roll.trace["retries"]).tolist() == both.case.stepper.halved
    nq = both.ours.nq
    assert relative(both.roll.x[:, :nq], both.xs[:, :nq]) <= 1e-9
    assert relative(both.roll.x[:, nq:], both.xs[:, nq:]) <= 1e-9


def test_every_scene_has_its_contacts():
    for name, expected in CARRIED.items():
        run = case(name)
        assert run.rollout and expected <= run.stepper.loaded, (name, run.stepper.loaded)
    lands = case("ball_rolls_sdirk2")
    assert lands.rollout and len(lands.stepper.halved) == 1


def test_bars_see_small_errors():
    """A coefficient of friction that is off by 1e-6 of itself, a size by 1e-9 m, and a rest gap by a thousandth fail the bars."""
    for name, path, change in (("box_slides", "floor.friction", 5e-7), ("edge_on_edge", "upper.shape[0].half_extent[2]", 1e-9)):
        run, model = case(name), pliant.loads(case(name).text)
        xs = run.rollout[0]
        theta = model.theta.copy()
        theta[model.param_index(path)] += change
        assert relative(model.rollout(run.x0, run.u, theta=theta).x, xs) > 1e-9
    run = case("box_slides")
    text = run.text.replace("rest_gap = 1e-06", "rest_gap = 1.001e-06")
    assert text != run.text
    assert relative(pliant.loads(text).rollout(run.x0, run.u).x, run.rollout[0]) > 1e-9


def halves(n):
    """Positions and velocities of a state's change."""
    return [("q", slice(0, n)), ("v", slice(n, 2 * n))]


PLACES = ("position", "rotation", "center", "center_of_mass", "a", "b")


def by_entry(paths, got, want, floor):
    """Relative errors of slopes (…, n_params) by θ, entry by entry or place by place."""
    groups = {}
    for j, path in enumerate(paths):
        name = path.split("[")[0] if "shape[" not in path else "[".join(path.split("[")[:2])
        groups.setdefault(name if name.split(".")[-1] in PLACES else path, []).append(j)
    return {name: relative(got[..., j], want[..., j], floor[j].max()) for name, j in groups.items()}


def rounding(theta, slopes):
    """The slope by each entry of θ below which it is compared on this scale instead: where the whole of the entry (one SI
    unit, if it is zero) has a millionth of the strongest entry's effect, terms that cancel leave no more digits."""
    size = np.where(theta == 0.0, 1.0, np.abs(theta))
    return 1e-6 * (slopes * np.abs(theta)).max() / size


def test_step_jacobians(both):
    n = both.ours.nv
    for k, (a, b, c) in enumerate(both.slopes):
        got_a, got_b, got_c = both.roll.linearize(k)
        got_c = got_c[:, both.places]
        worst = {f"A{i}{j}": relative(got_a[r, s], a[r, s]) for i, r in halves(n) for j, s in halves(n)}
        worst |= {f"u[{j}]": relative(got_b[:, j], b[:, j]) for j in range(both.ours.nu)}
        floor = rounding(both.case.theta, np.abs(c).max(axis=0))
        worst |= by_entry(both.ours.paths, got_c, c, floor)
        failed = {key: v for key, v in worst.items() if not v <= 1e-8}
        assert not failed, (k, failed)


def test_rollout_derivatives(both):
    ours, rng = both.ours, np.random.default_rng(3)
    steps = len(both.slopes)
    x_bar = rng.normal(size=(steps + 1, ours.ndx))
    u_bar, theta_bar, bar = np.zeros_like(both.case.u), np.zeros_like(ours.theta), x_bar[-1].copy()
    for k in reversed(range(steps)):
        a, b, c = both.slopes[k]
        u_bar[k], bar, theta_bar = b.T @ bar, a.T @ bar + x_bar[k], theta_bar + c.T @ bar
    got_x0, got_u, got_theta = both.roll.vjp(x_bar)
    got_theta = got_theta[both.places]
    worst = {name: relative(got_x0[part], bar[part]) for name, part in halves(ours.nv)}
    worst |= {f"u[{j}]": relative(got_u[:, j], u_bar[:, j]) for j in range(ours.nu)}
    floor = rounding(both.case.theta, np.abs(theta_bar))
    worst |= by_entry(ours.paths, got_theta, theta_bar, floor)
    failed = {key: v for key, v in worst.items() if not v <= 1e-8}
    assert not failed, failed

    dx, du = rng.normal(size=ours.ndx), rng.normal(size=both.case.u.shape)
    dtheta = rng.normal(size=len(ours.theta)) * np.abs(both.case.theta)
    tangents, own = [dx], np.zeros(both.model.n_params)
    own[both.places] = dtheta
    for (a, b, c), row in zip(both.slopes, du, strict=True):
        tangents.append(a @ tangents[-1] + b @ row + c @ dtheta)
    got, want = both.roll.jvp(dx, du, own), np.array(tangents)
    assert all(relative(got[:, part], want[:, part]) <= 1e-8 for _, part in halves(ours.nv))


def test_a_ball_that_lands_spinning_at_the_default_rest_gap():
    model, stepper = stepper_of(SPINNING)
    x0 = model.initial_state()
    x = stepper.step(x0, np.zeros(0), model.theta)[0]
    assert stepper.largest < 1e-11
    roll = pliant.loads(SPINNING).rollout(x0, np.zeros((1, 0)))
    assert np.abs(roll.x[1] - x).max() <= 1e-9
