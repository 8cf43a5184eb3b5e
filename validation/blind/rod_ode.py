"""A rod that twists as a continuous-time ODE, with the laws of the JAX reference; batched over variants.

    m ẍ = f(x, φ, ẋ, φ̇, d, z) + hidden forces        free nodes, 3 each [m]
    I φ̈ = τ(x, φ, ẋ, φ̇, d, z)                        twists φ [rad] of free edges about reference axes d
    ḋ = -(d·ṫ) t                                       reference axes are transported along with their edges' directions t

f and τ are derivatives of the energies and dissipations of `validation.reference`, which shares no code with pliant. Nodes that grippers
hold move as commanded, straight from one row of a table to the next; the edges they hold have the material axis

    R(t, φ_g) S(t₀ → t) d₀,    φ_g = roll + a·(t - t₀) + b·(x - x₀)

with S the smallest rotation, t₀, d₀, x₀ the direction, axis and first node's place as the scene begins, a, b [rad, rad/m] the roll by
direction and by place. What sections remember follows its own equations (κ̇ the rate of the strains, l the length of a joint):

    creep          ė = κ̇ - e/τ                        e (3) beside the elastic section, of g times its stiffness
    friction       ė = κ̇ - |κ̇| e/(κ_f l)              moment M_f e/(κ_f l)
    plasticity     ż = max(|x| - κ_y l, 0)/τ_p x/|x|   x = κ - z the elastic bending

and is zero as a record begins, in the equilibrium of the elastic rod. Integrated by Runge and Kutta's classical rule; `midpoint` takes the
implicit midpoint rule instead, as a fitter would.

Outside the library: `magnet` [N·m] a pull K (p - x)/(|p - x|² + a²)^{3/2} per length; `gust` [N/m] across the rod's plane, of 0.05 s, at
`gust_at` [s]; `coupling` [N·m²] the energy c κ₁ τ/l of every joint.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from validation import reference
from validation.reference import forces, rods
from validation.reference.laws import taken

ROW = 5e-3  # s between rows of commands and states
STEPS = 6  # of the truth in a row: with twice as many readings change by less than 1e-3 of the noise
CORE, GUST = 0.12, 0.05  # m, s
EXTRA = ("magnet", "gust", "coupling", "gust_at")
MAGNET = np.array([0.25, 0.2, -0.3])  # m
KEPT = Path(__file__).resolve().parents[1] / "out" / "jax"  # compiled programs, not in the repository
QUICK = {"xla_llvm_disable_expensive_passes": True}  # compiles three times as fast
LANES = (4, 48)  # variants that are simulated together: one compiled program each


def differences(function, y, delta=1e-7):
    """Jacobian of a function of a vector by forward differences, which compile in a third of the time of derivatives."""
    begin = function(y)
    return jax.lax.map(lambda e: (function(y + delta * e) - begin) / delta, jnp.eye(len(y))).T


@dataclass(frozen=True, eq=False)
class Rod:
    """A layout of nodes and grippers, of which everything else is a number."""

    model: reference.Model
    free: np.ndarray  # nodes
    driven: np.ndarray  # nodes, in the order of the commands
    held: tuple  # (edge, place of its first node among the driven, positions in θ of roll, a and b) of every gripper
    loose: np.ndarray  # edges that no gripper holds

    @classmethod
    def of(cls, text: str) -> Rod:
        model = reference.loads(text)
        driven = np.concatenate([g.nodes for g in model.grippers])
        held = []
        for g in model.grippers:
            (own,) = g.held
            held.append((own.edge, list(driven).index(own.nodes[0]), g.roll, g.offset, len(g.nodes)))
        edges = np.arange(len(model.rods.edges))
        return cls(model, model.free, driven, tuple(held), np.setdiff1d(edges, [h[0] for h in held]))

    def driven_at(self, theta, origin, p, p_dot):
        """Places and velocities of the driven nodes, first axes of the held edges and their rates about the edges."""
        shift = jnp.concatenate([jnp.tile(taken(theta, offset), (count, 1)) for *_, offset, count in self.held])
        axes, spins = [], []
        for edge, first, roll, *_ in self.held:
            t0, d0, x0 = origin[0][edge], origin[1][edge], origin[2][first]

            def axis(p, first=first, roll=roll, t0=t0, d0=d0, x0=x0):
                t, values = rods.unit(p[first + 1] - p[first]), taken(theta, roll)
                turn = values[0] + jnp.dot(values[1:4], t - t0) + jnp.dot(values[4:7], p[first] - x0)
                return rods.turned(t, rods.carried(t0, t, d0), turn)

            d, d_dot = jax.jvp(axis, (p,), (p_dot,))
            t = rods.unit(p[first + 1] - p[first])
            axes.append(d)
            spins.append(jnp.dot(d_dot, rods.cross(t, d)))
        return p + shift, p_dot, jnp.stack(axes), jnp.stack(spins)

    def whole(self, free, driven):
        """All nodes, twists or axes from the free and the driven ones."""
        (x, w, v, o, d), (p, p_dot, axes, spins) = free, driven
        edges = jnp.array([h[0] for h in self.held])
        n, count = self.model.n_nodes, len(self.model.rods.edges)
        put = lambda shape, where, a, other, b: jnp.zeros(shape).at[where].set(a).at[other].set(b)
        x, v = (put((n, 3), self.free, a, self.driven, b) for a, b in ((x, p), (v, p_dot)))
        d = put((count, 3), self.loose, d, edges, axes)
        w, o = jnp.zeros(count).at[self.loose].set(w), put((count,), self.loose, o, edges, spins)
        return x, w, v, o, d

    def force(self, theta, extra, time, state, memory):
        """(force on nodes (n, 3) [N], moments about edges (E,) [N·m], rates of what is remembered)."""
        model, own = self.model, self.model.rods
        x, w, v, o, d = state
        here = rods.directions(own.edges, x)
        frames = jnp.concatenate([d.ravel(), rods.reference_twist(own, here, d, jnp.zeros(len(own.joints)))])

        def strain(x, w):
            t = rods.directions(own.edges, x)
            return rods.strains(own, t, w, rods.carry_along(own, here, frames, t))

        value, rate = jax.jvp(strain, (x, w), (v, o))
        begin = (memory, value, 1e-9)
        moment = rods.moments(own, value, theta, begin) + jax.grad(rods.dissipation, 1)(own, rate, theta)
        length = own.joint_fraction * theta[model.ropes[0]["length"]]
        k = rods.principal(own, value, theta)
        moment += extra[2] * jnp.stack([k[:, 2], 0.0 * k[:, 0], k[:, 0]], axis=1) / length[:, None]
        f, tau = (-a for a in jax.vjp(strain, x, w)[1](moment))
        f += -jax.grad(forces.potential, 1)(model, x, theta) - jax.grad(forces.dissipation, 2)(model, x, v, theta)
        f += forces.drag(model, x, v, theta)
        part = forces.voronoi_lengths(model, theta)[:, None]
        r = jnp.asarray(MAGNET) - x
        f += extra[0] * part * r / (jnp.sum(r * r, axis=1, keepdims=True) + CORE**2) ** 1.5
        f += extra[1] * part * jnp.exp(-0.5 * ((time - extra[3]) / GUST) ** 2) * jnp.array([0.0, 1.0, 0.0])
        return f, tau, self.remembered(theta, value, rate, memory, begin, length)

    def remembered(self, theta, value, rate, z, begin, length):
        """ż of what sections remember."""
        own, m = self.model.rods, self.model.rods.memory
        out = jnp.zeros_like(z)
        if not m.count:
            return out
        e, k_dot = taken(z, m.creep_place), taken(rate, m.creep)
        out = out.at[m.creep_place].set(k_dot - e / taken(theta, m.relaxes[:, 3])[:, None])
        e, k_dot = taken(z, m.friction_place), taken(rate, m.friction)[:, :2]
        limit = taken(theta, m.rubs[:, 1:2]) * taken(length, m.friction)[:, None]
        out = out.at[m.friction_place].set(k_dot - jnp.sqrt(rods.dots(k_dot, k_dot) + 1e-24) * e / limit)
        x = taken(rods.elastic_parts(own, value, theta, begin), m.plastic)[:, :2]
        limit, tau = taken(theta, m.yields[:, :1]) * taken(length, m.plastic)[:, None], taken(theta, m.yields[:, 1:2])
        size = jnp.sqrt(rods.dots(x, x) + 1e-24)
        return out.at[m.plastic_place].set(jnp.maximum(size - limit, 0.0) / tau * x / size)

    def inertia(self, theta):
        """Masses of the free nodes (n, 1) [kg], moments of inertia of the loose edges [kg·m²]."""
        own = self.model.rods
        return taken(forces.masses(self.model, theta), self.free)[:, None], taken(rods.inertias(own, theta), self.loose)

    def at_rest(self, theta, extra, origin, p, guess, turns):
        """Equilibrium under the commands p, from a guess (x, d) of all nodes and axes, by Newton's method: (free state, last step)."""
        driven = self.driven_at(theta, origin, p, jnp.zeros_like(p))
        x0, d0 = guess
        loose, count = self.loose, len(self.free)
        none = (jnp.zeros((count, 3)), jnp.zeros(len(loose)))
        memory = jnp.zeros(self.model.n_memory)

        def state(y):
            x, w = y[: 3 * count].reshape(-1, 3), y[3 * count :]
            moved = self.whole((x, w, *none, taken(d0, loose)), driven)
            t0, t = rods.directions(self.model.rods.edges, x0), rods.directions(self.model.rods.edges, moved[0])
            return x, w, *none, taken(rods.carried(t0, t, d0), loose)

        def residual(y):
            f, tau, _ = self.force(theta, extra, -1e3, self.whole(state(y), driven), memory)
            return jnp.concatenate([taken(f, self.free).ravel(), taken(tau, loose)])

        def newton(_, carried):
            y, _ = carried
            step = jnp.linalg.solve(differences(residual, y), residual(y))
            step *= jnp.minimum(1.0, 0.05 / jnp.max(jnp.abs(step)))
            return y - step, jnp.max(jnp.abs(step))

        y, last = jax.lax.fori_loop(0, turns, newton, (jnp.concatenate([taken(x0, self.free).ravel(), none[1]]), 0.0))
        return state(y), last

    def simulate(self, begun, theta, extra, table, origin, steps):
        """Nodes (rows, n, 3), their velocities and first material axes (rows, E, 3) of one variant from rest."""
        begun = (*begun, jnp.zeros(self.model.n_memory))
        mass, inertia = self.inertia(theta)
        places, weights = jnp.array([0.0, 0.5, 0.5, 1.0]), jnp.array([1.0, 2.0, 2.0, 1.0]) / 6.0
        h = ROW / steps

        def rates(y, time, p, p_dot):
            state = self.whole(y[:5], self.driven_at(theta, origin, p, p_dot))
            f, tau, z_dot = self.force(theta, extra, time, state, y[5])
            e = self.model.rods.edges
            span, speed = state[0][e[:, 1]] - state[0][e[:, 0]], state[2][e[:, 1]] - state[2][e[:, 0]]
            size = jnp.sqrt(rods.dots(span, span))
            t = span / size
            d = y[4]
            turn = taken((speed - t * rods.dots(t, speed)) / size, self.loose)
            d_dot = -rods.dots(d, turn) * taken(t, self.loose)
            return y[2], y[3], taken(f, self.free) / mass, taken(tau, self.loose) / inertia, d_dot, z_dot

        def row(y, own):
            k, p, p_dot = own

            def step(i, y):
                def stage(j, carried):
                    slope, total = carried
                    at = tuple(a + places[j] * h * b for a, b in zip(y, slope, strict=True))
                    slope = rates(at, k * ROW + (i + places[j]) * h, p + (i + places[j]) * h * p_dot, p_dot)
                    return slope, tuple(a + weights[j] * b for a, b in zip(total, slope, strict=True))

                none = tuple(0.0 * a for a in y)
                _, total = jax.lax.fori_loop(0, 4, stage, (none, none))
                return tuple(a + h * b for a, b in zip(y, total, strict=True))

            seen = self.seen(y, self.driven_at(theta, origin, p, p_dot))
            return jax.lax.fori_loop(0, steps, step, y), seen

        slopes = (table[1:] - table[:-1]) / ROW
        end, out = jax.lax.scan(row, begun, (jnp.arange(len(slopes)), table[:-1], slopes))
        final = self.seen(end, self.driven_at(theta, origin, table[-1], slopes[-1]))
        return tuple(jnp.concatenate([a, b[None]]) for a, b in zip(out, final, strict=True))

    def seen(self, y, driven):
        x, w, v, _, d = self.whole(y[:5], driven)
        return x, v, rods.turned(rods.directions(self.model.rods.edges, x), d, w)

    def midpoint(self, begun, theta, extra, table, origin, steps):
        """The same by the implicit midpoint rule in steps of ROW/steps: r = m (v⁺ - v)/h - f(q̄, v̄) = 0 for free nodes and twists."""
        mass, inertia = self.inertia(theta)
        memory, h, edges, count = jnp.zeros(self.model.n_memory), ROW / steps, self.model.rods.edges, len(self.free)

        def carried(d, before, now):
            return rods.carried(*(taken(rods.directions(edges, x), self.loose) for x in (before, now)), d)

        def row(y, own):
            k, p, p_dot = own

            def step(i, y):
                x, w, v, o, d = y
                begin = self.whole(y, self.driven_at(theta, origin, p + i * h * p_dot, p_dot))[0]
                middle = self.driven_at(theta, origin, p + (i + 0.5) * h * p_dot, p_dot)

                def split(new):
                    return new[: 3 * count].reshape(-1, 3), new[3 * count :]

                def residual(new):
                    v_new, o_new = split(new)
                    v_bar, o_bar = 0.5 * (v + v_new), 0.5 * (o + o_new)
                    x_bar = self.whole((x + 0.5 * h * v_bar, w, v, o, d), middle)[0]
                    state = (x + 0.5 * h * v_bar, w + 0.5 * h * o_bar, v_bar, o_bar, carried(d, begin, x_bar))
                    f, tau, _ = self.force(theta, extra, k * ROW + (i + 0.5) * h, self.whole(state, middle), memory)
                    r = (v_new - v - h * taken(f, self.free) / mass, o_new - o - h * taken(tau, self.loose) / inertia)
                    return jnp.concatenate([a.ravel() for a in r])

                new = jnp.concatenate([v.ravel(), o])
                inverse = jnp.linalg.inv(differences(residual, new))
                new = jax.lax.fori_loop(0, 6, lambda _, a: a - inverse @ residual(a), new)
                v_new, o_new = split(new)
                x_new, w_new = x + 0.5 * h * (v + v_new), w + 0.5 * h * (o + o_new)
                end = self.driven_at(theta, origin, p + (i + 1) * h * p_dot, p_dot)
                after = self.whole((x_new, w_new, v_new, o_new, d), end)[0]
                return x_new, w_new, v_new, o_new, carried(d, begin, after)

            seen = self.seen(y, self.driven_at(theta, origin, p, p_dot))
            return jax.lax.fori_loop(0, steps, step, y), seen

        slopes = (table[1:] - table[:-1]) / ROW
        end, out = jax.lax.scan(row, begun, (jnp.arange(len(slopes)), table[:-1], slopes))
        final = self.seen(end, self.driven_at(theta, origin, table[-1], slopes[-1]))
        return tuple(jnp.concatenate([a, b[None]]) for a, b in zip(out, final, strict=True))


@functools.cache
def layout(text: str) -> Rod:
    """The layout of a scene's text."""
    return Rod.of(text)


@functools.cache
def programs(text: str, rule: str) -> tuple:
    """Equilibria and rollouts of lanes of a layout; compiled programs are kept on disk, as each takes ten seconds and more."""
    jax.config.update("jax_compilation_cache_dir", str(KEPT))
    rod = layout(text)
    one = rod.midpoint if rule == "scene" else rod.simulate

    @functools.partial(jax.jit, compiler_options=QUICK)
    def rest(theta, extra, record, tables, origin, guess, turns):
        return jax.vmap(lambda p, e, r: rod.at_rest(p, e, origin, tables[r, 0], guess, turns))(theta, extra, record)

    @functools.partial(jax.jit, compiler_options=QUICK)
    def rollout(begun, theta, extra, record, tables, origin, steps):
        return jax.vmap(lambda b, p, e, r: one(b, p, e, tables[r], origin, steps))(begun, theta, extra, record)

    return rest, rollout


def in_lanes(function, count: int, width: int) -> list[np.ndarray]:
    """Arrays of `count` variants from those of `function(numbers of width variants)`; the last variant fills up."""
    parts = []
    for at in range(0, count, width):
        own = np.minimum(np.arange(at, at + width), count - 1)
        parts.append([np.asarray(a)[: count - at] for a in function(own)])
    return [np.concatenate(a) for a in zip(*parts, strict=True)]


def run(text: str, rule: str, theta, extra, record, tables, origin, guess, turns: int, steps: int):
    """Nodes (B, rows, n, 3), velocities, first axes (B, rows, E, 3) of B variants, and the last steps to their equilibria (B,)."""
    rest, rollout = programs(text, rule)

    def resting(own):
        begun, last = rest(theta[own], extra[own], record[own], tables, origin, guess, turns)
        return *begun, last

    few, many = LANES
    *begun, last = in_lanes(resting, len(record), few)
    moving = lambda own: rollout(tuple(a[own] for a in begun), theta[own], extra[own], record[own], tables, origin, steps)
    return *in_lanes(moving, len(record), few if len(record) <= 2 * few else many), last
