"""The generators of cables and rods against pliant: what they hide is what pliant's law of that name does.

A setup's readings with a knob off are compared with pliant's own simulation at the true value, by a short step, and what remains of
the noise's σ [-] is bounded: units, signs and frames of every knob.
"""

from __future__ import annotations

import tomllib

import mujoco
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

pliant = pytest.importorskip("pliant")
from validation.blind import cable_setup, draw
from validation.blind.cable_setup import CableSetup
from validation.blind.system import Changes, Setup, turned

PART = 0.3  # of a knob's largest change
SHORT = 0.6  # s
# laws of joints and motors that a scene without them has no numbers for: knob -> entries
OPENED = {"load": ("load_friction = 0.0",), "creep": ("plastic_time = 1e9", "yield = 1e-7")}
OPENED |= {"late": ("delay = 0.05",), "lag": ("lag = 0.05",)}


def truths(setup: Setup, changes: Changes) -> dict[str, float]:
    """Values by pliant's paths."""
    paths = {setup.knobs[key].path: setup.knobs[key].true(x) for key, x in changes.items() if key in setup.knobs}
    return {path: x for path, x in paths.items() if path and not path.startswith(("sensor", "marker"))}


def opened(text: str, changes: Changes) -> str:
    """The scene with the laws that the changes need."""
    for key in changes:
        what, _, at = key.partition(":")
        for name in (at,) if at else cable_setup.MOTORS if what == "lag" else ():
            entries = OPENED.get(what, ())
            text = text.replace(f'name = "{name}"\n', "\n".join([f'name = "{name}"', *entries, ""]), 1)
    return text


# ---- Cables ----------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cable() -> CableSetup:
    setup = CableSetup(np.random.default_rng(700))
    setup.duration = SHORT
    setup.logged = [tuple(x[: round(SHORT * setup.rate) + 1] for x in own) for own in setup.logged]
    return setup


def cable_by_pliant(setup: CableSetup, changes: Changes, every: int = 16) -> np.ndarray:
    """Readings of the first record by pliant's midpoint rule, `every` steps a sample."""
    setup.substeps = every
    model = pliant.loads(opened(setup.scene({}, False), changes))
    true = truths(setup, changes)
    if (shared := true.pop("joint_*.stiffness", None)) is not None:
        true |= {f"{j}.stiffness": shared for j in cable_setup.BALLS}
    if (shared := true.pop("*.lag", None)) is not None:
        true |= {f"{m}.lag": shared for m in cable_setup.MOTORS}
    theta = model.theta_with(true)
    t, u = setup.logged[0]
    h = model.step_length
    told = np.stack([np.interp((np.arange(round(SHORT / h)) + 0.5) * h, t, x) for x in u.T], axis=1)
    x = model.rollout(model.equilibrium(u[0], theta).x, told, theta, record=False).x[:: every // 2, : 2 + 4 * cable_setup.LINKS]
    places = []
    for q in x:
        at, turns = model.body_poses(q)
        down = Rotation.from_quat(turns, scalar_first=True).apply([0.0, 0.0, -setup.link])
        places.append([(at + down)[1 + k] for k in cable_setup.MARKED])
    path = CubicSpline(np.arange(len(x)) * h * (every // 2), np.array(places), axis=0)
    return turned(path(np.maximum(t - changes.get("delay", 0.0), 0.0)), changes).reshape(len(t), -1)


def cable_knobs() -> list[str]:
    """Of the balls and links one in the middle and the last stand for all."""
    setup = CableSetup(np.random.default_rng(700))
    ends = tuple(f"_{k}" for k in (1, cable_setup.LINKS - 1))
    seen = [key for key, knob in setup.knobs.items() if knob.path]
    dry = ("friction", "stiction")  # by themselves, below
    return [k for k in seen if not k.startswith(dry) and ("joint_" not in k and "link_" not in k or k.endswith(ends))]


def test_a_cable_without_effect_moves_as_in_pliant(cable):
    error = cable.readings([(0, {})])[0] - cable_by_pliant(cable, {})
    assert np.abs(error).max() < 0.02 * cable.sigma


@pytest.mark.parametrize("key", cable_knobs())
def test_what_a_cable_hides_is_pliants_law(cable, key):
    size = PART * cable.knobs[key].largest
    hidden, plain = cable.readings([(0, {key: size}), (0, {})])
    error = hidden - plain - (cable_by_pliant(cable, {key: size}) - cable_by_pliant(cable, {}))
    effect = np.abs(hidden - plain).max()
    part = 0.2 if key.startswith("load") else 0.01  # friction by load is of first order in pliant's step
    assert np.abs(error).max() < part * effect, (effect / cable.sigma, np.abs(error).max() / cable.sigma)


def test_dry_friction_of_mujoco_is_that_which_does_not_fade(cable):
    """Pliant starts no slide that sticks with a cable on it, so that the two laws of the generator are compared."""
    size = PART * cable.knobs["friction:slide_y"].largest
    fading = {"stiction:slide_y": size, "speed:slide_y": 1e6}
    constraint, force, plain = cable.readings([(0, {"friction:slide_y": size}), (0, fading), (0, {})])
    assert np.abs(constraint - force).max() < 0.02 * np.abs(constraint - plain).max() and np.abs(constraint - plain).max() > cable.sigma


def test_a_hidden_mass_of_the_cable_is_not_in_the_scene(cable, tmp_path):
    """What a scene says is the nominal cable with a guess of the shared stiffness."""
    read = cable.readings([(r, {"mass:link_3": 0.01}) for r in range(4)])
    path = cable.write(tmp_path, read, {"joint_*.stiffness": 0.5}, True)
    scene = tomllib.loads(path.read_text(encoding="utf-8"))
    assert [b["mass"] for b in scene["body"][1:]] == [cable.mass] * cable_setup.LINKS
    assert {j["stiffness"] for b in scene["body"][1:] for j in b["joint"]} == {0.5}
    log = np.genfromtxt(tmp_path / "run1.csv", delimiter=",", names=True)
    assert np.allclose(log["m3_x"], read[0].reshape(len(log), -1, 3)[:, 2, 0], atol=1e-7)


def test_forces_leave_no_callback(cable):
    cable.readings([(0, {"drag": 0.01})])
    assert mujoco.get_mjcb_passive() is None


def test_a_motion_that_runs_away_has_no_readings(cable):
    assert cable_setup.through(np.arange(4.0), np.array([0.0, 1.0, np.nan, 2.0])) is None


def test_the_new_systems_are_drawn():
    systems = {system for system, _ in draw.plan(400, 700)}
    assert {"cable", "rod"} <= systems
    assert all(kind != "value" for system, kind in draw.plan(400, 700) if system in ("cable", "rod"))
