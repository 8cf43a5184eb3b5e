"""The benchmark's JSON: one entry per work and peer, ratios as documented, all by implicit Euler."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
pytest.importorskip("mujoco", minversion="4.0")
pytest.importorskip("pliant")
from validation.bench import scenes


def test_entries_compare_pliant_with_its_peers():
    sizes = ["--sizes", "6", "--growth", "6"]
    command = [sys.executable, "-m", "validation.bench", "--json", "--rounds", "1", "--repeats", "5"]
    run = subprocess.run([*command, *sizes], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    rows = json.loads(run.stdout)
    assert {"rope_step", "rope_step_contact", "rope_jacobian"} <= {row["work"] for row in rows}
    for row in rows:
        assert row["size"] > 0 and row["pliant_s"] > 0
        if row["peer"] is None:
            assert row["peer_s"] is None and row["ratio"] is None
        else:
            assert row["ratio"] == pytest.approx(row["pliant_s"] / row["peer_s"])
            least = row["pliant_min_s"] / row["peer_min_s"]
            assert row["ratio_min"] == pytest.approx(least)


def test_the_folder_runs_from_anywhere(tmp_path):
    command = [sys.executable, str(ROOT / "validation" / "bench"), "--help"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0 and "--json" in run.stdout, run.stderr


@pytest.mark.parametrize("kind", scenes.VELOCITY)
def test_every_scene_is_stepped_by_euler(kind):
    assert 'integrator = "euler"' in scenes.scene_text(6, kind)
