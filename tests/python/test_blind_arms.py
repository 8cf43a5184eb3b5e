"""Logs of an arm made by MuJoCo: what is hidden must be found, and nothing where nothing is hidden."""

from pathlib import Path

import pliant
import pytest

from validation.blind import arms

pytestmark = pytest.mark.long


def diagnose(name: str, folder: Path) -> dict:
    """pliant's answer to the scene and logs of an effect."""
    return pliant.diagnose(str(arms.write(arms.EFFECTS[name], folder / name, seed=0)))


@pytest.mark.parametrize("name", ["viscous_friction", "coulomb_friction"])
def test_friction_at_a_joint_is_named(name, tmp_path):
    report = diagnose(name, tmp_path)
    effect = arms.EFFECTS[name]
    assert report["verdict"] == "named", report["reason"]
    # the scene's own step may be a cause too: the arm goes over the top
    causes = [cause for cause in report["causes"] if cause["name"] != "discretisation"]
    assert [(cause["name"], cause["object"]) for cause in causes] == [(name, effect.object)]
    (size,) = effect.joint[effect.object].values()
    assert causes[0]["parameters"][0]["estimate"] == pytest.approx(size, rel=0.03)
    whole = report["gain"][-1]
    assert whole["unit"] == "rad" and whole["rmse_after"] < 0.1 * whole["rmse_before"]


def test_nothing_is_claimed_where_nothing_is_hidden(tmp_path):
    report = diagnose("null", tmp_path)
    assert report["verdict"] == "adequate", report["reason"]
    assert report["causes"] == [] and report["alternatives"] == []


def test_a_motor_that_saturates_is_named(tmp_path):
    report = diagnose("saturation", tmp_path)
    assert report["verdict"] == "named", report["reason"]
    causes = [cause for cause in report["causes"] if cause["name"] != "discretisation"]
    assert [(cause["name"], cause["object"]) for cause in causes] == [("saturation", "motor_shoulder")]
    assert causes[0]["parameters"][0]["estimate"] == pytest.approx(1.0, rel=0.01)


def test_an_encoders_zero_is_not_told_from_its_twin(tmp_path):
    """A last joint that is read turned is a last link whose centre of mass is turned: no log of these sensors can tell."""
    report = diagnose("encoder_bias", tmp_path)
    assert report["verdict"] == "ambiguous", report["reason"]
    (alternatives,), (objects,) = report["alternatives"], report["alternative_objects"]
    assert set(zip(alternatives, objects, strict=True)) == {("encoder_bias", "elbow"), ("center_of_mass", "lower")}
    assert report["causes"] == []


def test_a_late_motor_is_told_from_late_encoders(tmp_path):
    report = diagnose("actuator_delay", tmp_path)
    assert report["verdict"] == "named", report["reason"]
    causes = [cause for cause in report["causes"] if cause["name"] != "discretisation"]
    assert [(cause["name"], cause["object"]) for cause in causes] == [("actuator_delay", "motor_elbow")]
    assert causes[0]["parameters"][0]["estimate"] == pytest.approx(0.006, rel=0.01)
