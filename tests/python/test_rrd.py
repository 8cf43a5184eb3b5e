"""Recordings of Rerun: what is in them, and what is said where Rerun is not."""

import builtins
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
rrd = pytest.importorskip("pliant.rrd")

SCENES = Path(__file__).resolve().parents[1] / "scenes"


def rollout(name, steps=6):
    """The start of a shared scene's run."""
    model = pliant.load(SCENES / f"{name}.toml")
    return model, model.rollout(model.initial_state(), model.controls(steps), record=False)


def recorded(roll, path):
    """What a recording of the run holds: (entity, column) -> values in the order of time."""
    reading = pytest.importorskip("rerun.chunk", reason="no Rerun, or one that reads recordings otherwise")
    assert rrd.save(roll, path) is None
    out = {}
    for chunk in reading.RrdReader(path).stream():
        table = chunk.to_record_batch()
        for name in (name for name in table.schema.names if ":" in name or name == "time"):
            column = table.column(name)
            values = column.cast("int64") if name == "time" else column  # nanoseconds
            out.setdefault((str(chunk.entity_path), name), []).extend(values.to_pylist())
    return out


def test_rerun_that_is_missing_is_named_with_the_fix(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.split(".")[0] == "rerun":
            raise ImportError("No module named 'rerun'")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    _, roll = rollout("free_swing")
    with pytest.raises(ImportError, match=r"not installed; install it by `pip install rerun-sdk`, or write a page by `roll.view`"):
        rrd.save(roll, tmp_path / "swing.rrd")
    assert not list(tmp_path.iterdir())


def test_another_package_of_that_name_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", type(np)("rerun"))
    with pytest.raises(ImportError, match="another one than Rerun's; install that by `pip install rerun-sdk`"):
        rrd.save(rollout("free_swing")[1], tmp_path / "swing.rrd")


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(pliant.InputError, match=r"does not end in .rrd"):
        rrd.save(rollout("free_swing")[1], tmp_path / "swing.html")


def test_importing_pliant_does_not_import_rerun():
    program = "import sys, pliant, pliant.rrd; raise SystemExit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


@pytest.mark.parametrize("name", ["free_swing", "cloth_sphere", "four_bar", "arm_pushes", "rope_on_box", "grasp_rope", "capsule_drape"])
def test_recordings_of_all_kinds_are_written(tmp_path, name):
    pytest.importorskip("rerun", reason="Rerun is not installed")
    _, roll = rollout(name)
    assert rrd.save(roll, tmp_path / "run.rrd") is None
    assert [path.name for path in tmp_path.iterdir()] == ["run.rrd"]
    assert (tmp_path / "run.rrd").read_bytes()[:3] == b"RRF"


def test_what_is_recorded_is_the_run(tmp_path):
    model, roll = rollout("free_swing")
    found = recorded(roll, tmp_path / "swing.rrd")
    (middle,) = found["/scene", "Transform3D:translation"]
    shown = np.array([row[0] for row in found["/scene/rope/cable", "LineStrips3D:strips"]]) + np.array(middle)
    expected = roll.x[:, : 3 * model.n_nodes].reshape(7, -1, 3)[:, model.ropes["cable"]]
    np.testing.assert_allclose(shown, expected, atol=1e-6)
    np.testing.assert_array_equal(found["/scene/rope/cable", "time"], np.arange(7) * round(1e9 * model.step_length))
    energy = np.ravel(found["/energy", "Scalars:scalars"])
    np.testing.assert_allclose(energy, roll.energy(), rtol=1e-6)


def test_a_bar_is_where_it_is(tmp_path):
    """Rerun's capsules begin at the centre of one cap, pliant's shapes at their middle."""
    _, roll = rollout("capsule_drape")
    found = recorded(roll, tmp_path / "drape.rrd")
    middle = np.array(found["/scene", "Transform3D:translation"][0]).ravel()
    bar = {key: np.array(found["/scene/fixed/bar", f"Capsules3D:{key}"][0][0]) for key in ("translations", "quaternions", "lengths")}
    x, y, z, w = bar["quaternions"]
    along = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    begin = middle + bar["translations"]
    ends = sorted([tuple(begin), tuple(begin + bar["lengths"] * along)])
    text = (SCENES / "capsule_drape.toml").read_text()
    (shape,) = tomllib.loads(text)["capsule"]
    np.testing.assert_allclose(ends, sorted([shape["a"], shape["b"]]), atol=1e-6)


def test_a_folder_that_is_not_there(tmp_path):
    pytest.importorskip("rerun", reason="Rerun is not installed")
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        rrd.save(rollout("free_swing")[1], tmp_path / "missing" / "swing.rrd")
