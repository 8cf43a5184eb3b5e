"""The batch's generators against closed forms and other integrators, its oracle, and its scorer."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validation.blind import batch, draw, judge, noise, ropes, score, toss
from validation.blind.chain import Chain, zero
from validation.blind.chains import ChainSetup
from validation.blind.system import Cause

HELD = np.zeros((1, 4 * 200 + 1, 1))  # commands of 200 steps


def one_joint(kind: str, **laws: float) -> tuple[Chain, dict]:
    """A mass of 2 kg on a slide along x, or 0.5 m below a hinge about y."""
    p = zero(1) | {"mass": np.array([2.0]), "spread": np.array([[0.1, 0.1, 0.1]]), "gain": np.ones(1)}
    if kind == "revolute":
        p["com"] = np.array([[0.0, 0.0, -0.5]])
    return Chain((kind,), (0 if kind == "prismatic" else 1,)), p | {key: np.array([x]) for key, x in laws.items()}


def moved(chain: Chain, p: dict, q: float, v: float, rule: str = "strang", steps: int = 200) -> np.ndarray:
    """Positions at all steps of 5 ms."""
    out, _ = chain.simulate([p], np.array([[q]]), np.array([[v]]), HELD[:, : 4 * steps + 1], 5e-3, 0.0, rule)
    return out[0, :, 0]


def test_a_damped_spring_is_the_closed_form():
    chain, p = one_joint("prismatic", stiffness=50.0, damping=1.5)
    t, decay = np.arange(201) * 5e-3, 1.5 / 4.0
    fast = np.sqrt(25.0 - decay**2)
    exact = np.exp(-decay * t) * (0.1 * np.cos(fast * t) + 0.1 * decay / fast * np.sin(fast * t))
    assert np.abs(moved(chain, p, 0.1, 0.0) - exact).max() < 1e-7


def test_dry_friction_stops_a_slide_where_it_must():
    chain, p = one_joint("prismatic", friction=3.0)  # 1.5 m/s²
    x = moved(chain, p, 0.0, 0.6)
    assert x[-1] == pytest.approx(0.6**2 / 3.0, abs=2e-5) and x[-1] == x[-20]
    t = np.arange(50) * 5e-3
    assert np.abs(x[:50] - (0.6 * t - 0.75 * t**2)).max() < 1e-12


def test_a_slide_that_a_force_turns_round_loses_no_step():
    chain, p = one_joint("prismatic", friction=3.0, offset=4.0)  # 1.5 and 2 m/s²
    t, turned = np.arange(201) * 5e-3, 1.0 / 3.5
    after = np.maximum(t - turned, 0.0)
    before = np.minimum(t, turned)
    exact = -before + 1.75 * before**2 + 0.25 * after**2
    assert np.abs(moved(chain, p, 0.0, -1.0) - exact).max() < 1e-5


def test_a_pendulum_keeps_its_energy_and_its_small_period():
    chain, p = one_joint("revolute")
    arm = 0.25 + 0.02  # r² + k², k² = 0.01 + 0.01
    speed = np.sqrt(9.81 * 0.5 / arm)
    small = moved(chain, p, 1e-4, 0.0)
    assert np.abs(small - 1e-4 * np.cos(speed * np.arange(201) * 5e-3)).max() < 1e-9
    q, v = chain.simulate([p], np.array([[1.5]]), np.zeros((1, 1)), HELD, 5e-3, 0.0)
    energy = 0.5 * 2.0 * arm * v[0, :, 0] ** 2 - 2.0 * 9.81 * 0.5 * np.cos(q[0, :, 0])
    assert np.abs(energy - energy[0]).max() < 1e-7 * 9.81


def test_midpoint_converges_in_second_order():
    chain, p = one_joint("revolute", damping=0.3)
    truth = moved(chain, p, 1.0, 0.0)[-1]
    error = []
    for n in (200, 400):
        u = np.zeros((1, 4 * n + 1, 1))
        q, _ = chain.simulate([p], np.array([[1.0]]), np.zeros((1, 1)), u, 1.0 / n, 0.0, "midpoint")
        error.append(abs(q[0, -1, 0] - truth))
    assert 3.8 < error[0] / error[1] < 4.2


def test_an_arm_in_space_is_that_of_mujoco():
    """Accelerations of a chain with a slide, three axes and tilted gravity."""
    rng = np.random.default_rng(3)
    kinds, axes = ("prismatic", "revolute", "revolute", "revolute"), (0, 1, 2, 0)
    p = zero(4) | {"mass": rng.uniform(0.5, 2.0, 4), "com": rng.uniform(-0.2, 0.2, (4, 3)), "spread": rng.uniform(0.05, 0.15, (4, 3))}
    p |= {"places": rng.uniform(-0.3, 0.3, (4, 3)), "armature": rng.uniform(0.0, 0.1, 4), "damping": rng.uniform(0.0, 0.5, 4)}
    p |= {"stiffness": rng.uniform(0.0, 2.0, 4), "tilt": np.array([0.1, -0.2])}
    body = ""
    for k in reversed(range(4)):
        s = p["spread"][k] ** 2
        text = lambda x: " ".join(map(repr, map(float, x)))
        kind = {"prismatic": "slide", "revolute": "hinge"}[kinds[k]]
        body = f"""<body pos="{text(p["places"][k])}"><joint type="{kind}" axis="{text(np.eye(3)[axes[k]])}" damping="{p["damping"][k]}"
            stiffness="{p["stiffness"][k]}" armature="{p["armature"][k]}"/><inertial pos="{text(p["com"][k])}" mass="{p["mass"][k]}"
            diaginertia="{text(p["mass"][k] * (s.sum() - s))}"/>{body}</body>"""
    a, b = p["tilt"]
    g = 9.81 * np.array([np.sin(b) * -np.cos(a), np.sin(a), np.cos(b) * -np.cos(a)])
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="{" ".join(map(repr, map(float, g)))}"/><worldbody>{body}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    q, v = rng.uniform(-1.0, 1.0, 4), rng.uniform(-2.0, 2.0, 4)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    assert np.allclose(Chain(kinds, axes).acceleration(p, q, v, np.zeros(4), 0.0), data.qacc, rtol=1e-9, atol=1e-9)


def test_a_lag_and_a_delay_are_what_their_names_say():
    setup = ChainSetup("cart", np.random.default_rng(0))
    t = np.linspace(-0.1, 1.0, 4401)
    late = setup.table(0, {"late:rail": 0.02}, t, linear=True)[:, 0]
    told = setup.table(0, {}, t, linear=True)[:, 0]
    assert np.allclose(late[400:], np.interp(t[400:] - 0.02, t, told), atol=1e-9)
    lagged = setup.table(0, {"lag:rail": 0.02}, t, linear=True)[:, 0]
    rate = np.gradient(lagged, t)
    assert np.abs(0.02 * rate - (told - lagged))[500:].max() < 2e-2 * np.abs(told).max()


def test_a_tossed_body_falls_and_keeps_its_momentum():
    setup = toss.TossSetup(np.random.default_rng(0))
    p = {key: np.zeros((1, 1)) for key in toss.FORCES} | {"gust_at": np.zeros((1, 1)), "gravity": np.array([setup.gravity({})])}
    s = setup.spread**2
    p["inertia"] = setup.mass * (s.sum() - s)[None]
    start = np.array([[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 2.0, 4.0, -3.0, 5.0]])
    path = toss.simulate(p, start, 2e-3, 300, midpoint=False)[:, 0]
    t = np.arange(301) * 2e-3
    assert np.allclose(path[:, 2], 1.0 + 2.0 * t - 0.5 * 9.81 * t**2, atol=1e-12)
    spin = [toss.Rotation.from_quat(x[3:7], scalar_first=True).apply(p["inertia"][0] * x[10:]) for x in path]
    assert np.abs(spin - spin[0]).max() < 1e-8 * np.linalg.norm(spin[0])


@pytest.mark.parametrize("key", toss.DRAGS)
def test_the_drag_of_a_toss_is_pliants_law(key, tmp_path):
    pliant = pytest.importorskip("pliant")
    setup = toss.TossSetup(np.random.default_rng(3))
    knob = setup.knobs[key]
    size = 0.5 * knob.largest
    hidden, plain = setup.readings([(0, {key: size}), (0, {})])
    scene = setup.write(tmp_path, [hidden] * len(setup.roles), {}, False).read_text(encoding="utf-8")
    model = pliant.loads(scene[: scene.index("[experiment]")])
    place, angle, v, w = setup.begun[0]
    turn = Rotation.from_rotvec(angle)
    # the velocity of the origin in the world's axes, the spin in the body's
    x = np.concatenate([place, turn.as_quat(scalar_first=True), v, w])
    steps = round(setup.duration / model.step_length)

    def read(theta):
        path = model.rollout(x, np.zeros((steps, 0)), theta, record=False).x[:: setup.substeps]
        turns = Rotation.from_quat(path[:, 3:7], scalar_first=True)
        return np.stack([path[:, :3] + turns.apply(point) for point in toss.POINTS], axis=1).reshape(len(path), -1)

    error = hidden - plain - (read(model.theta_with({knob.path: knob.true(size)})) - read(model.theta))
    assert np.abs(error).max() < 0.01 * np.abs(hidden - plain).max() and np.abs(hidden - plain).max() > 5.0 * setup.sigma


def test_noise_has_its_colour_its_gaps_and_its_outliers():
    rng = np.random.default_rng(0)
    for kind in ("white", "ar_0.8", "ar_0.95"):
        own = noise.KINDS[kind]
        x = own.draw((4000, 50), rng)
        assert x.std() == pytest.approx(1.0, rel=0.05)
        w = noise.whiten(x, own.phi, 1.0).reshape(4000, 50)
        assert w.std() == pytest.approx(1.0, rel=0.02) and abs(np.mean(w[1:] * w[:-1])) < 0.02
    gone = np.isnan(noise.KINDS["gaps"].read(np.zeros((300, 4)), 1e-3, rng))
    assert gone.mean() == pytest.approx(0.1, abs=0.01) and not gone[[0, -1]].any()
    far = np.abs(noise.KINDS["outliers"].read(np.zeros((2000, 20)), 1e-3, rng)) > 0.02
    assert far.mean() == pytest.approx(0.002, abs=0.001)


@pytest.fixture(scope="module")
def pendulum() -> judge.Judge:
    return judge.Judge(ChainSetup("pendulum", np.random.default_rng(5)), noise.KINDS["ar_0.8"])


def test_the_oracle_knows_exact_symmetries(pendulum):
    """An encoder's zero and the tilt of gravity; a late motor and late readings."""
    for key, twin in (("bias:hinge", "gravity_tilt"), ("late:hinge", "sensor_delay")):
        u = pendulum.change([{key: 0.005}] * 4)
        assert pendulum.cosines(u)[twin] > score.SYMMETRIC, key
        assert not pendulum.allows_name(u, {"bias": "encoder_bias:hinge", "late": "actuator_delay:motor_hinge"}[key[:4]])[0]


def test_the_oracle_knows_symmetries_of_large_changes(pendulum):
    """A heavier turning bob and an armature: to first order, or simulated once at that size, the one seems to be told from the other."""
    key = "link_inertia:bob"
    u = pendulum.change([{knob: 0.3 * pendulum.setup.knobs[knob].largest for knob in pendulum.setup.causes[key].knobs}] * 4)
    lam = float(u @ u)
    assert lam * (1.0 - pendulum.cosines(u)["armature:hinge"] ** 2) > 400.0
    assert lam * (1.0 - pendulum.matched(u, key)["armature:hinge"] ** 2) < 0.1


def test_what_can_only_grow_imitates_no_change_the_other_way():
    """A heavier cart is one of a larger armature; a lighter one is not, for there is no armature below zero."""
    cart = judge.Judge(ChainSetup("cart", np.random.default_rng(2)), noise.KINDS["white"])
    knob = cart.setup.causes["payload:cart"].knobs[0]
    of = lambda way: cart.cosines(cart.change([{knob: way * 0.02 * cart.setup.knobs[knob].largest}] * 4))["armature:rail"]
    assert of(1.0) > 0.99 and of(-1.0) == 0.0


def test_the_oracle_sees_nothing_of_what_is_refitted(pendulum):
    u = pendulum.change([{"start:0": 0.01, "start:1": -0.02}] * 4)
    assert u @ u < 3.0  # of 1e5 and more
    assert pendulum.change([{}] * 4) @ pendulum.change([{}] * 4) == 0.0


def test_its_lambda_is_what_the_noise_makes_of_an_effect(pendulum):
    """The variance of the estimate, from readings with noise, is 1/λ of the size that is hidden."""
    setup, rng = pendulum.setup, np.random.default_rng(1)
    size = 0.02 * pendulum.setup.knobs["damping:hinge"].largest
    u = pendulum.change([{"damping:hinge": size}] * 4)
    estimates = []
    for _ in range(300):
        n = [noise.KINDS["ar_0.8"].read(0.0 * y, setup.sigma, rng) for y in pendulum.zero]
        estimates.append(u @ pendulum.project(n) / (u @ u))
    assert np.std(estimates) * np.sqrt(u @ u) == pytest.approx(1.0, rel=0.12)


def test_a_case_has_the_lambda_aimed_at_and_a_scene_that_lacks_it(tmp_path: Path):
    drawn = draw.draw(0, 3, "cart", "effect")
    case = drawn.case
    assert 0.8 < case.lam_exact / case.lam < 1.25 and case.hidden[0]["truth"]
    scene = drawn.write(tmp_path).read_text(encoding="utf-8")
    assert "pliant" in scene and all(f"run{r + 1}.csv" in scene for r in range(5))
    again = draw.draw(0, 3, "cart", "effect")
    assert again.case.as_json() == case.as_json()
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(drawn.readings, again.readings, strict=True))


def test_plans_have_their_shares_and_do_not_depend_on_the_order_of_asking():
    wanted = draw.plan(200, 4)
    kinds = [kind for _, kind in wanted]
    assert wanted == draw.plan(200, 4) and len(wanted) == 200
    assert kinds.count("null") == pytest.approx(68, abs=1)
    assert all(kind not in draw.RULED_OUT.get(system, ()) for system, kind in wanted)


def test_a_system_that_is_drawn_by_name_is_in_no_other_batch():
    assert not {system for system, _ in draw.plan(400, 4)} & set(draw.BY_NAME)
    assert {system for system, _ in draw.plan(20, 4, ["cloth"])} == {"cloth"}


def test_parameters_of_ropes_are_absolute():
    setup = ropes.RopeSetup("two_ends", np.random.default_rng(0))
    told = setup.parameters({"c1": 0.01, "wind1": 0.2, "right.offset2": 1e-3, "EA": 1e-3, "scale": 0.1})
    assert told["c1"] == pytest.approx(0.09) and told["wind"] == [0.0, 0.2, 0.0]
    assert told["offset"] == [0.0] * 8 + [1e-3] and told["EA"] == pytest.approx(1.0 / (1.0 / 120.0 + 1e-3))
    assert set(told) == {"c1", "wind", "offset", "EA"}


# ---- Scores ----------------------------------------------------------------------------------------------------------------


def answer(verdict: str, *names: tuple[str, str], others: list[list[tuple[str, str]]] | None = None) -> dict:
    parameters = [{"path": "elbow.damping", "interval": [0.0, 1.0]}]
    causes = [{"name": name, "object": at or None, "parameters": parameters} for name, at in names]
    groups = others or []
    return {
        "verdict": verdict, "causes": causes, "alternatives": [[n for n, _ in g] for g in groups],
        "alternative_objects": [[at or None for _, at in g] for g in groups], "gain": [],
    }  # fmt: skip


def case(kind: str, *names: tuple[str, str], **more) -> dict:
    hidden = [{"name": name, "object": at, "truth": {"elbow.damping": 0.5}} for name, at in names]
    base = {"seed": 0, "index": 0, "system": "arm2", "kind": kind, "noise": "white", "numerics": "", "lam": 100.0, "allowed": True}
    return base | {"hidden": hidden, "cosines": {}} | more


V, C, D = ("viscous_friction", "elbow"), ("coulomb_friction", "elbow"), ("viscous_friction", "shoulder")


@pytest.mark.parametrize(
    ("hidden", "told", "worth"),
    [
        (case("effect", V), answer("named", V), "right"),
        (case("effect", V), answer("named", D), "wrong"),
        (case("effect", V), answer("named", V, C), "wrong"),
        (case("effect", V), answer("varies", V), "varied"),
        (case("effect", V), answer("ambiguous", others=[[C], [V]]), "honest"),
        (case("effect", V), answer("ambiguous", others=[[C], [D]]), "astray"),
        (case("effect", V), answer("adequate"), "missed"),
        (case("effect", V), answer("numerics"), "numerics"),
        (case("pair", V, C), answer("named", C, V), "right"),
        (case("pair", V, C), answer("named", C), "part"),
        (case("pair", V, C), answer("named", D), "wrong"),
        (case("pair", V, C), answer("varies", C), "wrong"),
        (case("pair", V, C), answer("ambiguous", V, others=[[C], [D]]), "honest"),
        (case("pair", V, C), answer("ambiguous", others=[[C, D]]), "half"),
        (case("pair", V, C), answer("ambiguous", D, others=[[C, D]]), "astray"),
        (case("varies", V), answer("varies", V), "right"),
        (case("varies", V), answer("named", V), "one_size"),
        (case("some", V), answer("named", C), "wrong"),
        (case("null"), answer("adequate"), "clean"),
        (case("null"), answer("named", V), "false_alarm"),
        (case("null"), answer("varies", V), "false_alarm"),
        (case("null"), answer("numerics"), "flagged"),
        (case("null", numerics="step"), answer("numerics"), "clean"),
        (case("outside"), answer("not_in_library"), "not_in_library"),
        (case("outside"), answer("named", V), "wrong"),
        (case("value", ("", "")), answer("named", C), "right"),  # its parameter is the wrong number
        (case("symmetric", ("actuator_delay", "m")), answer("named", ("sensor_delay", "")), "wrong"),
        (case("symmetric", ("sensor_delay", "")), answer("ambiguous", others=[[("actuator_delay", "")]]), "honest"),
        (case("effect", V), None, "failed"),
        (case("effect", V), answer("nonsense"), "failed"),
    ],
)  # fmt: skip
def test_outcomes(hidden, told, worth):
    assert score.outcome(hidden, told) == worth


def test_a_single_motor_is_late_as_its_readings_are():
    hidden = {"name": "actuator_delay", "object": "m", "alone": True}
    assert all(score.is_cause(hidden, name) for name in (("sensor_delay", ""), ("actuator_delay", ""), ("actuator_delay", "m")))
    assert not score.is_cause(hidden | {"alone": False}, ("sensor_delay", ""))


def test_an_exact_symmetry_is_one_at_the_size_of_the_effect():
    cause = Cause("a", "", ("x",))
    alike = {"a": 1.0, "b": 0.9999}  # 1 - ρ² = 2e-4
    assert draw.has_twin(alike, cause, 5e3) and not draw.has_twin(alike, cause, 2e4)
    assert not draw.has_twin({"a": 1.0, "b": 0.99}, cause, 10.0)


def test_what_runs_away_has_no_direction():
    """A candidate whose change throws the motion to infinity stands beside none of the others."""
    setup = ChainSetup("cart", np.random.default_rng(0))
    good = judge.Judge(setup, noise.KINDS["white"])
    gone = [np.full_like(y, np.nan) for y in good.zero]
    some = [np.ones_like(y).cumsum(axis=0) ** 2 for y in good.zero]
    assert good.spanned([some]) is not None and good.spanned([gone]) is None and good.spanned([some, gone]) is None


def test_parts_of_a_batch_are_of_one_program(tmp_path: Path):
    planned = {"commit": "a", "seeds": [1003], "planned": 600}
    path, row_of_it = tmp_path / "blind.json", {"index": 3, "outcome": "clean"}
    assert batch.earlier(path, planned) == []
    batch.stored(path, planned | {"cases": 1, "answers": [row_of_it]})
    assert batch.earlier(path, planned) == [row_of_it]
    for other in ({"commit": "b"}, {"seeds": [1004]}, {"planned": 601}):
        assert batch.earlier(path, planned | other) == []


def row(hidden: dict, told: dict) -> dict:
    return {"case": hidden, "report": told, "outcome": score.outcome(hidden, told), "seconds": 1.0}


def test_a_batch_is_counted_as_agreed():
    rows = [row(case("null", lam=0.0), answer("adequate")) for _ in range(240)] + [row(case("null"), answer("named", V))] * 5
    rows += [row(case("effect", V), answer("named", V))] * 30 + [row(case("effect", V), answer("named", C))]
    rows += [row(case("outside"), answer("named", V)), row(case("outside"), answer("not_in_library"))]
    rows += [row(case("symmetric", V), answer("named", V)), row(case("varies", V), answer("varies", V))]
    summary = score.summarize([score.short(each) for each in rows])
    assert {key: summary["nulls"][key] for key in ("n", "named")} == {"n": 245, "named": 5}
    assert summary["outside"]["n"] == 2 and summary["outside"]["named"] == 1
    assert summary["symmetric"]["n"] == 1 and summary["symmetric"]["named"] == 1
    assert summary["intervals"] == {"n": 30, "hold": 30} and summary["varies"]["right"] == 1
    keys = ("n", "named_right", "named_wrong", "ambiguous_with", "ambiguous_without", "adequate", "withheld", "oracle_allows", "oracle_named")
    assert [summary["effects"][key] for key in keys] == [31, 30, 1, 0, 0, 0, 0, 31, 30]
    state = {r["name"]: r["state"] for r in summary["requirements"]}
    assert state["false names ≤ 2 % of nulls"] == "fails" and state["outside effects never named"] == "too few cases"
    assert state["exact symmetries never named"] == "too few cases"
    assert "nulls" in score.table(summary)


def test_bounds():
    assert score.clopper_pearson(0, 10) == pytest.approx((0.0, 0.3085), abs=1e-4)
    assert score.upper_bound(0, 204) == pytest.approx(0.0146, abs=1e-4)
    assert not set(score.DEVELOPMENT) & set(score.FRESH)


def test_what_lies_there_is_not_made_again(tmp_path: Path):
    hidden = case("null")
    batch.stored(tmp_path / "seed0-case0000.truth.json", hidden)
    (tmp_path / "answers").mkdir()
    batch.stored(tmp_path / "answers" / "seed0-case0000.json", {"report": answer("adequate"), "error": "", "seconds": 2.0})
    made = batch.one((tmp_path, tmp_path / "answers", 0, 0, "arm2", "null", "no such program", 1.0))
    assert made["outcome"] == "clean" and json.loads(json.dumps(made))["seconds"] == 2.0
