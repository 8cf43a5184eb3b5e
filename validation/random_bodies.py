"""Random scenes of bodies by seed: piles, stacks, impacts, unlike masses, long steps.

Shapes of 1 to 10 cm (times a size of 0.1 to 10), four kinds; steps of 1/1000 to 1/100 s, and of 0.02 to 0.1 s in every eighth scene; mass
ratios to 1e4 and speeds to 20 m/s in some. No two bodies overlap at the beginning. A scene is a TOML text and what must be known to
judge its energy: bodies that fall and collide gain none.
"""

import numpy as np

from validation.random_scenes import GRAVITY, Scene, log_uniform, table

KINDS = ("pile", "stack", "impact")
SHAPES = ("sphere", "capsule", "cylinder", "box")


def random_bodies(seed: int) -> Scene:
    """The scene of a seed."""
    rng = np.random.default_rng([seed, 7])
    kind = KINDS[rng.integers(len(KINDS))]
    size = log_uniform(rng, 0.1, 10.0)
    long_steps = rng.random() < 1 / 8
    h = log_uniform(rng, 0.02, 0.1) if long_steps else log_uniform(rng, 1 / 1000, 1 / 100)
    # time in which something falls through the scene, a few times
    duration = 3.0 * float(np.sqrt(size)) if long_steps else 1.2 * float(np.sqrt(size))
    steps = int(min(max(duration / h, 10), 250))
    what = [kind, f"size {size:.2g}", f"h 1/{1 / h:.0f} s"]
    spread = rng.choice([1.0, 10.0, 100.0])  # masses within a factor of spread² of each other
    make = {"pile": pile, "stack": stack, "impact": impact}[kind]
    bodies = make(rng, size, what)
    for body in bodies:
        body["density"] = 1000.0 * log_uniform(rng, 1.0 / spread, spread)
    if spread > 1.0:
        what.append(f"densities within {spread**2:.0e}")
    integrator = "sdirk2" if rng.random() < 0.2 else "euler"
    what.append(integrator)
    friction = float(rng.choice([0.0, 0.3, 0.8]))
    head = "schema_version = 1\n" + table("[time]", {"step": h, "duration": steps * h, "integrator": integrator})
    gravity = 0.0 if kind == "impact" and rng.random() < 0.5 else GRAVITY
    head += table("[gravity]", {"magnitude": gravity})
    head += table("[contact]", {"rest_gap": float(rng.choice([1e-9, 1e-6])) * size})
    tilt = rng.normal(size=2) * rng.choice([0.0, 0.1])
    low = min(b["position"][2] for b in bodies) - 0.3 * size
    floor = {"name": "floor", "point": [0.0, 0.0, low if tilt.any() else 0.0], "normal": [*tilt, 1.0], "friction": friction}
    parts = [table("plane", floor)]
    scale, total = 0.0, 0.0
    for number, body in enumerate(bodies):
        mass, text = written_body(number, body, friction)
        parts.append(text)
        total += mass
        scale += mass * (gravity * size + 0.5 * float(np.dot(body["velocity"], body["velocity"])))
    what.append(f"{len(bodies)} bodies, friction {friction}")
    text = f"# bodies, seed {seed}: {', '.join(what)}\n" + "\n".join([head, *parts])
    return Scene(seed, kind, text, size, steps, False, True, what, scale)


def written_body(number, body, friction):
    """A free body's mass [kg] and tables."""
    shape, density = body["shape"], body["density"]
    mass, inertia = inertia_of(shape, density)
    entries = {"name": f"b{number}", "position": body["position"], "quaternion": body["quaternion"], "mass": mass,
               "inertia": [*inertia, 0.0, 0.0, 0.0]}  # fmt: skip
    joint = {"name": f"b{number}_free", "kind": "free"}
    return mass, (
        table("body", entries)
        + table("body.joint", joint | {"velocity": [*body["velocity"], *body["spin"]]})
        + table("body.shape", shape | {"friction": friction})
    )


def inertia_of(shape, density):
    """Mass [kg] and principal moments [kg·m²] of a solid."""
    kind = shape["kind"]
    if kind == "box":
        a, b, c = shape["half_extents"]
        mass = 8.0 * a * b * c * density
        return mass, mass / 3.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    r = shape["radius"]
    if kind == "sphere":
        mass = 4.0 / 3.0 * np.pi * r**3 * density
        return mass, mass * 0.4 * r * r * np.ones(3)
    half = shape["half_length"] + (0.4 * r if kind == "capsule" else 0.0)  # of a capsule nearly
    mass = 2.0 * np.pi * r * r * half * density
    across = mass * (r * r / 4.0 + half * half / 3.0)
    return mass, np.array([across, across, 0.5 * mass * r * r])


def random_shape(rng, size):
    """A shape, and the radius [m] of a ball that holds it."""
    kind = SHAPES[rng.integers(len(SHAPES))]
    a, b, c = size * rng.uniform(0.02, 0.08, 3)
    if kind == "sphere":
        return {"kind": kind, "radius": a}, a
    if kind == "box":
        return {"kind": kind, "half_extents": [a, b, c]}, float(np.sqrt(a * a + b * b + c * c))
    return {"kind": kind, "radius": a, "half_length": b}, float(a + b if kind == "capsule" else np.hypot(a, b))


def turned(rng):
    """A unit quaternion, evenly."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def pile(rng, size, what):
    """Three to eight bodies that fall onto each other."""
    bodies, z = [], 0.0
    speed = float(rng.choice([0.0, 1.0, 5.0]))
    for _ in range(int(rng.integers(3, 9))):
        shape, reach = random_shape(rng, size)
        z += reach + 0.01 * size
        x, y = rng.uniform(-0.04, 0.04, 2) * size
        velocity = np.array([0.0, 0.0, -speed * np.sqrt(size)])
        spin = rng.normal(size=3) * rng.choice([0.0, 5.0])
        bodies.append({"shape": shape, "position": [x, y, z], "quaternion": turned(rng), "velocity": velocity, "spin": spin})
        z += reach
    what.append(f"thrown at {speed:.0f} √size m/s")
    return bodies


def stack(rng, size, what):
    """Two to six boxes or cylinders that stand on each other, a millimetre apart."""
    bodies, z = [], 0.0
    for _ in range(int(rng.integers(2, 7))):
        a, b, c = size * rng.uniform(0.02, 0.08, 3)
        box = rng.random() < 0.6
        shape = {"kind": "box", "half_extents": [a, b, c]} if box else {"kind": "cylinder", "radius": a, "half_length": c}
        z += c + 0.001 * size
        yaw = rng.uniform(0.0, np.pi)
        quaternion = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        x, y = rng.normal(size=2) * 0.01 * size
        bodies.append({"shape": shape, "position": [x, y, z], "quaternion": quaternion, "velocity": np.zeros(3), "spin": np.zeros(3)})
        z += c
    return bodies


def impact(rng, size, what):
    """One body thrown at another at up to 20 m/s."""
    speed = log_uniform(rng, 1.0, 20.0)
    one, reach_one = random_shape(rng, size)
    two, reach_two = random_shape(rng, size)
    z = reach_two + 0.01 * size
    way = reach_one + reach_two + size * rng.uniform(0.02, 0.2)
    side = rng.uniform(-0.5, 0.5) * min(reach_one, reach_two)
    still = np.zeros(3)
    what.append(f"at {speed:.1f} m/s")
    spin = rng.normal(size=3) * rng.choice([0.0, 10.0])
    return [
        {"shape": two, "position": [0.0, 0.0, z], "quaternion": turned(rng), "velocity": still, "spin": still},
        {"shape": one, "position": [-way, side, max(z, reach_one + 0.01 * size)], "quaternion": turned(rng),
         "velocity": np.array([speed, 0.0, 0.0]), "spin": spin},
    ]  # fmt: skip
