"""pliant's rods that twist against MuJoCo 4.0's discrete elastic rod with a hinge per edge (`validation.mujoco_rod`).

Both hold whole edges here, so that they have the same nodes, joints, masses and energies, and what remains is named:

* statics agree to where MuJoCo's relaxation is stopped and to what its held hinge gives way by (1e-4 of a joint's twist), also
  where the twist has pushed the rod out of its plane, which takes the right turn of what is carried along a bent rod;
* motion: MuJoCo's `discrete` is of first order in the step, pliant's midpoint of second. The gap is MuJoCo's own error: it halves
  with its step.
"""

import numpy as np
import pytest

pytest.importorskip("mujoco", minversion="4.0")
from validation import mujoco_rod, mujoco_rope
from validation.mujoco_rod import Twist, TwistingRod
from validation.mujoco_rope import Rope

pliant = pytest.importorskip("pliant")

DRAG = 2.0 * np.sqrt(9.81) * 0.05  # kg/(m·s): critical for a rope of 1 m and 0.05 kg/m


def turned(rope, twist, points, turn):
    """pliant's equilibrium with the last edge turned, followed from none: nodes (n, 3), and its energy [J]."""
    model = pliant.loads(mujoco_rod.scene(rope, twist, points, both=True))
    u, theta, q = model.controls(1)[0], model.theta, None
    for part in np.linspace(0.0, 1.0, 21):
        theta[model.param_index("last.roll")] = part * turn
        found = model.equilibrium(u, theta, guess=q)
        q = np.asarray(found.q)
    energy = model.rollout(found.x, u[None], theta, record=False).energy()[0]
    return q[: 3 * rope.nodes].reshape(-1, 3), energy


@pytest.mark.parametrize(("nodes", "turn"), [(11, 2.0), (21, 4.0)])
def test_a_twisted_arch_leaves_its_plane_alike(nodes, turn):
    rope, twist = Rope(nodes=nodes, stretch_stiffness=1e3, drag_linear=DRAG), Twist()
    points = mujoco_rod.between(rope, 0.7)
    theirs = TwistingRod(rope, twist, both=True, step=5e-3, damping=2e-6)
    theirs.start(points)
    theirs.turn(turn)
    ours, _ = turned(rope, twist, points, turn)
    assert np.abs(ours[:, 1]).max() > 0.01  # it does leave it
    # twelve digits of the moment, five of the hinge that holds it: 1e-5 of 20 mm
    np.testing.assert_allclose(theirs.settle(), ours, atol=1e-6)
    # the moment that holds the end is the slope of the least energy
    up, down = (turned(rope, twist, points, turn + by)[1] for by in (0.01, -0.01))
    assert theirs.torque() == pytest.approx((up - down) / 0.02, rel=1e-3)


def test_a_straight_rod_resists_with_gj_times_twist_over_length():
    rope, twist = Rope(nodes=9, stretch_stiffness=1e3, drag_linear=DRAG, gravity=0.0), Twist()
    theirs = TwistingRod(rope, twist, both=True, step=5e-3, damping=2e-6)
    theirs.start(mujoco_rope.straight(rope))
    theirs.turn(1.5)
    theirs.settle()
    # edges that are held do not twist: seven joints are left of the length
    assert theirs.torque() == pytest.approx(twist.stiffness * 1.5 / (7 * rope.edge), rel=1e-3)
    _, up = turned(rope, twist, mujoco_rope.straight(rope), 1.51)
    _, down = turned(rope, twist, mujoco_rope.straight(rope), 1.49)
    assert (up - down) / 0.02 == pytest.approx(twist.stiffness * 1.5 / (7 * rope.edge), rel=1e-8)


def test_twist_does_not_make_a_cantilever_sag():
    rope, twist = Rope(nodes=11, stretch_stiffness=1e3, bend_stiffness=0.05, drag_linear=DRAG), Twist()
    points = mujoco_rope.straight(rope)
    theirs = TwistingRod(rope, twist, both=False, step=5e-3, damping=2e-6)
    theirs.start(points, np.linspace(0.0, 4.0, rope.nodes - 1))  # unwinds from the free end
    model = pliant.loads(mujoco_rod.scene(rope, twist, points, both=False, initial=4.0))
    ours = np.asarray(model.equilibrium(model.controls(1)[0]).q)[: 3 * rope.nodes].reshape(-1, 3)
    assert ours[-1, 2] < -0.4
    np.testing.assert_allclose(theirs.settle(), ours, atol=1e-7)


def test_a_rod_that_unwinds_as_it_swings_differs_by_mujocos_step():
    rope, twist = Rope(nodes=11, stretch_stiffness=1e3, bend_stiffness=5e-3), Twist(inertia=2e-5)
    points, duration, turn = mujoco_rope.straight(rope), 0.4, 6.0
    model = pliant.loads(mujoco_rod.scene(rope, twist, points, both=False, step=1e-3, initial=turn))
    x = model.rollout(model.initial_state(), model.controls(400), record=False).x[-1]
    ours = x[: 3 * rope.nodes].reshape(-1, 3)
    assert np.abs(ours[:, 1]).max() > 9e-3  # the twist has pushed it sideways
    gaps = []
    for step in (1e-3, 5e-4, 2.5e-4):
        theirs = TwistingRod(rope, twist, both=False, step=step)
        theirs.start(points, np.linspace(0.0, turn, rope.nodes - 1))
        theirs.rod.advance(round(duration / step))
        gaps.append(np.abs(theirs.rod.positions() - ours).max())
    assert gaps[0] < 3e-3
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.1)
    assert gaps[1] / gaps[2] == pytest.approx(2.0, rel=0.1)
