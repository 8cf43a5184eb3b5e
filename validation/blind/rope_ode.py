"""The rope as a continuous-time ODE, written anew: analytic forces, batched over variants.

    M q̈ = f_gravity + f_stretch + f_bend + f_damping + f_drag + f_hidden,   driven nodes prescribed

Layout: q, v are (3, n, B) [m], [m/s]; B variants (records × parameter values) advance together.
A parameter is an array (B,) or, for vectors, (k, B). With edges e, t = e/|e|, ṫ = (I - t tᵀ) ė/|e|,
d = t2 - t1, s = t1 + t2, T = s/|s|, κ = 2 d/|s| [-], l_v the Voronoi length [m]:

    κ̇⊥ = P_T κ̇ = (2/|s|) P_T (ṫ2 - ṫ1) - (2 d/|s|²) T·(ṫ1 + ṫ2)                        [1/s]

The moment conjugate to κ, τ = -(EI κ + c_b κ̇⊥ + …)/l_v, acts on the edges through the transpose of
the same map, which serves elastic and viscous parts alike (P_T κ = κ).

Outside pliant's library (keys of `HIDDEN`): magnet [N·m] pull K (p - x)/(|p - x|² + a²)^{3/2} per
length; hardening [-] EI (1 + β|κ|²); gradient [-] EI (1 + g (2 i/(n-1) - 1)); curvature
[-] rest value of κ·e_z; friction [N·m²] -M κ̇⊥/(|κ̇⊥|² + δ²)^½ / l_v; lag [s] of the grippers.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from validation.blind.families import Family, driven_positions

GRAVITY = 9.81  # m/s²
FRICTION_RATE = 0.1  # 1/s, δ of the bending friction
MAGNET_CORE = 0.15  # m, a of the pull
HIDDEN = ("magnet", "hardening", "gradient", "curvature", "friction", "lag")
Params = dict[str, np.ndarray]


def parameters(family: Family, changes: list[dict[str, float | list[float]]]) -> Params:
    """Batch of parameter sets: the nominal ones with one dict of changes (absolute values) each."""
    n_driven = len(family.driven)
    base: dict[str, object] = dict(family.nominal)
    base |= {"wind": [0.0] * 3, "tilt": [0.0] * 2, "offset": [0.0] * (3 * n_driven)}
    base |= dict.fromkeys(HIDDEN, 0.0)
    for change in changes:
        assert change.keys() <= base.keys(), change.keys() - base.keys()
    rows = [base | change for change in changes]
    return {key: np.array([row[key] for row in rows], dtype=float).T for key in base}


def take(params: Params, index: np.ndarray) -> Params:
    """The sub-batch `index` (with repetition)."""
    return {key: value[..., index] for key, value in params.items()}


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("inb,inb->nb", a, b)


def masses(family: Family, p: Params) -> np.ndarray:
    """Nodal masses (n, B) [kg]: ρ × Voronoi length, the tip mass on the last node."""
    m = p["rho"] * voronoi(family)[:, None]
    m[-1] += p["tip"]
    return m


def voronoi(family: Family) -> np.ndarray:
    """Voronoi length of every node (n,) [m]; equal edges."""
    length = np.full(family.n, family.length / (family.n - 1))
    length[[0, -1]] *= 0.5
    return length


def gravity(p: Params) -> np.ndarray:
    """g Ry(tilt1) Rx(tilt0) (0, 0, -1), (3, 1, B) [m/s²]."""
    a, b = p["tilt"]
    y, z = np.sin(a), -np.cos(a)
    return GRAVITY * np.stack([np.sin(b) * z, y, np.cos(b) * z])[:, None, :]


def bend_moment(family: Family, p: Params, kappa: np.ndarray, rate: np.ndarray, tangent: np.ndarray):
    """Moment τ conjugate to κ at the interior nodes (3, n-2, B) [N·m]."""
    place = np.linspace(-1.0, 1.0, family.n)[1:-1, None]
    stiffness = p["EI"] * (1.0 + p["gradient"] * place)
    if p["hardening"].any():
        stiffness = stiffness * (1.0 + p["hardening"] * dot(kappa, kappa))
    moment = -stiffness * kappa - p["cb"] * rate
    if p["curvature"].any():
        rest = np.zeros_like(tangent)
        rest[2] = 1.0
        moment += stiffness * p["curvature"] * (rest - tangent * tangent[2])
    if p["friction"].any():
        moment -= p["friction"] * rate / np.sqrt(dot(rate, rate) + FRICTION_RATE**2)
    return moment * ((family.n - 1) / family.length)


def forces(family: Family, p: Params, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Force on every node (3, n, B) [N]."""
    l0 = family.length / (family.n - 1)
    e, w = q[:, 1:] - q[:, :-1], v[:, 1:] - v[:, :-1]
    length = np.sqrt(dot(e, e))
    t = e / length
    stretch_rate = dot(t, w)
    t_dot = (w - t * stretch_rate) / length
    t1, t2 = t[:, :-1], t[:, 1:]
    d, s = t2 - t1, t1 + t2
    size = np.sqrt(dot(s, s))
    tangent = s / size
    d_dot, s_dot = t_dot[:, 1:] - t_dot[:, :-1], t_dot[:, :-1] + t_dot[:, 1:]
    kappa = 2.0 * d / size
    rate = (2.0 / size) * (d_dot - tangent * dot(tangent, d_dot) - kappa * (0.5 * dot(tangent, s_dot)))
    tau = bend_moment(family, p, kappa, rate, tangent)
    push = 2.0 * tau / size
    common = tangent * (dot(kappa, tau) / size)
    on_t = np.zeros_like(t)  # generalised force conjugate to t
    on_t[:, 1:] += push - common
    on_t[:, :-1] -= push + common
    tension = p["EA"] * (length / l0 - 1.0) + p["cs"] * stretch_rate / l0
    on_e = (on_t - t * dot(t, on_t)) / length - t * tension
    area = voronoi(family)[:, None]
    u = v - p["wind"][:, None, :]
    f = masses(family, p) * gravity(p) - u * (area * (p["c1"] + p["c2"] * np.sqrt(dot(u, u))))
    f[:, 1:] += on_e
    f[:, :-1] -= on_e
    if p["magnet"].any():
        r = np.asarray(family.magnet)[:, None, None] - q
        f += r * (p["magnet"] * area / (dot(r, r) + MAGNET_CORE**2) ** 1.5)
    return f


def drive(family: Family, p: Params, records: np.ndarray, t: np.ndarray):
    """True positions and velocities of the driven nodes, each (3, n_driven, B, len(t)).

    Position = command (lagged by p.lag) + offset; velocity by central differences of the smooth law.
    """
    delta = 1.0e-5
    position, velocity = [], []
    for b, record in enumerate(records):
        x = driven_positions(family, record, t)
        ahead, behind = (driven_positions(family, record, t + side) for side in (delta, -delta))
        rate = (ahead - behind) / (2.0 * delta)
        lag = p["lag"][b]
        if lag > 0.0:  # exact for a command linear between the (fine) grid times
            step = t[1] - t[0]
            decay = np.exp(-step / lag)
            behind_by = np.zeros_like(x)  # command - true
            for k in range(1, len(t)):
                slope = (x[..., k] - x[..., k - 1]) / step
                behind_by[..., k] = decay * behind_by[..., k - 1] + lag * (1.0 - decay) * slope
            x, rate = x - behind_by, behind_by / lag
        position.append(x + p["offset"][:, b].reshape(-1, 3).T[:, :, None])
        velocity.append(rate)
    return np.stack(position, axis=2), np.stack(velocity, axis=2)


def equilibrium(family: Family, p: Params, held: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Static shapes (3, n, B) with the driven nodes at `held` (3, n_driven, B), by Newton's method.

    The Jacobian is a forward difference; `guess` (3, n) a nearby stable shape.
    """
    n_batch = held.shape[2]
    free = family.free_nodes
    k = 3 * (free.stop - free.start)
    q = np.repeat(guess[:, :, None], n_batch, axis=2)
    q[:, family.driven] = held
    spread = take(p, np.repeat(np.arange(n_batch), k + 1))
    delta = 1.0e-7
    for _ in range(40):
        trial = np.repeat(q, k + 1, axis=2).reshape(3, family.n, n_batch, k + 1)
        for j in range(k):
            trial[j // (k // 3), free.start + j % (k // 3), :, j + 1] += delta
        trial = trial.reshape(3, family.n, -1)
        f = forces(family, spread, trial, np.zeros_like(trial))[:, free]
        f = f.reshape(k, n_batch, k + 1).transpose(1, 0, 2)
        step = np.linalg.solve(f[:, :, 1:] - f[:, :, :1], -f[:, :, 0][..., None])[..., 0] * delta
        step *= np.minimum(1.0, 0.05 / np.abs(step).max(axis=1, keepdims=True))
        q[:, free] += step.reshape(n_batch, 3, -1).transpose(1, 2, 0)
        if np.abs(step).max() < 1.0e-9:
            return q
    raise RuntimeError(f"no equilibrium: last step {np.abs(step).max():.1e} m")


def stable_step(family: Family, p: Params) -> float:
    """Largest RK4 step [s] for the stiffest axial and bending modes, with a margin."""
    edge = family.length / (family.n - 1)
    rho = p["rho"]
    axial = 2.0 / edge * np.sqrt(p["EA"] / rho) + 4.0 * p["cs"] / rho / edge**2
    bend = p["EI"] * (1.0 + np.abs(p["gradient"]) + 2.0 * p["hardening"])
    flexural = 4.0 / edge**2 * np.sqrt(bend / rho)
    viscous = 16.0 / edge**4 * (p["cb"] + p["friction"] / FRICTION_RATE) / rho
    return float(1.6 / np.max(np.maximum(axial, flexural + viscous)))


def simulate(
    family: Family, p: Params, records: np.ndarray, guess: np.ndarray, refine: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Truth by classical RK4 at fixed steps; q, v at the log's times, each (T, 3, n, B).

    Starts in the equilibrium of each variant, at rest. `refine` divides the step (convergence tests).
    """
    times = family.times
    sub = refine * int(np.ceil(1.0 / (family.rate * stable_step(family, p))))
    h = 1.0 / (family.rate * sub)
    x_drive, v_drive = drive(family, p, records, np.arange(2 * sub * (len(times) - 1) + 1) * (0.5 * h))
    q = equilibrium(family, p, x_drive[..., 0], guess)
    v = np.zeros_like(q)
    q_log, v_log = (np.empty((len(times), *q.shape)) for _ in range(2))
    q_log[0], v_log[0] = q, v
    free = family.free_nodes
    held = family.driven
    inverse_mass = 1.0 / masses(family, p)[free]

    def acceleration(q_free: np.ndarray, v_free: np.ndarray, k: int) -> np.ndarray:
        q[:, free], v[:, free] = q_free, v_free
        q[:, held], v[:, held] = x_drive[..., k], v_drive[..., k]
        return forces(family, p, q, v)[:, free] * inverse_mass

    x, y = q[:, free].copy(), v[:, free].copy()
    for row in range(1, len(times)):
        for k in range(2 * sub * (row - 1), 2 * sub * row, 2):
            a1 = acceleration(x, y, k)
            y2 = y + 0.5 * h * a1
            a2 = acceleration(x + 0.5 * h * y, y2, k + 1)
            y3 = y + 0.5 * h * a2
            a3 = acceleration(x + 0.5 * h * y2, y3, k + 1)
            y4 = y + h * a3
            a4 = acceleration(x + h * y3, y4, k + 2)
            x = x + (h / 6.0) * (y + 2.0 * y2 + 2.0 * y3 + y4)
            y = y + (h / 6.0) * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        q_log[row, :, free], v_log[row, :, free] = x, y
        q_log[row, :, held] = x_drive[..., 2 * sub * row].transpose(1, 0, 2)
        v_log[row, :, held] = v_drive[..., 2 * sub * row].transpose(1, 0, 2)
    return q_log, v_log


def simulate_dop853(family: Family, p: Params, record: int, guess: np.ndarray) -> np.ndarray:
    """The same record (one variant, no lag) by DOP853 at rtol 1e-10: checks `simulate`. (T, 3, n)."""
    free = family.free_nodes
    held = family.driven
    inverse_mass = 1.0 / masses(family, p)[free]
    one = np.array([record])
    x0, _ = drive(family, p, one, np.zeros(1))
    q = equilibrium(family, p, x0[..., 0], guess)
    v = np.zeros_like(q)
    shape = q[:, free].shape

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        x, y = state.reshape(2, *shape)
        q[:, free], v[:, free] = x, y
        xd, vd = drive(family, p, one, np.array([t]))
        q[:, held], v[:, held] = xd[..., 0], vd[..., 0]
        return np.concatenate([y.ravel(), (forces(family, p, q, v)[:, free] * inverse_mass).ravel()])

    start = np.concatenate([q[:, free].ravel(), np.zeros(q[:, free].size)])
    solution = solve_ivp(
        rate, (0.0, family.times[-1]), start, "DOP853", family.times, rtol=1e-10, atol=1e-12
    )
    out = np.empty((len(family.times), 3, family.n))
    out[:, :, free] = solution.y.T.reshape(-1, 2, *shape)[:, 0, ..., 0]
    out[:, :, held] = drive(family, p, one, family.times)[0][:, :, 0].transpose(2, 0, 1)
    return out


def relaxed_shape(family: Family) -> np.ndarray:
    """A stable static shape (3, n) of the nominal rope: heavily damped motion, then Newton."""
    p = parameters(family, [{"c1": 1.0}])
    hold, _ = drive(family, p, np.array([0]), np.zeros(1))
    last = np.asarray(family.grippers[-1].at[-1])
    first = np.asarray(family.grippers[0].at[0])
    s = np.linspace(0.0, 1.0, family.n)
    if len(family.grippers) > 1:  # a parabola about as long as the rope
        sag = 0.5 * np.sqrt(max(family.length**2 - np.sum((last - first) ** 2), 0.0))
        q = first[:, None] + (last - first)[:, None] * s - np.array([[0], [0], [4 * sag]]) * s * (1 - s)
    else:
        direction = last - first if len(family.driven) > 1 else np.array([0.0, 0.0, -1.0])
        q = first[:, None] + family.length * s * (direction / np.linalg.norm(direction))[:, None]
    q = np.array(q)[:, :, None]
    q[:, family.driven] = hold[..., 0]
    v = np.zeros_like(q)
    free = family.free_nodes
    h = 0.5 * stable_step(family, p)
    inverse_mass = 1.0 / masses(family, p)[free]
    for _ in range(int(2.0 / h)):  # symplectic Euler
        v[:, free] += h * forces(family, p, q, v)[:, free] * inverse_mass
        q[:, free] += h * v[:, free]
    return equilibrium(family, p, hold[..., 0], q[:, :, 0])[:, :, 0]
