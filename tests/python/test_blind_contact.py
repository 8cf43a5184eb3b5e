"""A ball that slides on a floor, its motion in closed form: what the floor hides must be found, as far as encoders can tell.

The wrong friction of a floor is a record (test_diagnoses.py).
"""

import pliant
import pytest

from validation.blind import slider

pytestmark = pytest.mark.long


def causes(report: dict) -> list[tuple[str, str]]:
    """The causes named."""
    return [(c["name"], c["object"]) for c in report["causes"]]


def alternatives(report: dict) -> set[tuple[str, str]]:
    names = [name for group in report["alternatives"] for name in group]
    objects = [at for group in report["alternative_objects"] for at in group]
    return set(zip(names, objects, strict=True))


def test_friction_is_found_where_the_scene_has_none(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=2, friction=0.15, believed=0.0)))
    assert report["verdict"] in ("named", "ambiguous"), report["reason"]
    assert ("contact_friction", "floor") in {*causes(report), *alternatives(report)}
    assert set(causes(report)) <= {("contact_friction", "floor")}


def test_a_higher_floor_is_not_told_from_an_encoders_zero(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=3, height=0.004)))
    assert report["verdict"] == "ambiguous", report["reason"]
    assert {("ground_height", "floor"), ("encoder_bias", "z")} <= alternatives(report)


def test_no_effect_is_claimed_where_none_is_hidden(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=4)))
    assert causes(report) == [] and report["alternatives"] == [], report["reason"]
    assert not report["remainder"]["significant"] and report["remainder"]["rmse"] < 1.1 * slider.SIGMA
