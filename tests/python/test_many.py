"""Diagnoses of many scenes: on this machine's threads, and on two workers of dask, the same answers to the last digit."""

import json

import pliant
import pytest
from dask.distributed import LocalCluster
from pliant import many

from validation.blind import batch, draw

TIMES = ("wall_s", "parts")


def untimed(report):
    return {key: value for key, value in report.items() if key not in TIMES}


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many")
    return [draw.draw(2, index, "pendulum", "null").write(folder / f"case{index}") for index in range(2)]


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster


@pytest.mark.long
def test_a_cluster_answers_as_this_process_does(scenes, cluster):
    absent = scenes[0].parent / "absent.toml"
    with cluster.get_client() as client:
        answers = many.diagnose([scenes[0], absent, (scenes[1], [])], executor=client.get_executor(pure=False))
    assert [answer.scene for answer in answers] == [str(scenes[0]), str(absent), str(scenes[1])]
    for answer, scene in zip(answers[::2], scenes, strict=True):
        assert answer.error == ""
        assert untimed(answer.report) == untimed(pliant.diagnose(str(scene)))
    # what cannot be read ends alone
    assert answers[1].report is None and "absent.toml" in answers[1].error


@pytest.mark.long
def test_threads_answer_as_one_after_the_other(scenes):
    answers = many.diagnose(scenes)
    assert [untimed(answer.report) for answer in answers] == [untimed(pliant.diagnose(str(scene))) for scene in scenes]


@pytest.mark.long
def test_a_batch_on_a_cluster_is_the_batch(cluster, tmp_path):
    def summary(name, *more):
        batch.main(["--cases", "1", "--seed", "2", "--systems", "pendulum", "--kinds", "null", "--keep", str(tmp_path / name),
                    "--json", str(tmp_path / f"{name}.json"), *more])  # fmt: skip
        answered = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
        return [untimed(row["report"]) | {"scene": ""} for row in answered["cases"]]

    here, there = summary("here"), summary("there", "--scheduler", cluster.scheduler_address)
    assert len(here) == 1 and here == there


def test_cases_that_are_none_are_refused():
    with pytest.raises(ValueError, match="fix: give \\(scene, \\[log\\]\\)"):
        many.diagnose([("scene.toml", "log.csv")])
    with pytest.raises(ValueError, match="has 3 parts"):
        many.diagnose([("scene.toml", "a.csv", "b.csv")])
    assert many.diagnose([], executor=None) == []
