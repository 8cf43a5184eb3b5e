"""The flat parameter vector θ of a scene: paths, defaults and their positions.

Order: gravity, air, per rope, per sheet, per rod that twists, per gripper, per shape. SI units.
"""

from dataclasses import dataclass, field

import numpy as np

ROPE_SCALARS = (
    "length",
    "linear_density",
    "stretch_stiffness",
    "stretch_damping",
    "bend_stiffness",
    "bend_damping",
    "drag_linear",
    "drag_quadratic",
    "tip_mass",
    "radius",
)
ROPE_DEFAULTS = {
    "stretch_damping": 0.0,
    "bend_stiffness": 0.0,
    "bend_damping": 0.0,
    "drag_linear": 0.0,
    "drag_quadratic": 0.0,
    "tip_mass": 0.0,
    "radius": 0.0,
}
SECTION_LAWS = {  # table of a rope -> its entries and what they are called in θ
    "stiffening": {"coefficient": "stiffening"},
    "plasticity": {"yield_curvature": "yield_curvature", "time": "plastic_time"},
    "creep": {"fraction": "creep_fraction", "twist_fraction": "creep_twist_fraction", "time": "creep_time"},
    "bend_friction": {"moment": "friction_moment", "curvature": "friction_curvature"},
}
SHEET_ENTRIES = (
    "area",
    "area_density",
    "thickness",
    "youngs_modulus",
    "poisson_ratio",
    "bend_stiffness",
    "membrane_damping",
    "bend_damping",
    "drag_normal",
    "drag_quadratic",
    "radius",
)
SHAPE_ENTRIES = {  # kind -> (entry, components; 0 = scalar)
    "plane": (("height", 0), ("rotation", 3), ("friction", 0)),
    "sphere": (("center", 3), ("radius", 0), ("friction", 0)),
    "capsule": (("a", 3), ("b", 3), ("radius", 0), ("friction", 0)),
}


@dataclass
class Table:
    """Paths and default values of θ, and where each path sits."""

    paths: list = field(default_factory=list)
    values: list = field(default_factory=list)

    def add(self, path, value):
        """Appends one entry and returns its position."""
        self.paths.append(path)
        self.values.append(float(value))
        return len(self.paths) - 1

    def add_vector(self, path, values):
        """Appends path[0], path[1], … and returns their positions."""
        return np.array([self.add(f"{path}[{k}]", v) for k, v in enumerate(values)], dtype=int)


def add_rope(table, rope):
    """Adds a rope's entries; returns their positions by name, `node_mass` and `rest_strain` as arrays."""
    name, count = rope["name"], len(rope["fractions"]) + 1
    where = {}
    for key in ROPE_SCALARS:
        where[key] = table.add(f"{name}.{key}", rope.get(key, ROPE_DEFAULTS.get(key)))
    extra = np.zeros(count)
    for entry in rope.get("node_mass", []):
        extra[entry["node"]] += entry["mass"]
    where["node_mass"] = np.array(
        [table.add(f"{name}.node[{i}].mass", m) for i, m in enumerate(extra)]
    )
    strains = rope.get("edge_rest_strains", [])
    where["rest_strain"] = [table.add(f"{name}.edge[{e}].rest_strain", x) for e, x in enumerate(strains)]
    return where


def add_rod(table, rope, where, numbers):
    """Adds the entries of a rope's twist table and of its section's other laws; returns their positions by name, `joints` an array with a row each.

    `where`: those of the rope itself; `numbers` of the nodes at which it has joints.
    """
    name, twist = rope["name"], rope["twist"]
    inertia = twist.get("inertia", 0.5 * rope["linear_density"] * rope.get("radius", 0.0) ** 2)
    out = {
        "twist_stiffness": table.add(f"{name}.twist_stiffness", twist["stiffness"]),
        "twist_damping": table.add(f"{name}.twist_damping", twist.get("damping", 0.0)),
        "twist_inertia": table.add(f"{name}.twist_inertia", inertia),
        "bend_stiffness_2": where["bend_stiffness"],
    }
    if "bend_stiffness_2" in twist:
        out["bend_stiffness_2"] = table.add(f"{name}.bend_stiffness_2", twist["bend_stiffness_2"])
    out["section_roll"] = table.add(f"{name}.section_roll", twist.get("section_roll", 0.0))
    curvature = table.add_vector(f"{name}.rest_curvature", twist.get("rest_curvature", [0.0, 0.0]))
    out["rest_curvature_0"], out["rest_curvature_1"] = curvature
    out["rest_twist"] = table.add(f"{name}.rest_twist", twist.get("rest_twist", 0.0))
    count = len(rope["fractions"]) + 1
    own = {entry["node"] % count: entry for entry in twist.get("joint", [])}
    joints = []
    for k in numbers:
        entry = own.get(k, {})
        curvature = table.add_vector(f"{name}.node[{k}].rest_curvature", entry.get("rest_curvature", [0.0, 0.0]))
        joints.append([*curvature, table.add(f"{name}.node[{k}].bend_factor", entry.get("bend_factor", 1.0))])
    out["joints"] = np.array(joints)
    for key, names in SECTION_LAWS.items():
        given = rope.get(key, {})
        out |= {to: table.add(f"{name}.{to}", given[entry]) for entry, to in names.items() if entry in given}
    return out


def add_sheet(table, cloth):
    """Adds a sheet's entries; returns their positions by name."""
    t, young, nu = cloth["thickness"], cloth["youngs_modulus"], cloth.get("poisson_ratio", 0.3)
    usual = {
        "area": float(np.prod(cloth["grid"]["size"])),
        "area_density": cloth.get("density", 0.0) * t,
        "poisson_ratio": nu,
        "bend_stiffness": young * t**3 / (12.0 * (1.0 - nu**2)),
        "radius": 0.5 * t,
    }
    value = lambda key: cloth.get(key, usual.get(key, 0.0))
    return {key: table.add(f"{cloth['name']}.{key}", value(key)) for key in SHEET_ENTRIES}


def add_shape(table, kind, shape):
    """Adds a shape's entries; returns their positions by name."""
    where = {}
    for entry, components in SHAPE_ENTRIES[kind]:
        path = f"{shape['name']}.{entry}"
        default = np.zeros(components) if components else 0.0
        value = shape.get(entry, default)
        where[entry] = table.add_vector(path, value) if components else table.add(path, value)
    return where
