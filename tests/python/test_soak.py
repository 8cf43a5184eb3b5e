"""A cable moved without end (validation/soak): 20 000 steps here, 100 000 on record."""

import numpy as np
import pytest

pytest.importorskip("pliant")

from validation import evidence, soak

pytestmark = pytest.mark.long


def sound(figures):
    """Nothing grows: neither strain nor depth nor speed after the first periods, nor memory."""
    rows = figures["periods"][2:]
    assert max(row["depth_m"] for row in rows) < 1e-9 and max(row["largest_strain"] for row in rows) < 0.03
    assert max(row["fastest_m_s"] for row in rows[-5:]) <= 1.01 * max(row["fastest_m_s"] for row in rows[:-5])
    assert rows[-1]["memory_mb"] - rows[0]["memory_mb"] < 5.0
    assert figures["replay_difference"] < 1e-10 and np.isfinite(figures["largest_gradient"])


def test_twenty_periods():
    figures = soak.run(20)
    sound(figures)
    changes = [row["change_m"] for row in figures["periods"][1:]]
    # friction and damping lead it to a motion that repeats itself
    assert changes[-1] < 1e-3 < 0.1 < changes[0]


def test_the_record_has_a_hundred_thousand_steps_that_repeat_themselves():
    figures = evidence.read("soak")["figures"]
    assert figures["steps"] == 100_000
    sound(figures)
    rows = figures["periods"]
    assert all(row["change_m"] < 1e-10 for row in rows[60:])
    assert sum(row["seconds"] for row in rows[-10:]) < 2.0 * sum(row["seconds"] for row in rows[10:20])


def test_the_hand_comes_back():
    assert np.abs(soak.controls().sum(axis=0)).max() < 1e-12
