"""Writes the scene of a real cable (DEFORM's DLO1 or DLO2) for `pliant diagnose`.

    python -m validation.real.deform_dlo 1 out/dlo1.toml [--twist] [--halved]
    pliant diagnose out/dlo1.toml --out out/dlo1_report

With `--twist` the cable is a rod, whose causes the diagnosis then knows; with `--halved` it has two edges from marker to marker (the bends
of these cables are hardly longer than the distance of two markers). What it found, as errors in DEFORM's metric:

    pliant diagnose out/dlo1.toml --out out/dlo1_report --json > out/dlo1.json
    python -m validation.real.deform_dlo --table out/dlo1.json

The data are found by `data_folder` and never copied. Vertices 0, 1, -2, -1 are clamped by the two grippers and are the
inputs; the others are measured. Neither mass nor stiffness is published: motion without forces identifies ratios only, so
the mass per length is fixed at a plausible value and stiffness and damping are relative to it.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np

DENSITY = 0.03  # kg/m, fixes the scale of all forces
STRETCH_STIFFNESS = 500.0  # N; strains stay below 1e-3 under the cable's weight
STRETCH_DAMPING = 0.3  # N·s; longitudinal waves (beyond 200 Hz) die within a few steps
BEND_STIFFNESS = 5e-4  # N·m², a guess to start from
BEND_DAMPING = 3e-5  # N·m²·s, a guess; without any the motion is chaotic and nothing can be fitted
TWIST_STIFFNESS = 5e-5  # N·m², where DEFORM begins; small, so that how the grippers turn the cable, which nobody measured, does little
TWIST_DAMPING = 3e-5  # N·m²·s, a guess: as in bending
TWIST_INERTIA = 4e-7  # kg·m, a rod of 5 mm radius; twist is at rest within milliseconds whatever it is
# Training records that the audit finds faulty (frames lost and filled in, a marker that slipped, another clamp).
FAULTY = {1: [11, 12, 16, 21, 26, 27, 28, 29, 36], 2: [35, 47, 48, 49]}


def data_folder() -> Path | None:
    """Folder of the real measurements: PLIANT_DATA, else `../shared/data` beside the repository; None where absent."""
    given = os.environ.get("PLIANT_DATA")
    folder = Path(given) if given else Path(__file__).resolve().parents[2].parent / "shared" / "data"
    return folder if folder.is_dir() else None


TWIST = f"""
[rope.twist]
stiffness = {TWIST_STIFFNESS}
damping = {TWIST_DAMPING}
inertia = {TWIST_INERTIA}
"""

FREE_TWIST = """  { path = "cable.twist_stiffness", lower = 1e-7, upper = 1e-1 },
"""


def halved(lengths: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rest lengths and initial points with a node in the middle of every edge but the two that grippers hold."""
    middle = np.repeat(lengths[1:-1] / 2, 2)
    between = (points[1:-2] + points[2:-1]) / 2
    inner = np.stack([points[1:-2], between], axis=1).reshape(-1, 3)
    return np.concatenate([lengths[:1], middle, lengths[-1:]]), np.concatenate([points[:1], inner, points[-2:]])


def free_length(length: float) -> str:
    """Between two markers the cable is bent and longer than their distance: once it has nodes there, its length is to be found."""
    return f'  {{ path = "cable.length", lower = {0.95 * length:.5f}, upper = {1.05 * length:.5f} }},\n'


def scene(cable: int, skip: list[int] | None = None, twist: bool = False, halve: bool = False) -> str:
    """Scene text: rest lengths are the median distances of neighbouring markers over the training records.

    `skip`: training records left out, those of FAULTY if not given. `halve`: edges between markers are halved. Initial states are taken from the
    data as they are: within 0.1 s the model (a straight, isotropic rod) is off by 3 mm, more than they.
    """
    folder = data_folder()
    if folder is None:
        raise FileNotFoundError("the real measurements are absent: set PLIANT_DATA to their folder")
    file = folder / "deform_dlo" / f"DLO{cable}.npz"
    train = np.load(file)["train"].astype(float)
    n = train.shape[2]
    edges = np.median(np.linalg.norm(np.diff(train, axis=2), axis=-1), axis=(0, 1))
    points = train[0, 0]
    if halve:
        edges, points = halved(edges, points)
    last = len(edges)
    node = lambda i: 2 * i - 1 if halve else i
    rows = ", ".join("[" + ", ".join(f"{x:.5f}" for x in p) + "]" for p in points)
    markers = "".join(f'\n[[experiment.marker]]\nrope = "cable"\nnode = {node(i)}\nindex = {i}\n' for i in range(2, n - 2))
    return f"""# Cable DLO{cable} held by two robot arms, motion capture at 100 Hz (DEFORM, CoRL 2024).
schema_version = 1

[time]
step = 0.01
duration = 5.0
integrator = "midpoint"

[[rope]]
name = "cable"
edge_fractions = [{", ".join(f"{e:.6f}" for e in edges)}]
length = {edges.sum():.5f}
linear_density = {DENSITY}
stretch_stiffness = {STRETCH_STIFFNESS}
stretch_damping = {STRETCH_DAMPING}
bend_stiffness = {BEND_STIFFNESS}
bend_damping = {BEND_DAMPING}
initial = {{ shape = "points", points = [{rows}] }}
{TWIST if twist else ""}
[[gripper]]
name = "left"
rope = "cable"
nodes = [0, 1]

[[gripper]]
name = "right"
rope = "cable"
nodes = [{last - 1}, {last}]

[experiment]
initial = "given"
gripper_sensor = "markers"
time = {{ rate = 100.0 }}
noise_floor = 1e-4
lead_in = 0.1
{markers}
[[experiment.input]]
gripper = "left"
indices = [0, 1]

[[experiment.input]]
gripper = "right"
indices = [{n - 2}, {n - 1}]

[[experiment.record]]
file = "{file}"
array = "train"
role = "fit"
skip = {FAULTY[cable] if skip is None else skip}

[[experiment.record]]
file = "{file}"
array = "eval"
role = "held_out"

[experiment.fit]
free = [
  {{ path = "cable.bend_stiffness", lower = 1e-6, upper = 1e-1 }},
  {{ path = "cable.bend_damping", lower = 1e-7, upper = 1e-2 }},
{FREE_TWIST if twist else ""}{free_length(edges.sum()) if halve else ""}]
"""


def table(diagnosis: dict) -> str:
    """Errors on the evaluation records after each accepted cause, as a Markdown table.

    DEFORM's metric is the mean |error| per coordinate over all vertices, the four that the grippers hold (error 0) among them;
    a diagnosis counts the others. Millimetres.
    """
    cable = 1 if "DLO1" in json.dumps(diagnosis["curves"][:1]) else 2
    n = {1: 13, 2: 12}[cable]
    part = 1e3 * (n - 4) / n
    horizons = [e["horizon_s"] for e in diagnosis["stages"][0]["held_out"]]
    head = " | ".join(f"{h:.2g} s" for h in horizons)
    lines = [f"| DLO{cable} | {head} | median record | without the worst |", "|---|" + "---:|" * (len(horizons) + 2)]
    for stage in diagnosis["stages"]:
        errors = [part * e["mean_abs"] for e in stage["held_out"]]
        last = stage["held_out"][-1]
        errors += [part * last["median_record"], part * last["without_worst"]]
        lines.append(f"| {stage['name']} | " + " | ".join(f"{e:.2f}" for e in errors) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    if sys.argv[1] == "--table":
        print(table(json.loads(Path(sys.argv[2]).read_text())))
        sys.exit()
    out = Path(sys.argv[2])
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(scene(int(sys.argv[1]), twist="--twist" in sys.argv[3:], halve="--halved" in sys.argv[3:]))
