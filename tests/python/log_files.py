"""Files of logs in other formats, written with the libraries that their users have, and what tests of `pliant.logs` share."""

import csv
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
for needed in ("h5py", "pyarrow", "mcap", "mcap_protobuf", "rosbags"):
    pytest.importorskip(needed)

import pyarrow as pa
import pyarrow.parquet as pq
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from pliant.logs import read
from rosbags import rosbag2
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


def run(*arguments):
    """The command's exit code, output and errors."""
    out = subprocess.run([sys.executable, "-m", "pliant.logs", *map(str, arguments)], capture_output=True, text=True, check=False)
    return out.returncode, out.stdout, out.stderr


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
