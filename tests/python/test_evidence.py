"""Records of long runs (`validation/evidence/`): complete, quoted rightly, and repeated in part."""

import re
from datetime import datetime
from pathlib import Path

import pytest

from validation import evidence, robustness
from validation.evidence import page

pliant = pytest.importorskip("pliant")

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", page.records())
def test_a_record_says_how_it_was_made(name):
    record = evidence.read(name)
    assert tuple(record) == evidence.KEYS
    assert re.fullmatch(r"[0-9a-f]{40}", record["commit"]) and isinstance(record["dirty"], bool)
    assert datetime.fromisoformat(record["date"]).tzinfo is not None
    assert record["machine"]["cores"] >= 1 and record["machine"]["processor"]
    assert record["processor_seconds"] > 0 and record["seconds"] > 0
    (module,) = re.findall(r"^python -m (validation[\w.]*) ", record["command"])
    assert (ROOT / (module.replace(".", "/") + ".py")).exists()


def test_the_page_shows_the_records():
    assert page.split(page.PAGE.read_text(encoding="utf-8"))[1] == page.table()


@pytest.mark.parametrize("name", ["random_scenes", "random_bodies"])
def test_outcomes_of_random_scenes_add_up(name):
    record = evidence.read(name)
    figures = record["figures"]
    counts = figures["counts"]
    assert tuple(counts) == robustness.ENDS
    assert sum(counts.values()) == figures["scenes"] == record["seeds"]["count"]
    for end in set(counts) - {"good"}:
        assert counts[end] == sum(bad["end"] == end for bad in figures["bad"])
    seeds = [bad["seed"] for bad in figures["bad"]]
    first = record["seeds"]["first"]
    assert len(set(seeds)) == len(seeds) and first <= min(seeds) and max(seeds) < first + figures["scenes"]


def test_documents_quote_the_random_scenes():
    counts = evidence.read("random_scenes")["figures"]["counts"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"of 1000 random scenes over eight decades of stiffness {counts['good']} run well" in readme
    assert f"{counts['stopped']} stop with an error and in {counts['grew']} the energy grows" in readme
    measured = (ROOT / "docs" / "measured.md").read_text(encoding="utf-8")
    for row, end in [
        ("good", "good"),
        ("energy grew", "grew"),
        ("stopped with an error that names step and force", "stopped"),
        ("panicked", "panic"),
        ("no end within 600 s", "hang"),
    ]:
        (said,) = re.findall(rf"^\| {row}[^|]*\| (\d+) \|$", measured, re.MULTILINE)
        assert int(said) == counts[end], row


def test_documents_quote_the_random_scenes_of_bodies():
    counts = evidence.read("random_bodies")["figures"]["counts"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    said = f"of 1000 piles, stacks and impacts of bodies {counts['good']} run well and {counts['stopped']} stop with an error"
    assert said in readme
    measured = (ROOT / "docs" / "measured.md").read_text(encoding="utf-8")
    rows = [("well", "good"), ("gained energy", "grew"), ("ended by an error that names", "stopped"), ("without an end", "hang")]
    for row, end in rows:
        (number,) = re.findall(rf"^\| {row}[^|]*\| (\d+) \|$", measured, re.MULTILINE)
        assert int(number) == counts[end], row


# every outcome and kind of scene: the first good ones, and bad ones that end within seconds
SEEDS = (*range(9), 9, 35, 111, 163, 189, 190, 220, 532, 648, 691, 913, 996)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_scene_ends_as_on_record(seed):
    ends = {bad["seed"]: bad["end"] for bad in evidence.read("random_scenes")["figures"]["bad"]}
    outcome = robustness.run(seed, limit=120.0)
    assert outcome.end == ends.get(seed, "good"), outcome
