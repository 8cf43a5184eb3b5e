"""Logs of a cable of capsules made by MuJoCo: what is hidden must be found, and nothing where nothing is hidden.

Three records in place of the six of `python -m validation.blind.run --cables`, so that it takes a minute.
"""

from pathlib import Path

import pliant
import pytest

from validation.blind import cable_logs

pytestmark = pytest.mark.long


def diagnose(name: str, folder: Path) -> dict:
    """pliant's answer to the scene and logs of an effect."""
    scene = cable_logs.write(cable_logs.EFFECTS[name], folder, [0], split=(2, 3))
    return pliant.diagnose(str(scene))


def test_a_stiffer_joint_is_named(tmp_path):
    report = diagnose("joint_stiffness", tmp_path)
    assert report["verdict"] == "named", report["reason"]
    assert [(c["name"], c["object"]) for c in report["causes"]] == [("joint_stiffness", "joint_2")]
    true = cable_logs.EFFECTS["joint_stiffness"].joint["joint_2"]["stiffness"]
    assert report["causes"][0]["parameters"][0]["estimate"] == pytest.approx(true, rel=0.03)
    whole = report["gain"][-1]
    assert whole["unit"] == "m" and whole["rmse_after"] < 0.6 * whole["rmse_before"]


def test_nothing_is_claimed_where_nothing_is_hidden(tmp_path):
    report = diagnose("null", tmp_path)
    assert report["verdict"] == "adequate", report["reason"]
    assert report["causes"] == [] and report["alternatives"] == []
