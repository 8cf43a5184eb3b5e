"""Controllers of readings: sensors, estimates and tubes from Python; what the Rust tests have is not repeated."""

from collections import deque

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

from validation.control import loops
from validation.control.tasks import make

SEED = 60_000
ROPE = """schema_version = 1
[time]
step = 0.05
duration = 1.0
integrator = "quasi_static"
[[rope]]
name = "rope"
nodes = 4
length = 0.15
linear_density = 0.05
stretch_stiffness = 50.0
bend_stiffness = 1e-4
initial = { shape = "straight", from = [0, 0, 0], direction = [0, 0, -1] }
[[gripper]]
name = "hand"
rope = "rope"
nodes = [0]
mode = "velocity"
"""
TASK = """schema_version = 1
steps = 12
horizon = 6
[[cost]]
kind = "nodes"
object = "rope"
nodes = [-1]
goal = [[0.1, 0, -0.15]]
[[cost]]
kind = "inputs"
inputs = ["hand.velocity.x", "hand.velocity.y", "hand.velocity.z"]
weight = 0.001
[[limit]]
kind = "above"
object = "rope"
nodes = [-1]
normal = [-1, 0, 0]
offset = -0.03
[sensing]
delay = 2
initial = 0.002
sensor = [{ kind = "nodes", object = "rope", nodes = [0, -1], noise = 0.001 }]
"""
CART = """schema_version = 1
[time]
step = 0.05
duration = 1.0
integrator = "euler"
[gravity]
magnitude = 0.0
[[body]]
name = "cart"
mass = 2.0
inertia = [0.01, 0.01, 0.01, 0, 0, 0]
[[body.joint]]
name = "slide"
kind = "prismatic"
axis = [1, 0, 0]
start = [0.5]
damping = 0.3
[[actuator]]
name = "push"
joint = "slide"
kind = "torque"
"""


def test_a_tasks_sensors_are_those_of_its_file():
    task = pliant.loads_task(TASK, scene=ROPE)
    sensing = task.sensing
    assert sensing.delay == 2 and np.array_equal(sensing.noise, np.full(6, 1e-3))
    assert np.array_equal(sensing.read(task.x0), task.x0[[0, 1, 2, 9, 10, 11]])
    assert pliant.loads_task(TASK[: TASK.index("[sensing]")], scene=ROPE).sensing is None
    same = pliant.Sensing(task.model, [0, 3], 1e-3, delay=2)
    assert np.array_equal(same.read(task.x0), sensing.read(task.x0)) and repr(same) == repr(sensing)


def closed(task, tube, steps=30) -> float:
    """How far the last node goes beyond its limit, with noise and disturbances."""
    rng, sensing = np.random.default_rng(SEED), task.sensing
    mpc = task.mpc(np.zeros((6, 3)), disturbance=5e-4, initial=2e-3, sensing=sensing, tube=tube)
    x, seen, beyond = task.x0, deque(), -np.inf
    for _ in range(steps):
        seen.append(sensing.read(x) + sensing.noise * rng.normal(size=6))
        x = task.model.step(x, mpc.update(seen.popleft() if len(seen) > 2 else None))
        w = rng.normal(size=9)
        dx = np.zeros(task.model.ndx)
        dx[3:12] = 5e-4 * w / np.linalg.norm(w)
        x = task.model.displaced(x, dx)
        beyond = max(beyond, x[9] - 0.03)
    assert (mpc.tightening > 0) == (tube is not None)
    return beyond


def test_tubes_of_readings_keep_a_limit_that_the_nominal_plan_crosses():
    task = pliant.loads_task(TASK, scene=ROPE)
    assert closed(task, None) > 1e-4
    assert closed(task, "exact") <= 0.0
    assert closed(task, "shared") <= 0.0


def test_a_function_and_joints():
    """A cart whose place is read with noise comes to its goal; its speed is estimated."""
    model = pliant.loads(CART)
    sensing = pliant.Sensing(model, [], joints=["slide"], joint_noise=0.01, delay=1)
    assert np.array_equal(sensing.read(model.initial_state()), [0.5])

    def evaluate(k, n, x, u):
        if u is None:
            return {"residuals": [x[0] - 1.0], "residuals_by_x": [[1, 0]]}
        return {"residuals": [x[0] - 1.0, 0.01 * u[0]], "residuals_by_x": [[1, 0], [0, 0]], "residuals_by_u": [[0], [0.01]]}

    process = np.diag([1e-4, 1e-3])
    mpc = pliant.Mpc(model, evaluate, np.zeros((20, 1)), lower=[-3.0], upper=[3.0], disturbance=process, sensing=sensing, tube=None)
    x, last, rng = model.initial_state(), None, np.random.default_rng(SEED)
    for _ in range(120):
        now = sensing.read(x) + sensing.noise * rng.normal(size=1)
        u = np.clip(mpc.update(last), -1.0, 1.0)
        mpc.sent(u)
        last, x = now, model.step(x, u)
    assert abs(x[0] - 1.0) < 0.02


def test_a_gripper_is_known_to_hold_what_it_holds():
    """LiftRope with readings two steps late: both hands seize, and what they hold is lifted as with the state."""
    instance = make("LiftRope", SEED)
    task = instance.load()
    outcome = loops.run(instance, loops.reading(task, None, 20, SEED, False), task, None, 70, np.random.default_rng(SEED))
    assert outcome.error < 0.15  # 0.08 at best, 0.5 with the rope on the floor


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("noise = 0.001", "noise = -1", r"sensing.sensor\[0\].noise: is -1"),
        ('object = "rope", nodes = [0, -1]', 'object = "rop", nodes = [0, -1]', r'(?s)sensing.sensor\[0\].object.*did you mean "rope"'),
        ("nodes = [0, -1], noise", "nodes = [7], noise", r"(?s)sensing.sensor\[0\].nodes\[0\].*between -4 and 3"),
        ("initial = 0.002", "initial = -1", "sensing.initial: is -1"),
        ("delay = 2", "delay = -2", "(?s)sensing.delay"),
        ("delay = 2", "dealy = 2", "(?s)did you mean `delay`"),
        ("horizon = 6", "horizon = 13", "(?s)horizon.*between 1 and 12"),
    ],
)
def test_wrong_sensing_of_a_task(old, new, said):
    assert old in TASK
    with pytest.raises(pliant.InputError, match=said):
        pliant.loads_task(TASK.replace(old, new), scene=ROPE)


def test_wrong_arguments_say_what_to_give():
    task = pliant.loads_task(TASK, scene=ROPE)
    with pytest.raises(pliant.InputError, match=r"u0 has 5 rows, but 6 steps are to be planned.*change `horizon`"):
        task.mpc(np.zeros((5, 3)))
    with pytest.raises(pliant.InputError, match=r"u0 has 6 rows, but 8 steps"):
        task.mpc(np.zeros((6, 3)), horizon=8)
    with pytest.raises(pliant.InputError, match=r"u0 has 5 rows, but 12 steps are to be planned.*`steps` of the task"):
        task.plan(u0=np.zeros((5, 3)))
    with pytest.raises(pliant.InputError, match="plan of 0 steps"):
        task.mpc(horizon=0)
    with pytest.raises(pliant.InputError, match="rest_gap is -1 m"):
        task.mpc(rest_gap=-1.0)
    with pytest.raises(pliant.InputError, match=r"nodes\[1\] is 4, but the model has the nodes 0 to 3"):
        pliant.Sensing(task.model, [0, 4])
    with pytest.raises(pliant.InputError, match='joint of one coordinate "slide"'):
        pliant.Sensing(task.model, joints=["slide"])
    with pytest.raises(pliant.InputError, match="noise is -1"):
        pliant.Sensing(task.model, noise=-1.0)
    mpc = task.mpc(sensing=task.sensing)
    with pytest.raises(pliant.InputError, match=r"the reading has shape \(5,\)"):
        mpc.update(np.zeros(5))
    with pytest.raises(pliant.InputError, match="that of the start comes at step 2: give none before"):
        mpc.update(np.zeros(6))
    with pytest.raises(pliant.InputError, match="needs the state"):
        task.mpc().update()


def test_contact_may_be_felt_at_a_distance():
    """A controller with `rest_gap` takes steps with these derivatives, and says so."""
    instance = make("LiftRope", SEED)
    task = instance.load()
    mpc = task.mpc(np.zeros((20, 8)), rest_gap=1e-3)
    mpc.update(task.x0)
    assert mpc.steps[0]["rest_gap"] == 1e-3
