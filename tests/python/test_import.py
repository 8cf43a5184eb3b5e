"""Imported models against MuJoCo's own compiler: masses, kinematics, dynamics, motion.

Coordinates are MuJoCo's, less the joints' `ref`. For URDF MuJoCo fuses links on fixed joints, so
bodies are compared where MuJoCo has them, and degrees of freedom by their joints' names.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", minversion="4.0")
pliant = pytest.importorskip("pliant")

MODELS = Path(__file__).resolve().parents[1] / "models"
MJCF = sorted(p.name for p in MODELS.glob("*.xml"))
URDF = sorted(p.name for p in MODELS.glob("*.urdf"))
HINGE, SLIDE, BALL, FREE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{k}")) for k in ("HINGE", "SLIDE", "BALL", "FREE")
)
TOLERANCE = 1e-9
SAMPLES = 5


def relative(a, b):
    """Largest difference, relative to the largest entry."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    return float(np.abs(a - b).max() / max(1e-3, np.abs(b).max())) if a.size else 0.0


def compiled(name, **options):
    """pliant's model, its scene as a dictionary, the report, MuJoCo's model."""
    text, report = pliant.import_model(MODELS / name, **options)
    return (
        pliant.loads(text),
        tomllib.loads(text),
        report,
        mujoco.MjModel.from_xml_path(str(MODELS / name)),
    )


def random_state(mj, rng):
    """qpos with quaternions of length one, and qvel."""
    q = mj.qpos0 + rng.normal(size=mj.nq)
    for j in range(mj.njnt):
        start = mj.jnt_qposadr[j] + (3 if mj.jnt_type[j] == FREE else 0)
        if mj.jnt_type[j] in (FREE, BALL):
            q[start : start + 4] = rng.normal(size=4)
            q[start : start + 4] /= np.linalg.norm(q[start : start + 4])
    return q, rng.normal(size=mj.nv)


def ours(mj, q):
    """qpos as pliant counts it: hinges and slides from where the file has them."""
    q = q.copy()
    for j in range(mj.njnt):
        if mj.jnt_type[j] in (HINGE, SLIDE):
            q[mj.jnt_qposadr[j]] -= mj.qpos0[mj.jnt_qposadr[j]]
    return q


def forward(mj, q, v):
    data = mujoco.MjData(mj)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(mj, data)
    return data


def full_mass_matrix(mj, data):
    full = np.zeros((mj.nv, mj.nv))
    mujoco.mj_fullM(mj, data, full)
    return full


def rotation(quaternion):
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quaternion, float))
    return flat.reshape(3, 3)


def matrix(numbers):
    xx, yy, zz, xy, xz, yz = numbers
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("name", MJCF)
def test_masses_are_those_of_mujoco(name):
    _, scene, _, mj = compiled(name)
    assert len(scene["body"]) == mj.nbody - 1
    for b, body in enumerate(scene["body"], start=1):
        assert relative(body.get("mass", 0.0), mj.body_mass[b]) < TOLERANCE
        if mj.body_mass[b] == 0.0:
            continue
        assert (
            np.abs(np.array(body.get("center_of_mass", [0, 0, 0])) - mj.body_ipos[b]).max() < 1e-12
        )
        r = rotation(mj.body_iquat[b])
        inertia = r @ np.diag(mj.body_inertia[b]) @ r.T
        assert np.abs(matrix(body["inertia"]) - inertia).max() < TOLERANCE * np.abs(inertia).max()


@pytest.mark.parametrize("name", MJCF)
def test_kinematics_and_dynamics_are_those_of_mujoco(name):
    model, _, _, mj = compiled(name)
    assert model.nx - len(model.memory_names) == mj.nq + mj.nv
    rng = np.random.default_rng(0)
    for _ in range(SAMPLES):
        q, v = random_state(mj, rng)
        data = forward(mj, q, v)
        at = ours(mj, q)
        positions, quaternions = model.body_poses(at)
        assert relative(positions, data.xpos[1:]) < TOLERANCE
        for mine, theirs in zip(quaternions, data.xquat[1:], strict=True):
            assert relative(rotation(mine), rotation(theirs)) < TOLERANCE
        assert relative(model.mass_matrix(at), full_mass_matrix(mj, data)) < TOLERANCE
        assert relative(model.bias_forces(at, v), data.qfrc_bias) < TOLERANCE


@pytest.mark.parametrize("name", URDF)
@pytest.mark.parametrize("samples", [SAMPLES])
def test_robots_move_like_those_of_mujoco(name, samples):
    model, scene, _, mj = compiled(name)
    # MuJoCo's degree of freedom for each of pliant's, by the joint's name in the file
    originals = {
        e["name"]: e.get("original", e["name"])
        for e in pliant.import_model(MODELS / name)[1]["entries"]
    }
    joints = [originals[j["name"]] for body in scene["body"] for j in body.get("joint", [])]
    order = [mj.joint(name).dofadr[0] for name in joints]
    assert sorted(order) == list(range(mj.nv))
    known = {originals.get(n, n): k for k, n in enumerate(model.body_names)}
    rng = np.random.default_rng(0)
    for _ in range(samples):
        q, v = random_state(mj, rng)
        data = forward(mj, q, v)
        positions, quaternions = model.body_poses(q[order])
        for b in range(1, mj.nbody):
            k = known[mj.body(b).name]
            assert relative(positions[k], data.xpos[b]) < TOLERANCE
            assert relative(rotation(quaternions[k]), rotation(data.xquat[b])) < TOLERANCE
        assert (
            relative(model.mass_matrix(q[order]), full_mass_matrix(mj, data)[np.ix_(order, order)])
            < TOLERANCE
        )
        assert relative(model.bias_forces(q[order], v[order]), data.qfrc_bias[order]) < TOLERANCE


def test_a_robot_flies_if_it_is_told_to(tmp_path):
    """MuJoCo has a floating joint in the file instead."""
    model, _, _, _ = compiled("rover.urdf", free_base=True)
    text = (MODELS / "rover.urdf").read_text()
    joint = (
        '<joint name="base" type="floating"><parent link="world"/><child link="chassis"/></joint>'
    )
    flying = tmp_path / "flying.urdf"
    flying.write_text(text.replace("</robot>", f'<link name="world"/>{joint}</robot>'))
    mj = mujoco.MjModel.from_xml_path(str(flying))
    assert model.nx == mj.nq + mj.nv
    same, _ = pliant.import_model(flying)
    flies = pliant.loads(same)
    q, v = random_state(mj, np.random.default_rng(1))
    data = forward(mj, q, v)
    names = [mj.joint(j).name for j in range(mj.njnt)]
    assert names == [
        "base",
        "pan",
        "left_pivot",
        "front left",
        "rear left",
        "right_pivot",
        "front right",
    ]
    for one in (model, flies):
        assert relative(one.mass_matrix(q), full_mass_matrix(mj, data)) < TOLERANCE
        assert relative(one.bias_forces(q, v), data.qfrc_bias) < TOLERANCE


@pytest.mark.parametrize(
    ("name", "tolerance"), [("pendulum.xml", 1e-6), ("cable.xml", 1e-5), ("slider_crank.xml", 1e-5)]
)
def test_motion_is_that_of_mujoco(name, tolerance):
    """Midpoint steps of 0.1 ms against MuJoCo's fourth order, friction, springs, motors too."""
    text, _ = pliant.import_model(MODELS / name, contact=False)
    mj = mujoco.MjModel.from_xml_path(str(MODELS / name))
    mj.opt.timestep, mj.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    scene = tomllib.loads(text)
    model = pliant.loads(text.replace(f"step = {scene['time']['step']}", "step = 0.0001"))
    data = mujoco.MjData(mj)
    rng = np.random.default_rng(2)
    data.qvel[:] = rng.normal(size=mj.nv) * 0.5
    data.ctrl[:] = 0.3
    x0 = np.concatenate([ours(mj, data.qpos), data.qvel])
    steps = 1000
    roll = model.rollout(x0, np.full((steps, model.nu), 0.3), record=False)
    for _ in range(steps):
        mujoco.mj_step(mj, data)
    end = np.concatenate([ours(mj, data.qpos), data.qvel])
    assert relative(roll.x[-1], end) < tolerance


@pytest.mark.parametrize("name", MJCF + URDF)
def test_every_element_is_reported(name):
    _, _, report, _ = compiled(name)
    assert report["schema_version"] == 1 and report["source"].endswith(name)
    assert all(
        e["verdict"] in ("kept", "approximated", "ignored") and e["reason"]
        for e in report["entries"]
    )
    assert all(e["line"] > 0 for e in report["entries"])


def test_names_are_made_usable():
    _, scene, report, _ = compiled("slider_crank.xml")
    names = [j["name"] for body in scene["body"] for j in body["joint"]]
    assert names == ["turn", "pin", "wrist_pin", "stroke"]
    assert scene["actuator"][1]["name"] == "turn_motor"
    renamed = {e["name"]: e["original"] for e in report["entries"] if e.get("original")}
    assert renamed == {"wrist_pin": "wrist/pin", "turn_motor": "turn"}


def test_what_cannot_be_kept_is_refused(tmp_path):
    body = '<body name="{0}"><joint name="{1}"/><geom size=".1" contype="0" conaffinity="0"/></body>'
    loop = tmp_path / "loop.xml"
    loop.write_text(
        f"<mujoco><worldbody>{body.format('a', 'i')}{body.format('b', 'j')}</worldbody>\n"
        '<tendon><fixed stiffness="3"><joint joint="j" coef="1"/></fixed></tendon></mujoco>'
    )
    with pytest.raises(
        pliant.InputError, match=r"loop.xml:2: fixed.*cannot be kept(.|\n)*--approximate"
    ):
        pliant.import_model(loop)
    _, report = pliant.import_model(loop, approximate=True)
    assert [
        e["line"]
        for e in report["entries"]
        if e["verdict"] == "approximated" and e["element"] == "fixed"
    ] == [2]


def corners(mj, g):
    """Vertices of a mesh geom in its body's frame."""
    mesh = mj.geom_dataid[g]
    first = mj.mesh_vertadr[mesh]
    vertices = mj.mesh_vert[first : first + mj.mesh_vertnum[mesh]].astype(float)
    return vertices @ rotation(mj.geom_quat[g]).T + mj.geom_pos[g]


def shapes(mj, body):
    """Kind, sizes, place and orientation of a body's geoms that may touch, as scenes count them."""
    out = []
    for g in range(mj.ngeom):
        kind = mujoco.mjtGeom(mj.geom_type[g]).name.removeprefix("mjGEOM_").lower()
        masks = mj.geom_contype[g] or mj.geom_conaffinity[g]
        paired = g in mj.pair_geom1 or g in mj.pair_geom2
        if mj.geom_bodyid[g] == body and (masks or paired) and kind != "ellipsoid":
            size = corners(mj, g) if kind == "mesh" else mj.geom_size[g]
            out.append((kind, size, mj.geom_pos[g], rotation(mj.geom_quat[g])))
    return out


@pytest.mark.parametrize("name", sorted({*MJCF} - {"arm7.xml", "four_bar.xml", "gears.xml", "pendulum.xml", "slider_crank.xml"}))
def test_shapes_are_those_of_mujoco(name):
    _, scene, _, mj = compiled(name)
    touching = 0
    for b, body in enumerate(scene["body"], start=1):
        theirs = shapes(mj, b)
        assert len(body.get("shape", [])) == len(theirs)
        for mine, (kind, size, position, axes) in zip(body.get("shape", []), theirs, strict=True):
            touching += 1
            if kind == "mesh":  # in single precision
                assert mine["kind"] == "hull"
                place, axes = np.array(mine.get("position", [0, 0, 0])), rotation(mine.get("quaternion", [1, 0, 0, 0]))
                points = np.array(mine["points"]) @ axes.T + place
                directions = np.random.default_rng(3).normal(size=(100, 3))
                assert np.abs((directions @ points.T).max(1) - (directions @ size.T).max(1)).max() < 1e-6
                continue
            assert mine["kind"] == kind
            sizes = mine.get("half_extents") or [mine["radius"], mine.get("half_length", 0.0)]
            assert relative(sizes, size[: len(sizes)]) < TOLERANCE
            assert np.abs(np.array(mine.get("position", [0, 0, 0])) - position).max() < 1e-9
            assert np.abs(rotation(mine.get("quaternion", [1, 0, 0, 0])) - axes).max() < 1e-9
    assert touching > 0 or name == "free_body.xml"
    stops = any("limits" in j for b in scene["body"] for j in b.get("joint", []))
    assert (scene["time"]["integrator"] == "euler") == (touching > 1 or stops)


def scene_pairs(scene):
    """Pairs of objects that touch in a scene, with their friction; by the rules of scenes, written down again."""
    bodies = {b["name"]: b for b in scene["body"]}

    def carrier(name):
        while name is not None and not bodies[name].get("joint"):
            name = bodies[name].get("parent")
        return name

    def above(name):
        return name and carrier(bodies[name].get("parent"))

    frictions = {n: b["shape"][0]["friction"] for n, b in bodies.items() if b.get("shape")}
    for kind in ("plane", "sphere", "capsule", "box", "cylinder"):
        frictions |= {s["name"]: s["friction"] for s in scene.get(kind, [])}
    rules = {frozenset(r["between"]): r for r in scene["contact"]["pair"]}
    out = {}
    for a in frictions:
        for b in frictions:
            if a >= b:
                continue
            x, y = (carrier(n) if n in bodies else None for n in (a, b))
            neighbours = x is not None and y is not None and y in (above(x), x) or x == y
            neighbours |= x is not None and y is not None and above(y) == x
            rule = rules.get(frozenset((a, b)), {})
            if not neighbours and not rule.get("ignore"):
                out[a, b] = rule.get("friction", (frictions[a] + frictions[b]) / 2)
    return out


def test_what_touches_is_what_touches_in_mujoco():
    """All bodies are thrown about one place, where MuJoCo finds contacts of whatever may touch."""
    model, scene, report, mj = compiled("touching.xml")
    data = mujoco.MjData(mj)
    theirs = {}
    rng = np.random.default_rng(4)
    for _ in range(400):
        data.qpos[:], _ = random_state(mj, rng)
        for j in range(mj.njnt):
            if mj.jnt_type[j] == FREE:
                place = [0, 0, -0.45] + rng.uniform(-1, 1, 3) * [0.1, 0.1, 0.3]
                data.qpos[mj.jnt_qposadr[j] :][:3] = place
        mujoco.mj_forward(mj, data)
        for c in data.contact:
            geoms = (int(c.geom1), int(c.geom2))
            bodies = [mj.geom_bodyid[g] for g in geoms]
            names = [
                mj.body(b).name if b else mj.geom(g).name
                for g, b in zip(geoms, bodies, strict=True)
            ]
            theirs[tuple(sorted(names))] = c.friction[0] if c.dim > 1 else 0.0
    theirs = {k: v for k, v in theirs.items() if "egg" not in k}
    # the flag may touch cart and plate, but cannot reach them
    mine = scene_pairs(scene)
    assert mine.pop(("cart", "flag")) == mine.pop(("flag", "plate")) == 0.6
    assert mine.keys() == theirs.keys()
    assert mine == pytest.approx(theirs)
    assert model.rollout(model.initial_state(), model.controls(20), record=False).x.shape[0] == 21
    said = {(e["element"], e["verdict"], e["reason"].split(":")[0]) for e in report["entries"]}
    assert ("exclude", "kept", "ball and pill pass through each other") in said
    assert ("exclude", "kept", "the world and can pass through each other") in said
    assert ("pair", "kept", '"ball" and "spirit" touch') in said
    assert any(
        e["line"] == 24 and e["verdict"] == "approximated" for e in report["entries"]
    )  # the egg
    assert any(e["reason"].startswith("solref: ") for e in report["entries"])


def test_collision_shapes_of_a_robot_touch():
    _, scene, report, mj = compiled("gripper.urdf")
    base, arm, finger = scene["body"]
    assert base["shape"] == [
        {
            "kind": "cylinder",
            "position": [0.0, 0.0, 0.1],
            "radius": 0.08,
            "half_length": 0.1,
            "friction": 1.0,
        }
    ]
    assert arm["shape"][0]["half_extents"] == [0.03, 0.04, 0.15]
    assert np.abs(rotation(arm["shape"][0]["quaternion"]) - rotation(mj.geom_quat[1])).max() < 1e-6
    assert [s["kind"] for s in finger["shape"]] == ["sphere", "cylinder"]
    assert [s["friction"] for s in finger["shape"]] == [1.4, 1.4]
    assert scene["contact"]["pair"] == [{"between": ["base", "arm"], "ignore": True}]
    assert arm["joint"][0]["limits"] == [-2.0, 2.0] and arm["joint"][0]["friction"] == 0.05
    assert scene["time"]["integrator"] == "euler"
    _, without = pliant.import_model(MODELS / "gripper.urdf", contact=False)
    assert [e["verdict"] for e in without["entries"] if e["element"] == "collision"] == [
        "ignored"
    ] * 4
    assert [e["verdict"] for e in report["entries"] if e["element"] == "collision"] == ["kept"] * 4


def test_shapes_that_overlap_at_the_start_are_refused(tmp_path):
    """Unless they may pass through each other."""
    body = '<body name="{0}" pos="{1} 0 0"><freejoint/><geom size=".1"/></body>'
    file = tmp_path / "two.xml"
    file.write_text(
        f"<mujoco><worldbody>\n{body.format('a', 0)}\n{body.format('b', 0.15)}\n</worldbody></mujoco>"
    )
    with pytest.raises(
        pliant.InputError,
        match=r"two.xml:2: body \"a\".*overlap by 5.00e-2 m(.|\n)*<exclude>(.|\n)*--approximate",
    ):
        pliant.import_model(file)
    text, report = pliant.import_model(file, approximate=True)
    assert tomllib.loads(text)["contact"]["pair"] == [{"between": ["a", "b"], "ignore": True}]
    assert any("the two pass through each other" in e["reason"] for e in report["entries"])
    assert "[[body.shape]]" not in pliant.import_model(file, contact=False)[0]


def test_a_package_is_where_the_option_says(tmp_path):
    robot = (MODELS / "explorer.urdf").read_text().replace("package://models/", "package://elsewhere/")
    (tmp_path / "robot.urdf").write_text(robot)
    with pytest.raises(pliant.InputError, match=r"robot.urdf:15: mesh(.|\n)*packages=\{\"elsewhere\": FOLDER\}"):
        pliant.import_model(tmp_path / "robot.urdf")
    text, _ = pliant.import_model(tmp_path / "robot.urdf", packages={"elsewhere": MODELS})
    assert tomllib.loads(text)["body"] == tomllib.loads(pliant.import_model(MODELS / "explorer.urdf")[0])["body"]


def test_hulls_come_to_rest_on_the_floor():
    """Two bodies of two meshes each fall beside an arm: their lowest corners end at the rest gap."""
    text, _ = pliant.import_model(MODELS / "meshes.xml")
    model, scene = pliant.loads(text), tomllib.loads(text)
    roll = model.rollout(model.initial_state(), model.controls(2000), record=False)
    end = roll.x[-1]
    positions, quaternions = model.body_poses(end[:20])  # two hinges, a ball, two free joints
    for name in ("stone", "other"):
        b = [body["name"] for body in scene["body"]].index(name)
        lowest = np.inf
        for shape in scene["body"][b]["shape"]:
            axes = rotation(shape.get("quaternion", [1, 0, 0, 0]))
            points = np.array(shape["points"]) @ axes.T + np.array(shape.get("position", [0, 0, 0]))
            lowest = min(lowest, (points @ rotation(quaternions[b]).T + positions[b])[:, 2].min())
        assert -1e-8 < lowest < 1e-6
    assert np.abs(end[-12:]).max() < 1e-4
