"""Forces of one's own: Python functions as formulas, what the engine makes of them, and a diagnosis that looks for one."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

# names of formulas, as Python has them
NAMES = {name: getattr(np, name) for name in dir(np) if not name.startswith("_")} | {"pi": math.pi}


def evaluated(text, **values):
    """A formula by Python itself."""
    return float(eval(text, {"__builtins__": {}}, NAMES | values))


NUMPY = [
    lambda q, v, c: -c * v * np.abs(v) + (q - (v - c)) / 2 - 3**q,
    lambda q, v, c: np.where((q > 0) & (v < 1), np.clip(q, -0.1, 0.1), -(q**2)),
    lambda q, v, c: np.exp(-((q / c) ** 2)) * np.tanh(v) + abs(q) ** 1.5,
    lambda q, v, c: -(-q - -v) * 2.0**-c / (1 + v**2) + np.log10(2 + q) + np.deg2rad(v),
    lambda q, v, c: np.where(~(q > 0) | (v >= 0), np.hypot(q, v), np.arctan2(q, v)) + np.square(c),
    lambda q, v, c: np.maximum(q, np.minimum(v, c)) + np.sign(q) * np.sqrt(c) - np.expm1(q) + np.log1p(c) + np.sinh(v),
]
JAX = [
    lambda q, v, c: -c * v * jnp.abs(v) + (q - (v - c)) / 2 - 3**q,
    lambda q, v, c: jnp.where((q > 0) & (v < 1), jnp.clip(q, -0.1, 0.1), -(q**2)),
    jax.jit(lambda q, v, c: jnp.exp(-((q / c) ** 2)) * jnp.tanh(v) + jnp.abs(q) ** 1.5),
    lambda q, v, c: jax.nn.sigmoid(v) / jnp.sqrt(2 + q) + jax.lax.rsqrt(c) * jnp.log2(c) + jnp.arctan(q),
    lambda q, v, c: jnp.linalg.norm(jnp.stack([q, v, c])) + jnp.sum(jnp.array([q, v]) ** 3) + jnp.hypot(q, v),
]


@pytest.mark.parametrize("function", NUMPY + JAX, ids=[f"numpy{k}" for k in range(len(NUMPY))] + [f"jax{k}" for k in range(len(JAX))])
def test_a_formula_has_the_function_s_values(function):
    text = pliant.own.formula(function)
    with jax.enable_x64(True):
        for q, v, c in np.random.default_rng(1).uniform([-1, -2, 0.1], [1, 2, 2], (20, 3)):
            wanted = float(function(q, v, c))
            assert evaluated(text, q=q, v=v, c=c) == pytest.approx(wanted, rel=1e-14, abs=1e-15), text


def test_texts_are_short_and_several_results_are_a_list():
    of = pliant.own.formula
    assert of(lambda q, v, c=0.0: -c * v * np.abs(v)) == "-c*v*abs(v)"
    assert of(lambda q: (q - 1) - (q + 2) * (q / (q * 3)) - -q**2) == "q - 1 - (q + 2)*(q/(q*3)) - -q**2"
    assert of(lambda q: 2) == "2"
    for xp in (np, jnp):

        def drag(vx, vy, vz):
            return -xp.array([vx, vy, vz]) * xp.sqrt(vx**2 + vy**2 + vz**2)  # noqa: B023

        texts = of(drag)
        assert texts == [f"-{v}*sqrt(vx**2 + vy**2 + vz**2)" for v in ("vx", "vy", "vz")]
    assert of(lambda x, y: [x, 0.0, jnp.sin(y)]) == ["x", "0", "sin(y)"]


@pytest.mark.parametrize(
    "function, error, said",
    [
        (lambda q: q if q > 0 else 0.0, TypeError, "fix: write `numpy.where(condition, a, b)`"),
        (lambda q: max(q, 0.0), TypeError, "`numpy.maximum` for `max`"),
        (lambda q: jnp.sin(q) if q > 0 else 0.0, TypeError, "`numpy.where"),
        (lambda q: 0.0 if jnp.sin(q) > 0 else q, TypeError, "jax.numpy.where"),
        (lambda q: math.sin(q), TypeError, "`numpy.sin` for `math.sin`"),
        (lambda q: np.where(q == 1, 0, q), TypeError, "compare with `<`"),
        (lambda q: np.cbrt(q), ValueError, "numpy.cbrt has no place in a formula"),
        (lambda q: np.sum(q), ValueError, "numpy.sum has no place in a formula"),
        (lambda q: q % 2, ValueError, "the remainder `%`"),
        (lambda q: jax.scipy.special.erf(q), ValueError, "the primitive `erf` of JAX has no place in a formula. fix: write it with"),
        (lambda q: q * math.nan, ValueError, "nan. fix: compute with finite numbers"),
        (lambda q: None, ValueError, "`return` the force"),
    ],
)
def test_what_no_formula_can_have_is_named(function, error, said):
    with pytest.raises(error) as raised:
        pliant.own.formula(function)
    assert said in str(raised.value)


def test_arguments_have_values():
    force = pliant.own.force
    text = force("seal", lambda q, v, c=0.0, w=0.3: -c * v * np.exp(-((q / w) ** 2)), joint="pivot", parameters={"w": 0.4})
    assert text.splitlines()[1:] == [
        "[[force]]", 'name = "seal"', 'joint = "pivot"', 'formula = "-c*v*exp(-(q/w)**2)"', "parameters = { c = 0.0, w = 0.4 }",
    ]  # fmt: skip
    with pytest.raises(ValueError, match="`k` has no value and is no variable"):
        force("seal", lambda q, k: -k * q, joint="pivot")
    with pytest.raises(ValueError, match="`q` has no value"):
        force("seal", lambda q: [q, 0, 0], rope="cord")
    with pytest.raises(ValueError, match="`parameters` has d, which is no argument"):
        force("seal", lambda q, c=1.0: -c * q, joint="pivot", parameters={"d": 1.0})
    with pytest.raises(ValueError, match="give one of joint, rope and cloth"):
        force("seal", lambda q: -q, joint="pivot", rope="cord")


PENDULUM = """
schema_version = 1
[time]
step = 0.005
duration = 1.0
[[body]]
name = "bob"
mass = 0.5
center_of_mass = [0, 0, -0.3]
inertia = [1e-6, 1e-6, 1e-6, 0, 0, 0]
[[body.joint]]
name = "pivot"
kind = "revolute"
axis = [0, -1, 0]
start = [0.8]
"""
INERTIA, WEIGHT = 0.5 * 0.3**2 + 1e-6, 0.5 * 9.81 * 0.3


def catch(q, v, c=0.0, a=0.0):
    """Damping by the square of the speed, and a catch that holds at places."""
    return -c * v * np.abs(v) + a * np.sin(7 * q)


def test_functions_of_numpy_and_jax_act_alike_with_exact_gradients():
    def with_jax(q, v, c=0.0, a=0.0):
        return -c * v * jnp.abs(v) + a * jnp.sin(7 * q)

    values = {"c": 0.02, "a": 0.05}
    models = [pliant.loads(PENDULUM + pliant.own.force("catch", f, joint="pivot", parameters=values)) for f in (catch, with_jax)]
    rolls = [model.rollout(model.initial_state(), np.zeros((100, 0))) for model in models]
    np.testing.assert_array_equal(rolls[0].x, rolls[1].x)
    model, x_bar = models[0], np.zeros_like(rolls[0].x)
    x_bar[-1, 0] = 1.0
    _, _, theta_bar = rolls[0].vjp(x_bar)
    for path, size in (("catch.c", 1e-5), ("catch.a", 1e-5)):
        k, ends = model.param_index(path), []
        for sign in (1.0, -1.0):
            theta = model.theta.copy()
            theta[k] += sign * size
            ends.append(model.rollout(model.initial_state(), np.zeros((100, 0)), theta=theta).x[-1, 0])
        assert theta_bar[k] == pytest.approx((ends[0] - ends[1]) / (2 * size), rel=1e-5)


def logs(folder, c, a):
    """Encoder logs of a pendulum with that catch, by a Runge–Kutta method of their own; the text of their experiment."""
    rng, h, fine = np.random.default_rng(5), 0.01, 10

    def slope(x):
        return np.array([x[1], (-WEIGHT * np.sin(x[0]) - 0.01 * x[1] + catch(x[0], x[1], c, a)) / INERTIA])

    text = '\n[experiment]\ninitial = "measured"\ntime = { column = "t", unit = "s" }\n'
    text += '[[experiment.joint]]\njoint = "pivot"\nmeasures = "position"\ncolumn = "q"\n'
    for k, start in enumerate((0.5, 1.2, -0.9, 1.6, -1.4, 0.8, 1.0, -0.6)):
        x, rows = np.array([start, 0.3 * (-1) ** k]), []
        for n in range(201):
            rows.append((n * h, x[0] + 1e-3 * rng.normal()))
            for _ in range(fine):
                d = h / fine
                k1 = slope(x)
                k2 = slope(x + d / 2 * k1)
                k3 = slope(x + d / 2 * k2)
                x = x + d / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + d * k3))
        np.savetxt(folder / f"run{k}.csv", rows, delimiter=",", header="t,q", comments="", fmt="%.9g")
        text += f'[[experiment.record]]\nfile = "run{k}.csv"\nrole = "{"held_out" if k > 5 else "fit"}"\n'
    return text


def diagnosed(folder, c, a, start=None):
    scene = PENDULUM.replace("start = [0.8]", "damping = 0.01").replace("step = 0.005", "step = 0.0025")
    text = scene + pliant.own.force("catch", catch, joint="pivot", parameters=start) + logs(folder, c, a)
    file = folder / "scene.toml"
    file.write_text(text, encoding="utf-8")
    return pliant.diagnose(file)


def test_a_diagnosis_finds_the_force_and_its_sizes(tmp_path):
    truth = {"catch.c": 0.01, "catch.a": 0.03}
    found = diagnosed(tmp_path, *truth.values())
    assert found["verdict"] == "named", found["reason"]
    assert [(cause["name"], cause["object"]) for cause in found["causes"]] == [("own_force", "catch")]
    parameters = {p["path"]: p for p in found["causes"][0]["parameters"]}
    for path, value in truth.items():
        low, high = parameters[path]["interval"]
        assert low <= value <= high and high - low < 0.2 * value, parameters[path]


def test_a_force_that_is_not_there_is_not_named(tmp_path):
    found = diagnosed(tmp_path, 0.0, 0.0)
    assert found["verdict"] == "adequate" and found["causes"] == [], found["reason"]


def test_a_force_that_the_scene_has_is_no_candidate(tmp_path):
    found = diagnosed(tmp_path, 0.01, 0.03, {"c": 0.01, "a": 0.03})
    assert found["verdict"] == "adequate", found["reason"]
    assert all(candidate["name"] != "own_force" for candidate in found["candidates"])
