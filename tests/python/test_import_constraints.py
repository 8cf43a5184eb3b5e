"""Loops, gears, filters and limits of imported models against MuJoCo: what they hold, and how they move."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", minversion="4.0")
pliant = pytest.importorskip("pliant")
from test_import import ours

MODELS = Path(__file__).resolve().parents[1] / "models"


def imported(name):
    text, report = pliant.import_model(MODELS / name)
    mj = mujoco.MjModel.from_xml_path(str(MODELS / name))
    return text, tomllib.loads(text), report, mj


def verdicts(report, element):
    return [(e["name"], e["verdict"]) for e in report["entries"] if e["element"] == element]


def theirs_end(mj, step, duration, start, control):
    """Where MuJoCo is at the end, in pliant's coordinates; constraints as stiff as the step allows."""
    mj.opt.timestep, mj.opt.integrator = step, mujoco.mjtIntegrator.mjINT_IMPLICIT
    mj.eq_solref[:, 0] = 2 * step
    data = mujoco.MjData(mj)
    data.qvel[:] = start
    data.ctrl[:] = control
    for _ in range(round(duration / step)):
        mujoco.mj_step(mj, data)
    return ours(mj, data.qpos), np.abs(data.efc_pos[: data.ne]).max()


def ours_run(text, scene, step, duration, start, control):
    model = pliant.loads(text.replace(f"step = {scene['time']['step']!r}", f"step = {step!r}"))
    x0 = model.initial_state()
    nq = model.nx - len(start) - len(model.memory_names)
    x0[nq : nq + len(start)] = start
    steps = round(duration / step)
    roll = model.rollout(
        x0, np.tile(control, (steps, 1)) if len(control) else model.controls(steps), record=False
    )
    return roll.x[:, :nq]


def test_loops_are_closed_where_mujoco_has_them():
    _, scene, report, mj = imported("four_bar.xml")
    pin, mount = scene["closure"]
    assert (pin["kind"], pin["body"], pin["to"]) == ("connect", "coupler", "rocker")
    assert (mount["kind"], mount["body"], mount["to"]) == ("weld", "coupler", "tool")
    # MuJoCo computes the second anchor of a connection; that of a weld is the file's, in the second body
    assert np.abs(np.array(pin["point"]) - mj.eq_data[0, :3]).max() < 1e-12
    assert np.abs(np.array(pin["to_point"]) - mj.eq_data[0, 3:6]).max() < 1e-12
    assert np.abs(np.array(mount["to_point"]) - mj.eq_data[1, :3]).max() < 1e-12
    assert verdicts(report, "connect") == [
        ("pin", "kept"),
        ("spare", "ignored"),
        ("footing", "ignored"),
    ]
    assert scene["time"]["integrator"] == "sdirk2"
    assert any(
        e["reason"].startswith("solref") or "solref" in e["reason"] for e in report["entries"]
    )
    assert np.abs(np.array(mount["point"]) - mj.eq_data[1, 3:6]).max() < 1e-12


def rotation(quaternion):
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quaternion, float))
    return flat.reshape(3, 3)


def test_a_loop_moves_as_in_mujoco():
    text, scene, _, mj = imported("four_bar.xml")
    start, duration = np.zeros(mj.nv), 0.3
    (coarse, _), (fine, open_there) = (
        theirs_end(mj, step, duration, start, []) for step in (1e-4, 5e-5)
    )
    expected = 2 * fine - coarse
    q = ours_run(text, scene, 0.0005, duration, start, [])
    error = np.abs(q[-1] - expected).max()
    moved = np.abs(q[-1] - q[0]).max()
    print(
        f"four_bar: error {error:.1e} of {moved:.2f}, MuJoCo's own change by half the step {np.abs(fine - coarse).max():.1e}"
    )
    assert moved > 0.3
    assert error < 2e-5
    # held a thousand times better than there
    model = pliant.loads(text)
    pin = scene["closure"][0]
    names = model.body_names
    worst = 0.0
    for state in q:
        positions, quaternions = model.body_poses(state)
        ends = []
        for body, point in ((pin["body"], pin["point"]), (pin["to"], pin["to_point"])):
            k = names.index(body)
            ends.append(positions[k] + rotation(quaternions[k]) @ np.array(point))
        worst = max(worst, np.linalg.norm(ends[0] - ends[1]))
    print(f"four_bar: open by {worst:.1e} m, MuJoCo's by {open_there:.1e}")
    assert worst < 1e-7


def test_gears_filters_and_limits_are_those_of_mujoco():
    _, scene, report, _ = imported("gears.xml")
    teeth, cam, brake = scene["coupling"]
    assert (teeth["joint"], teeth["to"], teeth["coefficients"]) == (
        "wheel_joint",
        "pinion_joint",
        [0.0, -0.5],
    )
    assert cam["coefficients"] == [0.0, 0.02, 0.03, -0.01]
    assert (brake["joint"], brake.get("to"), brake["coefficients"]) == ("clutch_joint", None, [0.0])
    said = [v for v in verdicts(report, "joint") if v[0] in ("teeth", "cam", "brake", "idle")]
    assert said == [("teeth", "kept"), ("cam", "kept"), ("brake", "kept"), ("idle", "ignored")]
    motor, lid, latch = scene["actuator"]
    # forcerange, and actuatorfrcrange over the gear
    assert motor["saturation"] == [-0.2, 0.125] and (motor["lag"], motor["start"]) == (0.02, 0.0)
    # forcerange and ctrlrange
    assert lid["saturation"] == [-0.15, 0.1]
    assert "saturation" not in latch and latch["lag"] == 0.05
    carried = {
        j["name"]: j.get("gravity_compensation") for b in scene["body"] for j in b.get("joint", [])
    }
    assert (carried["lid_joint"], carried["latch_joint"], carried["tether"]) == (0.8, 0.8, None)
    ignored = {e["name"]: e["reason"] for e in report["entries"] if e["verdict"] == "ignored"}
    assert "gravcomp 1" in ignored["balloon"]
    assert any(
        "keep them within" in e["reason"] for e in report["entries"] if e["name"] == "latch_servo"
    )


def test_gears_move_as_in_mujoco():
    """Teeth, cam, brake, filters, saturation and a balanced lid; without the balloon, whose weight is not carried here."""
    text, scene, _, mj = imported("gears.xml")
    mj.body_gravcomp[mj.body("balloon").id] = 0.0
    start = np.zeros(mj.nv)
    start[mj.joint("latch").dofadr[0]] = 0.4
    control, duration = np.array([0.6, 0.5, 0.7]), 0.3
    (coarse, _), (fine, _) = (
        theirs_end(mj, step, duration, start, control) for step in (1e-4, 5e-5)
    )
    expected = 2 * fine - coarse
    # Euler's error is proportional to its step too
    euler = text.replace('integrator = "sdirk2"', 'integrator = "euler"')
    rough, q = (
        ours_run(euler, scene, step, duration, start, control) for step in (0.0005, 0.00025)
    )
    error, moved = np.abs(2 * q[-1] - rough[-1] - expected).max(), np.abs(q[-1] - q[0])
    print(
        f"gears: error {error:.1e}, moved {moved}, MuJoCo's own change by half the step {np.abs(fine - coarse).max():.1e}"
    )
    assert moved[0] > 0.5 and moved[4] > 0.05 and moved[5] > 0.3
    assert error < 2e-5
    assert np.abs(q[:, 1] + 0.5 * q[:, 0]).max() < 1e-7 and np.abs(q[:, 3]).max() < 1e-7


SITES = """
<mujoco><default><default class="ends"><site pos="0.5 0 0"/></default></default>
<worldbody><site name="wall" pos="0 -0.2 0"/>
<body name="a"><joint name="j" axis="0 0 1"/><geom size=".1"/><site name="tip" class="ends"/></body>
<body name="b" pos="1 0 0" euler="0 0 90"><joint name="k" axis="0 0 1"/><geom size=".1"/>
  <frame pos="0 0.3 0"><site name="end" type="capsule" fromto="-0.1 0.2 0 0.1 0.2 0" size=".01"/></frame></body>
<body name="c" pos="0 -0.2 0.3"><joint name="l" axis="1 0 0" type="hinge"/><geom size=".1"/><site name="foot" pos="0 0 -0.3"/></body>
</worldbody><equality>{}</equality></mujoco>"""


@pytest.mark.parametrize(
    ("by_sites", "by_bodies"),
    [
        ('<connect site1="tip" site2="end"/>', '<connect body1="a" body2="b" anchor="0.5 0 0"/>'),
        ('<connect site1="wall" site2="foot"/>', '<connect body1="c" anchor="0 0 -0.3"/>'),
        ('<weld site1="foot" site2="wall"/>', '<weld body1="c" body2="world" anchor="0 -0.2 0"/>'),
    ],
)
def test_sites_that_meet_are_held_together(tmp_path, by_sites, by_bodies):
    """The same as with the bodies named, and where MuJoCo has the sites."""
    closures = []
    for inside in (by_sites, by_bodies):
        file = tmp_path / "model.xml"
        file.write_text(SITES.format(inside))
        closures.append(tomllib.loads(pliant.import_model(file)[0])["closure"][0])
    site, body = closures
    assert (site["kind"], site["body"], site.get("to")) == (body["kind"], body["body"], body.get("to"))
    assert np.allclose(site["point"], body["point"], atol=1e-15)
    assert np.allclose(site["to_point"], body["to_point"], atol=1e-15)
    mj = mujoco.MjModel.from_xml_string(SITES.format(by_sites))
    data = mujoco.MjData(mj)
    mujoco.mj_forward(mj, data)
    first = data.body(site["body"])
    place = first.xpos + first.xmat.reshape(3, 3) @ site["point"]
    assert np.abs(place - data.site(mj.eq_obj1id[0]).xpos).max() < 1e-12


def test_fingers_follow():
    _, scene, report, mj = imported("fingers.urdf")
    slide, thumb = scene["coupling"]
    assert (slide["joint"], slide["to"], slide["coefficients"]) == (
        "right_slide",
        "left_slide",
        [0.0, 1.0],
    )
    assert (thumb["joint"], thumb["to"], thumb["coefficients"]) == (
        "thumb_hinge",
        "wrist_turn",
        [0.2, -0.5],
    )
    assert np.abs(mj.eq_data[:, :2] - [[0.0, 1.0], [0.2, -0.5]]).max() < 1e-15
    # it starts where it follows to, which MuJoCo's does only after a while
    starts = {j["name"]: j.get("start") for b in scene["body"] for j in b.get("joint", [])}
    assert starts["thumb_hinge"] == [0.2]
    entries = [(e["line"], e["verdict"]) for e in report["entries"] if e["element"] == "mimic"]
    assert [v for _, v in entries] == ["kept", "kept", "approximated"]
    model = pliant.loads(pliant.import_model(MODELS / "fingers.urdf")[0])
    x = model.rollout(model.initial_state(), model.controls(100), record=False).x
    names = model.dof_names
    left, right = (x[:, names.index(n)] for n in ("left_slide", "right_slide"))
    assert np.abs(left - right).max() < 1e-8


EQUALITY = (
    '<mujoco>\n<worldbody>\n<body name="a"><joint name="j"/><geom size=".1"/><site name="s" pos=".5 0 0"/></body>\n'
    '<body name="b" pos="1 0 0"><joint name="k" type="ball"/><geom size=".1"/><site name="t" pos="-.3 0 0"/>'
    '<site name="v" pos="-.5 0 0" euler="0 0 5"/></body>\n</worldbody>\n<equality>\n{}\n</equality></mujoco>'
)


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ('<connect body1="a" body2="c" anchor="0 0 0"/>', r":7: connect: there is no body \"c\""),
        ('<connect body1="a" body2="b"/>', r":7: connect: `anchor` is missing"),
        (
            '<connect body1="a" body2="b" anchor="0 0 0" ancor="1"/>',
            r":7: connect: unknown attribute `ancor`(.|\n)*`anchor`",
        ),
        (
            '<weld body1="a" body2="b" relpose="1 0.1 0 1 0 0 0"/>',
            r":7: weld: a `relpose` that is not how(.|\n)*--approximate",
        ),
        ('<connect site1="s" site2="u"/>', r":7: connect: there is no site \"u\"(.|\n)*s, t, v"),
        ('<connect site1="s"/>', r":7: connect: `site2` is missing"),
        (
            '<connect site1="s" site2="t"/>',
            r":7: connect: a constraint between sites that are apart by 2\.000e-1 m(.|\n)*--approximate",
        ),
        (
            '<weld site1="s" site2="v"/>',
            r":7: weld: a constraint between sites that are apart by their axes(.|\n)*--approximate",
        ),
        (
            '<joint joint1="j" joint2="k"/>',
            r":7: joint: a coupling of such a joint(.|\n)*--approximate",
        ),
        ('<joint joint1="j" joint2="l"/>', r":7: joint: there is no joint \"l\""),
        ('<tendon tendon1="t"/>', r":7: tendon: an equality constraint(.|\n)*--approximate"),
    ],
)
def test_constraints_that_cannot_be_kept_are_refused(tmp_path, inside, words):
    file = tmp_path / "model.xml"
    file.write_text(EQUALITY.format(inside))
    with pytest.raises(pliant.InputError, match=words):
        pliant.import_model(file)


ARM = """<mujoco><option timestep="0.002"{option}/>{top}<worldbody>{world}<body name="arm" pos="0 0 1">{joint}
<geom name="g" type="capsule" size=".05" fromto="0 0 0 .3 0 0" contype="0" conaffinity="0"/>{inside}</body></worldbody>
<actuator>{actuator}</actuator></mujoco>"""
HINGE = '<joint name="j" axis="0 1 0" damping="0.5" frictionloss="0.2" range="-90 90"/>'


def arm(tmp_path, **parts):
    file = tmp_path / "arm.xml"
    defaults = {"option": "", "top": "", "world": "", "inside": "", "actuator": "", "joint": HINGE}
    file.write_text(ARM.format(**(defaults | parts)))
    return file


@pytest.mark.parametrize("integrator", ["euler", "sdirk2"])
def test_a_motor_holds_a_joint_with_friction_at_its_stop(tmp_path, integrator):
    """Stops take impacts without rebound (Euler), and what presses against them converges to the last digit of the coordinate."""
    file = arm(tmp_path, actuator='<motor name="m" joint="j" gear="20" ctrlrange="-1 1"/>')
    text = pliant.import_model(file)[0]
    assert 'integrator = "euler"' in text
    model = pliant.loads(text.replace('integrator = "euler"', f'integrator = "{integrator}"'))
    at_stop = 0
    for control in np.linspace(-1, 1, 12):
        run = model.rollout(model.initial_state(), np.full((600, 1), control), record=False)
        assert run.trace["retries"].sum() <= 3
        assert np.abs(run.x[:, 0]).max() < np.pi / 2 + 1e-9
        at_stop += abs(run.x[-1, 0]) > np.pi / 2 - 1e-6
    assert at_stop > 4


def test_stops_of_imported_models_do_not_rebound(tmp_path):
    joint = '<joint name="j" axis="0 1 0" range="-90 90"/>'
    file = arm(tmp_path, option=' gravity="0 0 0"', joint=joint)
    model = pliant.loads(pliant.import_model(file)[0])
    for k in range(10):
        start = np.array([np.pi / 2 - 0.1 - k * 0.0006, 3.0])
        end = model.rollout(start, np.zeros((100, 0)), record=False).x[-1]
        assert abs(end[1]) < 1e-3 * 3.0 and abs(end[0] - np.pi / 2) < 1e-4


def test_a_floor_that_nothing_can_touch_is_left_out(tmp_path):
    text, report = pliant.import_model(arm(tmp_path, world='<geom name="floor" type="plane" size="1 1 .1"/>'))
    assert "plane" not in tomllib.loads(text)
    assert any("no body has a shape" in e["reason"] for e in report["entries"] if e["verdict"] == "ignored")


def test_a_damping_ratio_is_of_the_inertia_that_yields(tmp_path):
    """MuJoCo computes it from 1/(M⁻¹)_jj."""
    lower = (
        '<body name="lower" pos=".3 0 0"><joint name="k" axis="0 1 0"/>'
        '<geom type="capsule" size=".04" fromto="0 0 0 .2 0 .1" contype="0" conaffinity="0"/></body>'
    )
    servo = '<position name="s" joint="j" kp="3" dampratio="0.5"/>'
    file = arm(tmp_path, inside=lower, actuator=servo, joint='<joint name="j" axis="0 1 0"/>')
    motor = tomllib.loads(pliant.import_model(file)[0])["actuator"][0]
    mj = mujoco.MjModel.from_xml_path(str(file))
    assert motor["damping"] == pytest.approx(-mj.actuator_biasprm[0, 2], rel=1e-9)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (
            {"actuator": '<motor name="m" joint="j" ctrllimited="true" ctrlrange="1 -1"/>'},
            r":3: motor \"m\": `ctrlrange` goes from 1 down to -1",
        ),
        ({"actuator": '<motor joint="j" forcelimited="true"/>'}, r":3: motor: `forcerange` is missing"),
        ({"joint": '<joint name="j" limited="true"/>'}, r":1: joint \"j\": `range` is missing"),
        (
            {"actuator": '<motor name="m" joint="j"/><motor name="m" joint="j"/>'},
            r':3: motor: the actuator "m" is there twice|"m"(.|\n)*line 3',
        ),
        ({"inside": '<geom name="g" size=".1" contype="0" conaffinity="0"/>'}, r'"g"(.|\n)*line 2'),
        ({"inside": '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="m"/>'}, r'there is no mesh "m"'),
        (
            {
                "top": '<asset><mesh name="m" file="no.stl"/></asset>',
                "inside": '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="m"/>',
            },
            r":2: geom(.|\n)*no\.stl",
        ),
        (
            {
                "top": '<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>',
                "actuator": '<motor name="m" tendon="t"/>',
            },
            r":3: motor \"m\": an actuator that is left out(.|\n)*on a tendon(.|\n)*--approximate",
        ),
        ({"option": ' density="1000"'}, r":1: option: `density` of the medium(.|\n)*--approximate"),
        (
            {"joint": '<joint type="free" damping="0.1"/>'},
            r":1: joint: the damping of a free joint(.|\n)*--approximate",
        ),
    ],
)
def test_what_would_be_another_model_is_refused(tmp_path, parts, words):
    with pytest.raises(pliant.InputError, match=words):
        pliant.import_model(arm(tmp_path, **parts))


def test_a_medium_is_kept_as_drag_at_the_centres_of_mass(tmp_path):
    """A cube that moves along an edge feels MuJoCo's drag times the areas' ratio: a quarter of its surface for one side."""
    file = tmp_path / "cube.xml"
    file.write_text(
        '<mujoco><option density="1000" viscosity="0.001" wind="1 0 0" gravity="0 0 0"/><worldbody><body name="cube"><freejoint/>'
        '<geom type="box" size="0.1 0.1 0.1" mass="2"/></body></worldbody></mujoco>'
    )
    text, report = pliant.import_model(file, approximate=True)
    air = tomllib.loads(text)["air"]
    assert air == {"wind": [1.0, 0.0, 0.0], "density": 1000.0, "viscosity": 0.001}
    said = [entry["reason"] for entry in report["entries"] if entry["verdict"] == "approximated" and entry["element"] == "option"]
    assert len(said) == 2 and all("centres of mass" in reason for reason in said)
    mj = mujoco.MjModel.from_xml_path(str(file))
    mj.opt.viscosity = 0.0
    data = mujoco.MjData(mj)
    mujoco.mj_forward(mj, data)
    step = 1e-6
    model = pliant.loads(text.replace("step = 0.002", f"step = {step}").replace("viscosity = 0.001", "viscosity = 0"))
    x = model.rollout(model.initial_state(), model.controls(1)).x
    assert (x[1, 7] - x[0, 7]) / step == pytest.approx(1.5 * data.qacc[0], rel=1e-3)
