"""Shape error of pliant's equilibrium on real hanging wires, bending stiffness the only free number.

    python -m validation.real.wires

The wires (adapteddlo_wires, MIT licence): 1.5 m between two level holders 0.12 m apart that point away from each
other, photographed; 51 points along the centreline. An independent planar elastica fits them to 4.7–6.1 mm (white), 9–23
(black), 11–18 (red); what is left is natural curvature and the holders' angle.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pliant
from scipy.optimize import minimize_scalar

from validation.real.deform_dlo import data_folder

WIRES = ("white", "black", "red")
TRIALS = 5
STRETCH_STIFFNESS = 2000.0  # N; strains stay below 2e-4
BOUNDS = (np.log(1e-5), np.log(1e-2))  # of EI [N·m²]


def scene(points: np.ndarray, length: float, density: float) -> str:
    """A rope through `points` (n, 2) [m] with its first and last edge held level."""
    rows = ", ".join(f"[{x:.6f}, 0.0, {z:.6f}]" for x, z in points)
    ends = "".join(
        f'[[gripper]]\nname = "{end}"\nrope = "wire"\nend = "{end}"\nmode = "prescribed"\nmotion = {{ kind = "hold" }}\n'
        for end in ("first", "last")
    )
    return f"""schema_version = 1
[time]
step = 0.01
duration = 0.01
integrator = "euler"
[[rope]]
name = "wire"
nodes = {len(points)}
length = {length}
linear_density = {density}
stretch_stiffness = {STRETCH_STIFFNESS}
bend_stiffness = 1e-4
initial = {{ shape = "points", points = [{rows}] }}
{ends}"""


def fit(shape: np.ndarray, length: float, density: float) -> tuple[float, float]:
    """EI [N·m²] and the root mean square distance of nodes and measured points [m]."""
    points = np.column_stack([shape[:, 0], -shape[:, 1]])
    model = pliant.loads(scene(points, length, density))
    u = np.array(model.controls()[0])
    u[3:6], u[9:12] = [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]  # axes of the level holders, into the wire
    stiffness = model.param_index("wire.bend_stiffness")
    nodes = model.ropes["wire"]

    def error(log_ei: float) -> float:
        theta = np.array(model.theta)
        theta[stiffness] = np.exp(log_ei)
        q = np.asarray(model.equilibrium(u, theta).q).reshape(-1, 3)[nodes.start : nodes.stop]
        away = q[:, [0, 2]] - points
        return float(np.sqrt((away**2).sum(axis=1).mean() + (q[:, 1] ** 2).mean()))

    best = minimize_scalar(error, bounds=BOUNDS, method="bounded", options={"xatol": 1e-3})
    return float(np.exp(best.x)), float(best.fun)


def main() -> int:
    folder = data_folder()
    if folder is None:
        print("the real measurements are absent: set PLIANT_DATA to their folder", file=sys.stderr)
        return 2
    wires: Path = folder / "adapteddlo_wires"
    measured = json.loads((wires / "measured.json").read_text())
    for wire in WIRES:
        for trial in range(TRIALS):
            shape = np.loadtxt(wires / "shape2d" / f"{wire}_{trial}.csv", delimiter=",", skiprows=1)
            ei, rms = fit(shape, measured["rope_length_m"], measured["mass_per_length_kg_m"][wire])
            print(f"{wire} {trial}: EI {ei:.3e} N·m², shape error {1e3 * rms:.1f} mm")
    return 0


if __name__ == "__main__":
    sys.exit(main())
