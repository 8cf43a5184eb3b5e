"""Scene and logs of real tosses of a cube (ContactNets), as `pliant diagnose` takes them; nothing of the data is kept here.

    python -m validation.real.cubes FOLDER [--flight-only]
    pliant diagnose FOLDER/scene.toml

Every record is one toss: the free flight of the cube until its lowest corner comes near the table, and beside it, in one reading at
the beginning, where the same cube lies in the end, a body that may slide along the table half a width above it. That known length is
what tells a wrong scale of the cameras from a wrong gravity. `--flight-only` leaves it out.

Positions come in half widths of the cube; the published half width makes metres of them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from validation.real.arms import entry, head, table
from validation.real.deform_dlo import data_folder

RATE = 148.0  # Hz
HALF_WIDTH = 0.0524  # m, published
MASS = 0.37  # kg, published
INERTIA = 8.1e-4  # kg·m², published
NEAR = 0.012  # m above the table: what is lower may touch it
LYING = 5  # samples at the end that must be still (it slides until shortly before)
STILL = 2e-4  # m
TOSSES = 40  # those with the longest flights; every fourth is held out
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def lowest(position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Height of the cube's lowest corner in each sample [m]."""
    w, x, y, z = quaternion.T
    down = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    return position[:, 2] + HALF_WIDTH * (down @ CORNERS.T).min(axis=1)


def tosses(data: Path) -> list[tuple[str, np.ndarray, int]]:
    """Name, rows (position [m], quaternion) and number of flying samples of the longest flights that end at rest."""
    archive = np.load(data / "cube_toss" / "tosses.npz")
    found = []
    for name in archive.files:
        rows = archive[name][:, :7].astype(float)
        rows[:, :3] *= HALF_WIDTH
        flying = int(np.argmax(lowest(rows[:, :3], rows[:, 3:]) < NEAR))
        end = rows[-LYING:]
        # it may end up against something, or on an edge
        flat = np.ptp(end[:, :3], axis=0).max() < STILL and abs(end[0, 2] / HALF_WIDTH - 1) < 0.05
        if flat:
            found.append((name, rows, flying))
    return sorted(found, key=lambda toss: -toss[2])[:TOSSES]


def write(data: Path, folder: Path, flight_only: bool = False, count: int = TOSSES, half: int | None = None) -> Path:
    """Scene and logs of `count` tosses, or of every second of them, from the first (`half` 0) or the second (1) on."""
    folder.mkdir(parents=True, exist_ok=True)
    records = ""
    chosen = tosses(data)[:count]
    for k, (name, rows, n) in enumerate(chosen if half is None else chosen[half::2]):
        columns = {"t": np.arange(n) / RATE}
        columns |= dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), rows[:n].T, strict=True))
        lying = np.full((n, 3), np.nan)
        # one reading: within a toss it does not vary, and what varies between tosses is its noise
        lying[0] = rows[-LYING:, :3].mean(axis=0)
        columns |= dict(zip(("lie_x", "lie_y", "lie_z"), lying.T, strict=True))
        table(folder / f"{name}.csv", columns)
        records += entry("experiment.record", file=f"{name}.csv", role="held_out" if k % 4 == 3 else "fit")
    about = [INERTIA, INERTIA, INERTIA, 0, 0, 0]
    text = head(1 / RATE) + entry("body", name="cube", position=[0, 0, 0.3], mass=MASS, inertia=about)
    text += entry("body.joint", name="flight", kind="free")
    if not flight_only:
        text += entry("body", name="slide", mass=0.0)
        text += entry("body.joint", name="along_x", kind="prismatic", axis=[1, 0, 0])
        text += entry("body", name="lying", parent="slide", position=[0, 0, HALF_WIDTH], mass=MASS, inertia=about)
        text += entry("body.joint", name="along_y", kind="prismatic", axis=[0, 1, 0])
    text += f'[experiment]\ntime = {{ column = "t" }}\nnoise_floor = 2e-5\nlead_in = {10 / RATE!r}\n'
    text += entry("experiment.marker", body="cube", columns=["x", "y", "z"])
    if not flight_only:
        text += entry("experiment.marker", body="lying", columns=["lie_x", "lie_y", "lie_z"], may_be_missing=True)
    text += entry("experiment.orientation", body="cube", columns=["qw", "qx", "qy", "qz"])
    path = folder / "scene.toml"
    path.write_text(text + records, encoding="utf-8")
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--flight-only", action="store_true")
    args = parser.parse_args()
    data = data_folder()
    if data is None:
        raise SystemExit("the measurements are absent: set PLIANT_DATA to their folder")
    print(write(data, args.folder, args.flight_only))


if __name__ == "__main__":
    main()
