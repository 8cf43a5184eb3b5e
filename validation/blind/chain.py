"""A chain of bodies on revolute and prismatic joints, many variants at once: the motions of pendulums, carts and arms.

    M(q) q̈ = τ - c(q, q̇)      c by the Newton-Euler recursion in the world's frame, M by composite rigid bodies

True motions take steps of Strang: half a step of classical Runge-Kutta with all smooth forces, the impulse of dry friction over
the whole step, the other half; without dry friction a whole step of Runge-Kutta. The impulse is exact where accelerations are constant,
joint by joint, until all agree (Gauss-Seidel). The same equations by the implicit midpoint rule are what a fitter's step would make of them.

A variant has entries of `zero(n)`; arrays are over joints, or links and their axes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

CACHE = Path(__file__).resolve().parents[1] / "out" / "compiled"  # not in the repository
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_compilation_cache_dir", str(CACHE))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)

G = 9.81  # m/s²
# arrays have few sizes, so that a kind of chain is compiled once for all setups
CHUNK = 64  # variants that are simulated together
SEGMENT = 256  # steps that are simulated together
SWEEPS = 12  # of Gauss-Seidel


def zero(n: int) -> dict[str, np.ndarray]:
    """A variant without laws; masses and lengths are to be filled in."""
    joints = (
        "damping", "friction", "backward", "stiction", "load", "stiffness", "cubic", "armature", "sine", "cosine", "gain", "offset",
        "kp", "kd", "cycles", "quadratic", "ripple", "ripples", "magnet", "gust", "gust_at", "slack", "gap", "rough", "warm",
    )  # fmt: skip
    out = {key: np.zeros(n) for key in joints}
    out |= {"speed": np.full(n, 0.1), "limit": np.full(n, np.inf), "place": np.zeros(n)}
    return out | {"mass": np.ones(n), "com": np.zeros((n, 3)), "places": np.zeros((n, 3)), "spread": np.zeros((n, 3)), "tilt": np.zeros(2)}


def is_dry(p: dict[str, np.ndarray]) -> bool:
    """Whether a variant has friction that can hold a joint still."""
    return any(p[key].any() for key in ("friction", "backward", "stiction", "load", "rough", "warm"))


def gravity(tilt):
    """R_y(tilt₁) R_x(tilt₀) (0, 0, -g)."""
    y, z = jnp.sin(tilt[0]), -jnp.cos(tilt[0])
    return [G * jnp.sin(tilt[1]) * z, G * y, G * jnp.cos(tilt[1]) * z]


# vectors are lists of three numbers, so that the compiler works on variants side by side
def add(*vectors):
    return [sum(parts) for parts in zip(*vectors, strict=True)]


def times(factor, a):
    return [factor * x for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def solve(matrix, right):
    """x of a symmetric positive definite n × n matrix, by L D Lᵀ."""
    n = len(right)
    low, d, x = [[0.0] * n for _ in range(n)], [0.0] * n, list(right)
    for j in range(n):
        d[j] = matrix[j][j] - sum(low[j][k] ** 2 * d[k] for k in range(j))
        for i in range(j + 1, n):
            low[i][j] = (matrix[i][j] - sum(low[i][k] * low[j][k] * d[k] for k in range(j))) / d[j]
    for i in range(n):
        x[i] = x[i] - sum(low[i][k] * x[k] for k in range(i))
    for i in reversed(range(n)):
        x[i] = x[i] / d[i] - sum(low[k][i] * x[k] for k in range(i + 1, n))
    return x


def braked(v, a, forward, backward, h):
    """Change of a velocity v over h by dry friction, exact where all else accelerates it by a: it may stop, and stay or turn round.

    `forward`, `backward`: deceleration of positive and of negative velocities.
    """
    against = lambda x: jnp.where(x > 0.0, forward, -backward)
    net = a - against(v)
    moving = v != 0.0
    stops = jnp.where(moving & (net * v < 0.0), -v / jnp.where(net == 0.0, 1.0, net), jnp.where(moving, jnp.inf, 0.0))
    held = (a <= forward) & (a >= -backward)
    after = jnp.where(held, -(v + a * h), -against(v) * jnp.minimum(stops, h) - against(a) * (h - jnp.minimum(stops, h)))
    return jnp.where(stops >= h, -against(v) * h, after)


@dataclass(frozen=True)
class Chain:
    """Kinds ("revolute", "prismatic") and axes (numbers of coordinate axes) of all joints; whether servos or motors drive them."""

    kinds: tuple[str, ...]
    axes: tuple[int, ...]
    servo: bool = False

    @property
    def n(self) -> int:
        return len(self.kinds)

    def links(self, p, q):
        """Of every link in the world's frame: axis, joint's place, orientation's columns, its joint's arm, its center's, its moments."""
        columns, at, out = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0] * 3, []
        for i, kind in enumerate(self.kinds):
            axis = columns[self.axes[i]]
            arm = add(*(times(p["places"][i, k], columns[k]) for k in range(3)))
            at = add(at, arm)
            if kind == "revolute":
                k, m = (self.axes[i] + 1) % 3, (self.axes[i] + 2) % 3
                cos, sin, old = jnp.cos(q[i]), jnp.sin(q[i]), columns
                columns = list(old)
                columns[k] = add(times(cos, old[k]), times(sin, old[m]))
                columns[m] = add(times(cos, old[m]), times(-sin, old[k]))
            else:
                at = add(at, times(q[i], axis))
            s = [p["spread"][i, k] ** 2 for k in range(3)]
            moments = times(p["mass"][i], [s[1] + s[2], s[0] + s[2], s[0] + s[1]])
            center = add(*(times(p["com"][i, k], columns[k]) for k in range(3)))
            out.append((kind, axis, at, columns, arm, center, moments))
        return out

    def needed(self, p, q, v, links):
        """Forces at the joints (list) that keep the velocities as they are, against gravity."""
        w, al, acc = [0.0] * 3, [0.0] * 3, times(-1.0, gravity(p["tilt"]))
        loads = []
        for i, (kind, axis, _, columns, arm, center, moments) in enumerate(links):
            acc = add(acc, cross(al, arm), cross(w, cross(w, arm)))
            if kind == "revolute":
                al = add(al, times(v[i], cross(w, axis)))
                w = add(w, times(v[i], axis))
            else:
                slid = times(q[i], axis)
                acc = add(acc, cross(al, slid), cross(w, cross(w, slid)), times(2.0 * v[i], cross(w, axis)))
            turn = lambda x, columns=columns, moments=moments: add(*(times(j * dot(c, x), c) for j, c in zip(moments, columns, strict=True)))
            force = times(p["mass"][i], add(acc, cross(al, center), cross(w, cross(w, center))))
            loads.append((force, add(turn(al), cross(w, turn(w)), cross(center, force))))
        f, m, out, last = [0.0] * 3, [0.0] * 3, [], [0.0] * 3
        for (kind, axis, at, *_), (force, moment) in zip(links[::-1], loads[::-1], strict=True):
            m = add(m, moment, cross(add(last, times(-1.0, at)), f))
            f, last = add(f, force), at
            out.append(dot(axis, m if kind == "revolute" else f))
        return out[::-1]

    def mass_matrix(self, p, q, links=None):
        """Rows of M: of each joint what it takes to accelerate all that it carries, a composite rigid body."""
        links = links or self.links(p, q)
        matrix = [[0.0] * self.n for _ in range(self.n)]
        mass, moment, inertia = 0.0, [0.0] * 3, [[0.0] * 3 for _ in range(3)]  # of what is carried, about the world's origin
        for i in reversed(range(self.n)):
            kind, axis, at, columns, _, center, own = links[i]
            x, m = add(at, center), p["mass"][i]
            mass, moment = mass + m, add(moment, times(m, x))
            for r in range(3):
                for c in range(3):
                    spin = sum(j * col[r] * col[c] for j, col in zip(own, columns, strict=True))
                    inertia[r][c] = inertia[r][c] + spin - m * x[r] * x[c] + (m * dot(x, x) if r == c else 0.0)
            if kind == "revolute":
                swept = cross(axis, at)
                force = add(cross(axis, moment), times(-mass, swept))
                torque = add([dot(row, axis) for row in inertia], times(-1.0, cross(moment, swept)))
            else:
                force, torque = times(mass, axis), cross(moment, axis)
            for j in range(i + 1):
                other, line, place = links[j][:3]
                matrix[i][j] = dot(line, force if other == "prismatic" else add(torque, times(-1.0, cross(place, force))))
                matrix[j][i] = matrix[i][j]
            matrix[i][i] = matrix[i][i] + p["armature"][i]
        return matrix

    def carried(self, p, q, v, u):
        """Torques of springs and motors (n,)."""
        motor = p["kp"] * (u - q) - p["kd"] * v + p["offset"] if self.servo else p["gain"] * u + p["offset"]
        motor = jnp.clip(motor, -p["limit"], p["limit"])
        return motor - p["stiffness"] * q - p["cubic"] * q**3

    def smooth(self, p, q, v, u, t):
        """All torques but dry friction (n,)."""
        f = self.carried(p, q, v, u) - p["damping"] * v - p["quadratic"] * v * jnp.abs(v)
        f = f + p["sine"] * jnp.sin(p["cycles"] * q) + p["cosine"] * jnp.cos(p["cycles"] * q)
        # outside the library
        f = f + p["ripple"] * jnp.sin(p["ripples"] * q)
        away = (q - p["place"]) / 0.15
        f = f - p["magnet"] * away * jnp.exp(-0.5 * away**2)
        f = f + p["gust"] * jnp.exp(-0.5 * ((t - p["gust_at"]) / 0.08) ** 2)
        return f - p["slack"] * jnp.sign(q) * jnp.maximum(jnp.abs(q) - p["gap"], 0.0)

    def acceleration(self, p, q, v, u, t):
        links = self.links(p, q)
        inertial, f = self.needed(p, q, v, links), self.smooth(p, q, v, u, t)
        return jnp.stack(solve(self.mass_matrix(p, q, links), [f[i] - inertial[i] for i in range(self.n)]))

    def rubbed(self, p, q, v, begun, u, h, t):
        """Velocities after the impulse of dry friction over h; `begun`: those at the step's beginning, half a step of other forces ago."""
        bound = p["friction"] + p["stiction"] * jnp.exp(-((v / p["speed"]) ** 2)) + p["load"] * jnp.abs(self.carried(p, q, v, u))
        bound = bound + p["rough"] * (1.0 + jnp.sin(5.0 * q)) + p["warm"] * jnp.maximum(t, 0.0)
        other = bound + p["backward"]
        matrix = self.mass_matrix(p, q)
        inverse = [solve(matrix, [float(i == j) for i in range(self.n)]) for j in range(self.n)]
        pushed = (v - begun) / (0.5 * h)

        def sweep(_, impulse):
            impulse = list(impulse)
            for i in range(self.n):
                own = inverse[i][i]
                rest = sum(inverse[i][k] * impulse[k] for k in range(self.n) if k != i) / h
                impulse[i] = braked(begun[i], pushed[i] + rest, own * bound[i], own * other[i], h) / own
            return tuple(impulse)

        start = tuple(jnp.zeros_like(v[i]) for i in range(self.n))
        impulse = jax.lax.fori_loop(0, 1 if self.n == 1 else SWEEPS, sweep, start)
        return jnp.stack([v[i] + sum(inverse[i][k] * impulse[k] for k in range(self.n)) for i in range(self.n)])

    def runge_kutta(self, p, q, v, u, h, t):
        """A step of h; `u` (3, n) at its beginning, middle and end."""

        def stage(carried, k):
            dq, dv, sum_q, sum_v = carried
            part, weight = jnp.array([0.0, 0.5, 0.5, 1.0])[k], jnp.array([1.0, 2.0, 2.0, 1.0])[k]
            x, w = q + part * h * dq, v + part * h * dv
            a = self.acceleration(p, x, w, u[jnp.array([0, 1, 1, 2])[k]], t + part * h)
            return (w, a, sum_q + weight * w, sum_v + weight * a), None

        nothing = jnp.zeros_like(q)
        (_, _, sum_q, sum_v), _ = jax.lax.scan(stage, (nothing,) * 4, jnp.arange(4))
        return q + h / 6.0 * sum_q, v + h / 6.0 * sum_v

    def strang(self, p, q, v, u, h, t, dry: bool):
        """A true step; `u` at its quarters (5, n)."""
        if not dry:
            return self.runge_kutta(p, q, v, u[::2], h, t)
        begun = v
        q, v = self.runge_kutta(p, q, v, u[:3], 0.5 * h, t)
        v = self.rubbed(p, q, v, begun, u[2], h, t + 0.5 * h)
        return self.runge_kutta(p, q, v, u[2:], 0.5 * h, t + 0.5 * h)

    def midpoint(self, p, q, v, u, h, t, dry: bool):
        """A step of the implicit midpoint rule; dry friction beside it."""
        if dry:
            v = self.rubbed(p, q, v, v, u[0], 0.5 * h, t)
        mean = 0.25 * (0.5 * u[0] + u[1] + u[2] + u[3] + 0.5 * u[4])

        def again(_, a):
            return self.acceleration(p, q + 0.5 * h * (v + 0.5 * h * a), v + 0.5 * h * a, mean, t + 0.5 * h)

        a = jax.lax.fori_loop(0, 8, again, jnp.zeros_like(v))
        q, v = q + h * (v + 0.5 * h * a), v + h * a
        return q, (self.rubbed(p, q, v, v, u[4], 0.5 * h, t + h) if dry else v)

    def simulate(
        self, variants: list[dict], q: np.ndarray, v: np.ndarray, u: np.ndarray, h: float, begin: float, rule: str = "strang"
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (variants, steps + 1, n) from states (variants, n)."""
        dry = [is_dry(p) for p in variants]
        steps = (u.shape[1] - 1) // 4
        short = -steps % SEGMENT
        u = np.concatenate([u, np.repeat(u[:, -1:], 4 * short, axis=1)], axis=1)
        shape = (len(variants), steps + short + 1, self.n)
        out_q, out_v = np.empty(shape), np.empty(shape)
        out_q[:, 0], out_v[:, 0] = q, v
        for kind in (False, True):
            own = np.flatnonzero(np.array(dry) == kind)
            for part in (own[k : k + CHUNK] for k in range(0, len(own), CHUNK)):
                size = CHUNK if len(part) > 8 else 8
                padded = np.resize(part, size)
                p = {key: np.stack([variants[k][key] for k in padded]) for key in variants[0]}
                x, w = q[padded], v[padded]
                for done in range(0, steps, SEGMENT):
                    own_u = u[padded, 4 * done : 4 * (done + SEGMENT) + 1]
                    all_x, all_w = compiled(self)(p, x, w, own_u, h, begin + done * h, kind, rule)
                    x, w = all_x[:, -1], all_w[:, -1]
                    after = slice(done + 1, done + SEGMENT + 1)
                    out_q[part, after], out_v[part, after] = np.asarray(all_x)[: len(part)], np.asarray(all_w)[: len(part)]
        return out_q[:, : steps + 1], out_v[:, : steps + 1]


@functools.cache
def compiled(chain: Chain) -> Callable:
    """(variants, q, v, u (variants, 4 steps + 1, n), h, beginning) -> q, v after every step (variants, steps, n)."""

    def run(p, q, v, u, h, begin, dry, rule):
        step = getattr(chain, rule)

        def body(state, k):
            own = jax.lax.dynamic_slice(u, (4 * k, 0), (5, chain.n))
            state = step(p, *state, own, h, begin + k * h, dry)
            return state, state

        _, (x, w) = jax.lax.scan(body, (q, v), jnp.arange((len(u) - 1) // 4))
        return x, w

    def many(p, q, v, u, h, begin, dry, rule):
        return jax.vmap(lambda p, q, v, u: run(p, q, v, u, h, begin, dry, rule))(p, q, v, u)

    return jax.jit(many, static_argnums=(6, 7))
