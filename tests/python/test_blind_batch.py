"""A few cases of the blind batch, drawn and diagnosed anew: what the smallest batch must reach.

Development seeds, and batches that are used up; the requirements on whole batches are those of `validation.blind.score`.
"""

from pathlib import Path

import pliant
import pytest

from validation.blind import draw, score

pytestmark = pytest.mark.long


def asked(folder: Path, index: int, system: str, kind: str, seed: int = 0) -> tuple[dict, str]:
    """A case of a seed, and what the answer to it is worth."""
    drawn = draw.draw(seed, index, system, kind)
    hidden = drawn.case.as_json()
    return hidden, score.outcome(hidden, pliant.diagnose(str(drawn.write(folder))))


@pytest.mark.parametrize("index", range(3))
def test_nothing_is_named_where_nothing_is_hidden(tmp_path, index):
    hidden, worth = asked(tmp_path, index, "cart", "null", seed=2)
    assert worth == "clean", hidden


def test_a_plain_effect_is_named(tmp_path):
    hidden, worth = asked(tmp_path, 6, "cart", "effect")
    assert hidden["allowed"] and hidden["lam"] >= 1000.0
    assert worth == "right", hidden


def test_an_exact_symmetry_is_not_named_singly(tmp_path):
    hidden, worth = asked(tmp_path, 0, "cart", "symmetric")
    assert worth in ("honest", "astray"), hidden


# what went wrong once in batches that are used up, or in other hands for want of a cause: the case, and what it hides
MENDED = {
    "a drive of another stiffness than simulated": ((7703, 3, "arm5", "effect"), "drive_stiffness (motor_joint3)"),
    "an encoder that drifts": ((7703, 8, "cart", "effect"), "encoder_drift (rail)"),
    "a limit 3 % below the largest command": ((1003, 211, "cart", "effect"), "saturation (motor_rail)"),
    "a limit that hardly shows": ((1003, 78, "cart", "effect"), "saturation (motor_rail)"),
    "friction that differs by record, where one size leaves 24 times the scatter": (
        (1007, 28, "cart", "varies"),
        "coulomb_friction (rail)",
    ),
    "a false third cause, told by pieces of records": (
        (1006, 93, "arm3", "pair"),
        "joint_stiffness (joint2) + sensor_delay (joint1)",
    ),
}


@pytest.mark.parametrize("name", MENDED)
def test_what_went_wrong_once_is_right(tmp_path, name):
    (seed, index, system, kind), cause = MENDED[name]
    hidden, worth = asked(tmp_path, index, system, kind, seed)
    assert score.hidden_name(hidden) == cause, hidden
    assert worth == "right", hidden
