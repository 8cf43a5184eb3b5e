"""Diagnoses of many scenes side by side: on the cores of this machine, or on those of a cluster.

    from pliant import many
    answers = many.diagnose(["a/scene.toml", "b/scene.toml"])
    found = {a.scene: a.report["verdict"] if a.report else a.error for a in answers}

    from dask.distributed import Client
    with Client("tcp://scheduler:8786") as client:
        answers = many.diagnose(scenes, executor=client.get_executor(pure=False))

Scenes and logs are read where a diagnosis runs: the machines of a cluster need the same files at the same places, and pliant. Every
diagnosis runs on one thread, without Python's lock; its numbers do not depend on where and beside what it runs.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pliant

__all__ = ["Answer", "diagnose"]

Case = str | os.PathLike[str] | tuple[str | os.PathLike[str], Sequence[str | os.PathLike[str]]]


@dataclass(frozen=True)
class Answer:
    """What became of one scene: its diagnosis as `pliant.diagnose` returns it, or None and why there is none."""

    scene: str
    report: dict[str, Any] | None
    error: str


def diagnose(cases: Iterable[Case], *, seed: int = 0, executor: Executor | None = None) -> list[Answer]:
    """Diagnoses every case: a scene, or a scene and further logs. Answers come in the order of the cases.

    `executor`: any `concurrent.futures.Executor`; by default a thread for each core. What fails, or cannot be read, ends as an answer with
    an error; the others go on.
    """
    work = [split(case) for case in cases]
    if executor is None:
        with ThreadPoolExecutor(os.cpu_count()) as own:
            return gathered(own, work, seed)
    return gathered(executor, work, seed)


def split(case: Case) -> tuple[str, list[str]]:
    """Absolute places of a scene and of its further logs: another process may run elsewhere."""
    if isinstance(case, tuple) and len(case) != 2:
        raise ValueError(f"case {case!r} has {len(case)} parts\n  likely cause: logs that are not in a list\n  fix: give (scene, [log, log])")
    scene, logs = case if isinstance(case, tuple) else (case, [])
    if isinstance(logs, str | os.PathLike):
        raise ValueError(f"logs of {scene} are {logs!r}, no list\n  likely cause: a single file\n  fix: give (scene, [log])")
    return str(Path(scene).resolve()), [str(Path(log).resolve()) for log in logs]


def gathered(executor: Executor, work: list[tuple[str, list[str]]], seed: int) -> list[Answer]:
    futures = [executor.submit(one, scene, logs, seed) for scene, logs in work]
    answers = []
    for (scene, _), future in zip(work, futures, strict=True):
        try:
            answers.append(Answer(scene, future.result(), ""))
        # wrong input and failed numerics, and of a cluster a process that died
        except Exception as error:
            answers.append(Answer(scene, None, str(error) or type(error).__name__))
    return answers


def one(scene: str, logs: list[str], seed: int) -> dict[str, Any]:
    return pliant.diagnose(scene, logs, seed=seed, threads=1)
