"""A small fixed part of the blind batch: what the seed hid must be found, and nothing where nothing is hidden.

The logs come from `validation.blind`'s own simulator (another integrator, coloured noise, quantisation,
jitter). The whole batch is `python -m validation.blind.run`.
"""

import pliant
import pytest

from validation.blind import cases

pytestmark = pytest.mark.long

SEED = 3
HIDDEN = (6, 10, 21, 34)  # large enough to be named, by the oracle or by luck of the draw
NULLS = (1, 4, 5)


def diagnose(index: int, kind: str, folder):
    """The case and pliant's answer to its scene and logs."""
    case = cases.draw(SEED, index, kind, None)
    truth = cases.truths([case])[index]
    return case, pliant.diagnose(cases.write(case, *truth, folder / "case"))


@pytest.mark.parametrize("index", HIDDEN)
def test_a_hidden_effect_is_named(index, tmp_path):
    case, report = diagnose(index, "effect", tmp_path)
    assert report["verdict"] == "named", report["reason"]
    assert [cause["name"] for cause in report["causes"]] == [case.name]


@pytest.mark.parametrize("index", NULLS)
def test_nothing_is_claimed_where_nothing_is_hidden(index, tmp_path):
    _, report = diagnose(index, "null", tmp_path)
    assert report["verdict"] == "adequate", report["reason"]
    assert report["causes"] == [] and report["alternatives"] == []
