"""Forces of one's own: the formulas of a scene, evaluated by Python itself with the functions of jax.numpy.

    f = F(position, velocity, parameters)

at joints [N·m or N], on listed nodes [N], or per length [N/m] or area [N/m²] of all nodes of a rope or a sheet.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np


def _root(x):
    """√x with derivative 0 at x = 0."""
    positive = x > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0 * x)


FUNCTIONS = {
    name: getattr(jnp, name)
    for name in "sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh exp expm1 log log1p abs sign minimum maximum where".split()
} | {"pi": np.pi, "sqrt": _root, "hypot": lambda a, b: _root(a * a + b * b)}


@dataclass(frozen=True, eq=False)
class Force:
    """Formulas, their variables, the positions in θ of their parameters, and where they act."""

    texts: list
    variables: tuple
    where: dict  # parameter -> position in θ
    place: object  # a joint, or nodes
    extent: tuple = ()  # per node: fraction, position in θ of the length or area that it is a fraction of; () for whole forces

    def __call__(self, values, theta):
        """One value (or array) per formula, of the variables' values."""
        names = FUNCTIONS | dict(zip(self.variables, values, strict=True)) | {k: theta[at] for k, at in self.where.items()}
        return [eval(text, {"__builtins__": {}}, names) for text in self.texts]  # noqa: S307


def read(entry, table, variables, place, extent=()):
    """The force of one [[force]]."""
    texts = [entry["formula"]] if isinstance(entry["formula"], str) else entry["formula"]
    where = {key: table.add(f"{entry['name']}.{key}", value) for key, value in sorted(entry.get("parameters", {}).items())}
    return Force(texts, variables, where, place, extent)


def on_nodes(entries, table, spans, extents):
    """Those on ropes and sheets; `spans`: name -> nodes, `extents`: name -> (fractions, positions in θ) of these nodes."""
    out = []
    for entry in entries:
        name = entry.get("rope") or entry["cloth"]
        nodes = np.asarray(spans[name])
        whole = "nodes" in entry
        out.append(
            read(
                entry,
                table,
                ("x", "y", "z", "vx", "vy", "vz"),
                nodes[np.array(entry["nodes"])] if whole else nodes,
                () if whole else extents[name],
            )
        )
    return out


def add_to_nodes(forces, q, v, theta, f):
    """f (n_nodes, 3) [N] and these forces at q, v (n_nodes, 3)."""
    for force in forces:
        x, x_dot = q[force.place], v[force.place]
        columns = [jnp.broadcast_to(c, len(x)) for c in force((*x.T, *x_dot.T), theta)]
        own = jnp.stack(columns, axis=1)
        if force.extent:
            fraction, at = force.extent
            own = own * (fraction * theta[at])[:, None]
        f = f.at[force.place].add(own)
    return f


def of_joint(force, coordinates, speeds, theta):
    """Generalized force [N·m or N] at the joint."""
    return jnp.stack([jnp.asarray(f, dtype=float) for f in force((*coordinates, *speeds), theta)])
