"""Contact against closed forms (validation/forms): values, pliant's derivatives and orders in the step, within bounds worked out here.

Friction is smoothed: at the speed v it is too small by the part c/v, c = gap/(2 σ h), with σ = √(μ² + 0.05²)/min(1, h²/τ²) and τ = 2 ms
(docs/theory/contact.md), and what sticks at the part ρ of the critical slope creeps at 2 c ρ/(1 − ρ²). A bound is the error of implicit
Euler without smoothing and that of smoothing, each to first order.
"""

import math

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

from validation import closed_forms, evidence
from validation.bodies.contact import G
from validation.evidence import page
from validation.forms import rolling, ropes, sliding, stacks
from validation.forms.case import orders, solve

STEPS = (2e-3, 1e-3, 5e-4)  # s; at steps above τ friction is less sharp, so an order across τ means nothing
GAPS = (1e-9, 1e-6)  # m
POINTS = {"block": 4, "node": 1, "ball": 1}  # that carry it
FROM_REST = ("block_slides", "node_slides", "ball_downhill")
SIMPLE = [(case, gap) for case in sliding.CASES + rolling.CASES for gap in GAPS]


def smoothing(points: int, rest_gap: float, mu: float, h: float) -> float:
    """c [m/s]: friction is too small by c/v. A node's gap is the rest gap, by its own weight; a body's is that of points in 10 m/s²."""
    gap = rest_gap if points == 1 else sliding.hover(points, rest_gap)
    return gap / (2.0 * h) * min(1.0, (h / 2e-3) ** 2) / math.hypot(mu, 0.05)


def bound(case, rest_gap: float, h: float) -> float:
    """Largest error that implicit Euler and the smoothing explain."""
    at = case.at
    mu = at.get("mu", 0.5)
    c = 1.02 * smoothing(POINTS[case.name.split("_")[0]], rest_gap, mu, h)
    if case.name.endswith("_to_rest"):  # it stops within a step; ∫ v dv/(1 − c/v)
        return mu * G * h / at["v0"] + 2.0 * c / at["v0"]
    if case.name.endswith("_sticks"):
        return 1.05 * 2.0 * c * 0.9 / (1.0 - 0.9**2)
    if case.name in ("block_slides", "node_slides"):  # ∫ (c/v) dt from where v = c
        last = case.value()
        return mu * G * math.cos(at["alpha"]) * at["time"] * c / last**2 * (1.0 + math.log(last / c))
    if case.name == "ball_rolls":  # the point of contact is in the middle of the gap
        return 0.3 * rest_gap / rolling.RADIUS
    if case.name == "ball_slides":
        return 3.5 * mu * G * h / at["v0"] + 4.0 * c / at["v0"]
    rho = 2.0 / 7.0 * math.tan(at["alpha"]) / mu
    return 3.0 * c * rho / case.value() + rest_gap / rolling.RADIUS  # ball_downhill: creep, and the gap


@pytest.mark.parametrize(("case", "gap"), SIMPLE, ids=[f"{case.name}-{gap:g}" for case, gap in SIMPLE])
def test_sliding_and_rolling(case, gap):
    found = [solve(case, h, gap) for h in STEPS]
    sticks = case.name.endswith("_sticks")
    for f, h in zip(found, STEPS, strict=True):
        most = bound(case, gap, h)
        assert abs(f.error) < most
        assert set(f.derivative_errors) == set(case.moves)
        for name, error in f.derivative_errors.items():
            # of a creep: ∂ log (ρ/(1 − ρ²))/∂ log ρ = 9.5, and what σ and the normal force add
            assert abs(error) < (11.0 if sticks else 1.1) * most, name
    if abs(found[-1].error) > 1e-7 and case.name != "ball_rolls":
        # a speed from rest has an error of h log h; so far its order is from 0.75
        assert min(orders([f.error for f in found])) > (0.74 if case.name in FROM_REST else 0.98)


def test_creep_is_that_of_the_smoothed_law():
    for kind, points in (("block", 4), ("node", 1)):
        case, h, gap = closed_forms.CASES[f"{kind}_sticks"], 1e-3, 1e-9
        # the normal force is that of the slope
        creep = 2.0 * smoothing(points, gap, sliding.MU, h) * 0.9 / (1.0 - 0.9**2) / math.cos(case.at["alpha"])
        assert solve(case, h, gap).value == pytest.approx(creep, rel=0.005)


def test_steps_above_and_below_the_sharpest_friction_differ_as_the_law_says():
    """The slip factor is constant above τ = 2 ms and grows with 1/h² below: creep is greatest at τ, the same at 4 and 1 ms."""
    creep = [solve(closed_forms.CASES["node_sticks"], h, 1e-9).value for h in (4e-3, 2e-3, 1e-3)]
    assert creep[1] / creep[0] == pytest.approx(2.0, rel=1e-3) and creep[2] / creep[0] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("name", ["block_to_rest", "ball_slides", "node_slides"])
def test_vjp_gives_the_same_derivatives(name):
    case = closed_forms.CASES[name]
    model = pliant.loads(case.scene(1e-3, 1e-9, "euler"))
    roll = model.rollout(model.initial_state(), model.controls())
    tangent = roll.jvp(**case.moves["mu"](model, len(roll)))
    rng = np.random.default_rng(1)
    x_bar = rng.normal(size=(len(roll) + 1, model.ndx))
    theta_bar = roll.vjp(x_bar)[2]
    mine = theta_bar[model.param_index("floor.friction")]
    assert mine == pytest.approx((x_bar * tangent).sum(), rel=1e-9) and mine != 0.0


@pytest.mark.parametrize("integrator", ["euler", "sdirk2"])
def test_a_capstan(integrator):
    case = closed_forms.CASES["capstan"]
    mu = case.at["mu"]
    for gap, most in ((1e-9, 1e-6), (1e-6, 3e-5)):
        found = solve(case, 1e-3, gap, integrator)
        assert abs(found.error) < most and abs(found.derivative_errors["mu"]) < most
        # 32 edges: the polygon is ahead of the circle by (2/3 μ³ + 2/3 μ) (φ/2)³ a corner
        edge = 0.5 * math.pi / ropes.EDGES
        ahead = ropes.EDGES * 2.0 / 3.0 * (mu + mu**3) * edge**3
        assert found.value / math.exp(mu * math.pi) - 1.0 == pytest.approx(ahead, rel=0.05)


def test_a_rope_over_a_pulley_ends_at_its_directrix():
    """Second order in the edges' length; derivatives depend on where the nodes lie on the pulley."""
    coarse, fine = (solve(closed_forms.CASES[f"catenary_{edges}"], 4e-3, 1e-6) for edges in (50, 100))
    assert abs(fine.error) < 5e-4 and 1.8 < math.log2(coarse.error / fine.error) < 2.2
    for found in (coarse, fine):
        assert max(map(abs, found.derivative_errors.values())) < 0.02


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("k", range(3))
def test_loads_under_a_stack_are_the_weights(k, gap):
    found = solve(closed_forms.CASES[f"stack_load_{k}"], 2e-3, gap)
    assert found.value == pytest.approx(sum(stacks.MASSES[k:]) * G, rel=1e-9)
    assert found.derivatives["m2"] == pytest.approx(G, rel=1e-9)
    assert found.derivatives["m0"] == pytest.approx(0.0 if k else G, abs=1e-9)


def test_a_block_stays_on_the_table_or_tips_over_its_edge():
    within = solve(closed_forms.CASES["block_within_edge"], 1e-3, 1e-9)
    assert abs(within.value) < 1e-9 and abs(within.derivatives["d"]) < 1e-9
    case = closed_forms.CASES["block_beyond_edge"]
    found = [solve(case, h, 1e-9) for h in STEPS]
    for errors in ([f.error for f in found], [f.derivative_errors["d"] for f in found]):
        assert min(orders(errors)) > 0.95
    for f, h in zip(found, STEPS, strict=True):
        # Euler's speed is that of a time between h/2 and h later or earlier, of motions that grow as sinh
        rate = math.sqrt(G * stacks.HALF / (5.0 / 3.0 * stacks.HALF**2))
        assert abs(f.error) < h * rate / math.tanh(rate * case.at["time"])
        assert abs(f.derivative_errors["d"]) < h * rate / math.tanh(rate * case.at["time"])


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("name", ["pulled_block", "carried_block"])
def test_a_block_is_pulled_from_under_another(name, gap):
    """Both faces slide from rest: their friction is too small by ∫ (c/v) dt."""
    case, at = closed_forms.CASES[name], stacks.PULL
    found = [solve(case, h, gap) for h in STEPS]
    plate = stacks.plate_speed(**at)
    faces = {"below": (stacks.LOWER + stacks.UPPER, plate), "between": (stacks.UPPER, plate - at["between"] * G * at["time"])}
    for f, h in zip(found, STEPS, strict=True):
        most = 0.0
        for face, (mass, speed) in faces.items():
            load = mass / (stacks.LOWER if face == "below" else stacks.UPPER)  # smoothing is that of the lighter body
            c = smoothing(4, gap, at[face], h) / load
            weight = mass / stacks.LOWER if name == "pulled_block" else (0.0 if face == "below" else 1.0)
            most += at[face] * G * weight * at["time"] * c / speed * (1.0 + math.log(speed / c)) / case.value()
        assert abs(f.error) < most
        # the part that one coefficient has in the value is smaller than the value
        assert max(map(abs, f.derivative_errors.values())) < 2.0 * most
    assert min(orders([f.error for f in found])) > 0.75


AGAIN = [("block_to_rest", "euler", 1e-4), ("node_slides", "sdirk2", 1e-6), ("ball_rolls", "euler", 1e-6), ("capstan", "euler", 1e-4)]


@pytest.mark.parametrize(("name", "integrator", "gap"), AGAIN)
def test_rows_are_as_on_record(name, integrator, gap):
    (case,) = (c for c in evidence.read("closed_forms")["figures"]["cases"] if c["name"] == name)
    (then,) = (r for r in case["rows"] if (r["integrator"], r["rest_gap"]) == (integrator, gap))
    for k in (1, 3):
        found = solve(closed_forms.CASES[name], then["steps"][k], gap, integrator)
        assert found.value == pytest.approx(then["values"][k], rel=1e-6)
        for by, value in found.derivatives.items():
            assert value == pytest.approx(then["derivatives"][by]["values"][k], rel=1e-5, abs=1e-9)


def test_the_record_has_all_cases_and_the_page_shows_them():
    cases = evidence.read("closed_forms")["figures"]["cases"]
    assert [c["name"] for c in cases] == list(closed_forms.CASES)
    assert [c["says"] for c in cases] == [c.says for c in closed_forms.CASES.values()]
    assert page.split(page.MEASURED.read_text(encoding="utf-8"), page.FORMS)[1] == page.forms_table()


def test_an_error_that_does_not_fall_is_said_to_stay():
    assert closed_forms.stays([1e-3, 1e-3, 9e-4]) and not closed_forms.stays([1e-3, 5e-4, 2e-4])
    assert not closed_forms.stays([1e-8, 1e-8, 1e-8])


def test_closed_forms_are_differentiated_exactly():
    for case in closed_forms.CASES.values():
        for name in case.moves:
            step = 1e-5 * abs(case.at[name] or 1.0)
            ends = [float(np.real(case.exact(**(dict(case.at) | {name: case.at[name] + s})))) for s in (-step, step)]
            assert case.derivative(name) == pytest.approx((ends[1] - ends[0]) / (2.0 * step), rel=1e-5, abs=1e-7), (case.name, name)
