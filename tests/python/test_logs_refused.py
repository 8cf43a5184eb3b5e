"""Logs that `pliant.logs` cannot use: what is said of them."""

import re
import sys
from pathlib import Path

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
    Q,
    T,
    joint_state,
    lerobot,
    mcap,
    mcap_json,
    mcap_ros,
    ns,
    one,
    parquet,
    refused,
    rows,
    said,
    savez,
)
from mcap.writer import CompressionType
from pliant.logs import __main__ as command
from pliant.logs import read


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
