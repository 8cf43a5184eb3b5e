"""A ball that slides on a floor, its motion in closed form: what the floor hides must be found, as far as encoders can tell."""

import pliant
import pytest

from validation.blind import slider


def test_a_wrong_friction_of_the_floor_is_named(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=1, friction=0.3)))
    assert report["verdict"] == "named", report["reason"]
    assert [(c["name"], c["object"]) for c in report["causes"]] == [("contact_friction", "floor")]
    assert report["causes"][0]["parameters"][0]["estimate"] == pytest.approx(0.3, rel=0.03)


def test_a_floor_without_friction_in_the_scene_is_found_out(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=2, friction=0.15, believed=0.0)))
    assert report["verdict"] == "named", report["reason"]
    assert [(c["name"], c["object"]) for c in report["causes"]] == [("contact_friction", "floor")]


def test_a_higher_floor_is_not_told_from_an_encoders_zero(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=3, height=0.004)))
    assert report["verdict"] == "ambiguous", report["reason"]
    titles = {name for group in report["alternatives"] for name in group}
    assert {"ground_height", "encoder_bias"} <= titles


def test_nothing_is_claimed_where_nothing_is_hidden(tmp_path):
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=4)))
    assert report["verdict"] == "adequate", report["reason"]
    assert report["causes"] == [] and report["alternatives"] == []
