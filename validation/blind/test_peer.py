"""The model that `mujoco.sysid` is given against the generator, how its answers are judged, and what counts as a form."""

from __future__ import annotations

import copy
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from validation.blind import peer, peer_chains, peer_model, peer_sindy
from validation.blind.chains import BEFORE, ChainSetup

HIDDEN = {
    "damping:rail": 0.2, "quadratic:hinge": 2e-3, "stiffness:hinge": 0.1, "cubic:rail": 300.0, "armature:hinge": 5e-3, "gain:rail": 0.05,
    "offset:rail": 0.2, "cut:rail": 0.2, "late:rail": 0.004, "lag:rail": 0.01, "mass:pole": 0.05, "comz": 0.02, "spread": 0.02, "tilt0": 0.02,
    "tilt1": -0.03, "bias:hinge": 0.01, "scale:rail": 0.02, "delay:hinge": 0.003,
}  # fmt: skip


@pytest.fixture(scope="module")
def setup() -> ChainSetup:
    return ChainSetup("cart_pole", np.random.default_rng(5))


@pytest.fixture(scope="module")
def plant(setup: ChainSetup, tmp_path_factory: pytest.TempPathFactory) -> peer_model.Plant:
    folder = tmp_path_factory.mktemp("chain")
    setup.write(folder, setup.readings([(r, {}) for r in range(len(setup.roles))]), {"pole.mass": setup.links[1].mass}, missing=False)
    return peer_model.read(folder)


def moved(plant: peer_model.Plant, setup: ChainSetup, record: int, values: dict[str, float]) -> np.ndarray:
    """Readings of MuJoCo's chain, begun where the generator begins, before the first of them."""
    given = plant.records[record]
    late = peer_model.Record(given.role, given.times + BEFORE, given.readings, given.stamps + BEFORE, given.commands)
    model = peer_model.fill(peer_model.build(plant), plant.scene, values)
    state = np.concatenate([[0.0], *setup.begun[record]])
    states, _ = rollout.rollout(model, mujoco.MjData(model), state[None], peer_model.driven(plant, late, values)[None])
    out = []
    for joint, q in zip(plant.joints, states[0][:, 1 : 1 + model.nq].T, strict=True):
        own = {key: values[f"{joint['name']}.position_{key}"] for key in ("bias", "scale", "delay")}
        out.append(own["scale"] * np.interp(late.times - own["delay"] - values["sensor.time_offset"], states[0][:, 0], q) + own["bias"])
    return np.stack(out, axis=1)


def test_the_model_moves_as_the_generator_says(plant: peer_model.Plant, setup: ChainSetup) -> None:
    """0.01 of the noise, by steps of a quarter of a sample."""
    values = peer_model.scene_values(plant.scene)
    for record in (0, 2):
        off = moved(plant, setup, record, values) - setup.readings([(record, {})])[0]
        assert np.sqrt(np.mean(off**2)) < 0.02 * setup.sigma


def test_every_number_that_can_be_freed_is_that_of_its_path(plant: peer_model.Plant, setup: ChainSetup) -> None:
    widest = next(key for key in setup.knobs if key.startswith("spread") and key.endswith(":pole"))
    hidden = {{"comz": "com2:pole", "spread": widest}.get(key, key): x for key, x in HIDDEN.items()}
    values = peer_model.scene_values(plant.scene)
    values |= {setup.knobs[key].path: setup.knobs[key].true(x) for key, x in hidden.items()}
    # of the paths that were changed, none is unknown but the late reading that all joints share
    assert {setup.knobs[key].path for key in hidden} <= set(peer_model.numbers(plant))
    off = moved(plant, setup, 0, values) - setup.readings([(0, hidden)])[0]
    plain = moved(plant, setup, 0, peer_model.scene_values(plant.scene)) - setup.readings([(0, hidden)])[0]
    assert np.sqrt(np.mean(off**2)) < 0.1 * setup.sigma < 0.01 * np.sqrt(np.mean(plain**2))


def test_causes_free_numbers_of_the_scene(plant: peer_model.Plant, setup: ChainSetup) -> None:
    known, of_library = peer_model.numbers(plant), {cause.name for cause in setup.causes.values()}
    for cause in peer_model.CAUSES:
        for at in peer_model.objects(cause, plant):
            assert set(peer_model.paths(cause, at, plant.scene)) <= set(known)
    assert of_library <= set(peer_model.CAUSES) | set(peer_model.NOT_REPRESENTED)
    assert peer_chains.cause_of_null(plant, 0) == ("viscous_friction", ["rail.damping"])
    assert peer_chains.cause_of_null(plant, 13)[0] != "payload"  # the scene frees it


def test_a_number_that_others_imitate_is_not_freed(plant: peer_model.Plant) -> None:
    """A cart's spring, damper, mass and motor have one scale in common; its encoder's zero is an offset of the motor's."""
    alone = copy.deepcopy(plant.scene)
    alone["body"], alone["experiment"]["joint"] = alone["body"][:1], alone["experiment"]["joint"][:1]
    alone["experiment"]["fit"]["free"] = []
    records = tuple(peer_model.Record(r.role, r.times[:60], r.readings[:60, :1], r.stamps, r.commands) for r in plant.records[:2])
    cart = peer_model.Plant(alone, records, plant.step)
    free = ["cart.mass", "rail.damping", "rail.stiffness", "motor_rail.gain", "motor_rail.offset", "rail.position_bias", "rail.armature"]
    assert peer_chains.told_apart(cart, free) == ["cart.mass", "rail.damping", "rail.stiffness", "motor_rail.offset"]


def row(index: int, kind: str, name: str = "", numerics: str = "") -> dict:
    hidden = [{"name": name, "object": "", "truth": {"a": 2.0}}] if name else []
    return {"case": {"index": index, "kind": kind, "hidden": hidden, "numerics": numerics, "sigma": 1.0, "lam": 10.0}, "folder": Path()}


def test_cases_are_chosen_in_order_and_effects_only_if_represented() -> None:
    rows = [row(0, "null"), row(1, "null", numerics="step"), row(2, "null"), row(3, "effect", "wind"), row(4, "effect", "time_offset")]
    pairs = peer.chosen(rows, {"null": 2, "effect": 5}, lambda case, _: True, lambda case: case["hidden"][0]["name"] in peer.CAUSES)
    assert [(r["case"]["index"], k) for r, k in pairs] == [(0, 0), (2, 1), (4, 0)]


def test_what_intervals_exclude_is_judged_and_counted() -> None:
    def number(path: str, fitted: float, half: float | None) -> dict:
        return {"path": path, "scene": 1.0, "fitted": fitted, "half_width_95": half, "half_width_all": half and 2 * half}

    effect, null = row(0, "effect", "x")["case"], row(1, "null")["case"]
    listed = [number("a", 1.9, 0.5), number("b", 1.1, 0.08), number("free", 9.0, 0.1), number("c", 7.0, None)]
    got = peer.excluded(effect, listed, ["free"], [])
    assert (got["found"], got["surely"], got["worth"], got["surely_worth"]) == (["a", "b"], [], "too many", "missed")
    assert got["covered"] == [True, False] and got["error"] == [pytest.approx(0.1)] and got["undetermined"] == 1
    assert peer.excluded(effect, listed[:1], [], ["a"])["worth"] == "right"
    assert peer.excluded(effect, listed[1:2], [], [])["worth"] == "wrong"
    assert peer.excluded(null, listed[1:2], [], [])["worth"] == "false"

    mine = {"outcome": "clean", "error": [], "covered": [True], "held_out": 1.5, "seconds": 2.0}
    theirs = got | {"cause": "x", "insights": ["No Issues Detected"], "held_out": 1.0, "seconds": 3.0}
    text = peer.table([{"case": effect, "ours": mine, "peer": {"told": theirs}}])
    assert "effect     1  pliant: {'clean': 1}" in text
    assert "mujoco.sysid, told: {'too many': 1}, something in 1 of 1" in text
    assert "mujoco.sysid, told: intervals hold the truth 1/2; error over the effect's size, median 0.1 (of 1)" in text


def test_forms_are_read_and_judged() -> None:
    words = [
        ("joint1", "a torque at `joint1` that repeats every 779 mrad of the position"),
        ("position of rail", "an error of the sensor of `position of rail` that depends on the velocity like c·sign(v)"),
        ("rail", "a force at `rail` that turns over with the velocity and grows with the time, like c·t·sign(v)"),
        ("hinge", "a torque at `hinge` that pushes for 0.1 s, 2 N·m at 0.6 s into run1.csv"),
    ]
    forms = [peer_sindy.read({"object": at, "what": what}) for at, what in words]
    assert [form[:4] for form in forms] == [
        ("joint1", "position", False, pytest.approx(0.779)),
        ("rail", "velocity", False, None),
        ("rail", "time", True, None),
        ("hinge", "time", False, None),
    ]
    hidden = lambda effect: {"kind": "outside", "hidden": [{"effect": effect}]}
    assert peer_sindy.worth(hidden("ripple:joint1"), forms) == "right"
    assert peer_sindy.worth(hidden("warm:rail"), forms) == "among them"
    assert peer_sindy.worth(hidden("slack:hinge"), forms) == "wrong"
    assert peer_sindy.worth({"kind": "null"}, forms) == "false"
    assert peer_sindy.worth({"kind": "null"}, []) == "none"


def test_readings_are_mended_and_bumps_are_means() -> None:
    t = np.arange(60) * 0.01
    q = np.sin(5 * t) + 1e-4 * np.random.default_rng(0).standard_normal(60)
    off = q.copy()
    off[20], off[41] = off[20] + 0.01, np.nan
    assert np.abs(peer_sindy.cleaned(t, off) - q).max() < 2e-3
    rows = peer_sindy.weak(t, 0.2)
    assert np.allclose(rows.sum(axis=1), 1.0) and np.abs(rows @ t - np.sort(rows @ t)).max() == 0.0


def test_without_pysindy_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    monkeypatch.setattr(peer_sindy, "pysindy", None)
    monkeypatch.setattr("sys.argv", ["peer_sindy", str(tmp_path)])
    assert peer_sindy.main() == 2
    assert "pip install" in capsys.readouterr().err
