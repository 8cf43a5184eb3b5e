"""Results of runs that take too long for the tests: one JSON file per run, written by the command that it records; those whose format is
agreed on stand in validation/results.

A file has the keys

    command            that wrote it
    commit, dirty      of the checkout, whose wheel is installed first; dirty: it had changes that were not committed
    date               UTC, of the beginning
    machine            processor and cores
    seconds            wall time
    processor_seconds  of this process and its children
    seeds              of the generators; null for measured data
    figures            results

Documents quote `figures`; `tests/python/test_evidence.py` compares them, and runs a part of the work again.
"""

import json
import resource
import subprocess
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from validation.bench.machine import describe

FOLDER = Path(__file__).resolve().parent
KEYS = ("command", "commit", "dirty", "date", "machine", "seconds", "processor_seconds", "seeds", "figures")


def git(*arguments: str) -> str:
    """Output of git in this repository."""
    done = subprocess.run(["git", *arguments], cwd=FOLDER, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def processor_seconds() -> float:
    """Of this process and its children that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


@dataclass
class Run:
    """A run that has begun; its checkout is looked at now, so that later edits do not count."""

    commit: str = field(default_factory=lambda: git("rev-parse", "HEAD"))
    dirty: bool = field(default_factory=lambda: bool(git("status", "--porcelain", "--", ":/", ":!/validation/evidence", ":!/validation/results")))
    begun: float = field(default_factory=time.time)
    used: float = field(default_factory=processor_seconds)

    def write(self, name: str, seeds: object, figures: object, folder: Path = FOLDER) -> Path:
        """Writes `name`.json into validation/evidence or another folder."""
        machine = describe()
        content = {
            "command": " ".join(["python", *sys.orig_argv[1:]]),
            "commit": self.commit,
            "dirty": self.dirty,
            "date": datetime.fromtimestamp(self.begun, UTC).isoformat(timespec="seconds"),
            "machine": {"processor": machine["processor"], "cores": machine["cores"]},
            "seconds": round(time.time() - self.begun, 1),
            "processor_seconds": round(processor_seconds() - self.used, 1),
            "seeds": seeds,
            "figures": figures,
        }
        path = folder / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        return path


def read(name: str) -> dict:
    """Content of validation/evidence/`name`.json."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
