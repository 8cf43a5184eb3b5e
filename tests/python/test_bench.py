"""The benchmark's JSON: one entry per work and peer, ratios as documented, all by implicit Euler."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
mujoco = pytest.importorskip("mujoco", minversion="4.0")
pliant = pytest.importorskip("pliant")
from validation.bench import bodies, page, rods_cloth, scenes, touching
from validation.bench.peers import MujocoSheet
from validation.bodies import chains


def test_entries_compare_pliant_with_its_peers():
    sizes = ["--sizes", "6", "--growth", "6", "--chains", "2", "7", "--touching", "arm_box"]
    command = [sys.executable, "-m", "validation.bench", "--json", "--rounds", "1", "--repeats", "5"]
    run = subprocess.run([*command, *sizes], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    rows = json.loads(run.stdout)
    assert {"rope_step", "rope_step_contact", "rope_jacobian"} <= {row["work"] for row in rows}
    expected = {
        "bodies_step": ["mj_step"],
        "bodies_jacobian": ["forward", "centred"],
        "bodies_rollout_vjp": ["in 10 parameters", "in 100 parameters", "pliant, forward rollout"],
    }
    for work, peers in expected.items():
        found = [row["peer"] for row in rows if row["work"] == work and row["size"] == 7]
        assert len(found) == len(peers) and all(x.endswith(y) for x, y in zip(found, peers, strict=True)), found
    assert {row["work"] for row in rows if row["size"] == 8} == {"arm_box_step", "arm_box_jacobian", "arm_box_rollout_vjp"}
    # two links have fewer than a hundred parameters
    assert not any("100 parameters" in row["peer"] for row in rows if row["work"] == "bodies_rollout_vjp" and row["size"] == 2)
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


def test_both_programs_push_the_same_box():
    """MuJoCo's soft contact lets the box go a little later and slower: 2.6 mm of 200 mm."""
    ours = pliant.loads(touching.scene_text("arm_box"))
    x = ours.rollout(ours.initial_state(), ours.controls(bodies.STEPS), record=False).x[-1]
    peer = touching.MujocoTouching("arm_box")
    peer.rollout()
    assert x[:3] == pytest.approx(peer.data.qpos[:3], abs=5e-3)
    assert x[2] > 0.25 and x[4] == pytest.approx(0.05, abs=1e-6)


def test_both_programs_simulate_the_same_chain():
    """Both are of first order: at the benchmark's step they stay near each other, and nearer at a finer one."""
    gaps = []
    for step in (bodies.STEP, bodies.STEP / 8):
        chain, seconds = bodies.chain(2), 0.2
        text = chains.scene(chain, integrator="euler", step=step, duration=seconds)
        ours = pliant.loads(text)
        x = ours.rollout(ours.initial_state(), ours.controls(), record=False).x[-1]
        model = mujoco.MjModel.from_xml_string(chains.mjcf(chain, integrator="implicitfast", step=step))
        data = mujoco.MjData(model)
        data.qpos[:] = chains.start(chain)
        mujoco.mj_step(model, data, len(ours.controls()))
        assert (model.nu, ours.nu) == (2, 2)
        gaps.append(np.abs(x[:2] - data.qpos).max())
    assert gaps[0] < 0.1 and gaps[1] < gaps[0] / 5, gaps


@pytest.mark.parametrize("kind", scenes.VELOCITY)
def test_every_scene_is_stepped_by_euler(kind):
    assert 'integrator = "euler"' in scenes.scene_text(6, kind)


def test_rods_and_cloth_are_compared():
    command = [sys.executable, "-m", "validation.bench.rods_cloth", "--quick", "--json"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    works = {f"{what}{kind}_{work}" for what in ("rod", "cloth") for kind in ("", "_contact") for work in rods_cloth.WORKS}
    assert {row["work"] for row in found["compared"]} == works
    assert all(row["ratio"] == pytest.approx(row["pliant_s"] / row["peer_s"]) for row in found["compared"])
    assert [row["nodes"] for row in found["growth"]] == [10, 20, 16, 36]
    assert len(found["batch"]) == 2
    assert len(found["memory"]) == 4
    # records cost memory, and what checkpoints keep, states alone, costs less
    kept = {row["work"]: row["bytes_per_step"] for row in found["memory"]}
    assert kept["cloth_record"] > max(0.0, kept["cloth_checkpoints"]), kept
    text = page.page([found["compared"][0] | {key: found[key] for key in ("machine", "command")}], found)
    of_step = next(line for line in text.splitlines() if line.startswith("| cloth_step | 4 |"))
    assert of_step.endswith("| 15.1 ms |"), of_step
    assert "| rod_step | 20 |" in text and "validation.bench.rods_cloth --quick --json" in text


@pytest.mark.parametrize("nodes", (20, 3000, 10_000))
def test_ropes_of_every_size_are_accepted(nodes):
    assert pliant.loads(rods_cloth.rod_text(nodes, "hang", 2)).n_nodes == nodes


def test_stepping_is_measured_in_every_scene():
    command = [sys.executable, "-m", "validation.bench.stepping", "--rounds", "1", "--json"]
    out = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=True)
    found = json.loads(out.stdout)
    assert [row["scene"] for row in found["rows"]] == ["rope", "rope_contact", "chain", "arm_box"]
    for row in found["rows"]:
        assert all(value > 0 for key, value in row.items() if key != "scene"), row
    assert found["machine"]["cores"] >= 1


def test_every_node_of_the_benchmarks_sheet_touches_the_floor_in_both():
    peer = MujocoSheet(rods_cloth.sheet(5, "rest"), "rest")
    peer.contacts()  # runs it
    assert peer.thing.data.ncon >= 25
    ours = pliant.loads(rods_cloth.cloth_text(5, "rest"))
    x = ours.rollout(ours.initial_state(), ours.controls(), record=False).x[-1]
    assert np.abs(x[2 : 3 * 25 : 3] - 5e-4).max() < 1e-7
