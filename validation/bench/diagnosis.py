"""How long a diagnosis takes: a two-link arm with damped joints and encoders, six records of ten seconds at 500 Hz, one of them held out.

    python -m validation.bench.diagnosis [--pliant target/release/pliant] [--json FILE]

Two data sets, by the simulator of the blind tests: nothing hidden, and dry friction at the first joint. Printed are the verdict, the wall
time, the processor time and the share of each stage. Asked are 60 s of two cores.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from validation import evidence
from validation.bench.machine import describe
from validation.blind.chains import ChainSetup
from validation.blind.noise import KINDS

RATE, DURATION, FITTED, SUBSTEPS = 500.0, 10.0, 5, 2  # Hz, s, records, steps of the scene in a sample
DAMPING, CALM = 0.05, 0.25  # N·m·s/rad, part of the torques of the blind batch: over ten seconds those throw the arm round
FRICTION = 0.01  # N·m, hidden
SIGMA = 5e-4  # rad
SEED = 9  # of links, motions and noise


def arm(rng: np.random.Generator) -> ChainSetup:
    """The arm and its records."""
    setup = ChainSetup("arm2", rng, rate=RATE, duration=DURATION, fitted=FITTED)
    setup.substeps = SUBSTEPS
    setup.links = [replace(link, damping=DAMPING) for link in setup.links]
    setup.base["damping"][:] = DAMPING
    setup.waves, setup.logged = [(CALM * size, *wave) for size, *wave in setup.waves], []
    for _ in setup.roles:
        setup.log(rng, 0.0)
    return setup


def written(folder: Path, hidden: dict[str, float]) -> Path:
    """Scene and logs with these changes of the generator's knobs."""
    rng = np.random.default_rng(SEED)
    setup = arm(rng)
    clean = setup.readings([(record, hidden) for record in range(len(setup.roles))])
    guess = {setup.knobs[key].path: 1.05 * setup.knobs[key].scene for key in setup.free}
    return setup.write(folder, [KINDS["white"].read(y, SIGMA, rng) for y in clean], guess, missing=False)


def diagnosed(pliant: str, scene: Path) -> dict:
    """What a diagnosis said, and its seconds: wall, processor and by stage."""
    began, used = time.monotonic(), evidence.processor_seconds()
    command = [pliant, "diagnose", str(scene), "--json", "--out", str(scene.parent / "report")]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-2000:]}")
    report = json.loads(done.stdout)
    return {
        "verdict": report["verdict"],
        "causes": [cause["name"] for cause in report["causes"]],
        "wall_s": round(time.monotonic() - began, 1),
        "processor_s": round(evidence.processor_seconds() - used, 1),
        "stages": {part["part"]: round(part["seconds"], 1) for part in report["parts"]},
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--pliant", default="target/release/pliant")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    out = {"machine": describe()}
    for name, hidden in (("nothing hidden", {}), ("dry friction at joint1", {"friction:joint1": FRICTION})):
        with tempfile.TemporaryDirectory() as folder:
            found = out[name] = diagnosed(options.pliant, written(Path(folder), hidden))
        stages = ", ".join(f"{part} {100.0 * s / max(sum(found['stages'].values()), 1e-9):.0f} %" for part, s in found["stages"].items())
        print(f"{name}: {found['verdict']} {' '.join(found['causes'])}: {found['wall_s']} s, {found['processor_s']} s of processors; {stages}")
    if options.json:
        options.json.write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
