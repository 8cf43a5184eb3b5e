"""Plans and controllers: what they minimize, against formulas, `vjp`, NumPy and each other; wrong input; grasps and tubes.

Seeds of draws and disturbances are of development (60 000 and on); `python -m validation.control` has others.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

from validation.control import discovery, loops
from validation.control.tasks import make

ROOT = Path(__file__).resolve().parents[2]
SEED = 60_000
N = 8
GOAL = np.array([0.17, 0.01, -0.02])
INPUTS = 0.1  # factor of the inputs' residuals
ROPE = """schema_version = 1
[time]
step = 0.02
duration = 0.2
integrator = "euler"
[[rope]]
name = "rope"
nodes = 4
length = 0.15
linear_density = 0.02
stretch_stiffness = 5.0
bend_stiffness = 1e-4
drag_linear = 0.2
initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
[[gripper]]
name = "hand"
rope = "rope"
nodes = [0]
mode = "velocity"
"""
TASK = f"""schema_version = 1
steps = {N}
[[cost]]
kind = "nodes"
object = "rope"
nodes = [-1]
weight = 0.5
goal = [{GOAL.tolist()}]
[[cost]]
kind = "inputs"
inputs = ["hand.velocity.x", "hand.velocity.y", "hand.velocity.z"]
weight = {0.5 * INPUTS**2}
[[limit]]
kind = "inputs"
inputs = ["hand.velocity.z"]
lower = -3
upper = 3
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
stiffness = 1.0
[[actuator]]
name = "push"
joint = "slide"
kind = "torque"
"""


@pytest.fixture(scope="module")
def rope():
    """A rope of four nodes whose first one is driven; its last is to go to `GOAL`."""
    return pliant.loads(ROPE)


def tip(model) -> slice:
    """The last node's entries of the state."""
    return slice(3 * model.ropes["rope"].stop - 3, 3 * model.ropes["rope"].stop)


def cost_function(model):
    """½ |p − GOAL|² at the ends of steps and ½ |0.1 u|², with derivatives."""

    def evaluate(k, n, x, u):
        r, rows = [], 3 * (k > 0) + 3 * (u is not None)
        by_x, by_u = np.zeros((rows, model.ndx)), np.zeros((rows, model.nu))
        if k > 0:
            r += list(x[tip(model)] - GOAL)
            by_x[:3, tip(model)] = np.eye(3)
        if u is not None:
            by_u[len(r) :] = INPUTS * np.eye(3)
            r += list(INPUTS * u)
        return {"residuals": r, "residuals_by_x": by_x, "residuals_by_u": by_u}

    return evaluate


def cost(model, x, u) -> float:
    return 0.5 * float(np.sum((x[1:, tip(model)] - GOAL) ** 2) + np.sum((INPUTS * u) ** 2))


def gradient(model, roll) -> np.ndarray:
    """Of the cost by the inputs, by the rollout's vjp."""
    x_bar = np.zeros((len(roll) + 1, model.ndx))
    x_bar[1:, tip(model)] = roll.x[1:, tip(model)] - GOAL
    return roll.vjp(x_bar)[1] + INPUTS**2 * roll.u


def guess(seed=SEED) -> np.ndarray:
    return 0.05 * np.random.default_rng(seed).normal(size=(N, 3))


# Minimization


def test_a_linear_quadratic_problem_takes_one_step():
    """A cart on a spring; the optimum by least squares from the impulse responses."""
    model, steps = pliant.loads(CART), 20
    x0 = model.initial_state()

    def evaluate(k, n, x, u):
        r, by_x, by_u = [x[0] - 1.0], np.zeros((2, model.ndx)), np.zeros((2, 1))
        by_x[0, 0] = 1.0
        if u is None:
            return {"residuals": r, "residuals_by_x": by_x[:1]}
        by_u[1, 0] = INPUTS
        return {"residuals": [*r, INPUTS * u[0]], "residuals_by_x": by_x, "residuals_by_u": by_u}

    rest = model.rollout(x0, np.zeros((steps, 1)), record=False).x[:, 0]
    responses = [model.rollout(x0, np.eye(steps)[k][:, None], record=False).x[:, 0] - rest for k in range(steps)]
    j = np.vstack([np.column_stack(responses), INPUTS * np.eye(steps)])
    best = np.linalg.lstsq(j, np.concatenate([1.0 - rest, np.zeros(steps)]), rcond=None)[0]

    plan = pliant.plan(model, evaluate, x0, np.zeros((steps, 1)), tolerance=1e-10)
    assert plan.status == "converged" and not plan.surrogate
    assert sum(step["achieved"] > 0 for step in plan.steps) == 1
    assert plan.steps[0]["achieved"] == pytest.approx(plan.steps[0]["predicted"], rel=1e-9)
    np.testing.assert_allclose(plan.u[:, 0], best, atol=1e-9 * np.abs(best).max())


def test_bounds_bind_where_the_free_optimum_is_beyond_them():
    """The bounded optimum of the cart against projected gradients of the same least-squares problem."""
    from scipy.optimize import lsq_linear

    model, steps, most = pliant.loads(CART), 20, 2.0
    x0 = model.initial_state()
    plan = pliant.plan(
        model,
        lambda k, n, x, u: {"residuals": [x[0] - 1.0], "residuals_by_x": np.eye(model.ndx)[:1]}
        if u is None
        else {"residuals": [x[0] - 1.0, INPUTS * u[0]], "residuals_by_x": np.eye(2, model.ndx) * [[1], [0]], "residuals_by_u": [[0], [INPUTS]]},
        x0,
        np.zeros((steps, 1)),
        lower=[-most],
        upper=[most],
        tolerance=1e-12,
    )
    roll = model.rollout(x0, np.zeros((steps, 1)))
    rest, j, s = roll.x[:, 0], [np.zeros(steps)], np.zeros((model.ndx, steps))
    for k in range(steps):
        a, b, _ = roll.linearize(k)
        s = a @ s
        s[:, k] += b[:, 0]
        j.append(s[0].copy())
    rows = np.vstack([*j, INPUTS * np.eye(steps)])
    best = lsq_linear(rows, np.concatenate([1.0 - rest, np.zeros(steps)]), (-most, most), method="bvls", tol=1e-14).x
    np.testing.assert_allclose(plan.u[:, 0], best, atol=1e-8)
    assert (np.abs(np.abs(plan.u) - most) < 1e-12).any() and (np.abs(plan.u) < most - 1e-3).any()


def test_a_cost_that_is_no_sum_of_squares_is_minimized_from_its_slopes():
    """Sum of log cosh((x - 1)/0.2) along the cart's path, against SciPy's L-BFGS-B on the gradient by vjp."""
    from scipy.optimize import minimize

    model, steps, width = pliant.loads(CART), 20, 0.2
    x0 = model.initial_state()

    def of_x(x):
        away = (x - 1.0) / width
        return np.logaddexp(away, -away) - np.log(2.0), np.tanh(away) / width

    def evaluate(k, n, x, u):
        cost, slope = of_x(x[0])
        out = {"cost": cost, "cost_by_x": slope * np.eye(model.ndx)[0]}
        return out if u is None else {**out, "residuals": INPUTS * u, "residuals_by_u": [[INPUTS]]}

    def total(u):
        roll = model.rollout(x0, u.reshape(steps, 1))
        costs, slopes = of_x(roll.x[:, 0])
        x_bar = np.zeros((steps + 1, model.ndx))
        x_bar[:, 0] = slopes
        return costs.sum() + 0.5 * INPUTS**2 * (u @ u), roll.vjp(x_bar)[1].ravel() + INPUTS**2 * u

    bounds = {"lower": [-2.0], "upper": [2.0]}
    plan = pliant.plan(model, evaluate, x0, np.zeros((steps, 1)), iterations=100, tolerance=1e-9, **bounds)
    best = minimize(total, np.zeros(steps), jac=True, method="L-BFGS-B", bounds=[(-2.0, 2.0)] * steps, options={"ftol": 1e-14, "maxiter": 500})
    assert plan.cost == pytest.approx(total(plan.u.ravel())[0], rel=1e-12)
    assert plan.cost <= best.fun * (1 + 1e-6) and plan.steps[0]["cost"] > 1.05 * best.fun

    with pytest.raises(pliant.InputError, match="`cost_by_x` without `cost`"):
        pliant.plan(model, lambda k, n, x, u: {"cost_by_x": np.zeros(model.ndx)}, x0, np.zeros((steps, 1)))


def test_a_step_is_gauss_newtons_of_the_rollouts_jacobians(rope):
    x0, u0 = rope.initial_state(), guess()
    roll, s, rows = rope.rollout(x0, u0), np.zeros((rope.ndx, 3 * N)), []
    for k in range(N):
        a, b, _ = roll.linearize(k)
        s = a @ s
        s[:, 3 * k : 3 * k + 3] = b
        rows.append(s[tip(rope)].copy())
    j = np.vstack([*rows, INPUTS * np.eye(3 * N)])
    r = np.concatenate([(roll.x[1:, tip(rope)] - GOAL).ravel(), INPUTS * u0.ravel()])
    np.testing.assert_allclose((j.T @ r).reshape(N, 3), gradient(rope, roll), atol=1e-12)

    plan = pliant.plan(rope, cost_function(rope), x0, u0, iterations=1)
    (step,) = plan.steps
    assert step["damping"] == 0.0 and step["cost"] == pytest.approx(0.5 * r @ r, rel=1e-12)
    du = np.linalg.solve(j.T @ j, -j.T @ r)
    np.testing.assert_allclose(plan.u - u0, du.reshape(N, 3), atol=1e-10)
    assert step["predicted"] == pytest.approx(0.5 * r @ r - 0.5 * np.sum((r + j @ du) ** 2), rel=1e-9)
    assert step["achieved"] == pytest.approx(0.5 * r @ r - cost(rope, plan.rollout.x, plan.u), rel=1e-9)


def test_a_plan_is_stationary_by_vjp(rope):
    x0, u0 = rope.initial_state(), guess()
    plan = pliant.plan(rope, cost_function(rope), x0, u0, tolerance=1e-14)
    assert plan.status == "converged"
    assert np.abs(gradient(rope, plan.rollout)).max() < 1e-6 * np.abs(gradient(rope, rope.rollout(x0, u0))).max()
    assert plan.cost == pytest.approx(cost(rope, plan.rollout.x, plan.u), rel=1e-12)


def test_a_function_and_a_task_of_the_same_cost_give_the_same_plan(rope):
    task, x0, u0 = pliant.loads_task(TASK, scene=ROPE), rope.initial_state(), guess()
    by_task = task.plan(u0=u0, tolerance=1e-12)
    by_function = pliant.plan(rope, cost_function(rope), x0, u0, tolerance=1e-12)
    assert abs(by_task.cost - by_function.cost) < 1e-9 * by_task.cost
    np.testing.assert_allclose(by_task.u, by_function.u, atol=1e-9)
    value, violated = task.evaluate(by_function.rollout.x, by_function.u)
    assert value == pytest.approx(by_function.cost, rel=1e-12) and not violated


def test_derivatives_of_a_cost_may_come_from_jax(rope):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    rows = tip(rope)

    def residuals(x, u):
        bent = jax.numpy.sqrt(1e-4 + jax.numpy.sum((x[rows] - GOAL) ** 2))  # a distance, rounded off: not quadratic
        return jax.numpy.concatenate([bent[None], INPUTS * u])

    residuals = jax.jit(residuals)
    derivatives = jax.jit(jax.jacfwd(residuals, argnums=(0, 1)))

    def evaluate(k, n, x, u):
        u = np.zeros(3) if u is None else u
        by_x, by_u = derivatives(x, u)
        return {"residuals": residuals(x, u), "residuals_by_x": by_x, "residuals_by_u": by_u}

    x0, u0 = rope.initial_state(), guess()
    plan = pliant.plan(rope, evaluate, x0, u0, iterations=40, tolerance=1e-11)

    def whole(u):
        x = rope.rollout(x0, u, record=False).x
        return sum(0.5 * float(np.sum(residuals(x[k], u[k] if k < N else np.zeros(3)) ** 2)) for k in range(N + 1))

    assert plan.cost == pytest.approx(whole(plan.u), rel=1e-12)
    direction = np.random.default_rng(SEED).normal(size=u0.shape)
    slopes = [(whole(u + 1e-5 * direction) - whole(u - 1e-5 * direction)) / 2e-5 for u in (u0, plan.u)]
    assert abs(slopes[1]) < 1e-3 * abs(slopes[0])


def test_limits_hold_at_the_plans_end():
    """Above a plane that the free plan crosses."""
    limit = '\n[[limit]]\nkind = "above"\nobject = "rope"\nnodes = [-1]\nnormal = [0, 0, 1]\noffset = -0.002\nprice = 1000\n'
    free, kept = (pliant.loads_task(TASK + extra, scene=ROPE).plan(u0=guess()) for extra in ("", limit))
    heights = [plan.rollout.x[:, tip(plan_model)][:, 2].min() for plan, plan_model in ((free, pliant.loads(ROPE)), (kept, pliant.loads(ROPE)))]
    assert heights[0] < -0.01 and heights[1] >= -0.002 - 1e-9
    assert kept.cost > free.cost and not [v for v in kept.violations if v[1] > 1e-9]


# Wrong input


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("weight", "wieght", "(?s)cost.0..wieght.*did you mean `weight`"),
        ('object = "rope"', 'object = "rop"', '(?s)cost.0..object.*did you mean "rope"'),
        ('"nodes"', '"node"', '(?s)cost.0..kind.*did you mean "nodes"'),
        ("hand.velocity.z", "hand.velocity.w", '(?s)inputs.2.*did you mean "hand.velocity'),
        ("lower = -3", "lower = 4", "(?s)limit.0..*between 4 and inf"),
        ("nodes = [-1]", "nodes = [4]", "(?s)nodes.0..*between -4 and 3"),
        (f"steps = {N}", "steps = 0", "steps: is 0"),
        ("weight = 0.5", "weight = -0.5", "weight: is -0.5"),
        ("weight = 0.5", "weight = nan", "weight: is NaN"),
        (f"goal = [{GOAL.tolist()}]", f"goal = [{GOAL.tolist()}, [0, 0, 0]]", "goal: has 2 entries instead of 1"),
    ],
)
def test_wrong_task_files_say_where_and_what(old, new, said):
    assert old in TASK
    with pytest.raises(pliant.InputError, match=said) as error:
        pliant.loads_task(TASK.replace(old, new), scene=ROPE)
    assert str(error.value).startswith("task.toml:")


def test_a_task_file_that_is_not_there_or_has_no_scene(tmp_path):
    with pytest.raises(pliant.InputError, match=r"nothing\.toml: cannot be read"):
        pliant.load_task(tmp_path / "nothing.toml")
    with pytest.raises(pliant.InputError, match="key `scene` is missing"):
        pliant.loads_task(TASK)
    (tmp_path / "rope.toml").write_text(ROPE)
    (tmp_path / "task.toml").write_text(TASK.replace("steps", 'scene = "rope.toml"\nsteps', 1))
    assert pliant.load_task(tmp_path / "task.toml").model.nx == pliant.loads(ROPE).nx


@pytest.mark.parametrize(
    ("terms", "kind", "said"),
    [
        (lambda k: None, "InputError", "must return a dict"),
        (lambda k: {"residuals": [np.nan if k == 4 else 1.0]}, "NumericsError", "NaN at stage 4"),
        (lambda k: {"residuals": [1.0], "residuals_by_x": np.zeros((2, 24))}, "InputError", r"residuals_by_x has shape \(2, 24\)"),
        (lambda k: {"residuals": [1.0], "residuals_by_u": np.zeros((1, 4))}, "InputError", r"residuals_by_u has shape \(1, 4\)"),
        (lambda k: {"residuals": [1.0 / (k - 3)]}, "InputError", "ZeroDivisionError"),
    ],
)
def test_wrong_cost_functions_say_what_is_wrong(rope, terms, kind, said):
    assert rope.ndx == 24
    with pytest.raises(getattr(pliant, kind), match=said):
        pliant.plan(rope, lambda k, n, x, u: terms(k), rope.initial_state(), guess())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"x0": np.zeros(3)}, r"x0 has shape \(3,\)"),
        ({"u0": np.zeros((N, 2))}, r"u0 has shape \(8, 2\)"),
        ({"u0": np.full((N, 3), np.nan)}, "NaN"),
        ({"lower": np.zeros(2)}, r"lower has shape \(2,\)"),
        ({"lower": np.ones(3), "upper": -np.ones(3)}, "lower bound 1 above the upper bound -1"),
        ({"tolerance": -1.0}, "tolerance is -1"),
        ({"time_limit": -1.0}, "time_limit is -1 s"),
        ({"rest_gap": 0.0}, "rest_gap is 0 m"),
    ],
)
def test_wrong_arguments_of_plans(rope, arguments, said):
    given = {"x0": rope.initial_state(), "u0": guess()} | arguments
    with pytest.raises(pliant.InputError, match=said):
        pliant.plan(rope, cost_function(rope), **given)


def test_wrong_arguments_of_controllers(rope):
    task = pliant.loads_task(TASK, scene=ROPE)
    with pytest.raises(pliant.InputError, match="plan of 0 steps"):
        pliant.Mpc(rope, cost_function(rope), np.zeros((0, 3)))
    with pytest.raises(pliant.InputError, match="disturbance is -1 m"):
        task.mpc(guess(), disturbance=-1.0)
    with pytest.raises(pliant.InputError, match=r"disturbance has shape \(3, 3\)"):
        task.mpc(guess(), disturbance=np.zeros((3, 3)))
    mpc = task.mpc(guess())
    for name in ("u", "x", "cost", "penalty", "violations", "tightening", "switches", "steps", "status"):
        with pytest.raises(pliant.InputError, match="not been updated yet"):
            getattr(mpc, name)
    with pytest.raises(pliant.InputError, match=r"x has shape \(3,\)"):
        mpc.update(np.zeros(3))


# Ends of a search


def test_a_time_limit_returns_the_guess(rope):
    x0, u0 = rope.initial_state(), guess()
    plan = pliant.plan(rope, cost_function(rope), x0, u0, time_limit=1e-9)
    assert plan.status == "time" and not plan.steps
    assert np.array_equal(plan.u, u0) and plan.cost == pytest.approx(cost(rope, rope.rollout(x0, u0).x, u0), rel=1e-12)
    assert pliant.plan(rope, cost_function(rope), x0, u0, iterations=2).status == "iterations"


def test_a_controller_goes_on_from_its_shifted_plan():
    """In closed loop without disturbances its states are the plant's, and the cart comes near its goal, where the spring pulls."""
    model = pliant.loads(CART)

    def evaluate(k, n, x, u):
        if u is None:
            return {"residuals": [x[0] - 1.0], "residuals_by_x": [[1, 0]]}
        return {"residuals": [x[0] - 1.0, 0.01 * u[0]], "residuals_by_x": [[1, 0], [0, 0]], "residuals_by_u": [[0], [0.01]]}

    mpc, x = pliant.Mpc(model, evaluate, np.zeros((20, 1)), lower=[-3.0], upper=[3.0]), model.initial_state()
    first = None
    for _ in range(120):
        u = mpc.update(x)
        assert np.array_equal(u, mpc.u[0]) and np.abs(u).max() <= 3.0 and np.array_equal(mpc.x[0], x)
        x = model.step(x, u)
        np.testing.assert_allclose(x, mpc.x[1], atol=1e-12)
        first = first or mpc.cost
    assert mpc.cost < 1e-3 * first
    assert abs(x[0] - 1.0) < 0.01 and abs(x[1]) < 0.01


# Grasps, tubes, samples


def test_a_rope_is_found_by_the_value_of_holding_and_not_without():
    task = make("LiftRope", SEED).load()
    begun = {}
    for holding in (True, False):
        mpc, x = task.mpc(np.clip(np.zeros((20, 8)), *task.bounds), holding=holding), task.x0
        for _ in range(25):
            x = task.model.step(x, mpc.update(x))
        begun[holding] = discovery.held(task.model, x)
    assert begun == {True: 2, False: 0}


def test_a_rope_is_seized_where_it_is_worth_most():
    """From above the ends of a soft rope the hands go to nodes beside them, at their full speed, and seize those."""
    task = make("LiftRope", SEED).load()
    model, x = task.model, task.x0
    mpc = task.mpc(np.clip(np.zeros((20, 8)), *task.bounds))
    for _ in range(18):
        x = model.step(x, mpc.update(x))
    assert discovery.held(model, x) == 2
    z = dict(zip(model.memory_names, x[-len(model.memory_names) :]))
    left, right = (z[f"{hand}.held"] - 1 + z[f"{hand}.held_weight[1]"] for hand in ("left", "right"))
    assert 1.5 < left < 3.5 and 16.5 < right < 18.5


def test_the_rows_of_a_first_plan_are_its_horizon():
    task = make("LiftRope", SEED).load()
    with pytest.raises(pliant.InputError, match="u0 has 5 rows, but 20 steps are to be planned"):
        task.mpc(np.zeros((5, 8)), horizon=20)


@pytest.mark.long
def test_tubes_keep_a_disturbed_rope_outside_of_a_post():
    """60 steps of DragRope; the nominal controller cuts into the post with the same disturbances."""
    clearance = {}
    for tubes in (False, True):
        instance = make("DragRope", SEED)
        task = instance.load()
        outcome = loops.run(instance, loops.gradient(task, None, 20, tubes), task, None, 60, np.random.default_rng(SEED))
        clearance[tubes] = outcome.clearance
    assert clearance[False] < -5e-6 and clearance[True] >= 0.0


SAMPLES = """
import sys
import numpy as np, pliant
task = pliant.loads_task(sys.argv[1], scene=sys.argv[2])
mppi = task.mppi(np.zeros((8, 3)), np.full(3, 0.3), samples=64, temperature=1e-3, seed=int(sys.argv[3]))
x = task.x0
for _ in range(5):
    x = task.model.step(x, mppi.update(x))
print(x.tobytes().hex())
"""


def test_samples_depend_on_the_seed_and_not_on_threads():
    def run(threads, seed):
        environment = os.environ | {"RAYON_NUM_THREADS": str(threads)}
        command = [sys.executable, "-c", SAMPLES, TASK, ROPE, str(seed)]
        return subprocess.run(command, env=environment, cwd=ROOT, check=True, capture_output=True, text=True).stdout

    assert run(1, 3) == run(2, 3) != run(1, 4)


def test_samples_lower_the_cost():
    """From rest, in closed loop: nearer to the goal than without inputs."""
    task = pliant.loads_task(TASK, scene=ROPE)
    mppi, x, still = task.mppi(np.zeros((N, 3)), np.full(3, 0.3), samples=128, temperature=1e-4, seed=SEED), task.x0, task.x0
    total = {"mppi": 0.0, "still": 0.0}
    for _ in range(30):
        u = mppi.update(x)
        x, still = task.model.step(x, u), task.model.step(still, np.zeros(3))
        total["mppi"] += 0.5 * float(np.sum((x[tip(task.model)] - GOAL) ** 2) + np.sum((INPUTS * u) ** 2))
        total["still"] += 0.5 * float(np.sum((still[tip(task.model)] - GOAL) ** 2))
    assert total["mppi"] < 0.8 * total["still"]


def test_a_controller_recovers_from_refused_steps():
    """Damping that grew while no step helped does not end the search for ever."""
    model, wrong = pliant.loads(CART), True

    def cost(k, n, x, u):
        slope = -1.0 if wrong else 1.0
        if u is None:
            return {"residuals": [x[0] - 1], "residuals_by_x": [[slope, 0]]}
        by_x = [[slope, 0], [0, 0]]
        return {"residuals": [x[0] - 1, 0.01 * u[0]], "residuals_by_x": by_x, "residuals_by_u": [[0], [0.01]]}

    mpc, x = pliant.Mpc(model, cost, np.zeros((20, 1)), lower=[-3.0], upper=[3.0]), model.initial_state()
    status = []
    for k in range(25):
        wrong = k < 3
        mpc.update(x)
        status.append(mpc.status)
    assert status[0] == "stalled", status
    wrong = False
    fresh = pliant.plan(model, cost, x, np.zeros((20, 1)), lower=[-3.0], upper=[3.0])
    assert mpc.steps[-1]["damping"] == 0
    assert abs(mpc.cost - fresh.cost) < 1e-3 * fresh.cost, (mpc.cost, fresh.cost)


@pytest.mark.parametrize(
    ("returned", "says"),
    [
        ({"residual": [1.0]}, "unknown key `residual`"),
        ({"residuals_by_x": [[0, 0]]}, "`residuals_by_x` without `residuals`"),
        ({"residuals": [1.0], "constraints": [1.0], "price": -1.0}, "price of constraint 0 is -1"),
    ],
)
def test_what_a_cost_function_may_return(returned, says):
    model = pliant.loads(CART)
    with pytest.raises(pliant.InputError, match=says):
        pliant.plan(model, lambda k, n, x, u: returned, model.initial_state(), np.zeros((3, 1)))


def test_a_cost_that_is_no_function_is_refused():
    model = pliant.loads(CART)
    with pytest.raises(pliant.InputError, match="must be a function"):
        pliant.Mpc(model, "x", np.zeros((3, 1)))


def test_gains_of_each_disturbance_differ_from_shared_ones():
    """Where a constraint holds the plan back, its multiplier weighs the gains."""
    instance = make("DragRope", 0)
    widths = {}
    for tube in ("exact", "shared"):
        task = instance.load()
        mpc, x = task.mpc(np.zeros((task.horizon, task.model.nu)), disturbance=1e-3, tube=tube), task.x0
        for _ in range(8):
            x = task.model.step(x, mpc.update(x))
        widths[tube] = mpc.tightening
    assert widths["exact"] > 0 and widths["shared"] > 0
    assert abs(widths["exact"] - widths["shared"]) > 1e-6 * widths["shared"], widths
    with pytest.raises(pliant.InputError, match='tube is "none"'):
        task.mpc(tube="none")
    with pytest.raises(pliant.InputError, match=r"sigma\[0\] is -1"):
        task.mppi(np.zeros((20, 4)), [-1.0, 0.1, 0.1, 0.0])
