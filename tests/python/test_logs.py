"""Logs of other formats as tables (`pliant.logs`): each file is written here with the libraries that its users have, then read back."""

import csv
import json
import os
import re
import sqlite3
import subprocess
import sys
import tomllib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
for needed in ("h5py", "pyarrow", "mcap", "mcap_protobuf", "rosbags"):
    pytest.importorskip(needed)

import h5py
import pyarrow as pa
import pyarrow.parquet as pq
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from pliant.logs import __main__ as command
from pliant.logs import names, read, write
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "examples" / "arm_log"
ROS = get_typestore(Stores.ROS2_HUMBLE)
START = 1_700_000_000_123_456_789  # ns
T = np.arange(21) * 0.01
Q = np.column_stack([np.sin(T), 0.5 - T, T**2])
JOINTS = ["shoulder", "elbow", "wrist"]


def ns(seconds):
    """Times [s] since the start of a recording as nanoseconds."""
    return START + round(seconds * 1e9)


def mcap(path, messages, schemas=None, encoding="json", compression=CompressionType.ZSTD):
    """Writes messages (topic, time [ns], bytes); schemas: topic -> (name, encoding, bytes)."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start()
        channels = {}
        for topic, time, data in messages:
            if topic not in channels:
                schema = writer.register_schema(*schemas[topic]) if schemas else 0
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], log_time=time, data=data, publish_time=time)
        writer.finish()
    return path


def mcap_json(path, messages):
    """Writes messages (topic, time [s], dictionary) as JSON."""
    return mcap(path, [(topic, ns(time), json.dumps(message).encode()) for topic, time, message in messages])


def header(time, frame=""):
    """A ROS header whose stamp is a time [s]."""
    stamp = ROS.types["builtin_interfaces/msg/Time"](*divmod(ns(time), 10**9))
    return ROS.types["std_msgs/msg/Header"](stamp, frame)


def joint_state(time, q, dq=(), tau=(), joints=JOINTS, stamped=True):
    """A sensor_msgs/JointState."""
    kind = ROS.types["sensor_msgs/msg/JointState"]
    stamp = header(time) if stamped else ROS.types["std_msgs/msg/Header"](ROS.types["builtin_interfaces/msg/Time"](0, 0), "")
    return kind(stamp, list(joints), *(np.asarray(values, dtype=np.float64) for values in (q, dq, tau)))


def floats(values):
    """A std_msgs/Float64MultiArray."""
    layout = ROS.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    return ROS.types["std_msgs/msg/Float64MultiArray"](layout, np.asarray(values, dtype=np.float64))


def pose(time, position, quaternion):
    """A geometry_msgs/PoseStamped; the quaternion as x, y, z, w."""
    point, turn = ROS.types["geometry_msgs/msg/Point"](*position), ROS.types["geometry_msgs/msg/Quaternion"](*quaternion)
    return ROS.types["geometry_msgs/msg/PoseStamped"](header(time), ROS.types["geometry_msgs/msg/Pose"](point, turn))


def mcap_ros(path, messages):
    """Writes messages (topic, time of recording [s], message) in CDR."""
    schemas, coded = {}, []
    for topic, time, message in messages:
        kind = message.__msgtype__
        schemas[topic] = (kind, "ros2msg", ROS.generate_msgdef(kind, ros_version=2)[0].encode())
        coded.append((topic, ns(time), bytes(ROS.serialize_cdr(message, kind))))
    return mcap(path, coded, schemas, "cdr")


def bag2(path, messages, storage):
    """Writes a bag of ROS 2: a folder."""
    with rosbag2.Writer(path, version=9, storage_plugin=storage) as writer:
        channels = {}
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in channels:
                channels[topic] = writer.add_connection(topic, kind, typestore=ROS)
            writer.write(channels[topic], ns(time), ROS.serialize_cdr(message, kind))
    return path


def parquet(path, columns):
    """Writes a Parquet file from lists or Arrow arrays."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), path)
    return path


def rows(array):
    """An array (T, k) as an Arrow column of lists."""
    return pa.array(array.tolist(), type=pa.list_(pa.float64()))


def one(path, **options):
    """The only table of a log."""
    (table,) = read(path, **options)
    return table


def check(table, expected, time=T):
    """The table has exactly these columns and numbers; times to a nanosecond."""
    assert list(table.columns) == ["time_s", *expected]
    np.testing.assert_allclose(table.columns["time_s"], time, rtol=0, atol=1e-9)
    for name, values in expected.items():
        np.testing.assert_array_equal(table.columns[name], values, err_msg=name)


def joints(ending, values=Q):
    """Columns of the three joints."""
    return {f"{joint}_{ending}": values[:, k] for k, joint in enumerate(JOINTS)}


def said(table, text):
    """Whether a note has this text."""
    return any(text in note for note in table.notes)


# --- topics


def test_mcap_json(tmp_path):
    messages = [("/arm", t, {"name": JOINTS, "position": q.tolist(), "on": True, "mode": "run"}) for t, q in zip(T, Q, strict=True)]
    messages += [("/info", 0.05, {"text": "no numbers"})]
    table = one(mcap_json(tmp_path / "run.mcap", messages))
    assert table.name == "run"
    check(table, {**joints("pos"), "on": np.ones(21)})
    assert said(table, "/arm (shoulder, elbow, wrist) gives the rows: 21 at 100 Hz, by the time of recording")
    assert said(table, "/info: left out, no numbers")


def test_json_numbers_are_columns_by_their_path(tmp_path):
    messages = [
        ("/state", t, {"shoulder": {"pos": q[0], "vel": None}, "tau": q.tolist(), "points": [{"name": "a", "x": t}, {"x": 2}]})
        for t, q in zip(T, Q, strict=True)
    ]
    path = mcap_json(tmp_path / "run.mcap", messages)
    expected = {"shoulder.pos": Q[:, 0], **{f"tau_{k}": Q[:, k] for k in range(3)}, "points.a.x": T, "points_1.x": 2 * np.ones(21)}
    check(one(path), expected)
    named = one(path, joints=JOINTS)
    np.testing.assert_array_equal(named.columns["elbow_effort"], Q[:, 1])


def state_type():
    """A protobuf type with a stamp, names, numbers, and a part that may be missing; and its descriptors as MCAP has them."""
    file = descriptor_pb2.FileDescriptorProto(
        name="arm.proto", package="arm", syntax="proto3", dependency=["google/protobuf/timestamp.proto"]
    )
    wrench = file.message_type.add(name="Wrench")
    wrench.field.add(name="z", number=1, type=1, label=1)
    state = file.message_type.add(name="State")
    state.field.add(name="timestamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp")
    state.field.add(name="name", number=2, type=9, label=3)
    state.field.add(name="position", number=3, type=1, label=3)
    state.field.add(name="wrench", number=4, type=11, label=1, type_name=".arm.Wrench")
    state.field.add(name="count", number=5, type=3, label=1)
    state.field.add(name="image", number=6, type=12, label=1)
    stamps = descriptor_pb2.FileDescriptorProto()
    Timestamp.DESCRIPTOR.file.CopyToProto(stamps)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(stamps)
    pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("arm.State"))
    return kind, descriptor_pb2.FileDescriptorSet(file=[stamps, file]).SerializeToString()


def test_mcap_protobuf(tmp_path):
    kind, schema = state_type()
    messages = []
    for k, (t, q) in enumerate(zip(T, Q, strict=True)):
        state = kind(name=JOINTS, position=q, count=7 * k, image=b"pixels")
        state.timestamp.FromNanoseconds(ns(t))
        if k % 2:
            state.wrench.z = 3.0 * k
        messages.append(("/arm", ns(t) + 1_000_000 * (k % 3), state.SerializeToString()))
    table = one(mcap(tmp_path / "run.mcap", messages, {"/arm": ("arm.State", "protobuf", schema)}, "protobuf"))
    z = np.where(np.arange(21) % 2, 3.0 * np.arange(21), np.nan)
    check(table, {**joints("pos"), "count": 7.0 * np.arange(21), "wrench.z": z})
    assert said(table, "by header stamps")


def test_mcap_cdr(tmp_path):
    """Positions, velocities and efforts by header stamps, although they were recorded late and unevenly."""
    late = np.random.default_rng(0).uniform(0.0, 0.009, size=len(T))
    messages = [("/joint_states", t + d, joint_state(t, q, 2 * q, 3 * q)) for t, d, q in zip(T, late, Q, strict=True)]
    path = mcap_ros(tmp_path / "run.mcap", messages)
    expected = {**joints("pos"), **joints("vel", 2 * Q), **joints("effort", 3 * Q)}
    check(one(path), expected)
    by_log = one(path, log_time=True)
    np.testing.assert_allclose(by_log.columns["time_s"], T + late - late[0], rtol=0, atol=1e-9)
    assert said(by_log, "by the time of recording")
    in_degrees = one(path, degrees=True)
    assert list(in_degrees.columns)[1:] == [*joints("pos_deg"), *joints("vel_deg"), *joints("effort")]


def test_mcap_cdr_by_idl(tmp_path):
    """Types that are described in IDL, as rmw_fastrtps of some distributions writes them."""
    idl = "module arm {\n  module msg {\n    struct Force {\n      double value;\n    };\n  };\n};\n"
    text = f"{'=' * 80}\nIDL: arm/msg/Force\n{idl}"
    messages = [("/force", ns(t), bytes([0, 1, 0, 0]) + np.float64(q).tobytes()) for t, q in zip(T, Q[:, 0], strict=True)]
    path = mcap(tmp_path / "run.mcap", messages, {"/force": ("arm/msg/Force", "ros2idl", text.encode())}, "cdr")
    check(one(path), {"value": Q[:, 0]})


@pytest.mark.parametrize("storage", list(rosbag2.StoragePlugin), ids=lambda s: s.name.lower())
def test_bags_of_ros_2(tmp_path, storage):
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    bag = bag2(tmp_path / "bag", messages, storage)
    table = one(bag)
    check(table, joints("pos"))
    assert table.name == "bag"
    (inner,) = [path for path in bag.iterdir() if path.suffix in (".mcap", ".db3")]
    check(one(inner), joints("pos"))


def test_a_bag_that_does_not_describe_its_types(tmp_path):
    """As those in sqlite3 before ROS 2 Iron: the types of ROS itself are known, others are left out."""
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/own", t, floats([t])) for t in T]
    bag = bag2(tmp_path / "bag", messages, rosbag2.StoragePlugin.SQLITE3)
    (inner,) = bag.glob("*.db3")
    with closing(sqlite3.connect(inner)) as base, base:
        base.execute("DELETE FROM message_definitions")
        base.execute("UPDATE topics SET type = 'own/msg/Type' WHERE name = '/own'")
    table = one(inner)
    check(table, joints("pos"))
    assert said(table, "/own: left out from") and said(table, "own/msg/Type cannot be decoded")


def test_bags_of_ros_1(tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(tmp_path / "run.bag") as writer:
        channel = writer.add_connection("/force", "std_msgs/msg/Float64", typestore=store)
        for t, q in zip(T, Q[:, 0], strict=True):
            writer.write(channel, ns(t), store.serialize_ros1(store.types["std_msgs/msg/Float64"](q), "std_msgs/msg/Float64"))
    check(one(tmp_path / "run.bag"), {"force": Q[:, 0]})


def test_topics_are_brought_to_one_clock(tmp_path):
    """A measurement at half the rate is interpolated, but not over a gap; a row has the mean of the commands in force in its period."""
    half = np.delete(np.arange(11) * 0.02, [4, 5, 6])  # a gap of 0.08 s, four periods
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/ft", t, pose(t, (10 * t, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))) for t in half]
    messages += [("/effort_controller/commands", t, floats([t, 0.7, 3.0])) for t in (0.0, 0.055, 0.12)]
    path = mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1]))
    table = one(path, joints=JOINTS)
    x = np.where((T > 0.0601) & (T < 0.1399), np.nan, 10 * T)
    np.testing.assert_allclose(table.columns["ft_x"], x, atol=1e-12)
    # 0.055 is halfway between two rows, 0.12 in the middle of a row's period
    command = np.where(T < 0.055, 0.0, np.where(T < 0.1199, 0.055, np.where(T < 0.1201, (0.055 + 0.12) / 2, 0.12)))
    np.testing.assert_allclose(table.columns["shoulder_effort"], command, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(table.columns["elbow_effort"], 0.7)  # not a mean's 0.7000000000000001
    assert [c for c in table.columns if c.startswith("ft")] == ["ft_x", "ft_y", "ft_z", "ft_qx", "ft_qy", "ft_qz", "ft_qw"]
    assert said(table, "shoulder_effort_cmd -> shoulder_effort: no torque of this joint was measured")
    assert said(table, "/ft: 8 messages, interpolated, never over more than 3 periods of 0.02 s; 7 of 21 rows are empty")
    assert said(table, "/effort_controller/commands: by the time of recording, for it has no header stamps")
    # by another clock, positions are interpolated to its times
    other = one(path, clock="/ft")
    np.testing.assert_allclose(other.columns["time_s"], half, atol=1e-9)
    np.testing.assert_array_equal(other.columns["elbow_pos"], np.interp(half, T, Q[:, 1]))


def test_rows_without_joints_of_other_topics_are_cut(tmp_path):
    """pliant refuses inputs with empty cells: before the first command there is none."""
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/joint_commands", t, joint_state(t, q, stamped=False)) for t, q in zip(T[5:], Q[5:], strict=True)]
    command = (Q[4:20] + Q[5:]) / 2  # one comes with every row: half of its period the last one was in force
    command[0] = Q[5]
    table = one(mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])))
    for name, values in {**joints("pos", Q[5:]), **joints("cmd", command)}.items():
        np.testing.assert_allclose(table.columns[name], values, rtol=0, atol=1e-14, err_msg=name)
    np.testing.assert_allclose(table.columns["time_s"], T[:16], rtol=0, atol=1e-9)
    assert said(table, "5 rows at the start and 0 at the end are cut")


def test_joint_positions_are_the_rows_although_others_come_more_often(tmp_path):
    messages = [("/joint_states", t, joint_state(t, q, (), 4 * q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/force", t, ROS.types["std_msgs/msg/Float64"](t)) for t in np.arange(201) * 1e-3]
    image = ROS.types["sensor_msgs/msg/CompressedImage"]
    messages += [("/camera", t, image(header(t), "png", np.arange(9, dtype=np.uint8))) for t in T]
    messages += [("/effort_controller/commands", t, floats([1.0, 2.0, 3.0])) for t in T]
    table = one(mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])), joints=JOINTS)
    commands = {f"{joint}_effort_cmd": np.full(21, k + 1.0) for k, joint in enumerate(JOINTS)}
    np.testing.assert_allclose(table.columns.pop("force"), T, rtol=0, atol=1e-12)
    # efforts were measured, so that the commanded ones keep their name
    check(table, {**joints("pos"), **joints("effort", 4 * Q), **commands})
    assert said(table, "/camera: left out, no numbers")


def test_commands_that_come_often_or_not_at_all(tmp_path):
    """Many in a row's period count by the time that they were in force; a missing number leaves the row empty."""
    messages = [("/joint_states", t, {"name": JOINTS, "position": q.tolist()}) for t, q in zip(T, Q, strict=True)]
    messages += [("/u", k * 1e-3, {"data": None if k == 103 else float(k)}) for k in range(201)]
    u = one(mcap_json(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])), clock="/joint_states").columns["u"]
    # from 5 ms before a row to 5 ms after it the commands 10 k - 5 to 10 k + 4 are in force; the first row begins at 0, the last lasts on
    expected = 10.0 * np.arange(21) - 0.5
    expected[[0, 10, 20]] = 2.0, np.nan, (195 + 196 + 197 + 198 + 199 + 5 * 200) / 10
    np.testing.assert_allclose(u, expected, rtol=0, atol=1e-9)


def test_parts_of_a_robot_on_one_topic(tmp_path):
    """Messages of one topic that name different joints have clocks of their own."""
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/joint_states", t, joint_state(t, [7 * t], joints=["finger"])) for t in T[::2]]
    table = one(mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])))
    assert list(table.columns) == ["time_s", *joints("pos"), "finger_pos"]
    np.testing.assert_allclose(table.columns["finger_pos"], 7 * T, atol=1e-12)


def test_joints_that_two_topics_have(tmp_path):
    """The clock's topic has the short name, which `pliant init` refuses twice."""
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/left/estimate", t, joint_state(t, 2 * q)) for t, q in zip(T[:-1], Q[:-1], strict=True)]
    table = one(mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])))
    np.testing.assert_array_equal(table.columns["elbow_pos"], Q[:, 1])
    np.testing.assert_array_equal(table.columns["left_estimate_elbow_pos"][:-1], 2 * Q[:-1, 1])
    assert len(table) == 21 and np.isnan(table.columns["left_estimate_elbow_pos"][-1])


def test_commands_of_controllers(tmp_path):
    """A controller's reference is a command, its feedback a position, its error neither; trajectories of one point are commands."""
    messages = []
    for t, q in zip(T, Q, strict=True):
        point = {"positions": q.tolist(), "velocities": (2 * q).tolist()}
        state = {"joint_names": JOINTS, "reference": {"positions": (3 * q).tolist()}, "feedback": point, "error": {"positions": [t, t, t]}}
        state["desired"] = {"positions": (4 * q).tolist()}  # means the same: the first has the short name
        messages.append(("/controller/state", t, state))
    columns = one(mcap_json(tmp_path / "state.mcap", messages)).columns
    errors, desired = ([f"{joint}.{part}.positions" for joint in JOINTS] for part in ("error", "desired"))
    assert list(columns)[1:] == [*joints("cmd"), *joints("pos"), *joints("vel"), *errors, *desired]
    np.testing.assert_array_equal(columns["wrist.desired.positions"], 4 * Q[:, 2])
    np.testing.assert_array_equal(columns["wrist_cmd"], 3 * Q[:, 2])
    np.testing.assert_array_equal(columns["wrist_vel"], 2 * Q[:, 2])
    goals = [
        ("/arm/joint_trajectory", t, {"joint_names": JOINTS, "points": [{"positions": q.tolist(), "time_from_start": {"sec": 0}}]})
        for t, q in zip(T, Q, strict=True)
    ]
    check(one(mcap_json(tmp_path / "goals.mcap", goals)), joints("cmd"))
    states = [("/joint_states", t, {"name": JOINTS, "position": q.tolist()}) for t, q in zip(T, Q, strict=True)]
    plans = [("/arm/joint_trajectory", 0.05, {"joint_names": JOINTS, "points": [{"positions": [1, 2, 3]}, {"positions": [4, 5, 6]}]})]
    table = one(mcap_json(tmp_path / "plans.mcap", states + plans))
    check(table, joints("pos"))
    assert said(table, "/arm/joint_trajectory: left out, its trajectories are plans (of 2 points)")


def test_quaternions_that_change_sign_are_interpolated_the_short_way(tmp_path):
    messages = [("/joint_states", t, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/hand", t, pose(t, (0, 0, 0), (0, 0, 0, (-1.0) ** k))) for k, t in enumerate(T[::2])]
    table = one(mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])))
    np.testing.assert_array_equal(table.columns["hand_qw"], 1.0)


def test_clocks_that_do_not_belong_together(tmp_path):
    """Stamps of a simulation and the time of recording: what has only the latter is left out, unless all is counted by it."""
    messages = [("/joint_states", t + 100.0, joint_state(t, q)) for t, q in zip(T, Q, strict=True)]
    messages += [("/force", t + 100.0, ROS.types["std_msgs/msg/Float64"](t)) for t in T]
    path = mcap_ros(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1]))
    table = one(path)
    check(table, joints("pos"))
    assert said(table, "/force: left out, it has only the time of recording, and the stamps of /joint_states are 100 s from it")
    np.testing.assert_allclose(one(path, log_time=True).columns["force"], T, atol=1e-12)


def test_lists_that_vary_or_are_long_are_left_out(tmp_path):
    messages = [("/joint_states", t, {"name": JOINTS, "position": q.tolist()}) for t, q in zip(T, Q, strict=True)]
    messages += [("/scan", t, {"ranges": [1.0] * (2 + k % 2), "angle": t, "image": [0] * 500}) for k, t in enumerate(T)]
    table = one(mcap_json(tmp_path / "run.mcap", sorted(messages, key=lambda m: m[1])))
    check(table, {**joints("pos"), "scan_angle": T})
    assert said(table, "/scan: ranges: left out, its length differs: 2 in message 0, 3 in message 1")
    assert said(table, "/scan: image: left out, 500 numbers per message")


# --- arrays


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


def lerobot(folder, names=("shoulder_pan.pos", "elbow_flex.pos", "gripper.pos")):
    """Writes a data set of LeRobot, version 3: three episodes in two files."""
    features = {
        "observation.state": {"dtype": "float32", "shape": [3], "names": list(names)},
        "action": {"dtype": "float32", "shape": [3], "names": {"motors": list(names)}},
        "observation.images.top": {"dtype": "video", "shape": [4, 4, 3], "names": ["height", "width", "channels"]},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    }
    (folder / "meta").mkdir(parents=True)
    info = {"codebase_version": "v3.0", "fps": 1, "features": features}
    (folder / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    for file, episodes in enumerate([(0, 1), (2,)]):
        count = 5 * len(episodes)
        episode = np.repeat(episodes, 5)
        frame = np.tile(np.arange(5), len(episodes))
        state = np.column_stack([episode, frame, 10 * episode + frame]).astype(np.float32)
        parquet(
            folder / "data" / "chunk-000" / f"file-{file:03d}.parquet",
            {
                "observation.state": rows(state),
                "action": rows(-state),
                "timestamp": pa.array(frame.astype(np.float32)),
                "frame_index": frame,
                "episode_index": episode,
                "index": np.arange(count),
                "task_index": np.zeros(count, dtype=int),
                "next.done": frame == 4,
            },
        )
    return folder


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


# --- names


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


# --- files


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


def run(*arguments):
    """The command's exit code, output and errors."""
    out = subprocess.run([sys.executable, "-m", "pliant.logs", *map(str, arguments)], capture_output=True, text=True, check=False)
    return out.returncode, out.stdout, out.stderr


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


# --- input that cannot be used


def refused(path, text, **options):
    """Reading the log is refused with this text, a cause and a fix."""
    with pytest.raises(pliant.InputError, match=text) as error:
        read(path, **options)
    message = str(error.value)
    assert path.name in message and "\n  likely cause: " in message and "\n  fix: " in message, message


def savez(path, **arrays):
    """Writes arrays."""
    np.savez(path, **arrays)
    return path


def test_formats_that_are_refused(tmp_path):
    refused(ARM / "run1.csv", "which pliant reads directly")
    refused(Path(__file__), "unknown format")
    refused(tmp_path, "neither metadata.yaml")
    with pytest.raises(pliant.InputError, match="--rate: is 0 Hz"):
        read(ARM / "run1.csv", rate=0.0)


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "a.bag", "a.parquet", "a.h5", "a.npz", "a.npy"])
def test_damaged_files(tmp_path, name):
    for data in (b"", b"nothing of the kind", bytes(range(256)) * 20):
        (tmp_path / name).write_bytes(data)
        refused(tmp_path / name, "cannot be read")


def test_damaged_folders(tmp_path):
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 5}", encoding="utf-8")
    refused(tmp_path, "cannot be read")
    data = lerobot(tmp_path / "set")
    (data / "data" / "chunk-000" / "file-000.parquet").rename(data / "moved")
    (data / "data" / "chunk-000" / "file-001.parquet").unlink()
    refused(data, "has no data/chunk")
    (data / "meta" / "info.json").write_text("{}", encoding="utf-8")
    with pytest.raises(pliant.InputError, match=r"info\.json: does not describe the data set"):
        read(data)


def test_a_recording_that_was_cut_off(tmp_path):
    messages = [("/arm", t, {"name": JOINTS, "position": q.tolist()}) for t, q in zip(T, Q, strict=True)]
    path = mcap_json(tmp_path / "run.mcap", messages)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    refused(path, "cannot be read")


def test_compression_that_is_not_known(tmp_path):
    path = mcap(tmp_path / "run.mcap", [("/arm", ns(t), b'{"q": 1}') for t in T], compression=CompressionType.LZ4)
    assert len(one(path)) == 21
    path.write_bytes(path.read_bytes().replace(b"\x03\x00\x00\x00lz4", b"\x03\x00\x00\x00aes"))
    refused(path, "cannot be read: .*aes")


def test_encodings_that_are_not_read(tmp_path):
    path = mcap(tmp_path / "run.mcap", [("/arm", ns(t), b"x") for t in T], encoding="msgpack")
    with pytest.raises(pliant.InputError, match=r"no topic with numbers(.|\n)*/arm: left out, its encoding \(msgpack"):
        read(path)
    path = mcap(tmp_path / "bad.mcap", [("/arm", ns(t), b"{") for t in T])
    with pytest.raises(pliant.InputError, match=r"no topic with numbers(.|\n)*cannot be decoded"):
        read(path)
    refused(mcap(tmp_path / "empty.mcap", []), "has no messages")


def test_topics_that_cannot_be_the_clock(tmp_path):
    messages = [("/arm", t, {"name": JOINTS, "position": q.tolist()}) for t, q in zip(T, Q, strict=True)]
    messages += [("/odd", t, {"name": JOINTS, "position": [1.0, 2.0]}) for t in T]
    path = mcap_json(tmp_path / "run.mcap", messages)
    refused(path, r"has no topic /arms with numbers(.|\n)*/arm \(21 messages\)", clock="/arms")
    refused(path, "topic /odd: cannot be the clock: it has 2 numbers in position, but 3 names in message 0", clock="/odd")
    assert said(one(path), "/odd: left out, it has 2 numbers in position, but 3 names")
    twice = mcap_json(tmp_path / "twice.mcap", [("/arm", t, {"name": ["a", "a"], "position": [1, 2]}) for t in T])
    refused(twice, r"no topic with numbers(.|\n)*names a joint twice")
    once = mcap_json(tmp_path / "once.mcap", messages[:1])
    refused(once, "topic /arm .*: its clock .*: has 1 row")


@pytest.mark.parametrize(
    ("change", "text"), [(0.02, r"repeats at row 3"), (0.011, r"runs backwards at row 3"), (np.nan, "has no number at row 3")]
)
def test_clocks_that_do_not_count_up(tmp_path, change, text):
    t = T.copy()
    t[3] = change
    refused(savez(tmp_path / "run.npz", t=t, q=Q), text)
    parquet(tmp_path / "run.parquet", {"t": t, "q": rows(Q)})
    refused(tmp_path / "run.parquet", text)
    if np.isfinite(change):
        messages = [("/joint_states", k, joint_state(s, q)) for k, s, q in zip(T, t, Q, strict=True)]
        path = mcap_ros(tmp_path / "run.mcap", messages)
        refused(path, rf"topic /joint_states(.|\n)*{text}(.|\n)*--log-time")
        np.testing.assert_allclose(one(path, log_time=True).columns["time_s"], T, atol=1e-9)


def test_arrays_without_a_clock(tmp_path):
    path = savez(tmp_path / "run.npz", q=Q)
    refused(path, r"has no time(.|\n)*there are q(.|\n)*--rate HZ")
    refused(path, r"has no column t to be the clock", clock="t")
    refused(savez(tmp_path / "two.npz", t=T, time=T, q=Q), r"several clocks: t, time")
    table = one(tmp_path / "two.npz", clock="time")
    assert list(table.columns) == ["time_s", "q_0", "q_1", "q_2"] and said(table, "t: left out, another clock")
    refused(savez(tmp_path / "alone.npz", t=T), "has no numbers beside the time")
    refused(savez(tmp_path / "texts.npz", t=np.array(["a"])), "has no numbers over time")


def test_arrays_of_different_lengths(tmp_path):
    refused(savez(tmp_path / "run.npz", t=T, qpos=Q[:-1]), "qpos has 20 rows, but the time 21")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["data/demo_0/t"], file["data/demo_0/obs/joint_vel"] = T, Q[:4]
    refused(tmp_path / "run.h5", "/data/demo_0: obs.joint_vel has 4 rows, but the time 21")


def test_arrays_that_are_records_of_their_own(tmp_path):
    path = savez(tmp_path / "tosses.npz", toss_0=Q, toss_1=Q[:-1], toss_2=Q[:-2], toss_3=Q)
    refused(path, "its 4 arrays have 3 different lengths", rate=100.0)
    table = one(savez(tmp_path / "run.npz", arm=Q, limits=Q[:2], wrist=Q), rate=100.0)
    assert len(table) == 21 and said(table, "limits: left out, 2 rows where the time has 21")


def test_lists_that_differ_in_length(tmp_path):
    path = parquet(tmp_path / "run.parquet", {"t": T[:3], "q": pa.array([[1.0, 2.0], [3.0], [4.0, 5.0]])})
    refused(path, "column q: its lists differ in length: 2 numbers in row 0, 1 in row 1")


def test_objects_are_not_loaded(tmp_path):
    np.savez(tmp_path / "run.npz", t=T, q=np.array([{}, 1], dtype=object))
    refused(tmp_path / "run.npz", "cannot be read(.|\n)*Python objects")


def test_encrypted_parquet(tmp_path):
    path = parquet(tmp_path / "run.parquet", {"t": T, "q": T})
    path.write_bytes(path.read_bytes()[:-4] + b"PARE")  # the mark of a file with an encrypted footer
    refused(path, "cannot be read(.|\n)*encrypted")


@pytest.mark.parametrize(
    ("module", "package", "name"),
    [
        ("h5py", "h5py", "a.h5"),
        ("mcap.reader", "mcap", "a.mcap"),
        ("pyarrow", "pyarrow", "a.parquet"),
        ("rosbags.highlevel", "rosbags", "a.bag"),
    ],
)
def test_libraries_that_are_missing(tmp_path, monkeypatch, capsys, module, package, name):
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(b"")
    assert command.main([str(tmp_path / name), "--out", str(tmp_path / "csv")]) == 2
    assert re.match(rf"error: pliant\.logs needs {package}, .*install it by `pip install pliant\[logs\]`", capsys.readouterr().err)


# --- from a recording to a diagnosis


def pliant_command():
    """The command `pliant`, built by cargo; the test is skipped without it."""
    path = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "pliant"
    return path if path.is_file() else pytest.skip("the command is not built: cargo build --release")


def init(logs, out):
    """The scene that `pliant init` writes for the arm and these logs."""
    run = [pliant_command(), "init", "--model", ARM / "arm.urdf", "--out", out]
    subprocess.run([*run, *(word for log in logs for word in ("--log", log))], check=True, capture_output=True)
    return tomllib.loads((out / "scene.toml").read_text(encoding="utf-8"))


def columns_of(path):
    """The columns of a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        head, *body = csv.reader(file)
    return dict(zip(head, np.array(body, dtype=float).T, strict=True))


def test_a_recording_becomes_the_scene_that_its_csv_becomes(tmp_path):
    """The example's runs as JointState in MCAP: the same experiment, but for the names of columns and the units that they say."""
    arm = ["shoulder", "elbow"]
    for k in (1, 2, 3):
        log = columns_of(ARM / f"run{k}.csv")
        positions = np.radians(np.column_stack([log[f"{joint}_pos_deg"] for joint in arm]))
        torques = np.column_stack([log[f"{joint}_torque"] for joint in arm])
        times = log["time_ms"] / 1e3
        messages = [("/joint_states", t, joint_state(t, q, (), u, arm)) for t, q, u in zip(times, positions, torques, strict=True)]
        mcap_ros(tmp_path / f"run{k}.mcap", messages)
    code, _, err = run(*(tmp_path / f"run{k}.mcap" for k in (1, 2, 3)), "--out", tmp_path)
    assert (code, err) == (0, "")
    ours = init([tmp_path / f"run{k}.csv" for k in (1, 2, 3)], tmp_path / "ours")
    theirs = init([ARM / f"run{k}.csv" for k in (1, 2, 3)], tmp_path / "theirs")
    own, other = ours.pop("experiment"), theirs.pop("experiment")
    assert ours == theirs  # bodies, motors, step
    assert own.pop("time") == {"column": "time_s", "unit": "s"} and other.pop("time") == {"column": "time_ms", "unit": "ms"}
    assert own["joint"] == [{"joint": joint, "measures": "position", "column": f"{joint}_pos", "angle_unit": "rad"} for joint in arm]
    assert own["input"] == [{"actuator": f"motor_{joint}", "columns": [f"{joint}_effort"]} for joint in arm]
    for new, old in zip(own["record"], other["record"], strict=True):
        assert new["role"] == old["role"]
        here, there = (columns_of(tmp_path / folder / record["file"]) for folder, record in (("ours", new), ("theirs", old)))
        np.testing.assert_allclose(here["time_s"], there["time_ms"] / 1e3, rtol=0, atol=1e-9)
        for new_joint, old_joint in zip(own["joint"], other["joint"], strict=True):
            assert new_joint["joint"] == old_joint["joint"] and new_joint["measures"] == old_joint["measures"]
            np.testing.assert_array_equal(here[new_joint["column"]], np.radians(there[old_joint["column"]]))
        for new_input, old_input in zip(own["input"], other["input"], strict=True):
            assert new_input["actuator"] == old_input["actuator"]
            np.testing.assert_array_equal(here[new_input["columns"][0]], there[old_input["columns"][0]])


@pytest.mark.long
def test_held_commands_do_not_look_late(tmp_path):
    """An arm whose commands come right after each joint state and are held: the diagnosis names what is missing, and no delay."""
    arm, h, each, n = ["shoulder", "elbow"], 0.0025, 4, 200
    init([ARM / "run1.csv"], tmp_path / "first")
    text = (tmp_path / "first" / "scene.toml").read_text(encoding="utf-8").partition("[experiment]")[0]
    truth = pliant.loads(text.replace('name = "elbow"\nkind', 'damping = 0.08\nname = "elbow"\nkind'))
    assert truth.theta[truth.param_index("elbow.damping")] == 0.08
    rng = np.random.default_rng(1)
    for k in range(3):
        t = np.arange(n) * each * h
        sizes, rates = rng.uniform(0.3, 1.0, size=(2, 3)) * [[1.5], [0.3]], rng.uniform(0.5, 3.0, size=(2, 3))
        u = np.stack([np.sin(2 * np.pi * np.outer(t, rates[j])) @ sizes[j] for j in range(2)], axis=1)
        x = truth.rollout(truth.initial_state(), np.repeat(u, each, axis=0)).x[::each][:n]
        q = x[:, :2] + rng.normal(scale=3e-4, size=(n, 2))
        messages = [("/joint_states", a, joint_state(a, b, joints=arm)) for a, b in zip(t, q, strict=True)]
        messages += [("/effort_controller/commands", a + 1e-4, floats(b)) for a, b in zip(t, u, strict=True)]
        mcap_ros(tmp_path / f"run{k}.mcap", sorted(messages, key=lambda m: m[1]))
    recordings = [tmp_path / f"run{k}.mcap" for k in range(3)]
    code, _, err = run(*recordings, "--names", ARM / "arm.urdf", "--out", tmp_path)
    assert (code, err) == (0, "")
    init([path.with_suffix(".csv") for path in recordings], tmp_path / "arm")
    diagnose = [pliant_command(), "diagnose", tmp_path / "arm" / "scene.toml", "--out", tmp_path / "report"]
    subprocess.run(diagnose, check=True, capture_output=True)
    found = json.loads((tmp_path / "report" / "diagnosis.json").read_text(encoding="utf-8"))
    assert (found["verdict"], [cause["name"] for cause in found["causes"]]) == ("named", ["viscous_friction"])
    assert found["causes"][0]["parameters"][0]["estimate"] == pytest.approx(0.08, rel=5e-3)
