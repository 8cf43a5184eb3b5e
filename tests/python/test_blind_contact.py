"""A ball that slides on a floor, its motion in closed form: what the floor hides must be found, as far as encoders can tell."""

import pliant
import pytest

from validation.blind import slider

pytestmark = pytest.mark.long


def test_a_wrong_friction_of_the_floor_is_found_beside_its_twin(tmp_path):
    """Friction 0.3 on the floor, or 0.2 and an encoder that counts half as much again: x is the same in flight, impact and sliding."""
    report = pliant.diagnose(str(slider.write(tmp_path / "case", seed=1, friction=0.3)))
    assert report["verdict"] == "ambiguous", report["reason"]
    names = [name for group in report["alternatives"] for name in group]
    objects = [at for group in report["alternative_objects"] for at in group]
    assert {("contact_friction", "floor"), ("encoder_scale", "x")} <= set(zip(names, objects, strict=True))
