"""Types of the compiled module. Arrays are float64 in SI units; anything array-like is accepted."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
"""A float64 array. Shapes stand in the documentation: nx numbers of a state, ndx of its change, T steps."""

__version__: str

class InputError(ValueError):
    """Wrong input: a scene, a log, an array's shape, a parameter."""

class NumericsError(RuntimeError):
    """The numerics failed: not converged, not finite, or singular."""

class Trace(TypedDict):
    """Work of each step of a rollout, (T,) each, int64 unless it says otherwise."""

    iterations: NDArray[np.int64]
    """Newton matrices assembled."""
    factorizations: NDArray[np.int64]
    """Factorizations, those at the root for a record included."""
    evaluations: NDArray[np.int64]
    """Residual evaluations besides."""
    retries: NDArray[np.int64]
    """Halvings; a step that is halved is another discrete map."""
    left: NDArray[np.float64]
    """Largest correction left where the residual was rounding before corrections were below the tolerance; zero if none [m/s], float64."""
    energy_created: NDArray[np.float64]
    """Energy that the step created beside the work of what acts, at most [J], float64."""

Verdict = Literal["pass", "fail", "inconclusive"]

class BlockReport(TypedDict):
    """A gradient check along a random direction in one block of inputs."""

    name: str
    """`x0.q`, `x0.v`, `x0.z`, `u`, or the path of a quantity of theta with its indices as `*`."""
    size: int
    """Number of entries."""
    derivative: float
    """Along the direction, by vjp."""
    difference: float
    """The finite difference of least uncertainty (one_sided at a bound); nan if each has a switch."""
    relative_error: float
    """Disagreement of derivative and difference; at most 1e-7 or ten floors pass."""
    floor: float
    """Relative uncertainty of the difference, which judges if it is at most 1e-6."""
    step: float
    """Smallest step of the difference, in the unit of the block."""
    taylor_slope: float | None
    """2 where the map is curved along the direction; None where it is affine."""
    dot_test: float
    """Relative disagreement of jvp and vjp, beyond the last digit of the loss."""
    switches: int
    """Contacts, motors, plastic or frictional sections and halvings that changed their mode within the
    smallest difference, if every difference has some; otherwise 0."""
    one_sided: bool
    """Whether the value is at its physical bound."""
    verdict: Verdict
    """inconclusive: jvp and vjp agree, but no difference judges."""
    reason: str | None
    """Why the block does not pass, with the figures."""

class GradcheckReport(TypedDict):
    """The outcome of a gradient check and its blocks."""

    verdict: Verdict
    """fail if a block fails, inconclusive if none fails and some are inconclusive."""
    judged: int
    """Number of blocks that pass or fail."""
    total: int
    """Number of blocks."""
    worst_relative_error: float
    """Of the blocks that are judged."""
    taylor_slope: float | None
    """The one farthest from 2 of the blocks that are judged."""
    dot_test: float
    """Largest disagreement of jvp and vjp."""
    switches: int
    """Sum over the blocks."""
    retries: int
    """Halvings of the rollout that is checked."""
    blocks: list[BlockReport]
    """Block by block."""

class Reach(TypedDict):
    """The point of a rope or a cloth nearest to a gripper."""

    distance: float
    """From the gripper's point [m]."""
    distance_by_x: Array
    """Its derivative by a change of x, (ndx,); exact but where another part is as near, zero where the distance is."""
    point: Array
    """The nearest point, (3,) [m]."""
    nodes: list[int]
    """Nodes of the edge or triangle it lies on."""
    weights: Array
    """Their weights [-]."""

@final
class Model:
    """A scene made ready to simulate: a fixed map x_next = F(x, u, theta). Immutable."""

    @property
    def n_nodes(self) -> int:
        """Number of nodes, ghosts at clamped end edges included."""
    @property
    def nx(self) -> int:
        """Size of the state x = [q, v, z]: node positions [m] and joint coordinates [rad, m] (a unit quaternion,
        w first, for a ball), velocities of nodes [m/s] and joints [rad/s, m/s], then history variables
        (`memory_names`)."""
    @property
    def ndx(self) -> int:
        """Size of a change of state [dq, dv, dz], of tangents, cotangents and Jacobians: nx, but for three numbers
        instead of a ball's quaternion, a turn in its body's axes [rad]."""
    @property
    def dof_names(self) -> list[str]:
        """Names of the entries of v that belong to joints, in order; `name[k]` for the parts of a ball."""
    @property
    def memory_names(self) -> list[str]:
        """Names of the entries of z, the end of x: `elbow.plastic` [rad, m], `elbow.load` [N·m, N],
        `rod.node[i].creep[k]` and `rod.node[i].plastic[k]` (docs/rods.md), `motor.target`,
        `motor.command[k]` (k + 1 steps ago) and `motor.lagged`, in the unit of the motor's control."""
    @property
    def nu(self) -> int:
        """Number of inputs of all grippers."""
    @property
    def n_params(self) -> int:
        """Number of parameters."""
    @property
    def step_length(self) -> float:
        """Step length h [s]."""
    @property
    def rest_gap(self) -> float:
        """Rest gap of the scene's contact [m]: how far above a floor a resting node hovers."""
    @property
    def param_paths(self) -> list[str]:
        """Names of the parameters in the order of theta, e.g. `cable.bend_stiffness`."""
    @property
    def param_units(self) -> list[str]:
        """SI units of the parameters; `-` if dimensionless."""
    @property
    def param_bounds(self) -> Array:
        """Physical bounds of the parameters, (n_params, 2), in the parameters' units."""
    @property
    def theta(self) -> Array:
        """The scene's parameters, (n_params,), in the parameters' units. A fresh copy."""
    @property
    def control_names(self) -> list[str]:
        """Names of the inputs, e.g. `left.node[0].x`."""
    @property
    def control_units(self) -> list[str]:
        """Units of the inputs: m for positions, m/s, rad/s; `-` for an axis."""
    @property
    def ropes(self) -> dict[str, slice]:
        """Nodes of every rope, ghosts left out: `q.reshape(-1, 3)[model.ropes["cable"]]`."""
    @property
    def cloths(self) -> dict[str, slice]:
        """Nodes of every sheet of cloth: `q.reshape(-1, 3)[model.cloths["sheet"]]`. A grid's node (i, j) has the number
        i * nodes[1] + j, so `.reshape(nu, nv, 3)` gives its rows."""
    @property
    def triangles(self) -> dict[str, NDArray[np.int64]]:
        """Triangles of every sheet of cloth, (n, 3), by its own nodes counted from 0; neighbours are turned the same way."""
    def param_index(self, path: str) -> int:
        """Index of a parameter in theta. InputError names the nearest path."""
    def theta_with(self, values: Mapping[str, float]) -> Array:
        """The scene's parameters with some replaced, (n_params,); SI units."""
    def initial_state(self, theta: ArrayLike | None = None) -> Array:
        """The state the scene starts from, (nx,) [m, m/s].

        The initial shape, or the equilibrium (solved at theta) if the scene says so.
        """
    def controls(self, n_steps: int | None = None) -> Array:
        """Inputs of the scene's gripper motions, (n_steps, nu), by default for its duration.

        Row k belongs to step k: prescribed positions are those at the step's end. At most 10⁷ rows.
        """
    def displaced(self, x: ArrayLike, dx: ArrayLike) -> Array:
        """The state (nx,) a change dx (ndx,) away from x (nx,), x ⊕ dx.

        Quaternions stay quaternions, and the material axes of rods move with their edges: change
        states this way rather than by hand.
        """
    def difference(self, b: ArrayLike, a: ArrayLike) -> Array:
        """The change dx (ndx,) that leads from state a (nx,) to state b (nx,), b ⊖ a."""
    def pull_displaced(self, x: ArrayLike, x_bar: ArrayLike) -> Array:
        """Cotangents of changes (n, ndx) from x_bar (n, nx), those of the numbers of states x (n, nx).

        Eᵀ x_bar with E = ∂(x ⊕ dx)/∂dx at dx = 0: the chain rule from a loss of x, with quaternions and the axes of rods,
        to the x_bar (n, ndx) that `vjp` takes.
        """
    def pull_difference(self, x: ArrayLike, dx_bar: ArrayLike) -> Array:
        """Cotangents of the numbers (n, nx) of states x (n, nx) from dx_bar (n, ndx), those of changes.

        Dᵀ dx_bar with D = ∂(b ⊖ x)/∂b at b = x: the chain rule from what `vjp` returns to what x was computed from. It undoes
        `pull_displaced` from the right: pull_displaced(x, pull_difference(x, dx_bar)) = dx_bar.
        """
    def material_axes(self, x: ArrayLike) -> Array:
        """First material axes at x (nx,) of all edges that twist, (n_twists, 3) [-]."""
    @property
    def grasping(self) -> list[str]:
        """Names of the grippers that grasp, in the order of `held`."""
    def held(self, x: ArrayLike) -> NDArray[np.bool_]:
        """Whether each grasping gripper holds something at x (nx,), in the order of `grasping`."""
    def reach(self, x: ArrayLike, gripper: str) -> Reach:
        """The point nearest to a grasping gripper at x (nx,) of what it may seize, whether it holds something or not."""
    def masses(self, theta: ArrayLike | None = None) -> Array:
        """Masses of all nodes [kg], (n_nodes,); ghosts have none."""
    @property
    def body_names(self) -> list[str]:
        """Names of the bodies, in the order of `body_poses`."""
    def body_poses(self, q: ArrayLike) -> tuple[Array, Array]:
        """Origins [m], (n_bodies, 3), and unit quaternions (w, x, y, z), (n_bodies, 4), in the world.

        q (nq,): nodes first, then joint by joint: a number [rad or m] of a hinge or slide, a unit
        quaternion of a ball, the origin in the world [m] and a quaternion of a free body.
        """
    def mass_matrix(self, q: ArrayLike, theta: ArrayLike | None = None) -> Array:
        """Mass matrix of the bodies' degrees of freedom at q (nq,), (n, n), armatures included.

        In kg·m², kg·m or kg. Velocities are those of q: of a ball its angular velocity in the
        body's axes; of a free body its origin's velocity in the world's axes, then its angular
        velocity in its own.
        """
    def bias_forces(self, q: ArrayLike, v: ArrayLike, theta: ArrayLike | None = None) -> Array:
        """Coriolis forces less weight at q (nq,) and v (nv,), (n,) [N·m or N].

        Joint forces and torques for zero acceleration, without springs, friction and motors.
        """
    def step(self, x: ArrayLike, u: ArrayLike, theta: ArrayLike | None = None) -> Array:
        """x (nx,) one step later, (nx,), with inputs u (nu,) and parameters theta (n_params,).

        Keeps nothing for derivatives or for the next step: a loop is faster with a `stepper`. Raises NumericsError if the
        step has no solution.
        """
    def stepper(
        self,
        n: int = 1,
        thetas: ArrayLike | None = None,
        *,
        x0s: ArrayLike | None = None,
        threads: int | None = None,
    ) -> VectorStepper:
        """`n` copies of the model that are stepped together, each with its own state, parameters and warm start.

        thetas: (n, n_params), or (n_params,) shared, or None for the scene's. x0s: (n, nx), or (nx,) shared, or None for
        `initial_state(theta)` of each. threads: how many; all cores if None. Results do not depend on it. InputError
        names the copy whose state or parameters are refused.
        """
    def rollout(
        self,
        x0: ArrayLike,
        u: ArrayLike,
        theta: ArrayLike | None = None,
        *,
        record: bool = True,
        max_records: int | None = None,
        rest_gap: float | None = None,
        states: Literal["smooth", "hard"] = "smooth",
        grasp: Literal["hard", "smooth"] = "hard",
    ) -> Rollout:
        """Simulates from x0 (nx,) through u (T, nu) with parameters theta (n_params,).

        record: keep each step's factorization, which derivatives need.
        max_records: keep those of at most so many steps, at least 1, and recompute the others in
            vjp, which stays bitwise the same; jvp and linearize then are not available.
        rest_gap: differentiate steps of another rest gap [m] than the scene's; the result is a
            SurrogateRollout. states says through which states: "smooth", a rollout at that rest
            gap, or "hard", each step taken from the states of the scene's own contact.
        grasp: "smooth" differentiates steps whose grippers have the smoothed activation of their
            parameters, which acts out of reach; a SurrogateRollout too.
        """
    def rollout_batch(
        self,
        x0s: ArrayLike,
        us: ArrayLike,
        thetas: ArrayLike | None = None,
        *,
        threads: int | None = None,
        record: bool = True,
        max_records: int | None = None,
        rest_gap: float | None = None,
        states: Literal["smooth", "hard"] = "smooth",
        grasp: Literal["hard", "smooth"] = "hard",
    ) -> Batch:
        """Simulates many at once, one task per rollout.

        x0s: (batch, nx). us: (batch, T, nu), or (T, nu) shared. thetas: (batch, n_params), or
        (n_params,) shared, or None. threads: how many; all cores if None. Results do not depend
        on it. The error, if any, is that of the first rollout that fails.
        """
    def equilibrium(
        self, u: ArrayLike, theta: ArrayLike | None = None, guess: ArrayLike | None = None
    ) -> Equilibrium:
        """Static equilibrium with inputs u (nu,); contact is refused.

        guess: where to start, (nq,), or positions [m] of the nodes, (n_nodes, 3); also where
        velocity-controlled grippers stay. By default the scene's initial shape.
        """
    def gradcheck(
        self,
        x0: ArrayLike | None = None,
        u: ArrayLike | None = None,
        theta: ArrayLike | None = None,
        *,
        seed: int = 0,
    ) -> GradcheckReport:
        """Checks the rollout's derivatives block by block against finite differences and each other.

        By default of the first 100 steps of the scene's own rollout, fewer of models beyond 100 degrees of freedom (never
        under 10). seed chooses weights and directions. A block passes, fails, or is inconclusive where no difference is free of
        switches and certain to 1e-6.
        """

class Rollout:
    """A simulated trajectory and its derivatives."""

    @property
    def x(self) -> Array:
        """States x_0 … x_T, (T + 1, nx): positions [m], velocities [m/s], history variables."""
    @property
    def u(self) -> Array:
        """Inputs it was simulated with, (T, nu)."""
    @property
    def theta(self) -> Array:
        """Parameters it was simulated with, (n_params,)."""
    @property
    def surrogate(self) -> bool:
        """Whether the derivatives are those of another rest gap or grasp than the scene's."""
    @property
    def trace(self) -> Trace:
        """Work of each step; of a surrogate along hard states that of both steps."""
    def energy(self) -> Array:
        """Total energy of every state [J], (T + 1,)."""
    def jvp(
        self,
        x0_dot: ArrayLike | None = None,
        u_dot: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
    ) -> Array:
        """Tangents of all states, (T + 1, ndx), along directions x0_dot (ndx,), u_dot (T, nu), theta_dot; None is zero."""
    def vjp(self, x_bar: ArrayLike) -> tuple[Array, Array, Array]:
        """Cotangents x0_bar (ndx,), u_bar (T, nu), theta_bar (n_params,) from x_bar (T + 1, ndx).

        The gradient of L(x_0 … x_T) has x_bar = dL/dx, by turns where x has a quaternion, and comes in units of L
        per SI unit.
        NaN or infinity in x_bar is refused.
        """
    def jacobians(self, *, theta: bool = False, out: Sequence[Array] | None = None) -> list[Array]:
        """Jacobians of all steps: A (T, ndx, ndx), B (T, ndx, nu) and, with theta, C (T, ndx, n_params).

        out: C-contiguous float64 arrays of these shapes to write into, which are then returned. Faster than `linearize` step by step.
        """
    def jvp_columns(
        self,
        x0_dot: ArrayLike | None = None,
        u_dot: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
    ) -> Array:
        """Tangents of all states along m directions at once, (T + 1, ndx, m): x0_dot (ndx, m), u_dot (T, nu, m), theta_dot (n_params, m)."""
    def linearize(self, k: int) -> tuple[Array, Array, Array]:
        """Jacobians of step k: A (ndx, ndx) by x_k, B (ndx, nu) by u_k, C (ndx, n_params) by theta."""
    def view(self, path: str | PathLike[str], *, title: str | None = None) -> str | None:
        """Writes a page with a 3-D view of the run to `path`, which ends in .html: one file that needs no network.

        title: of the page; the file's name if left out. Long runs are thinned to 60 frames a simulated
        second and to about 20 MB; the page and the text returned say so; None if the page has all states.
        OSError if the file cannot be written; an older file then stays.
        """
    def __len__(self) -> int:
        """Number of steps T."""

@final
class SurrogateRollout(Rollout):
    """A rollout whose derivatives are those of another rest gap or grasp than the scene's.

    With smooth states, states and derivatives are those of a smoother contact, and differences
    confirm them. With hard states the rollout is the scene's own, and each step's Jacobians are
    those of the smoother step from there: the gradient of no single function, for planning.
    """

    @property
    def rest_gap(self) -> float:
        """Rest gap [m] of the steps that are differentiated."""
    @property
    def grasp(self) -> Literal["hard", "smooth"]:
        """Grasp of the steps that are differentiated."""
    @property
    def states(self) -> Literal["smooth", "hard"]:
        """Whose states x are."""

@final
class Batch:
    """Rollouts of one model."""

    @property
    def x(self) -> Array:
        """States, (batch, T + 1, nx): positions [m], then velocities [m/s], then history variables."""
    @property
    def surrogate(self) -> bool:
        """Whether the derivatives are those of another rest gap or grasp than the scene's; each rollout says which."""
    def vjp(self, x_bar: ArrayLike, threads: int | None = None) -> tuple[Array, Array, Array]:
        """Cotangents x0_bar (batch, ndx), u_bar (batch, T, nu), theta_bar (batch, n_params).

        x_bar: (batch, T + 1, ndx). Shared inputs get one cotangent per rollout: sum them.
        """
    def __len__(self) -> int:
        """Number of rollouts."""
    def __getitem__(self, b: int) -> Rollout:
        """The rollout of that number."""

@final
class VectorStepper:
    """Copies of one model that are stepped together; made by `Model.stepper`.

    Each takes, bitwise, the steps of a rollout of its own. A copy whose step fails keeps the state before that step and
    takes no more until it is reset, while the others go on: look at `failed`. Copies are numbered from 0, negative numbers
    count from the end; IndexError if there is no such copy. Threads that call at the same time take turns.
    """

    @property
    def model(self) -> Model:
        """The model."""
    @property
    def x(self) -> Array:
        """States of all copies, (n, nx) [m, m/s], a fresh array; of a failed copy the last one before the failure."""
    @property
    def t(self) -> Array:
        """Time that every copy has been simulated since it was made or reset [s], (n,)."""
    @property
    def thetas(self) -> Array:
        """Parameters of all copies, (n, n_params), in the parameters' units. A fresh array."""
    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which copies have failed, (n,)."""
    @property
    def errors(self) -> dict[int, InputError | NumericsError]:
        """Why they have: the exception that a rollout would have raised, by number of the copy."""
    def step(self, u: ArrayLike, *, record: bool = False) -> Array:
        """Takes a step of every copy that has not failed, with inputs u (n, nu), or (nu,) for all; returns x (n, nx).

        record: keep each copy's step, with its factorization, for `linearize`, `jvp` and `vjp`, until its next step. That
        changes no state. InputError if u has another shape or an entry that is not finite: then no copy has taken a step.
        """
    def reset(self, i: int, x: ArrayLike | None = None) -> None:
        """Lets copy i start anew from x (nx,), by default its `initial_state(theta)`, at time 0 and without warm start."""
    def set_theta(self, i: int, theta: ArrayLike) -> None:
        """Gives copy i parameters theta (n_params,). It goes on from its state, without warm start."""
    def clone_copy(self, source: int, target: int) -> None:
        """Makes copy `target` the same as copy `source`: state, time, parameters, warm start, failure, record."""
    def clone(self) -> VectorStepper:
        """Another stepper whose copies go on bitwise as these do."""
    def linearize(self, i: int) -> tuple[Array, Array, Array]:
        """Jacobians of the recorded step of copy i: A (ndx, ndx) by x, B (ndx, nu) by u, C (ndx, n_params) by theta."""
    def jvp(
        self,
        i: int,
        x_dot: ArrayLike | None = None,
        u_dot: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
    ) -> Array:
        """Tangent (ndx,) after the recorded step of copy i along x_dot (ndx,) before it, u_dot (nu,), theta_dot; None is zero."""
    def vjp(self, i: int, x_bar: ArrayLike) -> tuple[Array, Array, Array]:
        """Cotangents x_bar (ndx,), u_bar (nu,), theta_bar (n_params,) before the recorded step of copy i from x_bar (ndx,) after it.

        NaN or infinity in x_bar is refused.
        """
    def __len__(self) -> int:
        """Number of copies n."""

@final
class Equilibrium:
    """A configuration at rest."""

    @property
    def q(self) -> Array:
        """Positions [m], twists [rad] and joint coordinates, (nq,)."""
    @property
    def x(self) -> Array:
        """The state at rest there, (nx,)."""
    @property
    def iterations(self) -> int:
        """Newton iterations it took."""
    def jvp(self, u_dot: ArrayLike | None = None, theta_dot: ArrayLike | None = None) -> Array:
        """Tangent of q, (3 n_nodes,), along directions of u (nu,) and theta (n_params,)."""
    def vjp(self, q_bar: ArrayLike) -> tuple[Array, Array]:
        """Cotangents u_bar (nu,), theta_bar (n_params,) from q_bar (3 n_nodes,)."""

PlanStatus = Literal["converged", "iterations", "time", "stalled"]

class PlanStep(TypedDict):
    """One Gauss-Newton step of a search for a plan."""

    cost: float
    """J before it."""
    penalty: float
    """Sum of price times violation of the constraints before it."""
    predicted: float
    """Decrease of both that the quadratic model predicted, surrogate terms included."""
    achieved: float
    """Decrease of both that it brought, surrogate terms included."""
    damping: float
    """Levenberg-Marquardt damping it was taken with [-], of the diagonal."""
    rollouts: int
    """Rollouts it took; those of copies in which empty grippers hold something, and their sweeps of derivatives, counted as one each."""
    approaches: int
    """Empty grippers that were drawn to what is worth holding: a surrogate term (docs/control.md)."""
    rest_gap: float | None
    """Rest gap of the contact that was differentiated [m], if it is not the scene's: a surrogate derivative."""

class StageTerms(TypedDict, total=False):
    """What a cost function returns for one stage; derivatives that are left out are zero."""

    residuals: ArrayLike
    """r (m,): the cost is half the sum of its squares."""
    residuals_by_x: ArrayLike
    """(m, ndx), by a change of x."""
    residuals_by_u: ArrayLike
    """(m, nu)."""
    cost: float
    """A cost that is no sum of squares, added to the residuals'; its curvature is found from one step of a plan to the next."""
    cost_by_x: ArrayLike
    """(ndx,), by a change of x."""
    cost_by_u: ArrayLike
    """(nu,)."""
    constraints: ArrayLike
    """c (p,), that must not be positive."""
    constraints_by_x: ArrayLike
    """(p, ndx)."""
    constraints_by_u: ArrayLike
    """(p, nu)."""
    price: ArrayLike
    """Price of a violation by 1: a number or (p,). 1000 if left out."""

CostFunction = Callable[[int, int, Array, Array | None], StageTerms]
"""Of stage k of N: (k, N, x (nx,), u (nu,) or None at k = N)."""

@final
class Task:
    """Cost and constraints of a task file, with its scene (docs/control.md)."""

    @property
    def model(self) -> Model:
        """The model of its scene."""
    @property
    def steps(self) -> int:
        """Steps of a plan."""
    @property
    def horizon(self) -> int:
        """Steps that a controller looks ahead."""
    @property
    def sensing(self) -> Sensing | None:
        """Sensors of its section `sensing`; None without one."""
    @property
    def x0(self) -> Array:
        """The state that the scene starts from, (nx,)."""
    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the inputs, (nu,) each; infinite where there are none."""
    def evaluate(self, x: ArrayLike, u: ArrayLike) -> tuple[float, list[tuple[str, float]]]:
        """Cost of states x (N + 1, nx) under inputs u (N, nu), and the constraints that they violate, largest first, with by how much."""
    def plan(
        self,
        x0: ArrayLike | None = None,
        u0: ArrayLike | None = None,
        theta: ArrayLike | None = None,
        *,
        iterations: int = 50,
        tolerance: float = 1e-6,
        time_limit: float | None = None,
        holding: bool = True,
        rest_gap: float | None = None,
    ) -> Plan:
        """Seeks the inputs of least cost from x0 (nx,), by default the scene's start.

        u0: the first guess, (N, nu), by default the scene's motions for `steps` steps. iterations: Gauss-Newton steps at most.
        tolerance: it is done when a step would lower the cost by less than this part of it. time_limit: time after which no further
        step is begun [s]; the best plan so far is returned. holding: whether empty grippers are drawn to what is worth holding.
        rest_gap: derivatives are those of contact with this rest gap [m] at first, where no step helps any more of a tenth of it, and so on
        to the scene's own; states are those of hard contact throughout.
        NumericsError if the rollout of the first guess fails.
        """
    def mpc(
        self,
        u0: ArrayLike | None = None,
        theta: ArrayLike | None = None,
        *,
        horizon: int | None = None,
        iterations: int = 1,
        time_limit: float | None = None,
        holding: bool = True,
        rest_gap: float | None = None,
        disturbance: ArrayLike | float | None = None,
        initial: ArrayLike | float | None = None,
        tube: Literal["exact", "shared"] | None = "exact",
        sensing: Sensing | None = None,
    ) -> Mpc:
        """A controller that looks `horizon` steps ahead; u0 is its first plan, (horizon, nu).

        rest_gap: as of `plan`, within the `iterations` of each update.
        disturbance: of every step, E w with |w| <= 1: E (ndx, nw), or the radius of a ball of all free nodes [m]. Constraints and bounds
        are then tightened by the tube about the plan. initial: likewise the uncertainty of the measured state. tube: "exact", gains for
        every disturbance, "shared", one gain a stage, or None: nothing is tightened. Tubes are those of the linearization
        (docs/control.md).
        sensing: `update` then takes readings (`Task.sensing` has the sensors of the task's file), from which the state is estimated,
        beginning with the task's `x0`, of which `initial` is the uncertainty; tubes cover the estimate's error.
        """

    def mppi(
        self,
        u0: ArrayLike,
        sigma: ArrayLike,
        theta: ArrayLike | None = None,
        *,
        samples: int = 256,
        temperature: float = 0.1,
        gamma: float = 1e-2,
        violation: float = 10.0,
        seed: int = 0,
    ) -> Mppi:
        """A controller that samples (MPPI), to compare with.

        u0: its first plan, (horizon, nu). sigma: standard deviation of each input, (nu,). violation: price of a squared violation.
        The other defaults are those of CORD-SLS's baseline.
        """

@final
class Sensing:
    """Readings of a controller that does not know the state: positions of nodes and coordinates of joints, with noise of a normal law, some steps
    late; and, at the end of a reading, 1 or 0 for each gripper that grasps: whether it holds something."""

    def __new__(
        cls,
        model: Model,
        nodes: Sequence[int] | None = None,
        noise: float = 0.0,
        *,
        joints: Sequence[str] = (),
        joint_noise: float = 0.0,
        delay: int = 0,
    ) -> Sensing:
        """nodes: numbers of the model's nodes, all if left out. noise: standard deviation of each coordinate [m]; joint_noise: of joints
        [rad or m]. delay: steps from a state to the update that gets its reading."""
    @property
    def delay(self) -> int:
        """Steps from a state to the update that gets its reading."""
    @property
    def noise(self) -> Array:
        """Standard deviations of a reading's numbers, (n,); 0 of whether grippers hold something."""
    def read(self, x: ArrayLike) -> Array:
        """The reading of a state x (nx,) without noise, (n,)."""

@final
class Mppi:
    """Model predictive path integral control: the plan is moved towards the samples of least cost."""

    def update(self, x: ArrayLike) -> Array:
        """Improves the plan from the measured state x (nx,); returns the inputs to apply now, (nu,). Results do not depend on threads."""

@final
class Plan:
    """A plan and how it was found."""

    @property
    def rollout(self) -> Rollout:
        """Its rollout, with derivatives."""
    @property
    def u(self) -> Array:
        """Its inputs, (N, nu)."""
    @property
    def cost(self) -> float:
        """J."""
    @property
    def violations(self) -> list[tuple[str, float]]:
        """Constraints that it violates, largest first, with by how much."""
    @property
    def steps(self) -> list[PlanStep]:
        """The steps of the search."""
    @property
    def status(self) -> PlanStatus:
        """Why the search ended; "stalled": no step, however damped, lowers the cost."""
    @property
    def surrogate(self) -> bool:
        """Whether the last step was taken with surrogate terms, so that the plan does not minimize J alone."""

@final
class Mpc:
    """A controller: one Gauss-Newton step per update, from the last plan shifted by a step."""

    def __new__(
        cls,
        model: Model,
        evaluate: CostFunction,
        u0: ArrayLike,
        theta: ArrayLike | None = None,
        *,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        iterations: int = 1,
        time_limit: float | None = None,
        holding: bool = True,
        rest_gap: float | None = None,
        disturbance: ArrayLike | float | None = None,
        initial: ArrayLike | float | None = None,
        tube: Literal["exact", "shared"] | None = "exact",
        sensing: Sensing | None = None,
        x0: ArrayLike | None = None,
    ) -> Mpc:
        """A controller for a cost given as a function; lower and upper bound the inputs, (nu,).

        The other arguments are those of `Task.mpc`; x0 (nx,), by default the scene's start, is what an estimate begins with.
        """
    def update(self, x: ArrayLike | None = None) -> Array:
        """Improves the plan from the measured state x (nx,); returns the inputs to apply now, (nu,).

        With `sensing` x is the reading (n,) of `delay` steps ago; None where there is none: at the first `delay` steps, or where it was
        lost. The returned inputs count as sent until `sent` says what was.
        NumericsError if the shifted plan cannot be simulated from x.
        """
    def sent(self, u: ArrayLike) -> None:
        """Tells the inputs (nu,) that were sent instead of those of the last update: an estimate depends on them."""
    @property
    def u(self) -> Array:
        """Inputs of the last plan, (N, nu)."""
    @property
    def x(self) -> Array:
        """States of the last plan, (N + 1, nx)."""
    @property
    def cost(self) -> float:
        """J of the last plan."""
    @property
    def penalty(self) -> float:
        """Sum of price times violation of the constraints of the last plan."""
    @property
    def tightening(self) -> float:
        """Largest tightening of a constraint by the last tube, in the constraint's unit; 0 without tubes."""
    @property
    def violations(self) -> list[tuple[str, float]]:
        """Constraints that the last tube reaches beyond, largest first, with by how much; without tubes those that the plan violates."""
    @property
    def switches(self) -> list[int]:
        """Steps of the last plan in which a gripper seizes or lets go, through which a tube is not valid."""
    @property
    def steps(self) -> list[PlanStep]:
        """The steps of the last update."""
    @property
    def status(self) -> PlanStatus:
        """Why the last update ended."""

class ConformalBound(TypedDict):
    """A bound on one-step errors, and what it supports."""

    radius: float
    """In the unit of the scores: `disturbance=` of `Task.mpc` where these are distances of states."""
    delta: float
    """Risk that any of the errors of a new run exceeds it."""
    horizon: int
    """Steps of the new run."""
    scores: int
    """Number of calibration scores."""
    rank: int
    """Which of them, from the smallest, the radius is."""
    statement: str
    """What it says, and on what condition, in words."""

def conformal_bound(
    runs: Sequence[Sequence[float]] | ArrayLike,
    delta: float,
    horizon: int,
    *,
    coverage: Literal["trajectory", "transitions"] = "trajectory",
) -> ConformalBound:
    """A bound on one-step errors from held-out runs, by split conformal prediction.

    runs: of each run its errors |x⁺ − f(x, u)|, step by step. delta: risk that any of the `horizon` errors of a new run exceeds the bound.
    coverage: "trajectory" takes the largest error of each run as one score, runs being exchangeable with the new one; "transitions"
    every error, with the union bound. InputError if there are too few runs, with how many are needed: never the largest score instead.
    """

def load_task(path: str | PathLike[str]) -> Task:
    """Reads a task file (TOML) and the scene beside it. InputError says file, line, field, cause and fix."""

def loads_task(text: str, *, scene: str | None = None, folder: str | PathLike[str] = "") -> Task:
    """Reads a task from a text (TOML); its scene is the text `scene`, or the file that it names in `folder`."""

def plan(
    model: Model,
    evaluate: CostFunction,
    x0: ArrayLike,
    u0: ArrayLike,
    theta: ArrayLike | None = None,
    *,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    iterations: int = 50,
    tolerance: float = 1e-6,
    time_limit: float | None = None,
    holding: bool = True,
    rest_gap: float | None = None,
) -> Plan:
    """Seeks the inputs of least cost, for a cost given as a function; as `Task.plan`. lower and upper bound the inputs, (nu,)."""

def load(path: str | PathLike[str]) -> Model:
    """Reads a scene file (TOML). InputError says file, line, field, cause and fix."""

def loads(text: str, name: str = "scene.toml") -> Model:
    """Reads a scene from a text (TOML); errors call it `name`."""

def import_model(
    path: str | PathLike[str],
    *,
    approximate: bool = False,
    free_base: bool = False,
    contact: bool = True,
    packages: Mapping[str, str | PathLike[str]] | None = None,
) -> tuple[str, dict[str, Any]]:
    """Reads an MJCF or URDF file: the text of a scene for `loads`, and a report of every element.

    approximate: approximate a model that uses tendons, sites in constraints or shapes that scenes do
    not have, instead of refusing it, and let bodies that overlap at the start pass through each other.
    free_base: give the root link of a URDF a free joint. contact: include collision shapes; a
    scene that has them runs with the integrator `euler`. packages: folders of packages by name, for
    `package://name/…` in a URDF; others are looked for around the model. The report has `format`,
    `source` and `entries`: `file`, `line`, `element`, `name`, `original` (the name in the file, if
    it is another), `verdict` ("kept", "approximated", "ignored") and `reason`.
    """

def cable(
    *,
    name: str | None = None,
    links: int | None = None,
    length: float | None = None,
    radius: float | None = None,
    linear_density: float | None = None,
    bend_stiffness: float | None = None,
    twist_stiffness: float | None = None,
    bend_damping: float | None = None,
    plasticity: float | None = None,
    yield_angle: float | None = None,
    friction: float | None = None,
    clamped: bool = False,
    position: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    clips: Sequence[Mapping[str, Any]] = (),
    floor: float | None = None,
) -> str:
    """The text of a scene with a cable: `links` capsules joined by springs of EI/link, for `loads` or a file.

    The defaults are SILO's cable: 18 links, length 0.375 m, radius 3 mm, bend_stiffness EI and bend_damping
    such that a joint has 1e-2 N m/rad and 1e-3 N m s/rad, plasticity 0.7 (the part of its bend that a
    joint forgets every 1/240 s; 0 is elastic), which become the time constant of its creep.
    linear_density is that of 1200 kg/m3. twist_stiffness GJ is EI if left out; if it differs, joints are
    universal ones with a hinge, good for bends below 90 degrees. clamped holds the first end, which is at
    `position` and from where the cable points along `direction`; otherwise it is free.

    clips: U-shaped holders of three boxes, each a mapping with `position` (the middle of the floor of its
    slot) and, if they differ from the defaults, `yaw` [rad] (0: along x), `opening`, `wall`, `depth`,
    `height` [m], `friction`, `name`. floor: the height of a floor. Steps are Euler's of 1/240 s.
    """

def bench(
    scene_text: str,
    work: Literal["step", "linearize", "rollout", "rollout_vjp"],
    repeats: int,
) -> float:
    """Seconds per unit of work over `repeats` units (steps: mean, rollouts: median), without Python in the figure.

    step: one step without records, along the scene's rollout. linearize: one step with its record
    and its Jacobians A and B. rollout: all steps of the scene without records. rollout_vjp: the
    same with records, and the gradient with respect to x0, u and theta.
    """

def fit(
    scene_path: str | PathLike[str],
    logs: Sequence[str | PathLike[str]] = (),
    *,
    threads: int | None = None,
    progress: Callable[[str], object] | None = None,
) -> dict[str, Any]:
    """Fits the free parameters that the scene's `[experiment.fit]` declares, from its records.

    logs: more files, read by the same mapping. progress: called with progress messages.
    The dict has the keys of the command's JSON: `parameters` (path, estimate, unit, interval,
    scene_value), `rmse_fit` and `rmse_held_out` in `unit`, the same of readings in `other_units`,
    `unidentifiable`, `warnings` (a residual that is not noise, estimates at their bounds), …

    Besides the parameters of the model (`Model.param_paths`), those of the markers' sensor can be
    free: `sensor.bias[0]` to `[2]` [m], `sensor.scale` [-], `sensor.rotation[0]` to `[2]` [rad],
    `sensor.time_offset` [s]; a marker at p is read as scale R(rotation) p(t - time_offset) + bias.
    Known errors are given in the scene's `[experiment.sensor]`.
    """

def diagnose(
    scene_path: str | PathLike[str],
    logs: Sequence[str | PathLike[str]] = (),
    *,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[str], object] | None = None,
) -> dict[str, Any]:
    """Finds the physical effects that the scene lacks to explain the records of its experiment and `logs`.

    seed: of bootstraps and sign flips. Nothing is kept of an interrupted call; the command `pliant diagnose` goes on where it was.
    The dict has the keys of the command's JSON: `verdict`
    ("named", "ambiguous", "varies", "numerics", "not_in_library", "adequate", "withheld"), `causes`,
    `gain`, `numerics`, `candidates`, `unidentifiable`, … An `interval` is None where none was estimated.
    """
