"""The page that a rollout writes. What is in it is tested in tests/view.rs."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest

pliant = pytest.importorskip("pliant")

ROOT = Path(__file__).resolve().parents[2]


def rollout(steps, **options):
    """The start of a shared scene's run."""
    model = pliant.load(ROOT / "tests" / "scenes" / "free_swing.toml")
    return model, model.rollout(model.initial_state(), model.controls(steps), **options)


@pytest.mark.parametrize("options", [{}, {"max_records": 2}, {"record": False}])
def test_a_rollout_writes_a_page_with_its_positions(tmp_path, options):
    model, roll = rollout(6, **options)
    path = tmp_path / "swing.html"
    assert roll.view(path, title="a <swing>") is None
    page = path.read_text()
    assert "<title>a &lt;swing&gt;</title>" in page and "http" not in page
    header = json.loads(re.search(r'id="header">(.*?)</script>', page, re.DOTALL)[1])
    coded = re.search(r'id="numbers">(.*?)</script>', page, re.DOTALL)[1]
    numbers = np.frombuffer(base64.b64decode(coded), "<f4")
    (rope,) = header["ropes"]
    at, n = rope["positions"]["offset"], rope["nodes"]
    shown = numbers[at : at + 7 * n * 3].reshape(7, n, 3) + np.array(header["center"])
    x = roll.x[:, : 3 * model.n_nodes].reshape(7, -1, 3)[:, model.ropes[rope["name"]]]
    np.testing.assert_allclose(shown, x, atol=1e-6)


def test_long_runs_are_thinned_and_say_so(tmp_path):
    _, roll = rollout(1000, record=False)
    note = roll.view(str(tmp_path / "swing.html"))
    assert re.match(r"\d+ of 1001 states are shown", note)
    assert note in (tmp_path / "swing.html").read_text()


def test_what_cannot_be_written_is_refused(tmp_path):
    _, roll = rollout(1)
    with pytest.raises(pliant.InputError, match="does not end in .html"):
        roll.view(tmp_path / "swing.txt")
    with pytest.raises(FileNotFoundError):
        roll.view(tmp_path / "missing" / "swing.html")
    assert not list(tmp_path.iterdir())
