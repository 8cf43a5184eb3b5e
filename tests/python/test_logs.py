"""Topics of recordings as tables (`pliant.logs`), from messages to the scene that they lead to."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
for needed in ("h5py", "pyarrow", "mcap", "mcap_protobuf", "rosbags"):
    pytest.importorskip(needed)

from log_files import (
    ARM,
    JOINTS,
    ROS,
    Q,
    T,
    bag2,
    check,
    columns_of,
    floats,
    header,
    init,
    joint_state,
    joints,
    mcap,
    mcap_json,
    mcap_ros,
    ns,
    one,
    pose,
    run,
    said,
    state_type,
)
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore


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


def test_held_commands_do_not_look_late(tmp_path):
    """An arm whose commands come right after each joint state and are held: a fit finds the damping that is missing, and no delay."""
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
    scene = tmp_path / "arm" / "scene.toml"
    bounds = {"elbow.damping": (0.0, 1.0)} | {f"{joint}.position_delay": (-0.02, 0.02) for joint in arm}
    free = ", ".join(f'{{ path = "{path}", lower = {lower}, upper = {upper} }}' for path, (lower, upper) in bounds.items())
    scene.write_text(f"{scene.read_text(encoding='utf-8')}\n[experiment.fit]\nfree = [{free}]\n", encoding="utf-8")
    damping, *delays = (parameter["estimate"] for parameter in pliant.fit(scene)["parameters"])
    assert damping == pytest.approx(0.08, rel=5e-3)
    assert np.abs(delays).max() < 0.2e-3  # 0.06 ms; by the command in force at each row 5 ms, half a period
