"""Diagnoses of measured arms, an oscillator and a thrown cube, on excerpts; skipped where the measurements are absent."""

from pathlib import Path

import pliant
import pytest

from validation.real import arms, cubes, torques
from validation.real.deform_dlo import data_folder

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def data() -> Path:
    folder = data_folder()
    if folder is None:
        pytest.skip("the real measurements are absent: set PLIANT_DATA to their folder")
    return folder


DRY = [
    '{ path = "shoulder.friction", lower = 0.0, upper = 1.0 }, { path = "elbow.friction", lower = 0.0, upper = 1.0 }, ',
]


def named(report: dict) -> list[str]:
    return [cause["name"] for cause in report["causes"]]


def size(report: dict, path: str) -> float:
    """Estimate of an accepted cause's parameter."""
    (found,) = [p["estimate"] for cause in report["causes"] for p in cause["parameters"] if p["path"] == path]
    return found


def test_the_silverbox_has_a_cubic_spring(data, tmp_path):
    which = ((41_000, 300, "fit"), (52_000, 300, "fit"), (120_000, 500, "held_out"))
    report = pliant.diagnose(str(arms.silverbox(data, tmp_path, which)))
    assert report["verdict"] == "named", report["reason"]
    # a scale of the encoder is an exact symmetry beside a free gain and must not be called a second cause
    assert [name for name in named(report) if name != "discretisation"] == ["cubic_stiffness"]
    (cubic,) = [p for p in report["causes"][0]["parameters"] if p["path"] == "spring.cubic_stiffness"]
    low, high = cubic["interval"]
    # all the data give 7.33e5 N/m³; these are 600 samples
    assert low < cubic["estimate"] < high and high - low < 0.05 * cubic["estimate"], cubic
    assert cubic["estimate"] == pytest.approx(7.33e5, rel=0.02)
    whole = report["gain"][-1]
    assert whole["rmse_after"] < 0.4 * whole["rmse_before"]


def test_gain_and_friction_are_not_told_apart_where_the_torque_follows_the_velocity(data, tmp_path):
    report = pliant.diagnose(str(arms.simple_pendulum(data, tmp_path)))
    assert report["verdict"] == "ambiguous", report["reason"]
    (together,) = report["alternatives"]
    # the mass is the gain's exact twin
    assert {"torque_gain", "payload"} <= set(together)
    assert report["causes"] == []


def test_dry_friction_of_the_double_pendulum(data, tmp_path):
    scene = arms.double_pendulum(data, tmp_path)
    model, errors, levers = pliant.load(scene), [], []
    text = scene.read_text(encoding="utf-8")
    for friction in ("", *DRY):
        scene.write_text(text.replace("free = [", f"free = [{friction}"), encoding="utf-8")
        fitted = pliant.fit(str(scene))
        torque, lever = torques.of_scene(model, {p["path"]: p["estimate"] for p in fitted["parameters"]})
        # inverse dynamics on held-out recordings, which the fit never saw
        errors.append(torques.error(torque, data))
        levers.append(lever)
    assert errors[1] < 0.6 * errors[0], errors
    # the published parameter sets with friction have 0.158 and 0.160 kg·m
    assert levers[1] == pytest.approx(0.16, rel=0.08), levers


def test_a_thrown_cube_is_measured_in_wrong_lengths(data, tmp_path):
    report = pliant.diagnose(str(cubes.write(data, tmp_path, count=24)))
    # what remains (the tosses differ by more than their noise) may forbid the name; it must not bring another one
    assert [stage["name"] for stage in report["stages"]] == ["baseline", "length_scale"], report["reason"]
    assert report["verdict"] == "named" or "length_scale fits best" in report["reason"]
    (scale,) = [p["estimate"] for p in report["stages"][1]["parameters"] if p["path"] == "sensor.scale"]
    # the data's README: free fall reads 0.980 g, the cube at rest stands 0.9779 half widths high
    assert scale == pytest.approx(0.979, abs=0.002)
    assert all(horizon["interval"][0] > 0 for horizon in report["gain"])
    score = {c["name"]: c["statistic"] for c in report["candidates"] if c["object"] is None}
    assert score["length_scale"] > max(
        score[rival] for rival in ("gravity_magnitude", "sensor_bias", "frame_rotation", "time_offset")
    )


def test_free_fall_alone_does_not_tell_length_from_gravity(data, tmp_path):
    report = pliant.diagnose(str(cubes.write(data, tmp_path, flight_only=True, count=24)))
    assert report["verdict"] == "ambiguous", report["reason"]
    assert set(report["alternatives"][0]) == {"length_scale", "gravity_magnitude"}
