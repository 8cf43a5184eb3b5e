"""Lets the tests import `validation` from the repository's root, and knows the mark of tests that `tests/run fast` leaves out."""

import os
import sys
from pathlib import Path

# Before NumPy is loaded: matrices here are small, and threads of BLAS in every worker wait for each other on a shared machine.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# MuJoCo asks for this when it is imported: Mesa's EGL renders without a window and without a GPU.
os.environ.setdefault("MUJOCO_GL", "egl")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def pytest_configure(config):
    """Registers the mark."""
    config.addinivalue_line("markers", "long: takes more than some seconds; left out by `tests/run fast`")
