"""Piles, stacks and pushes beside MuJoCo: energy, rest, penetration, heights and ways (validation/bodies/piles.py)."""

import math

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")
pytest.importorskip("mujoco")

from validation.bodies.contact import Free, G, Solid
from validation.bodies.piles import FRICTION, Judge, World, mujoco_pushes, pile, push, pushed, pushed_way, stack

SEEDS = range(6)
ROUND = ("sphere", "capsule")
WITH_BOXES = ("sphere", "capsule", "box")


@pytest.fixture(scope="module")
def piles():
    """(world, pliant's motion, MuJoCo's) of each seed."""
    judges = [Judge(pile(seed, WITH_BOXES)) for seed in SEEDS]
    return [(judge.world, judge.pliant(), judge.mujoco()) for judge in judges]


def test_piles_gain_no_energy_and_come_to_rest(piles):
    for _, ours, theirs in piles:
        start = ours.energy[0]
        assert theirs.energy[0] == pytest.approx(start, rel=1e-12)
        for motion in (ours, theirs):
            assert motion.energy.max() <= start * (1.0 + 1e-12)  # kinetic energy never above the work of weight
            assert motion.kinetic.max() > 0.2 * start  # they fell
        assert np.maximum(np.diff(ours.energy), 0.0).sum() < 1e-4 * start
        # MuJoCo's elliptic friction creeps, and some of its bodies rock
        assert ours.kinetic[-1] < 1e-8 and theirs.kinetic[-1] < 1e-3 * start


def test_piles_do_not_overlap(piles):
    """Contact is found between features that are near as a step begins: fast ones may enter by a part of a step's way, for a while."""
    for world, ours, theirs in piles:
        way = world.step * math.sqrt(2.0 * G * max(body.position[2] for body in world.bodies))
        assert ours.depth.max() < 0.2 * way
        assert ours.depth[-1] < 1e-6 < theirs.depth[-1]  # MuJoCo's bodies rest on springs


def test_piles_rest_as_high_as_those_of_mujoco(piles):
    """Single piles end differently in the two engines, by 6 % (12 seeds); their mean is less uncertain, by the root of their number."""
    ratios = np.array([ours.energy[-1] / theirs.energy[-1] for _, ours, theirs in piles])
    scatter = 0.06
    assert np.abs(ratios - 1.0).max() < 4.0 * scatter
    assert abs(ratios.mean() - 1.0) < 3.0 * scatter / math.sqrt(len(ratios))


def test_round_piles_overlap_less_in_shorter_steps():
    """Spheres and capsules: the chord of a step's way, of second order in it."""
    for seed in SEEDS:
        deepest = Judge(pile(seed, ROUND, 0.002)).pliant().depth.max()
        assert deepest < 1e-4


STACKS = [("box", "cylinder", "box"), ("box", "box", "box", "box"), ("cylinder", "cylinder", "cylinder")]


@pytest.mark.parametrize("kinds", STACKS, ids="-".join)
def test_stacks_stand_as_high_as_they_are(kinds):
    judge = Judge(stack(kinds))
    ours, theirs = judge.pliant(), judge.mujoco()
    heights = 0.04 + 0.08 * np.arange(len(kinds))
    # each level hovers at as many rest gaps as points carry it, 8 on a rim
    assert np.all(ours.centers[-1, :, 2] - heights > 0.0) and np.all(ours.centers[-1, :, 2] - heights < 1e-7)
    assert np.abs(theirs.centers[-1, :, 2] - heights).max() < 1e-3  # sunk into its springs
    for motion in (ours, theirs):
        assert np.abs(motion.centers[-1, :, :2] - motion.centers[0, :, :2]).max() < 1e-4
        assert motion.kinetic[-1] < 1e-6 and motion.energy.max() <= motion.energy[0] * (1.0 + 1e-9)
    assert ours.depth.max() == 0.0


def test_a_pushed_box_goes_as_far_as_friction_lets_it():
    """At the centre the way is known; the ball's command is held over a step, which leaves an error of first order."""
    exact = pushed_way()
    errors = [pushed(Judge(push(0.0, h)).pliant())[0] - exact for h in (4e-3, 2e-3, 1e-3)]
    assert max(map(abs, errors)) < 2e-4 * exact
    theirs = mujoco_pushes(0.0)
    assert np.median(theirs[:, 0]) == pytest.approx(exact, rel=0.01)
    # it slides on alone from where the ball brakes harder than friction: without that it would go less far
    assert exact > 1.05 * (2.0 * 0.8 * 0.3 / math.pi)


def test_a_box_pushed_beside_its_centre_turns_as_that_of_mujoco():
    """MuJoCo's own results over steps and springs spread by 2 % of the way and 10 % of the angle; its median is compared."""
    ours, theirs = pushed(Judge(push(0.02)).pliant()), mujoco_pushes(0.02)
    x, y, angle = np.median(theirs, axis=0)
    assert ours[0] == pytest.approx(x, rel=0.01) and ours[2] == pytest.approx(angle, rel=0.02)
    assert ours[1] == pytest.approx(y, rel=0.1)


# ---- Known limits: each of these fails today -------------------------------------------------------------------------


def test_a_box_stands_on_a_cylinder_that_its_corners_overhang():
    cylinder, box = Solid("cylinder", (0.034, 0.04)), Solid("box", (0.026, 0.026, 0.04))
    bodies = [Free("low", cylinder, (0.0, 0.0, 0.041), friction=FRICTION), Free("high", box, (0.002, 0.0, 0.122), friction=FRICTION)]
    ours = Judge(World(bodies, duration=0.5)).pliant()
    assert ours.centers[-1, 1, 2] == pytest.approx(0.12, abs=1e-6)


@pytest.mark.xfail(strict=True, raises=AssertionError, reason="features are chosen where a step begins: tumbling boxes enter each other")
def test_boxes_that_tumble_at_4_ms_do_not_stay_in_each_other():
    assert Judge(pile(1, ("box",), 0.004)).pliant().depth[-1] < 1e-3


def test_cylinders_and_capsules_do_not_rest_in_each_other():
    assert Judge(pile(2, ("sphere", "capsule", "cylinder"), 0.001)).pliant().depth[-1] < 1e-3
