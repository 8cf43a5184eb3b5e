"""Arrays over time as tables (`pliant.logs`), names of columns, and the files and the command that they are written by."""

import csv
import re

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
for needed in ("h5py", "pyarrow", "mcap", "mcap_protobuf", "rosbags"):
    pytest.importorskip(needed)

import h5py
import pyarrow as pa
from log_files import (
    ARM,
    JOINTS,
    START,
    Q,
    T,
    check,
    joints,
    lerobot,
    ns,
    one,
    parquet,
    rows,
    run,
    said,
)
from pliant.logs import __main__ as command
from pliant.logs import names, read, write


def test_npz(tmp_path):
    np.savez(tmp_path / "run.npz", t_ms=1000 * T, qpos=Q, qvel=2 * Q, tau=Q[:, :1], eef_pos=Q, note="hello", images=np.zeros((21, 4, 4)))
    table = one(tmp_path / "run.npz", joints=JOINTS)
    check(table, {**joints("pos"), **joints("vel", 2 * Q), "tau": Q[:, 0], **{f"eef_pos_{k}": Q[:, k] for k in range(3)}})
    assert said(table, "t_ms -> time_s [ms], by its name")
    assert said(table, "note: left out, no numbers") and said(table, "images: left out, its shape is (21, 4, 4)")
    unnamed = one(tmp_path / "run.npz")
    np.testing.assert_array_equal(unnamed.columns["qpos_2"], Q[:, 2])
    assert said(unnamed, "qpos: 3 elements without names")


def test_integer_clocks_keep_their_nanoseconds(tmp_path):
    """As float64 the times since 1970 would be wrong by up to 128 ns."""
    counts = np.array([0, 10_000_001, 20_000_003])
    np.savez(tmp_path / "run.npz", timestamp=START + counts, q=Q[:3, 0])
    table = one(tmp_path / "run.npz")
    np.testing.assert_array_equal(table.columns["time_s"], counts / 1e9)
    assert said(table, "timestamp -> time_s [ns], by the distance of its samples")
    np.savez(tmp_path / "dates.npz", time=(START + counts).astype("datetime64[ns]"), q=Q[:3, 0])
    np.testing.assert_array_equal(one(tmp_path / "dates.npz").columns["time_s"], counts / 1e9)


def test_npy(tmp_path):
    np.save(tmp_path / "qpos.npy", Q)
    table = one(tmp_path / "qpos.npy", rate=100.0, joints=JOINTS)
    check(table, joints("pos"))
    fields = np.zeros(21, dtype=[("t", float), ("elbow", float)])
    fields["t"], fields["elbow"] = T, Q[:, 0]
    np.save(tmp_path / "fields.npy", fields)
    check(one(tmp_path / "fields.npy"), {"elbow": Q[:, 0]})


def test_hdf5_of_demonstrations(tmp_path):
    """robomimic: a numbered group per demonstration, in the order of the numbers; no time."""
    with h5py.File(tmp_path / "demos.hdf5", "w") as file:
        for k in (0, 2, 10):
            demo = file.create_group(f"data/demo_{k}")
            demo["actions"] = k + Q
            demo["obs/robot0_joint_pos"] = 2 * k + Q
            demo["obs/robot0_eef_pos"] = Q
            demo["obs/agentview_image"] = np.zeros((21, 4, 4, 3), dtype=np.uint8)
        file["mask/train"] = np.array([b"demo_0"])
    tables = read(tmp_path / "demos.hdf5", rate=100.0, joints=JOINTS)
    assert [table.name for table in tables] == ["demos_demo_0", "demos_demo_2", "demos_demo_10"]
    for k, table in zip((0, 2, 10), tables, strict=True):
        eef = {f"obs.robot0_eef_pos_{j}": Q[:, j] for j in range(3)}
        check(table, {**joints("cmd", k + Q), **eef, **joints("pos", 2 * k + Q)})
        assert said(table, "obs/agentview_image: left out")


def test_hdf5_of_one_episode(tmp_path):
    """ACT: a file per episode, arrays in groups."""
    with h5py.File(tmp_path / "episode_3.hdf5", "w") as file:
        file["observations/qpos"], file["observations/qvel"], file["action"] = Q, 2 * Q, 3 * Q
        file["observations/time"] = T
        file["compress_len"] = np.zeros((2, 7))
        file.attrs["sim"] = True
    table = one(tmp_path / "episode_3.hdf5", joints=JOINTS)
    check(table, {**joints("cmd", 3 * Q), **joints("pos"), **joints("vel", 2 * Q)})
    assert said(table, "compress_len: left out, 2 rows where the time has 21")


def test_parquet(tmp_path):
    nulls = [None if k == 4 else float(k) for k in range(21)]
    when = pa.array([ns(t) for t in T], type=pa.timestamp("ns"))
    columns = {"stamp": when, "qpos": rows(Q), "gap": nulls, "on": [True] * 21, "text": ["a"] * 21}
    columns["wrench"] = pa.array([{"force": {"z": t}, "frame": "hand"} for t in T])
    table = one(parquet(tmp_path / "run.parquet", columns), joints=JOINTS)
    gap = np.array([np.nan if k == 4 else float(k) for k in range(21)])
    check(table, {**joints("pos"), "gap": gap, "on": np.ones(21), "wrench.force.z": T})
    assert said(table, "text: left out, no numbers") and said(table, "stamp -> time_s [ns], by its type")


def test_lerobot(tmp_path):
    """Times are in seconds, even of one frame per second, which would else be taken for milliseconds."""
    tables = read(lerobot(tmp_path / "so101"))
    assert [table.name for table in tables] == [f"so101_episode_{k:06d}" for k in range(3)]
    for k, table in enumerate(tables):
        frame = np.arange(5.0)
        state = {"shoulder_pan": np.full(5, float(k)), "elbow_flex": frame, "gripper": 10.0 * k + frame}
        expected = {f"{joint}_pos": values for joint, values in state.items()}
        expected |= {f"{joint}_cmd": -values for joint, values in state.items()}
        check(table, {**expected, "next.done": frame == 4}, frame)


def test_a_data_sets_names_without_quantities(tmp_path):
    (first, *_) = read(lerobot(tmp_path / "set", names=("left_waist", "x.vel", "left_gripper")))
    assert list(first.columns) == [
        "time_s",
        "left_waist_pos",
        "x_vel",
        "left_gripper_pos",
        "left_waist_cmd",
        "x_vel_cmd",
        "left_gripper_cmd",
        "next.done",
    ]


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("qpos", ("pos", False)),
        ("observations.qvel", ("vel", False)),
        ("robot0_joint_pos", ("pos", False)),
        ("observation.state", ("pos", False)),
        ("action", ("pos", True)),
        ("effort_controller_commands", ("effort", True)),
        ("forward_position_controller_commands", ("pos", True)),
        ("eef_pos", None),
        ("gripper_qpos", None),
        ("states", None),
        ("current", None),
        ("pos_vel", None),
    ],
)
def test_quantities(name, found):
    assert names.quantity(name) == found


def test_clocks_are_those_of_pliant_init():
    assert all(map(names.is_clock, ["t", "time_ms", "Timestamp [ns]", "stamp", "force_t"]))
    assert not any(map(names.is_clock, ["time_of_flight", "elbow_s", "s", "clock"]))


def test_files_are_read_back_bit_by_bit(tmp_path):
    values = np.array([0.1, 1 / 3, np.nan, -1e-300])
    table = pliant.logs.Table("run", {"time_s": np.arange(4) / 3, "a,b": values})
    (path,) = write([table], tmp_path / "new" / "folder")
    with path.open(newline="", encoding="utf-8") as file:
        head, *body = csv.reader(file)
    assert head == ["time_s", "a,b"] and body[2][1] == ""
    back = np.array([[float(cell or "nan") for cell in row] for row in body])
    np.testing.assert_array_equal(back, np.column_stack(list(table.columns.values())))


def test_nothing_is_half_written(tmp_path, monkeypatch):
    first, second = (pliant.logs.Table(name, {"time_s": T, "q": T}) for name in ("a", "b"))
    write([second], tmp_path)
    with pytest.raises(pliant.InputError, match=r"b\.csv: is there already(.|\n)*--force"):
        write([first, second], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["b.csv"]
    with pytest.raises(pliant.InputError, match="would be written twice"):
        write([first, first], tmp_path)
    with pytest.raises(pliant.InputError, match=r"b\.csv: is no folder"):
        write([first], tmp_path / "b.csv")
    broken = pliant.logs.Table("c", {"time_s": T, "q": T[:3]})
    with pytest.raises(ValueError):
        write([first, broken], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["b.csv"]
    write([first, pliant.logs.Table("b", {"time_s": T, "q": 2 * T})], tmp_path, force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]
    assert (tmp_path / "b.csv").read_text(encoding="utf-8").splitlines()[2] == "0.01,0.02"


def test_the_command(tmp_path):
    np.savez(tmp_path / "run.npz", qpos=Q[:, :2])
    code, out, err = run(tmp_path / "run.npz", "--rate", 100, "--names", ARM / "arm.urdf", "--degrees", "--out", tmp_path / "csv")
    assert (code, err) == (0, "")
    assert out.splitlines()[0].endswith("run.npz: time_s: 21 rows at 100 Hz, as given")
    assert out.splitlines()[-1] == f"wrote {tmp_path / 'csv' / 'run.csv'}: 21 rows, 3 columns, 0.2 s at 100 Hz"
    assert (tmp_path / "csv" / "run.csv").read_text(encoding="utf-8").startswith("time_s,shoulder_pos_deg,elbow_pos_deg\n0.0,0.0,0.5\n")
    code, out, err = run(tmp_path / "gone.mcap", "--out", tmp_path / "other")
    assert code == 2 and out == "" and "Traceback" not in err and not (tmp_path / "other").exists()
    assert re.fullmatch(r"error: .*gone\.mcap: is not there\n  likely cause: .*\n  fix: .*\n", err)


def test_names_from_files(tmp_path):
    (tmp_path / "names.txt").write_text("# joints\na\n\nb\n", encoding="utf-8")
    assert command.joint_names(tmp_path / "names.txt") == ["a", "b"]
    urdf = '<robot><joint name="a" type="revolute"/><joint name="b" type="fixed"/><joint name="c" type="prismatic"/></robot>'
    (tmp_path / "arm.urdf").write_text(urdf, encoding="utf-8")
    assert command.joint_names(tmp_path / "arm.urdf") == ["a", "c"]
    (tmp_path / "broken.urdf").write_text("<robot>", encoding="utf-8")
    with pytest.raises(pliant.InputError, match="--names"):
        command.joint_names(tmp_path / "broken.urdf")
