"""Shared by the tests of the JAX reference: scenes by name, and one compiled program per scene.

A program maps (x, u, θ, x̄⁺) to (x⁺, residual [m/s], (x̄, ū, θ̄)): a step and its pullback, x̄ by changes of the state.
Traced and compiled programs are kept under target/, so a second run of the tests is quicker.
"""

import hashlib
import os
import re
import tempfile
from functools import cache, partial
from pathlib import Path

import jax
from jax import export
import numpy as np

from validation import reference
from validation.reference.step import Scheme, scheme

ROOT = Path(__file__).resolve().parents[2]
jax.config.update("jax_compilation_cache_dir", str(ROOT / "target" / "jax-cache"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)

# Quick compilation matters more here than quick execution.
COMPILER = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
jit = partial(jax.jit, compiler_options=COMPILER)
PROGRAMS = ROOT / "target" / "jax-programs"


@cache
def sources():
    """What every program of the reference follows from: its files and these tests', and the version of JAX."""
    files = sorted([*(ROOT / "validation" / "reference").glob("*.py"), *Path(__file__).parent.glob("*_cases.py")])
    return b"\0".join([jax.__version__.encode(), *(file.read_bytes() for file in files)])


def traced_once(function, *about):
    """`function` under jit, for arguments of one shape; `about` says what it follows from beside :func:`sources`.

    The traced program is kept under target/ by all that it follows from, since tracing takes several times as long as running.
    """
    name = hashlib.sha256(sources() + repr(about).encode()).hexdigest()
    file = PROGRAMS / name

    def load(args):
        if not file.exists():
            program = export.export(jit(function))(*args).serialize()
            PROGRAMS.mkdir(parents=True, exist_ok=True)
            # tests in other processes may write it too: whole or not at all
            with tempfile.NamedTemporaryFile(dir=PROGRAMS, delete=False) as draft:
                draft.write(program)
            os.replace(draft.name, file)
        return jit(export.deserialize(bytearray(file.read_bytes())).call)

    loaded = []

    def call(*args):
        if not loaded:
            loaded.append(load(args))
        return loaded[0](*args)

    return call


FLOOR = """
[[plane]]
name = "floor"
point = [0.0, 0.0, -0.0075]
normal = [0.0, 0.1, 1.0]
friction = 0.5

[contact]
law = "coulomb"
rest_gap = 1e-6
"""
CURLED = """initial = { shape = "points", points = [
  [0.08, 0, 0], [0.06118737, 0.05153741, 0.03], [0.01359737, 0.07883598, 0.06], [-0.04038769, 0.06905675, 0.09],
  [-0.07537779, 0.02679905, 0.12], [-0.07491653, -0.02806265, 0.15], [-0.03922087, -0.06972607, 0.18], [0.01492099, -0.07859622, 0.21]] }"""
CLOTH_MESH = ("nodes = [9, 6], size = [0.4, 0.25]", "nodes = [4, 4], size = [0.3, 0.25]")
CLOTH_MOVES = "[gravity]\ntilt = [0.1, -0.2]\n\n[air]"
CLOTH_HANDS = """[[gripper]]
name = "left"
cloth = "sheet"
nodes = [0]

[[gripper]]
name = "right"
cloth = "sheet"
nodes = [48]
motion = { kind = "sine", amplitude = [-0.05, 0, 0.05], frequency = 1.0 }
"""
JOINTS = "joint = [{ node = 2, rest_curvature = [2.0, 1.0], bend_factor = 0.3 }, { node = -2, bend_factor = 4.0 }]"
OWN_FORCE = """
[[force]]
name = "draft"
cloth = "sheet"
formula = ["a*(z - vx)", "-c*vy*vz**2", "a*cos(8*x)"]
parameters = { a = 0.4, c = 0.3 }
"""
REMEMBERS = """[rope.plasticity]
yield_curvature = 2.0
time = 0.02

[rope.creep]
fraction = 0.4
time = 0.04

[[gripper]]"""
ROLLS = "roll_by_direction = [0.3, -0.2, 0.5]\nroll_by_position = [2.0, 1.0, -3.0]"
# name -> (scene file, [(what is replaced, by what)], what is added)
VARIANTS = {
    "spun_rod": (  # turned by its hand's angular velocity, curled where it is at rest
        "twisting_rod",
        [
            ('mode = "prescribed"', 'mode = "velocity"'),
            ("roll = 0.1\n", ""),
            ('initial = { shape = "straight", from = [0.0, 0.0, 0.0], direction = [1.0, 0.0, 0.0] }', CURLED),
            ("edge_fractions = [0.1, 0.12, 0.15, 0.15, 0.16, 0.16, 0.16]", "nodes = 8"),
            ("length = 0.5", "length = 0.434"),
            ("[rope.twist]", f'[rope.twist]\n{JOINTS}\nrest = "initial"'),
        ],
        "",
    ),
    "set_rod_on_floor": (  # that creeps and yields, its joints unlike, held by three nodes, half of it on a slope
        "twisting_rod",
        [
            ("[rope.twist]", f'[rope.twist]\n{JOINTS}\nrest = "initial"'),
            ("[[gripper]]", REMEMBERS),
            ('end = "first"', "nodes = [0, 1, 2]"),
            ("spin = 6.0\n", ""),
            ("velocity = [0.0, 0.3, 0.5]", "velocity = [0.2, 0.3, -0.3]"),
        ],
        FLOOR.replace("1e-6", "1e-5"),  # the slope of a contact knows the rounding of positions as a part of its gap
    ),
    "set_friction": ("rod_friction", [("coefficient = 0.05", "coefficient = -0.02"), ("[[gripper]]", REMEMBERS)], ""),
    "rolled_rod": ("twisting_rod", [("roll = 0.1", f"roll = 0.1\n{ROLLS}")], ""),
    "rod_on_floor": (  # held by three nodes, half of it on a slope
        "twisting_rod",
        [
            ('end = "first"', f"nodes = [0, 1, 2]\n{ROLLS}"),
            ("spin = 6.0\n", ""),
            ("velocity = [0.0, 0.3, 0.5]", "velocity = [0.2, 0.3, -0.3]"),
        ],
        FLOOR,
    ),
    "cloth_free": ("cloth_hung", [CLOTH_MESH, (CLOTH_HANDS, ""), ("[air]", CLOTH_MOVES)], ""),
    "cloth_held": ("cloth_hung", [CLOTH_MESH, ("nodes = [48]", "nodes = [15]")], OWN_FORCE),
    "cloth_on_ball": (
        "cloth_sphere",
        [("nodes = [8, 8], size = [0.4, 0.4]", 'nodes = [4, 3], size = [0.12, 0.12], diagonal = "alternating"'),
         ("origin = [-0.2, -0.2, 0.105]", "origin = [-0.05, -0.06, 0.1015]\nvelocity = [0.3, 0.1, -0.4]"),
         ("youngs_modulus", "poisson_ratio = -0.1\nyoungs_modulus")],
        "",
    ),
}


def scene_text(name, integrator=None, law=None):
    """Text of tests/scenes/<name>.toml or of a variant of one, with another integrator or contact law."""
    name, replaced, added = VARIANTS.get(name, (name, [], ""))
    text = (ROOT / "tests" / "scenes" / f"{name}.toml").read_text()
    for old, new in replaced:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    text += added
    if integrator:
        text = re.sub(r'integrator = "\w+"', f'integrator = "{integrator}"', text)
    if law:
        text = re.sub(r'law = "\w+"', f'law = "{law}"', text)
    return text


@cache
def program(name, law, landing):
    """The compiled step-and-pullback of a scene: (x, u, θ, x̄⁺, scheme) as above; `landing`: by sdirk2 with contact.

    The integrator is an argument, except that one.
    """
    text = scene_text(name, "sdirk2" if landing else "euler", law)
    model = reference.loads(text)
    step = reference.make_change_of_step(model)

    def of(x, u, theta, x_bar, by):
        by = Scheme(*by)
        _, pull, (x_next, error) = jax.vjp(lambda *a: step(a[0], x, *a[1:], by), np.zeros(model.ndx), u, theta, has_aux=True)
        return x_next, error, pull(x_bar)

    return traced_once(of, text)


class Case:
    """A reference model with its compiled step-and-pullback."""

    def __init__(self, name, integrator, law):
        self.text = scene_text(name, integrator, law)
        self.model = reference.loads(self.text)
        landing = bool(self.model.shapes) and self.model.integrator == "sdirk2"
        traced, by = program(name, law, landing), tuple(scheme(self.model))
        self.program = lambda *at: traced(*at, by)

    def start(self):
        """The scene's initial state; sheets, which are flat, a little out of shape and in motion."""
        x0, rng = self.model.initial_state(), np.random.default_rng(8)
        if self.model.sheets is not None:
            free, n = np.repeat(~self.model.driven, 3), 3 * self.model.n_nodes
            x0[:n] += free * rng.normal(size=n) * 2e-3
            x0[n : 2 * n] += free * rng.normal(size=n) * 0.1
        return x0

    def rollout(self, x0, u, theta):
        """(x (T + 1, nx), largest residual [m/s])."""
        xs, errors = [np.asarray(x0)], []
        for row in u:
            x, error, _ = self.program(xs[-1], row, theta, np.zeros(self.model.ndx))
            xs.append(np.asarray(x))
            errors.append(float(error))
        return np.array(xs), max(errors)

    def vjp(self, xs, u, theta, x_bar):
        """(x̄0, ū (T, nu), θ̄, what θ̄ is the sum of, in absolute values) of the rollout xs for the cotangent x_bar (T + 1, ndx)."""
        u_bar, theta_bar, terms, bar = np.zeros_like(u), np.zeros_like(theta), np.zeros_like(theta), x_bar[-1].copy()
        for k in reversed(range(len(u))):
            _, _, (x_k, u_k, theta_k) = self.program(xs[k], u[k], theta, bar)
            u_bar[k] = u_k
            theta_bar += theta_k
            terms += np.abs(theta_k)
            bar = np.asarray(x_k) + x_bar[k]
        return bar, u_bar, theta_bar, terms


def relative(a, b):
    """max |a - b| / max |b|."""
    a, b = np.asarray(a), np.asarray(b)
    return np.abs(a - b).max(initial=0.0) / max(np.abs(b).max(initial=0.0), 1e-300)


def parts(model, xs):
    """Positions, twists, velocities, their rates, what sections remember, and axes, of states (T + 1, nx)."""
    nodes, n = 3 * model.n_nodes, model.nq
    return np.split(xs, [nodes, n, n + nodes, 2 * n, 2 * n + model.n_memory], axis=1)


def gradient_errors(model, got, expected, cancelling=False):
    """Relative errors of (x̄0, ū, θ̄), block by block.

    An entry of θ that hardly acts is compared on the scale of its group's effect, so that it is not asked for more digits than
    cancellation leaves in either program. `cancelling`: for the same reason on that of the sum of what its steps contribute, in absolute
    values: where a contact slides under `anitescu`, v̂_n - μ|v_t| = 5e-5 m/s is known to 2e-10, and contributions that are known as well
    cancel to a hundredth of their size.
    """
    (x0, u, theta), (x0_bar, u_bar, theta_bar, terms) = got, expected
    names, errors = ("q0", "twist0", "v0", "turns0", "memory0"), {}
    for name, a, b in zip(names, parts(model, x0[None]), parts(model, x0_bar[None]), strict=False):
        errors[name] = relative(a, b)
    for g in model.grippers:
        errors[f"u.{g.name}"] = relative(u[:, g.inputs], u_bar[:, g.inputs])
    floor = 1e-9 * np.abs(x0_bar).max()
    for path, a, b, size in zip(model.paths, theta, theta_bar, terms, strict=True):
        errors[path] = abs(a - b) / max(size if cancelling else abs(b), floor)
    return errors


@cache
def case(name, integrator=None, law=None):
    """The case, built once per test process."""
    return Case(name, integrator, law)


def wiggle(model, q0, steps, seed=0):
    """Inputs (steps, nu): grippers that start where q0 has them and move gently.

    Prescribed positions drift by up to 0.2 m/s, axes turn by up to 0.5 rad/s; velocity inputs
    stay below 0.2 m/s and 1 rad/s.
    """
    rng = np.random.default_rng(seed)
    u = np.tile(model.hold(q0), (steps, 1))
    t = model.h * np.arange(1, steps + 1)[:, None]
    for g in model.grippers:
        size = g.inputs.stop - g.inputs.start
        if g.mode == "velocity":
            rate = np.concatenate([rng.uniform(-0.2, 0.2, 3), rng.uniform(-1.0, 1.0, size - 3)])
            u[:, g.inputs] = rate * (1.0 + 0.3 * np.sin(20.0 * t))
        elif g.ghost is None:
            u[:, g.inputs] += np.tile(rng.uniform(-0.2, 0.2, 3), size // 3) * t
        else:
            rate = np.concatenate([rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.5, 0.5, size - 3)])
            u[:, g.inputs] += rate * t
    return u
