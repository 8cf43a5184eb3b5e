"""MPC with derivatives of smoothed grasps through hard states: a baseline in the manner of CORD-SLS.

States are those of the hard rollout; each step's Jacobians A, B are those of a step whose grippers have the smoothed activation
(`Model.rollout(grasp="smooth", states="hard")`). An update takes one step, without a search: before something is held the cost of
the hard rollout falls along no step, and a search would refuse them all. Steps are

newton     A, B condensed to the inputs, and the full step of the bounded linear least-squares problem ½ |r + J du|² + ½ μ |D du|², D² the
           diagonal of JᵀJ
gradient   projected gradient: of J by `vjp`, scaled so that its largest entry changes an input by `STRIDE`

It is a baseline for comparison, not a part of the product: no constraints but the inputs' bounds, no value of holding.

Widths of the activation are parameters of the scene. `WIDTHS` are those tried, with the scene's contact and with a rest gap of 1 mm.
"""

import numpy as np
import pliant
from scipy.optimize import lsq_linear

DAMPING = 1e-3  # μ
FLOOR = 1e-12  # of the largest entry of D²: Jacobians of inputs that do nothing are zero
STRIDE = 0.05  # m/s
INPUTS = 0.1  # weight of squared velocities, the task's


# (smoothing [m], tail [-], tail_reach [m]): of CORD-SLS with the scene's default tail, a wider one, one of a tenth of the spring at 10 cm
WIDTHS = {"narrow": (1e-3, 1e-3, 0.017), "wide": (1e-2, 1e-2, 0.05), "long": (2e-2, 0.1, 0.1)}


class SmoothedMpc:
    """For a cost that is a sum of squares of nodes' distances from `goal` (n, 3) at every step, and 0.1 |velocity|² of grippers."""

    def __init__(self, model: pliant.Model, theta, goal, horizon: int, lower, upper, *, step: str = "newton", widths: str = "narrow", rest_gap: float | None = None):
        (span,) = {**model.ropes, **model.cloths}.values()
        self.rows, self.goal = slice(3 * span.start, 3 * span.stop), np.ravel(goal)
        values = dict(zip(("smoothing", "tail", "tail_reach"), WIDTHS[widths], strict=True))
        hands = {name.split(".")[0] for name in model.control_names}
        self.theta = model.theta_with({f"{hand}.{key}": value for hand in hands for key, value in values.items()})
        chosen = [k for k, path in enumerate(model.param_paths) if path.split(".")[-1] not in values]
        self.theta[chosen] = np.asarray(theta)[chosen]
        self.model, self.lower, self.upper = model, lower, upper
        self.smooth = {"grasp": "smooth", "states": "hard"} | ({"rest_gap": rest_gap} if rest_gap else {})
        self.moving = [k for k, name in enumerate(model.control_names) if ".velocity." in name]
        self.step, self.shape = step, (horizon, model.nu)
        self.u = np.clip(np.zeros(self.shape), lower, upper)

    def jacobian(self, roll) -> np.ndarray:
        """Derivative of the nodes at all steps by all inputs, (N · 3n, N · nu)."""
        horizon, nu = self.shape
        sensitivity, out = np.zeros((self.model.ndx, horizon * nu)), []
        for k in range(horizon):
            a, b, _ = roll.linearize(k)
            sensitivity[:, : k * nu] = a @ sensitivity[:, : k * nu]
            sensitivity[:, k * nu : (k + 1) * nu] = b
            out.append(sensitivity[self.rows].copy())
        return np.vstack(out)

    def update(self, x0) -> np.ndarray:
        """The inputs to apply now."""
        self.u = np.vstack([self.u[1:], self.u[-1:]])
        roll = self.model.rollout(x0, self.u, self.theta, **self.smooth)
        du = self.newton(roll) if self.step == "newton" else self.gradient(roll)
        self.u = np.clip(self.u + du, self.lower, self.upper)
        return self.u[0]

    def gradient(self, roll) -> np.ndarray:
        """A step along the negative gradient."""
        x_bar = np.zeros((len(roll) + 1, self.model.ndx))
        x_bar[1:, self.rows] = 2 * (roll.x[1:, self.rows] - self.goal)
        slope = roll.vjp(x_bar)[1]
        slope[:, self.moving] += 2 * INPUTS * self.u[:, self.moving]
        slope[:, self.upper <= self.lower] = 0.0
        return -STRIDE * slope / max(np.abs(slope).max(), 1e-300)

    def newton(self, roll) -> np.ndarray:
        """A Gauss-Newton step within the bounds."""
        horizon, nu = self.shape
        by_u = np.sqrt(INPUTS) * np.eye(self.u.size)[[k * nu + j for k in range(horizon) for j in self.moving]]
        rows = np.vstack([self.jacobian(roll), by_u])
        r = np.concatenate([(roll.x[1:, self.rows] - self.goal).ravel(), by_u @ self.u.ravel()])
        free = np.tile(self.upper > self.lower, horizon)
        low, high = (np.tile(bound, horizon) - self.u.ravel() for bound in (self.lower, self.upper))
        a = rows[:, free]
        gram = a.T @ a
        scale = np.sqrt(np.diag(gram) + FLOOR * gram.max())  # unknowns D du
        factor = np.linalg.cholesky(gram / np.outer(scale, scale) + DAMPING * np.eye(len(scale))).T
        bounds = (low[free] * scale, high[free] * scale + 1e-15)
        solution = lsq_linear(factor, np.linalg.solve(factor.T, -(a.T @ r) / scale), bounds, method="bvls")
        du = np.zeros(self.u.size)
        du[free] = solution.x / scale
        return du.reshape(self.shape)
