"""The root of a stage and its derivatives, and rollouts, from the slopes of its residual.

Newton's method starts from the last impulses; where that does not converge, from a soft contact whose κ falls tenfold at a time. No
derivative passes through the search.
"""

import numpy as np

from . import touching_landing, touching_step
from .step import GAMMA


MOST = 80  # iterations at one κ
SLOW = 1e-3  # [m/s] beside which velocities count as large
SHORTEST = 1e-6  # part of a correction
COARSE, FINE = 1e-6, 1e-9  # relative size of the correction that is left, on the way and at the end
ROUNDING = 1e-13  # relative size of a correction that need not contract


CARRIES = 0.3  # [m/s²] of the lighter solid's mass, from which on a contact is one that carries


class NotSolved(Exception):
    """No root was found."""


class Stepper:
    """Steps of a model by a compiled `slopes`: (directions, q, v, command, u, θ, y, h, contacts, scale) -> (value, its slopes along as
    many directions of z as there are unknowns) of a stage.

    It takes `size` contacts and `width` entries of θ, of which the last are idle, so that it may serve several scenes.
    """

    def __init__(self, model, slopes, size, width):
        self.model, self.slopes, self.size, self.width = model, slopes, size, width
        self.impulses = {}  # w₀ of the contacts of the last stage
        self.largest = 0.0  # relative size of the last Newton steps
        self.counts = []  # contacts listed, stage by stage
        self.steps = 0
        self.halved = []  # numbers of the steps of sdirk2 that two half steps take
        self.last = None  # contacts and w₀ of the last stage
        self.loaded = set()  # what carried a part of a weight: kinds of the two features

    def stage(self, q, v, command, u, theta, h):
        """(v⁺, S (2 nv, …)): the stage's end and the slope of its change (q⁺, v⁺) by (q, v, command, u, θ)."""
        model, n = self.model, self.model.nv
        v_cmd = np.asarray(touching_step.commands(model, command, u, theta))
        contacts = touching_step.listed(model, q, v, v_cmd, theta, h)
        self.counts.append(len(contacts))
        c = touching_step.packed(model, contacts, self.size, self.width)
        m = n + touching_step.n_rows(model)
        padded = np.concatenate([theta, np.zeros(self.width - len(theta))])

        n_y, n_x = m + self.size, 2 * n + len(command) + len(u) + self.width

        def at(y, scale, columns=None):
            """The rows of the residual and of q⁺, and their slopes by y, or by these entries of z."""
            columns = n_x + np.arange(n_y) if columns is None else columns
            along = np.zeros((n_y, n_x + n_y))
            along[np.arange(len(columns)), columns] = 1.0
            value, slope = (np.asarray(x) for x in self.slopes(along, q, v, command, u, padded, y, h, c, scale))
            return value[:n_y], slope[:, : len(columns)]

        # size of a correction: velocities, and impulses over masses
        weight = np.concatenate([np.ones(m), 1.0 / c["rho"]])
        soft = np.concatenate([v, np.zeros(m - n), np.where(c["listed"], np.sqrt(c["rho"] * c["kappa"]), 0.0)])
        start = soft.copy()
        for k, contact in enumerate(contacts):
            start[m + k] = self.impulses.get(contact.identity, soft[m + k])
        y = self._newton(at, start, weight, 1.0, last=True)
        y = self._continued(at, soft, weight) if y is None else y
        self.last = contacts, y[m : m + len(contacts)]
        self.impulses = {contact.identity: w for contact, w in zip(*self.last, strict=True)}
        carries = y[m:] > CARRIES * h * c["rho"] / touching_step.RHO
        self.loaded |= {(a.first.name[0], a.second.name[0]) for a, yes in zip(contacts, carries, strict=False) if yes}
        given = np.arange(n_x - self.width + len(theta))
        outside = np.hstack([at(y, 1.0, given[k : k + n_y])[1] for k in range(0, len(given), n_y)])
        inside = at(y, 1.0)[1]
        by_outside = -np.linalg.solve(inside[:n_y], outside[:n_y])
        return y[:n], np.vstack([outside[n_y:] + inside[n_y:] @ by_outside, by_outside[:n]])

    def _continued(self, at, y, weight):
        """The root, from that at 10⁴ κ."""
        level, step = 4.0, 1.0
        y = self._newton(at, y, weight, 10.0**level)
        if y is None:
            raise NotSolved("the soft contact")
        while level > 0.0:
            lower = max(0.0, level - step)
            found = self._newton(at, y, weight, 10.0**lower, last=lower == 0.0)
            if found is None:
                step *= 0.5
                if step < 0.02:
                    raise NotSolved(f"at 10^{lower} κ")
                continue
            y, level, step = found, lower, min(1.0, 1.5 * step)
        return y

    def _newton(self, at, y, weight, scale, last=False):
        """The root at this κ, or None; at the end corrections go on for as long as they shrink tenfold."""
        size = lambda d: np.sqrt(np.sum((weight * d) ** 2))
        n, velocities = self.model.nv, weight == 1.0

        def correction(y):
            r, k = at(y, scale)
            return r, k, -np.linalg.solve(k[: len(y)], r) if np.all(np.isfinite(r)) else None

        _, k, d = correction(y)
        alpha = 1.0
        for _ in range(MOST):
            unit = SLOW + size(y * velocities)
            trial = y + alpha * d
            r, k_next, next_d = correction(trial)
            simplified = np.inf if next_d is None else size(np.linalg.solve(k[: len(y)], r))
            if simplified > max((1.0 - 0.25 * alpha) * size(d), ROUNDING * unit):
                alpha *= 0.5
                if alpha < SHORTEST:
                    return None
                continue
            quick = alpha == 1.0 and size(next_d) < 0.1 * size(d)
            y, k, d, alpha = trial, k_next, next_d, min(1.0, 2.0 * alpha)
            if size(d) < (FINE if last else COARSE) * unit and not (last and quick):
                if last:
                    self.largest = max(self.largest, np.linalg.norm(d[:n]) / unit)
                return y + d
        return None

    def step(self, x, u, theta):
        """(x⁺, A, B, C)."""
        model, n, h, count = self.model, self.model.nv, self.model.h, 3 * self.model.n_nodes
        q, v = x[: model.nq], x[model.nq :]
        # slopes of what a stage is given, by (q, v, u, θ)
        by_q, by_v, by_u, by_theta = np.split(np.eye(2 * n + len(u) + len(theta)), np.cumsum([n, n, len(u)]))
        begin = (q, v, by_q, by_v)

        def advance(start, length):
            (q_0, v_0, to_q, to_v) = start
            v_1, s = self.stage(q_0, v_0, q[:count], u, theta, length)
            slope = s @ np.vstack([to_q, to_v, by_q[:count], by_u, by_theta])
            return touching_step.moved(model, q_0, length * v_1), v_1, slope[:n], slope[n:]

        if model.integrator == "euler":
            end = advance(begin, h)
        elif model.integrator == "sdirk2":
            first = advance(begin, GAMMA * h)
            contacts, load = self.last
            second = self._second(begin, first)
            ends = [(q, v), first[:2], second[:2]]
            if touching_landing.thrown_back(model, ends, contacts, load, theta, GAMMA * h):
                self.halved.append(self.steps)
                end = advance(advance(begin, 0.5 * h), 0.5 * h)
            else:
                end = advance(second, GAMMA * h)
        else:
            raise ValueError(model.integrator)
        self.steps += 1
        slopes = np.split(np.vstack(end[2:]), np.cumsum([2 * n, len(u)]), axis=1)
        return np.concatenate(end[:2]), *slopes

    def _second(self, begin, first):
        """Where the second stage of sdirk2 begins: q ⊕ (1 - γ) h v₁, v + (1 - γ)/γ (v₁ - v)."""
        q, v, by_q, by_v = begin
        way, more = (1.0 - GAMMA) * self.model.h, (1.0 - GAMMA) / GAMMA
        at_q, at_t = touching_step.slopes_of_moved(self.model, way * first[1])
        to_q = at_q @ by_q + at_t @ (way * first[3])
        return touching_step.moved(self.model, q, way * first[1]), v + more * (first[1] - v), to_q, by_v + more * (first[3] - by_v)

    def rollout(self, x0, u, theta):
        """(x (T + 1, nx), [(A, B, C)])."""
        xs, slopes = [np.asarray(x0, dtype=float)], []
        for row in u:
            x, *abc = self.step(xs[-1], row, theta)
            xs.append(x)
            slopes.append(abc)
        return np.array(xs), slopes
