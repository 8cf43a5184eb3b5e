"""The batch of measured sets: what is written, and what of an answer is kept."""

import tomllib
from pathlib import Path

import pytest

from validation.real import arms, batch, cubes, deform_dlo

DATA = deform_dlo.data_folder()
needs_data = pytest.mark.skipif(DATA is None, reason="the real measurements are absent (PLIANT_DATA)")


def roles(path):
    return {(r["file"].rpartition("/")[2], r.get("array")): r["role"] for r in tomllib.loads(path.read_text(encoding="utf-8"))["experiment"]["record"]}


@needs_data
def test_training_and_evaluation_records_change_places(tmp_path):
    given, swapped = roles(batch.cable(1, tmp_path)), roles(batch.cable(1, tmp_path, "train"))
    assert set(given.values()) == {"fit", "held_out"}
    assert swapped == {key: {"fit": "held_out", "held_out": "fit"}[role] for key, role in given.items()}


@needs_data
def test_other_recordings_are_held_out(tmp_path):
    held_out = {name for (name, _), role in roles(arms.double_pendulum(DATA, tmp_path, held_out=(0, 3))).items() if role == "held_out"}
    assert held_out == {"run0.csv", "run3.csv"}


@needs_data
def test_halves_of_the_tosses_share_none(tmp_path):
    halves = [{name for name, _ in roles(cubes.write(DATA, tmp_path / str(half), half=half))} for half in (0, 1)]
    assert len(halves[0]) == len(halves[1]) == cubes.TOSSES // 2
    assert not halves[0] & halves[1]


def test_a_row_keeps_the_longest_horizon():
    gain = lambda h, after: {
        "horizon_s": h, "unit": "rad", "rmse_before": 1.0, "rmse_after": after, "mean_abs": [1.0, after], "interval": None, "explained_fraction": 0.5,
    }  # fmt: skip
    cause = {"name": "payload", "object": "link", "parameters": [{"path": "link.mass", "unit": "kg", "estimate": 1.0, "interval": [0.9, 1.1], "scene_value": 0.5}]}
    report = {
        "verdict": "named", "reason": "a push 1.66 s into /data/cable/run.npz/train[15]", "causes": [cause], "extension": [], "alternatives": [], "alternative_objects": [],
        "gain": [gain(0.1, 0.9), gain(2.0, 0.2), gain(1.0, 0.4)], "remainder": {"over_scatter": 1.5},
    }  # fmt: skip
    row = batch.row("a set", report, 12.34, Path("/data"))
    assert row["reason"] == "a push 1.66 s into cable/run.npz/train[15]"
    assert row["held_out"]["rmse_after"] == 0.2
    assert row["causes"][0]["parameters"] == [{"path": "link.mass", "unit": "kg", "estimate": 1.0, "interval": [0.9, 1.1]}]
    assert (row["set"], row["over_scatter"], row["processor_seconds"]) == ("a set", 1.5, 12.3)
    assert batch.row("a set", report | {"gain": []}, 1.0, Path("/data"))["held_out"] is None
