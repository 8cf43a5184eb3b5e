"""pliant's rope against MuJoCo 4.0's one-dimensional flex rod.

The two discretize the same energies on the same nodes (`validation.mujoco_rope` says how they
are matched), so what remains is named, measured and, where it is an error of order h or 1/n,
shown to shrink as it should:

* statics agree to the settling tolerance: same energy, same lumped weights, no step error;
* motion: MuJoCo's `discrete` is first order in h, pliant's midpoint second. At h the gap is
  MuJoCo's own error; halving h halves it (9.0, 4.7, 2.4, 1.2, 0.6 mm at 4 … 0.25 ms after 0.5 s);
* a pinned edge (MuJoCo's clamp) begins the free rope one edge late: first order in 1/n, -16 % of
  the tip's drop at 11 nodes and -8 % at 21; pliant's end clamp is second order;
* MuJoCo's own edge constraint stretches: 3 % of the length at 21 nodes with its default
  impedance, growing with n², vanishing as the impedance goes to 1;
* equal node masses instead of Voronoi ones shift the weight: the end nodes are twice as heavy.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
pytest.importorskip("mujoco", minversion="4.0")
from validation import mujoco_rope as mj

G = 9.81  # m/s²
SAG_08 = 0.265438  # catenary of span / length 0.8: sag / L


def scene(rope, step, integrator, gripper, shape):
    """The TOML scene of `rope` with one or two `gripper` texts and an initial `shape`."""
    return f"""schema_version = 1
[time]
step = {step}
integrator = "{integrator}"
duration = 1.0
[gravity]
magnitude = {rope.gravity}
[[rope]]
name = "cable"
nodes = {rope.nodes}
length = {rope.length}
linear_density = {rope.linear_density}
stretch_stiffness = {rope.stretch_stiffness}
bend_stiffness = {rope.bend_stiffness}
radius = {rope.radius}
initial = {shape}
start = "as_given"
{gripper}
"""


def gripper(name, where):
    """A held gripper at `where`, e.g. `nodes = [0]` or `end = "first"`."""
    held = 'mode = "prescribed"\nmotion = { kind = "hold" }\n'
    return f'[[gripper]]\nname = "{name}"\nrope = "cable"\n{where}\n{held}'


STRAIGHT = '{ shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }'


def pliant_model(*args):
    """Load the scene; the test is skipped where the package is not built."""
    return pytest.importorskip("pliant").loads(scene(*args))


def pliant_positions(x, nodes):
    """Real nodes' positions from states (..., nx); a ghost comes first and is dropped."""
    x = np.asarray(x)
    q = x[..., : x.shape[-1] // 2]
    return q.reshape(*x.shape[:-1], -1, 3)[..., -nodes:, :]


def pliant_swing(rope, step, duration, where, integrator="midpoint"):
    """Node positions (records, nodes, 3) of the horizontal rope let go, once per step."""
    model = pliant_model(rope, step, integrator, gripper("hand", where), STRAIGHT)
    roll = model.rollout(model.initial_state(), model.controls(round(duration / step)))
    return pliant_positions(roll.x, rope.nodes)


def pliant_static(rope, grippers, guess):
    """Equilibrium positions (nodes, 3) from a guess of the real nodes' positions."""
    points = ", ".join(f"[{x:.17g}, {y:.17g}, {z:.17g}]" for x, y, z in guess)
    shape = f'{{ shape = "points", points = [{points}] }}'
    model = pliant_model(rope, 0.01, "midpoint", grippers, shape)
    q = np.asarray(model.equilibrium(model.controls(1)[0]).q)
    return q.reshape(-1, 3)[-rope.nodes :]


# MuJoCo's side alone: what the comparison rests on ---------------------------------------


def test_mujoco_catenary_is_second_order_with_springs():
    """Sag of the catenary: the polygon's error falls as 1/n² onto the stretch's own share.

    The mean strain H/EA ≈ 1.7 … 2.1e-4 lengthens the rope, and the sag answers threefold:
    the extrapolated error is 6e-4 ± the bending of EI 1e-7.
    """
    errors = []
    for nodes in (11, 21):
        rope = mj.Rope(nodes=nodes, bend_stiffness=1e-7, stretch_stiffness=1e3)
        shape = mj.hanging(rope, (0, 0, 0), (0.8, 0, 0), speed=1e-7)
        errors.append(-shape[:, 2].min() / SAG_08 - 1)
    assert errors[0] == pytest.approx(6.0e-3, rel=0.05)
    assert (4 * errors[1] - errors[0]) / 3 == pytest.approx(6e-4, abs=2e-4)


def test_mujoco_edge_constraint_stretches_with_n():
    """Default impedance: sag 3 % and 9 % too large at 11 and 21 nodes; at 0.9999 it is not."""

    def sag_error(nodes, solimp):
        rope = mj.Rope(nodes=nodes, bend_stiffness=1e-7)
        options = {"stretch": "equality", "solimp": solimp, "speed": 1e-7}
        return -mj.hanging(rope, (0, 0, 0), (0.8, 0, 0), **options)[:, 2].min() / SAG_08 - 1

    soft = [sag_error(nodes, "0.9 0.95 0.001") for nodes in (11, 21)]
    assert soft[0] == pytest.approx(0.030, abs=0.003)
    assert soft[1] == pytest.approx(0.088, abs=0.009)
    assert sag_error(21, "0.9999 0.9999 0.001") < 2.5e-3


def test_mujoco_pinned_edge_is_first_order_and_the_ghost_second():
    """Self-weight elastica, w L³ / EI = 4: tip drop 0.42516 L."""
    pinned, ghost = [], []
    for nodes in (11, 21):
        rope = mj.Rope(nodes=nodes, bend_stiffness=0.05 * G / 4, stretch_stiffness=1e3)
        for errors, options in ((pinned, {"ghost": False, "fixed": (0, 1)}), (ghost, {})):
            shape = mj.cantilever(rope, speed=1e-6, **options)
            errors.append(-shape[-1, 2] / 0.42516 - 1)
    assert pinned[0] / pinned[1] == pytest.approx(2, rel=0.1) and pinned[1] < -0.07
    assert ghost[0] / ghost[1] > 3 and 0 < ghost[1] < 2e-3


def test_mujoco_twist_hinges_do_not_change_a_straight_rope():
    """Isotropic section, straight at rest: bending does not see the twist angle."""
    rope = mj.Rope(nodes=8, stretch_stiffness=1e3)
    _, without = mj.swinging(rope, 0.3, every=150, step=2e-3)
    _, with_twist = mj.swinging(rope, 0.3, every=150, step=2e-3, twist=True)
    assert np.abs(with_twist - without).max() < 1e-12


# Against pliant --------------------------------------------------------------------------


def test_hanging_shape():
    """Both ends held, span 0.8 L: same energy, same weights, so the same polygon.

    Left over: MuJoCo still moves at 1e-7 m/s, a fraction of a micrometre from rest.
    """
    rope = mj.Rope(nodes=15, stretch_stiffness=1e3)
    theirs = mj.hanging(rope, (0, 0, 0), (0.8, 0, 0), speed=1e-7)
    held = gripper("left", "nodes = [0]") + gripper("right", "nodes = [-1]")
    ours = pliant_static(rope, held, mj.arch(rope, (0, 0, 0), (0.8, 0, 0)))
    assert np.abs(ours - theirs).max() < 1e-6


def test_clamped_cantilever():
    """End clamp: MuJoCo's auxiliary edge makes l_v (1 + 1e-4) l / 2, a relative 1e-4 of one
    stencil of ten; speed 1e-7 m/s left as above."""
    rope = mj.Rope(nodes=11, bend_stiffness=0.05 * G / 4, stretch_stiffness=1e3)
    theirs = mj.cantilever(rope, speed=1e-7)
    ours = pliant_static(rope, gripper("hand", 'end = "first"'), mj.straight(rope))
    assert np.abs(ours - theirs).max() < 5e-5


@pytest.mark.parametrize(
    ("where", "options"),
    [
        ("nodes = [0]", {}),
        ("nodes = [0, 1]", {"fixed": (0, 1)}),
        ('end = "first"', {"ghost": True}),
    ],
    ids=["pinned", "edge", "end-clamp"],
)
def test_swing_converges_to_pliant(where, options):
    """Half a second of the falling rope: MuJoCo's gap to pliant halves with its step.

    Its error is first order, 2.4 mm per ms of step for the pinned rope; pliant's midpoint at
    1 ms is second order and below 1e-4 m, so the extrapolated gap must vanish to that.
    """
    rope = mj.Rope(nodes=11, stretch_stiffness=1e3)
    ours = pliant_swing(rope, 1e-3, 0.5, where)[-1]
    ends = []
    for step in (1e-3, 5e-4, 2.5e-4):
        every = round(0.5 / step)
        ends.append(mj.swinging(rope, 0.5, every=every, step=step, **options)[1][-1])
    gaps = [np.abs(end - ours).max() for end in ends]
    assert gaps[0] < 4e-3
    assert gaps[0] / gaps[1] == pytest.approx(2, rel=0.1)
    assert gaps[1] / gaps[2] == pytest.approx(2, rel=0.1)
    assert np.abs(2 * ends[2] - ends[1] - ours).max() < 1e-4


def test_lumping_accounts_for_the_end_nodes():
    """MuJoCo's equal masses against Voronoi masses: the difference is the heavier end node.

    Every node weighs 1/n, so the tip is 2 (n-1)/n times as heavy as half an edge: after 0.4 s
    the gap is 20 mm at 11 nodes and 10 mm at 21, first order in 1/n; the step's share is 2 mm.
    """
    gaps = []
    for nodes in (11, 21):
        rope = mj.Rope(nodes=nodes, stretch_stiffness=1e3)
        ours = pliant_swing(rope, 2e-3, 0.4, "nodes = [0]")[-1]
        _, theirs = mj.swinging(rope, 0.4, every=800, step=5e-4, lumping="equal")
        gaps.append(np.abs(theirs[-1] - ours).max())
    assert 0.015 < gaps[0] < 0.025
    assert 1.5 < gaps[0] / gaps[1] < 2.5


def test_floor_stops_both_at_the_same_height():
    """A free rope laid flat 5 mm above the floor falls and rests on it.

    pliant rests at the radius plus 1e-9 m; MuJoCo's soft contact sinks by less than 0.3 mm
    and both keep the rope flat. Where it lands sideways, both stay within 1e-6 m of x = x0.
    """
    rope = mj.Rope(nodes=10, stretch_stiffness=1e3)
    floor, above = 0.0, rope.radius + 5e-3
    start = mj.straight(rope, start=(0, 0, above))
    options = {"fixed": (), "floor": floor, "step": 2e-3}
    _, theirs = mj.swinging(rope, 1.0, every=500, start=start, **options)
    shape = f'{{ shape = "straight", from = [0, 0, {above!r}], direction = [1, 0, 0] }}'
    plane = '[[plane]]\nname = "floor"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\nfriction = 0.5\n'
    model = pliant_model(rope, 2e-3, "euler", plane, shape)
    roll = model.rollout(model.initial_state(), model.controls(500))
    ours = pliant_positions(roll.x, rope.nodes)[-1]
    assert np.abs(ours[:, 2] - rope.radius).max() < 1e-7
    assert np.abs(theirs[-1][:, 2] - rope.radius).max() < 3e-4
    assert np.abs(ours[:, :2] - start[:, :2]).max() < 1e-6
    assert np.abs(theirs[-1][:, :2] - start[:, :2]).max() < 1e-6
