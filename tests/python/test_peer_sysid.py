"""The peer's identification on a log of its own making: it must recover what it represents."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
pytest.importorskip("mujoco", minversion="4.0")
sysid = pytest.importorskip("mujoco.sysid")
if not hasattr(sysid, "optimize"):
    pytest.skip("mujoco[sysid] is not installed", allow_module_level=True)
from validation import peer_sysid

SCENE = """schema_version = 1
[time]
step = 0.02
[[rope]]
name = "cable"
nodes = 7
length = 0.5
linear_density = 0.05
stretch_stiffness = 1e3
bend_stiffness = 1e-3
radius = 0.003
[[gripper]]
name = "hand"
rope = "cable"
nodes = [0, 1]
mode = "prescribed"
[experiment]
time = { column = "t", unit = "s" }
[[experiment.marker]]
rope = "cable"
node = 6
columns = ["m_x", "m_y", "m_z"]
[[experiment.input]]
gripper = "hand"
columns = ["a_x", "a_y", "a_z", "b_x", "b_y", "b_z"]
[experiment.fit]
free = [
  { path = "cable.bend_stiffness", lower = 1e-4, upper = 1e-2 },
  { path = "cable.drag_linear", lower = 0.0, upper = 0.2 },
  { path = "cable.bend_damping", lower = 0.0, upper = 1.0 },
]
"""


def log(path, times, driven, markers):
    """Write the log's columns."""
    names = ["t", "a_x", "a_y", "a_z", "b_x", "b_y", "b_z", "m_x", "m_y", "m_z"]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(np.hstack([times[:, None], driven, markers]).tolist())


def test_recovers_stiffness_and_drag_and_refuses_bend_damping(tmp_path):
    """A hand shaken sideways for 1 s with EI 2e-3 and drag 0.03; start at EI 1e-3, no drag."""
    scene, run = tmp_path / "scene.toml", tmp_path / "run.csv"
    scene.write_text(SCENE, encoding="utf-8")
    times = np.arange(0, 1.01, 0.02)
    x = 0.05 * np.sin(2 * np.pi * 1.5 * times) ** 2
    zero = np.zeros_like(x)
    driven = np.stack([x, zero, zero, x, zero, zero - 0.5 / 6], axis=1)
    log(run, times, driven, np.zeros((len(times), 3)))
    experiment = peer_sysid.read(scene, run, substeps=2)
    truth = {"cable.bend_stiffness": 2e-3, "cable.drag_linear": 0.03}
    experiment.markers = peer_sysid.simulate(experiment, truth)
    verdict = peer_sysid.fit(experiment)
    fitted = {p["path"]: p["fitted"] for p in verdict["parameters"]}
    assert fitted["cable.bend_stiffness"] == pytest.approx(2e-3, rel=1e-2)
    assert fitted["cable.drag_linear"] == pytest.approx(0.03, rel=1e-2)
    assert verdict["refused"] == ["cable.bend_damping"]
    assert verdict["rms_fitted_m"] < 1e-2 * verdict["rms_start_m"]
    assert verdict["insights"][0]["title"] == "No Issues Detected"
