"""The rods whose logs the JAX reference makes; diagnoses of these logs are in `test_diagnoses.py`."""

import numpy as np
import pytest

pytest.importorskip("optimistix")
from validation.blind import rods

pytestmark = pytest.mark.long


def test_the_true_rod_begins_at_rest_and_ends_elsewhere():
    x = rods.motion({}, 0)
    assert np.abs(x[1] - x[0]).max() < 1e-3
    assert np.abs(x[-1] - x[0]).max() > 0.02
    held = [node for nodes in rods.HELD.values() for node in nodes]
    told = rods.commands(0, np.arange(rods.SAMPLES + 1) / rods.RATE).reshape(-1, len(held), 3)
    assert np.abs(x[:, held] - told).max() < 1e-12
