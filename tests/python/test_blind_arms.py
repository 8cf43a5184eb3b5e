"""An arm of MuJoCo with a late motor, diagnosed anew: the other effects of arms are records (test_diagnoses.py)."""

import pliant
import pytest

from validation.blind import arms

pytestmark = pytest.mark.long


def test_a_late_motor_is_told_from_late_encoders(tmp_path):
    report = pliant.diagnose(str(arms.write(arms.EFFECTS["actuator_delay"], tmp_path / "case", seed=0)))
    assert report["verdict"] == "named", report["reason"]
    causes = report["causes"]
    assert [(cause["name"], cause["object"]) for cause in causes] == [("actuator_delay", "motor_elbow")]
    assert causes[0]["parameters"][0]["estimate"] == pytest.approx(0.006, rel=0.01)
