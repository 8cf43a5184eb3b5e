"""pliant.jax under jit, grad, vmap and scan, in a process of its own: a callback that hangs would
otherwise hang the tests."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pliant")
pytest.importorskip("jax")

pytestmark = pytest.mark.long

PROGRAM = Path(__file__).with_name("jax_program.py")
AGREE = [
    "rollout_value",
    "rollout_grad_jit",
    "rollout_value_and_grad",
    "rollout_vmap",
    "rollout_vmap_grad",
    "rollout_nested_vmap",
    "step_value",
    "step_grad",
    "vmap_of_scan",
    "scan_of_steps",
    "surrogate_grad",
    "many_calls",
]


@pytest.fixture(scope="module")
def found():
    """What the checks found."""
    out = subprocess.run(
        [sys.executable, PROGRAM],
        env=os.environ | {"JAX_PLATFORMS": "cpu"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert out.returncode == 0, out.stderr[-3000:]
    return json.loads(out.stdout)


@pytest.mark.parametrize("scene", ["windy", "sliding", "arm_free"])
@pytest.mark.parametrize("check", AGREE)
def test_agrees_with_vjp(found, scene, check):
    """The same code runs below, so the same bits but for summation order and cold contacts."""
    bound = 1e-9 if scene == "sliding" and "scan" in check else 1e-12
    assert found[f"{scene}-{check}"] <= bound


@pytest.mark.parametrize(
    ("check", "bound"),
    [
        ("quaternion_differences", 1e-9),
        ("quaternion_chain", 1e-9),
        ("quaternion_radial", 1e-15),
        ("quaternion_reference", 1e-9),
    ],
)
def test_quaternions(found, check, bound):
    """Balls and free joints: against central differences, along the sphere, and the JAX reference."""
    assert found[check] <= bound


@pytest.mark.parametrize(("check", "bound"), [("rod_differences", 1e-8), ("rod_scan", 1e-12)])
def test_rods(found, check, bound):
    """Rods that twist: against central differences, and step by step against rollouts."""
    assert found[check] <= bound


def test_surrogates_say_so(found):
    plain, smooth, names = found["says_surrogate"]
    assert plain == [False] * 3 and smooth == [True] * 3
    assert not any("surrogate" in name for name in names[:3]) and all("surrogate" in name for name in names[3:])


def test_long_rollout(found):
    assert found["long_rollout"] == 0.0


@pytest.mark.parametrize(
    ("check", "text"),
    [
        ("wrong_shape", "x has shape (47,), but (48,) is needed"),
        ("failed_numerics", "NumericsError: step 0"),
        ("needs_float64", 'jax.config.update("jax_enable_x64", True)'),
        ("wrong_dtype", "x is float32, but pliant needs float64"),
    ],
)
def test_says_what_is_wrong(found, check, text):
    assert text in found[check]
