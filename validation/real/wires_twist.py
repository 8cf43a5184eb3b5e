"""The end turn at which real hanging wires leave their plane, predicted from stiffnesses that were found otherwise.

    OMP_NUM_THREADS=1 python -m validation.real.wires_twist        (some minutes)

The wires of `wires`, one holder turned until the loop snaps out of its plane (five trials a wire). A twisted loop under its weight warps
from the first degree on, as its curvature is not even; what is predicted is the turn at which that shape loses its stability: the least
stiffness over mass of the equilibrium vanishes, or there is no equilibrium nearby any more.

EI is fitted to photographs without twist. GJ is in none of them: a straight isotropic wire at rest knows GJ only by the torque it
transmits, and nobody measured how far the ends of the wires in space (`shape3d_12`) were turned (`same_for_any_gj` shows it). So GJ/EI is

    that of a round solid section, 1/(1 + ν);   that of another wire, from its critical turn;   that of the same wire's first trial

and at last what the critical turn itself says it is, beside what the authors of the data identified with their model. Photographs do not
know an even curvature at rest in the plane either: between clamps its energy EI κ̄ ∫κ ds depends on the holders alone. The turn does.
"""

import json
import math
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pliant
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from validation.real.deform_dlo import data_folder
from validation.real.wires import STRETCH_STIFFNESS, TRIALS, WIRES

RADIUS = 0.003  # m, about; it is only in the inertia by which an edge turns
STEP = math.radians(60.0)  # of the turn, until stability is lost
CLOSE = math.radians(1.0)  # to which the loss is bracketed
EDGES = 100
SPAN = 0.123  # m between the holders, 0.12 to 0.126
POISSON = (0.5, 0.3)
SECTION = 0.75  # GJ/EI of a solid section at ν = 1/3
RATIOS = (0.65, 0.8, 1.2, 1.6)  # GJ/EI that critical turns are computed for; between them in their logarithms
CURVATURES = (-2.0, 0.0, 2.0, 4.0, 6.0)  # 1/m, positive the way the loop turns
SCALES = {"ei": 1.0, "first": 0.1, "last": 0.1, "slope": 1.0}

FREE = {
    "EI": ("ei",),
    "EI, holders": ("ei", "first", "last"),
    "EI, holders, curvature": ("ei", "first", "last", "slope"),
}


def scene(points: np.ndarray, length: float, density: float, gravity: float = 9.81) -> str:
    """A rod through `points` (n, 2) [m] in the plane of x and z, its first and last edge held, its first material axis along y."""
    rows = ", ".join(f"[{x:.9f}, 0.0, {z:.9f}]" for x, z in points)
    ends = "".join(
        f'[[gripper]]\nname = "{end}"\nrope = "wire"\nend = "{end}"\nmode = "prescribed"\nmotion = {{ kind = "hold" }}\n'
        for end in ("first", "last")
    )
    return f"""schema_version = 1
[time]
step = 0.01
duration = 0.01
integrator = "euler"
[gravity]
magnitude = {gravity}
[[rope]]
name = "wire"
nodes = {len(points)}
length = {length}
linear_density = {density}
stretch_stiffness = {STRETCH_STIFFNESS}
bend_stiffness = 1e-3
radius = {RADIUS}
initial = {{ shape = "points", points = [{rows}] }}
[rope.twist]
stiffness = 1e-3
director = [0.0, 1.0, 0.0]
{ends}"""


@dataclass
class Held:
    """A wire in two holders: level and pointing away from each other, or turned up by `first` and `last` [rad].

    EI [N·m²], `ratio` GJ/EI, the `curvature` at rest in the plane [1/m], positive the way the loop turns, and by how much it grows from
    the first end to the last (`slope`).
    """

    model: pliant.Model
    numbers: dict = field(default_factory=lambda: {"ei": 1e-3, "ratio": 1.0, "curvature": 0.0, "slope": 0.0, "first": 0.0, "last": 0.0})

    def theta(self) -> np.ndarray:
        """The numbers as parameters."""
        theta, index = np.array(self.model.theta), self.model.param_index
        ei = self.numbers["ei"]
        theta[index("wire.bend_stiffness")], theta[index("wire.twist_stiffness")] = ei, ei * self.numbers["ratio"]
        theta[index("wire.rest_curvature[1]")] = -self.numbers["curvature"]
        places, along = self.places()
        theta[places] = -self.numbers["slope"] * along
        return theta

    def places(self) -> tuple[list, np.ndarray]:
        """Parameters of the curvature at rest at single nodes, and how far along the wire they are, −½ to ½."""
        span = self.model.ropes["wire"]
        count = span.stop - span.start
        places = [self.model.param_index(f"wire.node[{i}].rest_curvature[1]") for i in range(count)]
        return places, np.linspace(-0.5, 0.5, count)

    def inputs(self, turn: float = 0.0) -> np.ndarray:
        """The last holder turned about its axis [rad]."""
        u = np.array(self.model.controls()[0])
        a, b = self.numbers["first"], self.numbers["last"]
        u[3:6], u[12:15] = [math.cos(a), 0.0, math.sin(a)], [-math.cos(b), 0.0, math.sin(b)]
        along, across = -u[12:15], np.array([0.0, 1.0, 0.0])
        u[15:18] = math.cos(turn) * across + math.sin(turn) * np.cross(along, across)
        return u

    def at_rest(self, turn: float = 0.0, guess=None) -> pliant.Equilibrium:
        """The equilibrium that is found downhill from `guess`."""
        return self.model.equilibrium(self.inputs(turn), self.theta(), guess)

    def tangent(self, found: pliant.Equilibrium, name: str) -> np.ndarray:
        """Change of the nodes (n_nodes, 3) with log EI, the curvature or its slope, or a holder's angle."""
        u, theta = np.zeros(self.model.nu), np.zeros(self.model.n_params)
        angle = self.numbers.get(name, 0.0)
        if name == "ei":
            theta[self.model.param_index("wire.bend_stiffness")] = self.numbers["ei"]
        elif name == "curvature":
            theta[self.model.param_index("wire.rest_curvature[1]")] = -1.0
        elif name == "slope":
            places, along = self.places()
            theta[places] = -along
        elif name == "first":
            u[3:6] = [-math.sin(angle), 0.0, math.cos(angle)]
        else:
            u[12:15] = [math.sin(angle), 0.0, math.cos(angle)]
        return found.jvp(u, theta)[: 3 * self.model.n_nodes].reshape(-1, 3)

    def nodes(self, found: pliant.Equilibrium) -> np.ndarray:
        """Positions of the wire's own nodes (n, 3)."""
        span = self.model.ropes["wire"]
        return np.asarray(found.q)[: 3 * self.model.n_nodes].reshape(-1, 3)[span.start : span.stop]

    def twist(self, found: pliant.Equilibrium) -> float:
        """Twist of the whole wire [rad]."""
        n, x = self.model.n_nodes, np.asarray(found.x)
        return float(np.diff(x[3 * n : 4 * n - 1]).sum() + x[-(n - 2) :].sum())

    def softest(self, found: pliant.Equilibrium, turn: float) -> float:
        """Least stiffness over mass [1/s²] of what is free."""
        m, x = self.model, np.asarray(found.x)
        a = m.rollout(x, self.inputs(turn)[None], self.theta()).linearize(0)[0]
        h, n = m.step_length, m.ndx // 2
        # an Euler step at rest turns a displacement into the velocity −h (M + h²K)⁻¹ K, so I + h of it is (M + h²K)⁻¹ M; 0 if driven
        mass = np.concatenate([np.repeat(m.masses(), 3), np.full(n - 3 * m.n_nodes, m.theta[m.param_index("wire.twist_inertia")])])
        mass[3 * m.n_nodes :] *= m.theta[m.param_index("wire.length")] / (m.n_nodes - 3)
        after = np.eye(n) + h * a[n:, :n]
        free = np.abs(after).sum(axis=1) > 1e-9
        stiffness = (np.linalg.inv(after[np.ix_(free, free)]) - np.eye(free.sum())) / (h * h)  # over mass
        root = np.sqrt(mass[free])
        return float(np.linalg.eigvalsh(root[:, None] * stiffness / root)[0])


def critical_turn(wire: Held, close: float = CLOSE) -> float:
    """The turn of one end [rad] at which the shape that was flat without it loses its stability.

    The turn grows by steps, each equilibrium sought from the last. What is found is another shape where the twist has changed by more
    than half a turn beside the end's (a loop passes over itself and so loses two turns); then, or where the least stiffness is no longer
    positive, the last step is halved until both its ends are `close`.
    """
    here = wire.at_rest()
    turn, step = 0.0, STEP
    while step > close:
        try:
            found = wire.at_rest(turn + step, np.asarray(here.q))
            same = abs(wire.twist(found) - wire.twist(here) - step) < math.pi
            stays = same and wire.softest(found, turn + step) > 0.0
        except pliant.NumericsError:
            stays = False
        if stays:
            here, turn = found, turn + step
        else:
            step *= 0.5
        if turn > 100.0:
            raise ValueError(f"no loss of stability up to {turn:.0f} rad")
    return turn + 0.5 * step


def evenly(points: np.ndarray, edges: int) -> np.ndarray:
    """Points at even distances along a polygon (n, 2)."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    even = np.linspace(0.0, s[-1], edges + 1)
    return np.stack([np.interp(even, s, x) for x in points.T], 1)


def hanging(span: float, length: float, density: float, edges: int = EDGES, gravity: float = 9.81) -> Held:
    """A loop between level holders `span` apart; it begins as an arc of a circle."""
    angles = np.linspace(0.0, 2.0 * math.pi, 721)
    ring = np.stack([np.sin(angles), np.cos(angles) - 1.0], 1) * length / (2.0 * math.pi)
    ring[:, 0] -= span * angles / (2.0 * math.pi)
    points = evenly(ring, edges)
    points *= length / np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    points[:, 0] *= 1.0 if span == 0.0 else span / -points[-1, 0]
    return Held(pliant.loads(scene(points, length, density, gravity)))


def fit(shape: np.ndarray, length: float, density: float, free: tuple) -> tuple[dict, float]:
    """The numbers `free`, and the root mean square distance of nodes and measured points [m]."""
    points = np.column_stack([shape[:, 0], -shape[:, 1]])
    wire = Held(pliant.loads(scene(points, length, density)))

    def take(p):
        wire.numbers.update(zip(free, p, strict=True))
        wire.numbers["ei"] = math.exp(p[0])
        return wire.at_rest()

    def residual(p):
        return (wire.nodes(take(p))[:, [0, 2]] - points).ravel()

    def jacobian(p):
        found, span = take(p), wire.model.ropes["wire"]
        columns = [wire.tangent(found, name)[span.start : span.stop][:, [0, 2]].ravel() for name in free]
        return np.stack(columns, 1)

    start = np.zeros(len(free))
    start[0] = math.log(density * 9.81 * (length / 12.0) ** 3)  # length/12: about that of a bend under the weight
    found = least_squares(residual, start, jacobian, x_scale=[SCALES[name] for name in free])
    take(found.x)
    return dict(wire.numbers), math.sqrt(2.0 * found.cost / len(points))


def same_for_any_gj(points: np.ndarray, density: float, ratios: tuple) -> list:
    """A wire in space, its first and last edge held where it was seen: EI and the turn of one end are fitted with the first GJ/EI of
    `ratios`; with the others the end is turned such that the torque stays.

    Of each: the root mean square distance of the nodes between [m], the torque GJ τ [N·m], and the turn [rad]. The weight acts along the
    camera's y.
    """
    rows = ", ".join("[" + ", ".join(f"{x:.9f}" for x in p) + "]" for p in points)
    count, length = len(points), np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    model = pliant.loads(f"""schema_version = 1
[time]
step = 0.01
duration = 0.01
integrator = "euler"
[gravity]
tilt = [{-0.5 * math.pi}, 0.0]
[[rope]]
name = "wire"
nodes = {count}
length = {length}
linear_density = {density}
stretch_stiffness = {STRETCH_STIFFNESS}
bend_stiffness = 1e-3
radius = {RADIUS}
initial = {{ shape = "points", points = [{rows}] }}
[rope.twist]
stiffness = 1e-3
[[gripper]]
name = "first"
rope = "wire"
nodes = [0, 1]
[[gripper]]
name = "last"
rope = "wire"
nodes = [{count - 2}, {count - 1}]
""")
    u, paths = np.array(model.controls()[0]), ("wire.bend_stiffness", "wire.twist_stiffness", "last.roll")
    ei, gj, roll = map(model.param_index, paths)

    def rest(p, ratio):
        theta = np.array(model.theta)
        theta[ei], theta[gj], theta[roll] = math.exp(p[0]), ratio * math.exp(p[0]), p[1]
        return model.equilibrium(u, theta), theta

    def residual(p, ratio=ratios[0]):
        return (np.asarray(rest(p, ratio)[0].q)[: 3 * count].reshape(-1, 3) - points).ravel()

    def jacobian(p):
        found, theta = rest(p, ratios[0])
        along = np.zeros((2, model.n_params))
        along[0, [ei, gj]], along[1, roll] = theta[[ei, gj]], 1.0
        return np.stack([found.jvp(np.zeros(model.nu), a)[: 3 * count] for a in along], 1)

    def twist(found):
        x = np.asarray(found.x)  # between the middles of the held edges
        return np.diff(x[3 * count : 4 * count - 1]).sum() + x[-(count - 2) :].sum()

    half = math.pi - 0.01  # a hand turns what it holds by less than half a turn at once
    best = least_squares(residual, [math.log(1e-3), 0.0], jacobian, bounds=([math.log(1e-6), -half], [math.log(1e-2), half])).x
    whole, out = twist(rest(best, ratios[0])[0]), []
    for ratio in ratios:
        p = best + [0.0, (ratios[0] / ratio - 1.0) * whole]
        found, theta = rest(p, ratio)
        torque = theta[gj] * twist(found) / (length * (count - 2) / (count - 1))
        out.append((math.sqrt((residual(p, ratio) ** 2).sum() / (count - 4)), torque, p[1]))
    return out


def measurements(folder: Path) -> dict:
    """measured.json, with the shapes of every wire's trials and what was seen in space."""
    wires = folder / "adapteddlo_wires"
    out = json.loads((wires / "measured.json").read_text())
    out["shapes"] = {
        wire: [np.loadtxt(wires / "shape2d" / f"{wire}_{k}.csv", delimiter=",", skiprows=1) for k in range(TRIALS)] for wire in WIRES
    }
    rows = [line.split(",") for line in (wires / "shape3d_12.csv").read_text().split()[1:]]
    out["space"] = {w: np.array([[float(x) for x in r[3:]] for r in rows if r[0] == w and r[1] == "0"]) for w in WIRES}
    return out


def curve(wire: Held, name: str, values: tuple) -> np.ndarray:
    """Critical turns [rad] for values of one number."""
    kept, turns = wire.numbers[name], []
    for value in values:
        wire.numbers[name] = value
        turns.append(critical_turn(wire))
    wire.numbers[name] = kept
    return np.array(turns)


@dataclass
class Found:
    """What is computed of a wire: EI of every trial; critical turns [rad] by GJ/EI, by EI one deviation down and up, by the curvature at
    rest, and by GJ/EI at the loop's own mean curvature."""

    eis: np.ndarray
    turns: np.ndarray
    by_ei: np.ndarray
    by_curvature: np.ndarray
    coiled: np.ndarray

    def turn(self, ratio: float) -> float:
        """Critical turn [rad] at GJ/EI."""
        return math.exp(PchipInterpolator(np.log(RATIOS), np.log(self.turns), extrapolate=True)(math.log(ratio)))

    def ratio(self, turn: float, coiled: bool = False) -> float:
        """GJ/EI of a critical turn [rad]."""
        turns = self.coiled if coiled else self.turns
        return math.exp(PchipInterpolator(-np.log(turns), np.log(RATIOS), extrapolate=True)(-math.log(turn)))


def study(measured: dict, wire: str) -> Found:
    """Fits EI to the wire's photographs and computes its critical turns."""
    length, density = measured["rope_length_m"], measured["mass_per_length_kg_m"][wire]
    for name, free in FREE.items():
        fits = [fit(shape, length, density, free) for shape in measured["shapes"][wire]]
        eis, angles = np.array([f["ei"] for f, _ in fits]), np.degrees([[f["first"], f["last"]] for f, _ in fits])
        slope, rms = np.mean([f["slope"] for f, _ in fits]), 1e3 * np.mean([e for _, e in fits])
        print(f"| {wire} | {name} | {eis.mean():.2e} ± {eis.std(ddof=1):.1e} | {angles[:, 0].mean():.0f}°, {angles[:, 1].mean():.0f}° "
              f"| {slope:.1f} | {rms:.1f} |", flush=True)
        if name == "EI":
            level = eis
    loop = hanging(SPAN, length, density)
    loop.numbers["ei"] = level.mean()
    turns = curve(loop, "ratio", RATIOS)
    loop.numbers["curvature"] = 2.0 * math.pi / length
    coiled = curve(loop, "ratio", RATIOS)
    loop.numbers.update(curvature=0.0, ratio=SECTION)
    by_curvature = curve(loop, "curvature", CURVATURES)
    loop.numbers["ratio"] = 1.2
    by_ei = curve(loop, "ei", (level.mean() - level.std(ddof=1), level.mean() + level.std(ddof=1)))
    return Found(level, turns, by_ei, by_curvature, coiled)


def convergence(measured: dict, found: Found) -> str:
    """Critical turns of the black wire over the number of edges."""
    out = []
    for edges in (50, 100, 200):
        loop = hanging(SPAN, measured["rope_length_m"], measured["mass_per_length_kg_m"]["black"], edges)
        loop.numbers.update(ei=found.eis.mean(), ratio=1.2)
        out.append(f"{math.degrees(critical_turn(loop)):.1f}° with {edges}")
    return ", ".join(out)


def predictions(found: dict, turns: dict) -> None:
    """Prints the table of predictions: GJ/EI from elsewhere, the turn, and how far it is from what was measured."""

    def row(wire, origin, ratio, measured):
        predicted, mean = math.degrees(found[wire].turn(ratio)), measured.mean()
        print(f"| {wire} | {found[wire].eis.mean():.2e} | {ratio:.3f} | {origin} | {predicted:.0f} | {mean:.0f} ± "
              f"{measured.std(ddof=1):.0f} | {100.0 * (predicted / mean - 1.0):+.1f} % |")

    print("\n| wire | EI [N·m²] | GJ/EI | from | predicted [°] | measured [°] | error |\n|---|---:|---:|---|---:|---:|---:|")
    own = {wire: found[wire].ratio(math.radians(turns[wire].mean())) for wire in WIRES}
    for wire in WIRES:
        for nu in POISSON:
            row(wire, f"ν = {nu}", 1.0 / (1.0 + nu), turns[wire])
        for other in WIRES:
            if other != wire:
                row(wire, f"{other} wire", own[other], turns[wire])
        row(wire, "its first trial", found[wire].ratio(math.radians(turns[wire][0])), turns[wire][1:])


def implied(found: dict, turns: dict, authors: dict) -> None:
    """Prints what the critical turns say of GJ/EI, beside the authors' numbers."""
    print("\n| wire | GJ/EI of its critical turn | by the trials | by EI ± its deviation | authors | if at rest it is curved as the loop |\n"
          "|---|---:|---:|---:|---:|---:|")
    for wire in WIRES:
        f, measured = found[wire], np.radians(turns[wire])
        each, middle = [f.ratio(t) for t in measured], f.turn(1.2)
        by_ei = sorted(f.ratio(measured.mean() * middle / t) for t in f.by_ei)
        both = [authors[f"{wire}_{model}"]["beta_over_alpha"] for model in ("adapt", "native")]
        print(f"| {wire} | {f.ratio(measured.mean()):.2f} | {min(each):.2f} to {max(each):.2f} | {by_ei[0]:.2f} to {by_ei[1]:.2f} "
              f"| {both[0]:.2f}, {both[1]:.2f} | {f.ratio(measured.mean(), coiled=True):.2f} |")
    for wire in WIRES:
        by = ", ".join(f"{math.degrees(t):.0f}° at {c:g}/m" for c, t in zip(CURVATURES, found[wire].by_curvature, strict=True))
        print(f"{wire} wire at GJ/EI = {SECTION}, by its curvature at rest: {by}")


def main() -> int:
    """Prints all of it."""
    folder = data_folder()
    if folder is None:
        print("the real measurements are absent: set PLIANT_DATA to their folder", file=sys.stderr)
        return 2
    measured = measurements(folder)
    print("| wire | free | EI [N·m²] | holders | curvature, last − first [1/m] | mm |\n|---|---|---:|---:|---:|---:|")
    found = {wire: study(measured, wire) for wire in WIRES}
    turns = {wire: np.array(measured["measured_critical_twist_deg"][wire], dtype=float) for wire in WIRES}
    predictions(found, turns)
    implied(found, turns, measured["authors_identified"])
    print("\nblack wire at GJ/EI = 1.2:", convergence(measured, found["black"]))
    print("\n| black wire in space, GJ/EI given | mm | torque [N·m] | turn of the end [rad] |\n|---|---:|---:|---:|")
    ratios = (1.0, 0.7, 1.5)
    seen = same_for_any_gj(measured["space"]["black"], measured["mass_per_length_kg_m"]["black"], ratios)
    for ratio, (rms, torque, turn) in zip(ratios, seen, strict=True):
        print(f"| {ratio} | {1e3 * rms:.6f} | {torque:.6e} | {turn:.3f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
