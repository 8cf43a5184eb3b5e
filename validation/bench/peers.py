"""Peers' timers. Each returns seconds per unit of work, from a loop that runs in C or XLA."""

import time
from statistics import median

import mujoco
import numpy as np
from mujoco import rollout

from validation.bench import bodies, scenes
from validation.bodies import chains
from validation.mujoco_cloth import Flex, Sheet
from validation.mujoco_rope import Rod

FD_PARAMETERS = 10  # as many as a typical fit: gravity (3), EI, mass, drag, four node masses
CHUNK = 5  # C steps per reading of the clock: short enough to dodge other processes


class MujocoPeer:
    """What a thing of MuJoCo's that bends is timed by: `thing` has its `model` and `data` and takes steps by `advance`.

    Subclasses say how it starts, in `_reset`.
    """

    def __init__(self, thing):
        self.thing = thing
        self._columns = np.zeros((2 * thing.model.nv, 2 * thing.model.nv))

    def rollout(self) -> float:
        """Seconds of `STEPS` steps in C from the start."""
        self._reset()
        begin = time.perf_counter()
        self.thing.advance(scenes.STEPS)
        return time.perf_counter() - begin

    def step(self) -> float:
        """Median seconds of a step over the rollout, timed in chunks of `CHUNK` C steps."""
        self._reset()
        times = []
        for _ in range(scenes.STEPS // CHUNK):
            begin = time.perf_counter()
            self.thing.advance(CHUNK)
            times.append((time.perf_counter() - begin) / CHUNK)
        return median(times)

    def jacobian(self) -> float:
        """Seconds of `mjd_transitionFD` (forward differences, full A) a third of the way."""
        self._reset()
        self.thing.advance(scenes.STEPS // 3)
        begin = time.perf_counter()
        mujoco.mjd_transitionFD(self.thing.model, self.thing.data, 1e-6, 0, self._columns, None, None, None)
        return time.perf_counter() - begin

    def gradient(self) -> float:
        """Seconds of a forward-difference gradient: one rollout per parameter, and one."""
        return (FD_PARAMETERS + 1) * self.rollout()  # a changed constant costs nothing

    def contacts(self) -> float:
        """Mean number of active contacts over the rollout."""
        self._reset()
        counts = []
        for _ in range(scenes.STEPS):
            self.thing.advance()
            counts.append(self.thing.data.ncon)
        return float(np.mean(counts))

    def _reset(self):
        raise NotImplementedError


class MujocoRope(MujocoPeer):
    """MuJoCo 4.0's rod on the benchmark's scene."""

    def __init__(self, nodes: int, kind: str, **options):
        super().__init__(Rod(scenes.rope(nodes), scenes.mujoco_options(kind, **options)))
        self.start = scenes.points(nodes, kind)
        self.thing.reset(self.start, np.tile(scenes.VELOCITY[kind], (nodes, 1)))
        self._start = (self.thing.data.qpos.copy(), self.thing.data.qvel.copy())

    def _reset(self):
        model, data = self.thing.model, self.thing.data
        mujoco.mj_resetData(model, data)
        self.thing.place(self.start)
        data.qpos[:], data.qvel[:] = self._start
        mujoco.mj_forward(model, data)


class MujocoSheet(MujocoPeer):
    """MuJoCo 4.0's flex on a sheet that lies or hangs."""

    def __init__(self, sheet: Sheet, kind: str):
        floor = '<geom name="floor" type="plane" size="5 5 1" friction="0.5"/>' if kind == "rest" else ""
        super().__init__(Flex(sheet, scenes.STEP, floor=floor, tolerance=1e-8))

    def _reset(self):
        mujoco.mj_resetData(self.thing.model, self.thing.data)
        mujoco.mj_forward(self.thing.model, self.thing.data)


class MujocoRun:
    """MuJoCo's implicitfast on bodies from a configuration at rest; controls by step, (`STEPS`, n_u)."""

    def __init__(self, model: mujoco.MjModel, start: np.ndarray, controls: np.ndarray):
        self.model, self.data = model, mujoco.MjData(model)
        self._start, self._controls = start, controls
        n = 2 * model.nv
        self._a, self._b = np.zeros((n, n)), np.zeros((n, model.nu))

    def rollout(self) -> float:
        """Seconds of `STEPS` steps in C from the start."""
        self._reset()
        state = self._state()
        begin = time.perf_counter()
        rollout.rollout(self.model, self.data, state, self._controls[None])
        return time.perf_counter() - begin

    def step(self) -> float:
        """Mean seconds of a step over the rollout."""
        return self.rollout() / bodies.STEPS

    def jacobian(self, centred: bool) -> float:
        """Median seconds of `mjd_transitionFD` (full A and B) along the rollout."""
        self._reset()
        times = []
        for controls in np.array_split(self._controls, bodies.JACOBIANS):
            rollout.rollout(self.model, self.data, self._state(), controls[None])
            begin = time.perf_counter()
            mujoco.mjd_transitionFD(self.model, self.data, 1e-6, centred, self._a, self._b, None, None)
            times.append(time.perf_counter() - begin)
        return median(times)

    def gradient(self, parameters: int) -> float:
        """Seconds of a forward-difference gradient: one rollout per parameter, and one."""
        return (parameters + 1) * self.rollout()  # a changed constant costs nothing

    def _state(self) -> np.ndarray:
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return state

    def _reset(self):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self._start
        mujoco.mj_forward(self.model, self.data)


class MujocoChain(MujocoRun):
    """One of the benchmark's chains of hinges, motors at rest."""

    def __init__(self, links: int):
        chain = bodies.chain(links)
        text = chains.mjcf(chain, integrator="implicitfast", step=bodies.STEP)
        model = mujoco.MjModel.from_xml_string(text)
        super().__init__(model, chains.start(chain), np.zeros((bodies.STEPS, model.nu)))


class JaxRope:
    """The JAX reference on the same scene: compiled once, then timed."""

    def __init__(self, nodes: int, kind: str):
        import jax
        import jax.numpy as jnp

        from validation import reference

        model = reference.loads(scenes.scene_text(nodes, kind))
        rollout, step = reference.make_rollout(model), reference.make_step(model)
        x0, theta = jnp.asarray(model.initial_state()), jnp.asarray(model.theta)
        u0 = jnp.asarray(model.hold()).ravel()
        u = jnp.tile(u0, (scenes.STEPS, 1))
        self._args, self._one = (x0, u, theta), (x0, u0, theta)
        self._rollout = jax.jit(lambda *a: rollout(*a)[0])
        self._jacobian = jax.jit(jax.jacobian(lambda *a: step(*a)[: model.nx], argnums=(0, 1, 2)))
        self._gradient = jax.jit(
            jax.grad(lambda *a: jnp.sum(rollout(*a)[0][-1] ** 2), argnums=(0, 1, 2))
        )
        self._block = jax.block_until_ready

    def _timed(self, function, args) -> float:
        if not getattr(self, f"_warm_{id(function)}", False):
            self._block(function(*args))
            setattr(self, f"_warm_{id(function)}", True)
        begin = time.perf_counter()
        self._block(function(*args))
        return time.perf_counter() - begin

    def step(self) -> float:
        """Mean seconds of a step over the compiled rollout."""
        return self._timed(self._rollout, self._args) / scenes.STEPS

    def jacobian(self) -> float:
        """Seconds of the step's full Jacobian in x, u and theta."""
        return self._timed(self._jacobian, self._one)

    def gradient(self) -> float:
        """Seconds of one reverse-mode gradient of the rollout in x0, u and theta."""
        return self._timed(self._gradient, self._args)
