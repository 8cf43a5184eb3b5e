"""The timed work on bodies: chains of hinges with a motor each, as a pliant scene and for MuJoCo.

Rods of 0.1 m and 0.2 kg that fall from 0.3 rad at every hinge; damping 0.01 N·m·s/rad, motors at rest. Steps of 1/240 s by
implicit Euler: MuJoCo's implicitfast is of first order too. Nothing touches.
"""

from validation.bodies import chains
from validation.bodies.chains import Chain

STEP = 1 / 240  # s
STEPS = 200  # steps of one timed rollout
JACOBIANS = 10  # of MuJoCo per reading, spread over the rollout
PARAMETERS = (10, 100)  # of a gradient by differences: a fit of an arm, and all that is in one

# work -> pliant's name for it
WORKS = {"step": "step", "jacobian": "linearize", "rollout_vjp": "rollout_vjp"}


def chain(links: int) -> Chain:
    """The benchmark's chain."""
    return Chain(links, motors=True)


def scene_text(links: int) -> str:
    """The TOML scene pliant times."""
    return chains.scene(chain(links), integrator="euler", step=STEP, duration=STEPS * STEP)


def timers(work: str, peer, n_params: int | None) -> dict:
    """Timers by name of a `MujocoRun` on a work, by pliant's name.

    Differences in more parameters than pliant's θ has, n_params, are left out: they would be differences in nothing.
    """
    if work == "step":
        return {"MuJoCo implicitfast, mj_step": peer.step}
    if work == "linearize":
        name = "MuJoCo implicitfast, mjd_transitionFD"
        return {f"{name}, {k}": lambda c=c: peer.jacobian(c) for k, c in (("forward", False), ("centred", True))}
    some = [n for n in PARAMETERS if n_params is None or n <= n_params]
    return {f"MuJoCo implicitfast, forward differences in {n} parameters": lambda n=n: peer.gradient(n) for n in some}
