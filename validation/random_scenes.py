"""Random scenes by seed: ropes, rods that twist, sheets, chains of unlike links; falling, held, dragged, twisted.

Lengths of 1 cm to 100 m, Young's moduli of 10³ to 10¹¹ Pa, steps of 1/1000 to 1/30 s, all evenly by their logarithm, and speeds in
units of √(gL): what a scene looks like does not depend on its size. A scene is a TOML text and what must be known to judge its energy.

A *chain* is unlike in its links' lengths and its nodes' masses, since stretching has one stiffness in all of a rope; of every third rod
each joint has a bending stiffness of its own, over six decades.
"""

from dataclasses import dataclass, field

import numpy as np

KINDS = ("rope", "rod", "sheet", "chain")
GRAVITY = 9.81  # m/s²


@dataclass
class Scene:
    """A scene's text; `length` [m] and `moves`: whether a hand moves, and stops halfway; `alone`: only hands and weight push."""

    seed: int
    kind: str
    text: str
    length: float
    steps: int
    moves: bool
    alone: bool
    what: list = field(default_factory=list)  # in words
    scale: float | None = None  # of the energy [J], where bodies move; otherwise it follows from the nodes


def log_uniform(rng, low, high):
    """Evenly by the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def written(value):
    """A TOML value."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {written(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(map(written, value)) + "]"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    return repr(float(value))


def table(name, entries):
    """A TOML table from a dict, `[[…]]` if the name has none of its own."""
    head = name if name.startswith("[") else f"[[{name}]]"
    return head + "\n" + "".join(f"{k} = {written(v)}\n" for k, v in entries.items())


def direction(rng):
    """A unit vector."""
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def random_scene(seed: int) -> Scene:
    """The scene of a seed."""
    rng = np.random.default_rng(seed)
    kind = KINDS[rng.integers(len(KINDS))]
    length, young = log_uniform(rng, 1e-2, 100.0), log_uniform(rng, 1e3, 1e11)
    steps, h = int(rng.integers(40, 120)), log_uniform(rng, 1 / 1000, 1 / 30)
    what = [kind, f"L {length:.2g} m", f"E {young:.1e} Pa", f"h 1/{1 / h:.0f} s"]
    held, falls = rng.random() < 0.5, rng.random() < 0.65
    integrator = "euler" if rng.random() < 0.6 else ("sdirk2" if falls or rng.random() < 0.5 else "midpoint")
    what.append(integrator)
    speed = np.sqrt(GRAVITY * length)
    velocity = rng.uniform(-1.0, 1.0, 3) * speed * rng.choice([0.0, 0.3, 1.0])
    height = length * log_uniform(rng, 0.02, 1.0)
    if falls:
        velocity[2] = -abs(rng.normal()) * 2.0 * speed * (rng.random() < 0.5)
    drag = rng.random() < 0.2
    make = sheet if kind == "sheet" else rope
    parts, radius, ends = make(rng, kind, length, young, height, velocity, drag, what)
    if falls:
        parts += obstacles(rng, length, radius, what)
    moves = False
    if held:
        hand, moves = gripper(rng, kind, ends, length, h * steps, what)
        parts.append(hand)
    head = "schema_version = 1\n" + table("[time]", {"step": h, "duration": steps * h, "integrator": integrator})
    gravity = 0.0 if rng.random() < 0.04 else GRAVITY
    head += table("[gravity]", {"magnitude": gravity})
    if drag:
        head += table("[air]", {"wind": rng.normal(size=3) * 0.3 * speed})
        what.append("wind")
    if falls:
        law = "anitescu" if rng.random() < 0.1 else "coulomb"
        head += table("[contact]", {"law": law, "rest_gap": log_uniform(rng, 1e-9, 1e-6) * max(length, 0.1)})
    text = f"# seed {seed}: {', '.join(what)}\n" + "\n".join([head, *parts])
    return Scene(seed, kind, text, length, steps, moves, not falls and not drag, what)


def rope(rng, kind, length, young, height, velocity, drag, what):
    """A rope, rod or chain: its tables, its radius, its last node."""
    nodes = int(rng.integers(4, 40))
    radius, density = length * log_uniform(rng, 5e-4, 2e-2), log_uniform(rng, 100.0, 1e4)
    area, inertia = np.pi * radius**2, np.pi * radius**4 / 4.0
    damping = rng.choice([0.0, 1.0], 2) * np.array([log_uniform(rng, 1e-5, 1e-1) for _ in range(2)])
    axis = direction(rng) if rng.random() < 0.5 else np.array([1.0, 0.0, 0.0])
    start = np.array([0.0, 0.0, height + radius - length * min(axis[2], 0.0)])
    entries = {
        "name": "it", "nodes": nodes, "length": length, "linear_density": density * area,
        "stretch_stiffness": young * area, "stretch_damping": damping[0] * young * area,
        "bend_stiffness": young * inertia * (rng.random() < 0.85), "bend_damping": damping[1] * young * inertia,
        "radius": radius, "initial": {"shape": "straight", "from": start, "direction": axis}, "velocity": velocity,
    }  # fmt: skip
    what += [f"{nodes} nodes", f"r/L {radius / length:.1e}"]
    if rng.random() < 0.2:
        entries["tip_mass"] = density * area * length * log_uniform(rng, 1e-2, 1e2)
        what.append("tip")
    if drag:
        entries["drag_linear"] = density * area * log_uniform(rng, 1e-2, 10.0)
    if kind == "chain":
        del entries["nodes"]
        entries["edge_fractions"] = [log_uniform(rng, 0.01, 1.0) for _ in range(nodes - 1)]
        heavy = [{"node": k, "mass": density * area * length * log_uniform(rng, 1e-4, 1e2)} for k in range(0, nodes, 3)]
        entries["node_mass"] = heavy
    parts = [table("rope", entries)]
    if kind == "rod":
        second, own = log_uniform(rng, 1e-2, 1e2), np.random.default_rng([nodes, int(1e6 * length)])
        parts[0] += table("[rope.twist]", {
            "stiffness": young * inertia * log_uniform(rng, 0.1, 2.0), "damping": damping[1] * young * inertia,
            "bend_stiffness_2": second * young * inertia, "section_roll": rng.uniform(0.0, 3.0),
            "rest_curvature": rng.normal(size=2) * rng.choice([0.0, 3.0]) / length,
            "rest_twist": rng.normal() * rng.choice([0.0, 6.0]) / length, "initial": rng.normal() * rng.choice([0.0, 6.0, 60.0]),
        })  # fmt: skip
        what.append(f"EI₂/EI {second:.1e}")
        if own.random() < 1.0 / 3.0:
            joints = [{"node": k, "bend_factor": log_uniform(own, 1e-3, 1e3)} for k in range(1, nodes - 1)]
            parts[0] += f"joint = {written(joints)}\n"
            what.append("unlike joints")
    return parts, radius, nodes - 1


def sheet(rng, _kind, length, young, height, velocity, drag, what):
    """A sheet of cloth: its table, its radius, the number of its last corner."""
    nu, nv = (int(n) for n in rng.integers(2, 9, 2))
    thickness, density = length * log_uniform(rng, 1e-4, 2e-2), log_uniform(rng, 100.0, 1e4)
    damping = rng.choice([0.0, 1.0], 2) * np.array([log_uniform(rng, 1e-5, 1e-1) for _ in range(2)])
    plate = young * thickness**3 / 12.0 * log_uniform(rng, 1e-3, 1.0)
    u_axis = direction(rng) if rng.random() < 0.5 else np.array([1.0, 0.0, 0.0])
    v_axis = np.cross(u_axis, direction(rng))
    v_axis /= np.linalg.norm(v_axis)
    size = np.array([1.0, log_uniform(rng, 0.2, 1.0)]) * length
    low = min(0.0, u_axis[2] * size[0]) + min(0.0, v_axis[2] * size[1])
    diagonal = ("up", "down", "alternating")[rng.integers(3)]
    entries = {
        "name": "it", "grid": {"nodes": [nu, nv], "size": size, "diagonal": diagonal}, "u_axis": u_axis, "v_axis": v_axis,
        "origin": [0.0, 0.0, height + thickness - low], "velocity": velocity, "thickness": thickness,
        "density": density, "youngs_modulus": young, "poisson_ratio": rng.uniform(-0.3, 0.45), "bend_stiffness": plate,
        "membrane_damping": damping[0] * young, "bend_damping": damping[1] * plate,
    }  # fmt: skip
    if drag:
        entries["drag_normal"] = density * thickness * log_uniform(rng, 1e-2, 10.0)
        entries["drag_quadratic"] = log_uniform(rng, 1e-2, 2.0)
    what += [f"{nu} × {nv} nodes", f"t/L {thickness / length:.1e}"]
    return [table("cloth", entries)], 0.5 * thickness, nu * nv - 1


def obstacles(rng, length, radius, what):
    """A floor, and sometimes a ball, a rail or a box on it, all below what falls."""
    friction = lambda: float(rng.choice([0.0, 0.3, 1.5]))
    tilt = rng.normal(size=2) * rng.choice([0.0, 0.2])
    kind = ("plane", "sphere", "capsule", "box")[rng.integers(4)]
    what.append(f"on a {kind}")
    if kind == "plane":
        # what begins above z = 0 may reach sideways by its length: a tilted floor starts lower
        point = [0.0, 0.0, -2.0 * length * float(np.abs(tilt).sum())]
        return [table("plane", {"name": "floor", "point": point, "normal": [*tilt, 1.0], "friction": friction()})]
    size = length * log_uniform(rng, 0.05, 0.5)
    middle = np.array([0.3 * length, 0.05 * length, -size - radius])
    floor = table("plane", {"name": "floor", "point": [0.0, 0.0, -2.0 * size - 0.2 * length], "friction": friction()})
    if kind == "sphere":
        other = {"name": "other", "center": middle, "radius": size, "friction": friction()}
    elif kind == "capsule":
        across = np.array([0.0, 0.6 * length, 0.0])
        other = {"name": "other", "a": middle - across, "b": middle + across, "radius": size, "friction": friction()}
    else:
        other = {"name": "other", "position": middle, "half_extents": [size, 2.0 * size, size], "friction": friction()}
    return [floor, table(kind, other)]


def gripper(rng, kind, last, length, duration, what):
    """A hand, and whether it moves (on a line; the run stops it halfway)."""
    entries = {"name": "hand", ("cloth" if kind == "sheet" else "rope"): "it"}
    if kind != "sheet" and rng.random() < 0.5:
        entries["end"] = ("first", "last")[rng.integers(2)]
    else:
        numbers = rng.choice(last + 1, size=min(int(rng.integers(1, 4)), last), replace=False)
        entries["nodes"] = sorted(int(k) for k in numbers)
    entries["mode"] = ("prescribed", "velocity")[rng.integers(2)]
    moves = rng.random() < 0.6
    if moves:
        # upwards, so that nothing that is held is pushed into what it fell on
        way = rng.normal(size=3) * length * rng.choice([0.1, 0.5, 2.0])
        way[2] = abs(way[2])
        entries["motion"] = {"kind": "line", "velocity": way / duration}
    what.append(f"{entries['mode']} hand at {entries.get('end') or entries['nodes']}" + (", moving" if moves else ""))
    return table("gripper", entries), bool(moves)
