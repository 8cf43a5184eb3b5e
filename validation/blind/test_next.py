"""Records that are repeated as a diagnosis proposes, and what is counted of the trials."""

import json
import re

import numpy as np
import pytest

from validation.blind import chains, draw, next as trial, score


@pytest.fixture(scope="module")
def cart() -> chains.ChainSetup:
    return chains.ChainSetup("cart", np.random.default_rng(5))


@pytest.mark.parametrize(("commands", "pace", "start"), trial.MENU)
def test_a_record_is_repeated_with_other_commands_pace_and_start(commands, pace, start):
    setup = chains.ChainSetup("cart_pole", np.random.default_rng(5))
    number = setup.repeat(1, commands, pace, start, np.random.default_rng(0), 0.0)
    assert number == 5 and setup.roles[number] == "fit" and setup.fitted == [0, 1, 2, 3, 5]
    t = np.linspace(0.0, setup.duration, 101)
    before, now = setup.command(1, np.minimum(pace * t, setup.duration)), setup.command(number, t)
    assert now == pytest.approx(before[0] + commands * (before - before[0]), abs=1e-12)
    assert setup.begun[number][0] == pytest.approx(start * setup.begun[1][0]) and setup.begun[number][1] == pytest.approx(start * setup.begun[1][1])


def test_a_record_repeated_as_it_was_has_the_same_motion(cart):
    number = cart.repeat(0, 1.0, 1.0, 1.0, np.random.default_rng(0), 0.0)
    one, again = cart.readings([(0, {}), (number, {})])
    assert again == pytest.approx(one, abs=1e-12)


def test_a_repeated_record_can_be_repeated(cart):
    fast = cart.repeat(0, 2.0, 2.0, 1.0, np.random.default_rng(0), 0.0)
    again = cart.repeat(fast, 0.5, 0.5, 1.0, np.random.default_rng(0), 0.0)
    t = np.linspace(0.0, cart.duration, 50)
    assert cart.command(again, t) == pytest.approx(cart.command(0, t), abs=1e-12)


def test_the_menu_is_that_of_the_diagnosis():
    source = (trial.Path(__file__).parents[2] / "identify/src/diagnose/next.rs").read_text(encoding="utf-8")
    entries = re.findall(r"AGAIN,\n|Change \{(.*?)\},\n", source.split("const CHANGES")[1].split("];")[0])
    factor = lambda entry, name: float((re.search(rf"{name}: (-?[0-9.]+)", entry) or [0, 1.0])[1])
    assert tuple(tuple(factor(entry, name) for name in ("commands", "pace", "start")) for entry in entries) == trial.MENU


def test_the_first_proposal_is_taken():
    first = {"record": "run3.csv", "commands": 2.0, "pace": 1.0, "start": -1.0}
    assert trial.proposed({"next": [first, {}]}) == (2, (2.0, 1.0, -1.0)) and trial.proposed({"next": []}) is None


def test_trials_are_counted():
    rows = [
        {"chance": [0.9], "proposed": ["right"], "by_lot": ["honest", "right"]},
        {"chance": [0.1], "proposed": ["honest", "honest", "wrong"], "by_lot": []},
    ]
    found = trial.summary(rows)
    assert found["cases"] == 2 and found["offered"] == 1
    assert found["proposed"] == {"right": 1, "wrong": 1, "experiments": 4, "right_after_one": 1}
    assert found["by_lot"] == {"right": 1, "wrong": 0, "experiments": 2, "right_after_one": 0}


def test_ambiguous_effects_of_chains_are_gone_on_with(tmp_path):
    (tmp_path / "answers").mkdir()
    causes = {"seed": 0, "index": 0, "system": "cart", "kind": "effect", "lam": 1e3, "hidden": [{"name": "armature", "object": "rail", "truth": {}}]}
    answer = {"verdict": "ambiguous", "causes": [], "alternatives": [["armature", "payload"]], "alternative_objects": [["rail", "cart"]]}
    for name, case in (("a", causes), ("b", causes | {"system": "toss"}), ("c", causes | {"kind": "null"})):
        (tmp_path / f"{name}.truth.json").write_text(json.dumps(case))
        (tmp_path / "answers" / f"{name}.json").write_text(json.dumps({"report": answer}))
    assert trial.cases(tmp_path) == ["a"] and score.outcome(causes, answer) == "honest"
    assert draw.SYSTEMS.keys() >= set(chains.SYSTEMS)
