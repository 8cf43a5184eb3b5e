"""The Python package: names, shapes, derivatives, errors, batches, checkpoints."""

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "tests" / "scenes").glob("*.toml"))


def load(name):
    """The model of tests/scenes/<name>.toml."""
    return pliant.load(ROOT / "tests" / "scenes" / f"{name}.toml")


def run(model, steps=8, **options):
    """The scene's own rollout, shortened."""
    return model.rollout(model.initial_state(), model.controls(steps), **options)


def weights(roll, seed=0):
    """A random cotangent of all states; a ball's quaternion changes by three numbers."""
    ndx = roll.linearize(0)[0].shape[0]
    return np.random.default_rng(seed).normal(size=(len(roll.x), ndx))


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_shapes(path):
    model = pliant.load(str(path))
    roll = run(model, 3)
    nx, ndx, nu, n_params = model.nx, model.ndx, model.nu, model.n_params
    # reference axes of rods are numbers of the state, but a change of one has none of them
    axes = [name for name in model.memory_names if ".axis." in name or name.endswith(".reference_twist")]
    twists = len(model.material_axes(roll.x[0]))
    joints = 2 * len(model.dof_names) + len(model.memory_names) - len(axes)
    assert ndx == 6 * model.n_nodes + 2 * twists + joints and len(roll) == 3
    assert roll.x.shape == (4, nx) and roll.u.shape == (3, nu)
    assert roll.x.dtype == np.float64 and roll.x.flags.c_contiguous
    assert len(model.param_paths) == len(model.param_units) == n_params
    assert model.theta.shape == (n_params,) and model.param_bounds.shape == (n_params, 2)
    assert len(model.control_names) == len(model.control_units) == nu
    a, b, c = roll.linearize(-1)
    assert (a.shape, b.shape, c.shape) == ((ndx, ndx), (ndx, nu), (ndx, n_params))
    x0_bar, u_bar, theta_bar = roll.vjp(weights(roll))
    assert (x0_bar.shape, u_bar.shape, theta_bar.shape) == ((ndx,), (3, nu), (n_params,))
    assert all(len(column) == 3 for column in roll.trace.values())
    created = roll.trace["energy_created"]
    assert created.dtype == np.float64 and np.all((created >= 0) & np.isfinite(created))
    left = roll.trace["left"]
    assert left.dtype == np.float64 and np.all((left >= 0.0) & (left < 1e-6))
    assert roll.energy().shape == (4,) and not roll.surrogate
    for nodes in model.ropes.values():
        assert 0 <= nodes.start < nodes.stop <= model.n_nodes


def test_parameters_by_name():
    model = load("free_swing")
    k = model.param_index("cable.bend_stiffness")
    assert model.param_units[k] == "N·m²"
    theta = model.theta_with({"cable.bend_stiffness": 0.5})
    assert theta[k] == 0.5 and model.theta[k] != 0.5
    with pytest.raises(pliant.InputError, match="did you mean `cable.bend_stiffness`"):
        model.param_index("cable.bend_stifness")


def test_step_is_the_rollouts_step():
    model = load("sliding")
    roll = run(model, 4)
    np.testing.assert_array_equal(model.step(roll.x[0], roll.u[0]), roll.x[1])


def test_array_likes_are_taken():
    model = load("free_swing")
    x0, u = model.initial_state(), model.controls(2)
    lists = model.rollout(x0.tolist(), u.tolist(), model.theta.tolist())
    single = model.rollout(x0.astype(np.float32), u)
    strided = model.rollout(np.repeat(x0, 2)[::2], np.asfortranarray(u))
    np.testing.assert_array_equal(lists.x, strided.x)
    np.testing.assert_allclose(lists.x, single.x, atol=1e-4)


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_jvp_equals_vjp(path):
    """Relative to the parts of the sums: what cancels in them leaves its rounding behind."""
    roll = run(pliant.load(path))
    rng = np.random.default_rng(1)
    x_bar = weights(roll)
    bars = roll.vjp(x_bar)
    dots = [rng.normal(size=bar.shape) for bar in bars]
    by_jvp = roll.jvp(*dots) * x_bar
    by_vjp = [bar * dot for bar, dot in zip(bars, dots, strict=True)]
    size = max(np.abs(by_jvp).sum(), sum(np.abs(part).sum() for part in by_vjp))
    assert abs(by_jvp.sum() - sum(part.sum() for part in by_vjp)) <= 1e-11 * size


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_linearize_equals_jvp(path):
    """A, B, C chained over the steps carry a tangent as jvp does."""
    roll = run(pliant.load(path), 5)
    rng = np.random.default_rng(2)
    x0_dot = rng.normal(size=roll.linearize(0)[0].shape[0])
    u_dot, theta_dot = rng.normal(size=roll.u.shape), rng.normal(size=roll.theta.shape)
    x_dot = x0_dot
    for k in range(len(roll)):
        a, b, c = roll.linearize(k)
        x_dot = a @ x_dot + b @ u_dot[k] + c @ theta_dot
    expected = roll.jvp(x0_dot, u_dot, theta_dot)[-1]
    np.testing.assert_allclose(x_dot, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["free_swing", "edge_clamp", "velocity_gripper", "windy"])
def test_vjp_equals_differences(name):
    """Central differences of a random sum of states along a random direction of everything."""
    model = load(name)
    x0, u, theta = model.initial_state(), model.controls(8), model.theta
    roll = model.rollout(x0, u, theta)
    x_bar, rng = weights(roll), np.random.default_rng(3)
    dots = [
        rng.normal(size=x0.shape),
        rng.normal(size=u.shape),
        rng.normal(size=theta.shape) * theta,  # zeros stay zero, so that bounds are kept
    ]
    derivative = sum((bar * d).sum() for bar, d in zip(roll.vjp(x_bar), dots, strict=True))

    def value(eps):
        moved = (a + eps * d for a, d in zip((x0, u, theta), dots, strict=True))
        return (model.rollout(*moved, record=False).x * x_bar).sum()

    differences = [(value(e) - value(-e)) / (2 * e) for e in (1e-5, 3e-6, 1e-6, 3e-7)]
    errors = [abs(d - derivative) / abs(derivative) for d in differences]
    assert min(errors) <= 1e-6, errors


def test_gradcheck_reports_by_block():
    model = load("free_swing")
    report = model.gradcheck(u=model.controls(5), seed=1)
    assert report["verdict"] == "pass" and report["dot_test"] <= 1e-11
    assert report["judged"] == report["total"] == len(report["blocks"])
    names = [block["name"] for block in report["blocks"]]
    assert "x0.q" in names and "cable.bend_stiffness" in names


def test_equilibrium():
    model = load("clamped_ends")
    u = model.controls(1)[0]
    found = model.equilibrium(u)
    again = model.equilibrium(u, model.theta, found.q.reshape(-1, 3))
    np.testing.assert_allclose(again.q, found.q, atol=1e-9)
    rng = np.random.default_rng(4)
    q_bar, u_dot = rng.normal(size=found.q.shape), rng.normal(size=u.shape)
    theta_dot = rng.normal(size=model.n_params) * model.theta
    u_bar, theta_bar = found.vjp(q_bar)
    by_jvp = q_bar @ found.jvp(u_dot, theta_dot)
    by_vjp = u_bar @ u_dot + theta_bar @ theta_dot
    size = np.abs(u_bar * u_dot).sum() + np.abs(theta_bar * theta_dot).sum()
    assert abs(by_jvp - by_vjp) <= 1e-11 * size

    def value(eps):
        theta = model.theta + eps * theta_dot
        return q_bar @ model.equilibrium(u + eps * u_dot, theta, guess=found.q).q

    errors = [abs((value(e) - value(-e)) / (2 * e) - by_vjp) / abs(by_vjp) for e in (1e-4, 1e-5)]
    assert min(errors) <= 1e-6, errors


@pytest.mark.parametrize("name", ["windy", "sliding", "resting"])
@pytest.mark.parametrize("records", [1, 3, 7])
def test_checkpoints_are_bitwise_the_same(name, records):
    model = load(name)
    whole, kept = run(model), run(model, max_records=records)
    x_bar = weights(whole)
    np.testing.assert_array_equal(kept.x, whole.x)
    for ours, theirs in zip(kept.vjp(x_bar), whole.vjp(x_bar), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(pliant.InputError, match="max_records"):
        kept.jvp()


@pytest.mark.parametrize("name", ["windy", "sliding"])
def test_batch_is_bitwise_the_single_rollouts(name):
    model, rng = load(name), np.random.default_rng(5)
    x0 = model.initial_state()
    x0s = x0 + 1e-4 * rng.normal(size=(5, model.nx)) * (np.arange(model.nx) >= model.nx // 2)
    thetas = model.theta * rng.uniform(0.9, 1.1, size=(5, 1))
    u = model.controls(6)
    batches = [model.rollout_batch(x0s, u, thetas, threads=n) for n in (1, 2, 5, None)]
    x_bar = rng.normal(size=batches[0].x.shape)
    bars = [batch.vjp(x_bar) for batch in batches]
    for b in range(5):
        single = model.rollout(x0s[b], u, thetas[b])
        expected = single.vjp(x_bar[b])
        for batch, bar in zip(batches, bars, strict=True):
            np.testing.assert_array_equal(batch.x[b], single.x)
            np.testing.assert_array_equal(batch[b].x, single.x)
            for ours, theirs in zip(bar, expected, strict=True):
                np.testing.assert_array_equal(ours[b], theirs)
    assert len(batches[0]) == 5


def test_another_rest_gap_is_a_surrogate():
    model = load("sliding")
    own, other = run(model, rest_gap=model.rest_gap), run(model, rest_gap=1e-4)
    assert type(own) is pliant.Rollout and not own.surrogate
    assert type(other) is pliant.SurrogateRollout and other.surrogate
    assert isinstance(other, pliant.Rollout) and np.any(own.x != other.x)
    assert (other.rest_gap, other.states) == (1e-4, "smooth")


def test_a_surrogate_along_hard_states_keeps_them():
    model = load("sliding")
    own, hard = run(model), run(model, rest_gap=1e-4, states="hard")
    np.testing.assert_array_equal(own.x, hard.x)
    assert type(hard) is pliant.SurrogateRollout and hard.states == "hard"
    # step k of it is the smoothed step from the hard state x_k
    smooth = model.rollout(own.x[3], own.u[3:4], rest_gap=1e-4)
    for ours, theirs in zip(hard.linearize(3), smooth.linearize(0), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-7 * np.abs(theirs).max(initial=0))
    assert np.abs(hard.linearize(3)[0] - own.linearize(3)[0]).max() > 1e-3
    x_bar = np.ones_like(own.x)
    few = run(model, rest_gap=1e-4, states="hard", max_records=2)
    for ours, theirs in zip(few.vjp(x_bar), hard.vjp(x_bar), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_the_interpreter_is_free_meanwhile():
    """Another thread counts while a long rollout runs."""
    model, counted, done = load("windy"), 0, threading.Event()

    def count():
        nonlocal counted
        while not done.wait(1e-3):
            counted += 1

    thread = threading.Thread(target=count)
    x0, u = model.initial_state(), np.tile(model.controls(1), (3000, 1))
    thread.start()
    before = counted
    model.rollout(x0, u, record=False)
    after = counted
    done.set()
    thread.join()
    assert after - before >= 5


def test_wrong_shapes_are_input_errors():
    model = load("free_swing")
    x0, u = model.initial_state(), model.controls(4)
    roll = model.rollout(x0, u)
    nx, nu = model.nx, model.nu
    cases = [
        (lambda: model.rollout(x0[1:], u), rf"x0 has shape \({nx - 1},\), but \({nx},\) is needed"),
        (lambda: model.rollout(x0, u[0]), rf"u has shape \({nu},\), but \(any, {nu}\) is needed"),
        (lambda: model.rollout(x0, u, [1.0]), r"theta has shape \(1,\)"),
        (lambda: roll.vjp(roll.x[1:]), r"x_bar has shape"),
        (lambda: roll.jvp(u_dot=u[:-1]), r"u_dot has shape"),
        (lambda: roll.linearize(4), "there is no step 4: the rollout has 4 steps"),
        (lambda: model.step(["a"] * nx, u[0]), "x is not an array of numbers"),
        (lambda: model.rollout_batch([x0, x0], [u, u, u]), "us has 3 entries, but x0s has 2"),
        (lambda: model.rollout(x0, u, rest_gap=-1.0), "rest_gap is -1 m"),
        (lambda: model.rollout(x0, u, states="hard"), "needs a rest_gap"),
        (lambda: model.rollout(x0, u, rest_gap=1e-4, states="soft"), 'states is "soft"'),
        (lambda: model.rollout(x0, u, record=False).vjp(roll.x), "kept no records.*`record=True`"),
        (lambda: model.rollout(x0, u, max_records=0), "max_records is 0, but must be at least 1"),
        (lambda: roll.vjp(np.full_like(roll.x, np.nan)), r"x_bar\[0, 0\] is NaN"),
        (lambda: model.controls(-3), "n_steps is -3, but must be from 0"),
    ]
    for call, text in cases:
        with pytest.raises(pliant.InputError, match=text):
            call()


def test_impossible_parameters_are_input_errors():
    model = load("free_swing")
    theta = model.theta_with({"cable.linear_density": -0.1})
    with pytest.raises(pliant.InputError, match=r"parameter `cable.linear_density` is -0.1 kg/m"):
        model.rollout(model.initial_state(), model.controls(2), theta)


def test_bad_scenes_are_input_errors(tmp_path):
    path = tmp_path / "typo.toml"
    text = (ROOT / "tests" / "scenes" / "free_swing.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("linear_density", "linear_densty"), encoding="utf-8")
    with pytest.raises(pliant.InputError) as caught:
        pliant.load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}:") and "did you mean `linear_density`?" in message
    with pytest.raises(ValueError, match="cannot be read"):
        pliant.load(tmp_path / "missing.toml")


def test_failed_numerics_are_numerics_errors():
    model = load("free_swing")
    x0 = model.initial_state()
    x0[-1] = np.inf
    with pytest.raises(pliant.NumericsError, match="step 0"):
        model.rollout(x0, model.controls(2))
    assert issubclass(pliant.NumericsError, RuntimeError)
    x0s = np.stack([model.initial_state(), x0])
    with pytest.raises(pliant.NumericsError) as caught:
        model.rollout_batch(x0s, model.controls(2))
    assert caught.value.__notes__ == ["in rollout 1 of the batch"]


@pytest.mark.parametrize("work", ["step", "linearize", "rollout", "rollout_vjp"])
def test_bench_returns_seconds(work):
    text = (ROOT / "tests" / "scenes" / "windy.toml").read_text(encoding="utf-8")
    assert 0 < pliant.bench(text, work, 3) < 60


def test_fit_and_diagnose_refuse_what_has_no_experiment():
    for study in (pliant.fit, pliant.diagnose):
        with pytest.raises(pliant.InputError, match="experiment"):
            study(ROOT / "tests" / "scenes" / "windy.toml")


FIRST = """
import time
begin = time.perf_counter()
import pliant
model = pliant.load({scene!r})
roll = model.rollout(model.initial_state(), model.controls())
x0_bar, u_bar, theta_bar = roll.vjp(roll.x)
print(time.perf_counter() - begin, abs(theta_bar).max() > 0)
"""


def test_first_gradient():
    """Import, load, roll out and differentiate in a fresh interpreter; the time is printed."""
    program = FIRST.format(scene=str(ROOT / "tests" / "scenes" / "windy.toml"))
    out = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True
    )
    seconds, moved = out.stdout.split()
    print(f"import and first gradient: {float(seconds):.3f} s (goal: below 1 s)")
    assert moved == "True"


def test_a_rope_at_rest_ends_its_steps_at_rounding():
    model = pliant.load(ROOT / "examples" / "hanging_cable.toml")
    left = model.rollout(model.initial_state(), model.controls(10)).trace["left"]
    assert np.all((left > 0.0) & (left < 1e-12))
