"""Logs of a rod that twists made by the independent JAX reference: what is hidden must be found, and nothing where nothing is hidden."""

from pathlib import Path

import numpy as np
import pliant
import pytest

pytest.importorskip("optimistix")
from validation.blind import rods

pytestmark = pytest.mark.long


def diagnose(name: str, folder: Path) -> dict:
    """pliant's answer to the scene and logs of an effect."""
    return pliant.diagnose(str(rods.write(rods.EFFECTS[name], folder, [0])))


def test_friction_inside_a_rod_is_named_with_its_size(tmp_path):
    report = diagnose("bend_friction", tmp_path)
    assert report["verdict"] == "named", report["reason"]
    assert [cause["name"] for cause in report["causes"]] == ["bend_friction"]
    found = {p["path"]: p["estimate"] for p in report["causes"][0]["parameters"]}
    for path, value in rods.EFFECTS["bend_friction"].items():
        assert found[path] == pytest.approx(value, rel=0.05)
    whole = report["gain"][-1]
    assert whole["rmse_after"] < 0.6 * whole["rmse_before"], whole


def test_nothing_is_claimed_where_nothing_is_hidden(tmp_path):
    report = diagnose("null", tmp_path)
    assert report["verdict"] == "adequate", report["reason"]
    assert report["causes"] == [] and report["alternatives"] == []


def test_the_true_rod_begins_at_rest_and_ends_elsewhere():
    x = rods.motion({}, 0)
    assert np.abs(x[1] - x[0]).max() < 1e-3
    assert np.abs(x[-1] - x[0]).max() > 0.02
    held = [node for nodes in rods.HELD.values() for node in nodes]
    told = rods.commands(0, np.arange(rods.SAMPLES + 1) / rods.RATE).reshape(-1, len(held), 3)
    assert np.abs(x[:, held] - told).max() < 1e-12
