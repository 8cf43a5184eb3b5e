"""Scenes that nobody chose: pliant comes to their end, or says which step stopped it and why. And the judge of their energy."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from validation import robustness
from validation.random_bodies import random_bodies
from validation.random_scenes import random_scene

pliant = pytest.importorskip("pliant")

pytestmark = pytest.mark.long

SPEAKING = {"good", "grew", "stopped"}  # how a scene may end


def test_forty_random_scenes_end_or_say_why_not():
    outcomes = robustness.sweep(range(5000, 5040), jobs=2)
    silent = [o for o in outcomes if o.end not in SPEAKING]
    assert not silent, silent
    for o in outcomes:
        if o.end == "stopped":
            assert re.search(r"step \d+: .*(row \d+|gives|node|creates .* in `)", o.message), o
    bad = [o for o in outcomes if o.end != "good"]
    assert len(bad) <= 8, bad


def test_sixty_random_scenes_of_bodies_end_or_say_why_not():
    outcomes = robustness.sweep(range(7000, 7060), jobs=2, make=random_bodies)
    silent = [o for o in outcomes if o.end not in {"good", "stopped"}]
    assert not silent, silent
    bad = [o for o in outcomes if o.end != "good"]
    assert all(re.search(r"step \d+: ", o.message) for o in bad), bad
    assert len(bad) <= 6, bad


def test_scenes_are_the_same_for_the_same_seed_and_of_all_kinds():
    some = [random_scene(seed) for seed in range(60)]
    assert [s.text for s in some] == [random_scene(s.seed).text for s in some]
    assert {s.kind for s in some} == {"rope", "rod", "sheet", "chain"}
    assert any(s.moves for s in some) and any("on a box" in s.what for s in some)
    bodies = [random_bodies(seed) for seed in range(60)]
    assert [s.text for s in bodies] == [random_bodies(s.seed).text for s in bodies]
    assert {s.kind for s in bodies} == {"pile", "stack", "impact"}


LIFTED = """
schema_version = 1
[time]
step = 0.005
duration = 2.0
integrator = "euler"
[[rope]]
name = "it"
nodes = 6
length = 0.3
linear_density = 0.2
stretch_stiffness = 200.0
stretch_damping = 0.1
bend_stiffness = 1e-3
bend_damping = 1e-4
initial = { shape = "straight", from = [0.0, 0.0, 0.0], direction = [0.0, 0.0, -1.0] }
[[gripper]]
name = "hand"
rope = "it"
%s
motion = { kind = "line", velocity = [0.0, 0.0, 0.4] }
"""


HOLDS = ["nodes = [0]", 'end = "first"', 'nodes = [0]\nmode = "velocity"', 'end = "first"\nmode = "velocity"']


@pytest.mark.parametrize("hold", HOLDS)
def test_the_work_of_a_hand_is_what_it_lifts(hold):
    model = pliant.loads(LIFTED % hold)
    u = robustness.inputs(model, 400, True)
    roll = model.rollout(model.initial_state(), u, record=False)
    done = robustness.work(model, roll.x, u)
    # lifted by 0.4 m in the first second; a sudden start takes M v², of which half is motion
    mass = model.masses().sum()
    assert done[-1] == pytest.approx(mass * (9.81 * 0.4 + 0.4**2), rel=2e-3)
    assert np.all(done[201:] == done[201])
    assert roll.energy()[-1] - roll.energy()[0] <= done[-1]


def test_energy_without_a_cause_is_noticed():
    scene = next(s for s in map(random_scene, range(100)) if s.alone and not s.moves)
    model = pliant.loads(scene.text)
    roll = model.rollout(model.initial_state(), robustness.inputs(model, scene.steps, False), record=False)
    assert robustness.grown(model, scene, roll, None) is None
    more = 0.1 * (model.masses().sum() * 9.81 * scene.length + np.ptp(roll.energy()))
    louder = SimpleNamespace(x=roll.x, energy=lambda: roll.energy()[0] + np.linspace(0.0, more, len(roll.x)))
    assert "J at step" in robustness.grown(model, scene, louder, None)
    broken = SimpleNamespace(x=roll.x * np.nan, energy=roll.energy)
    assert robustness.grown(model, scene, broken, None) == "not finite"


def test_a_scene_that_does_not_end_is_stopped():
    assert robustness.run(43, limit=0.0).end == "hang"
