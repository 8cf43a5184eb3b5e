"""Motions of a strip of cloth that a hand holds by its upper side, for the blind batch: many variants at once, in JAX.

    m ẍ = m g − ∂E/∂x − ∂R/∂ẋ + drag + what the library lacks        E, R, drag: validation/reference/sheets.py

by the classical Runge-Kutta method in steps of 0.5 ms, and by the implicit midpoint rule at the step of the scene, as a fitter takes it.
Rows of a motion are `ROW` apart; the hand goes straight from row to row. A motion begins in the equilibrium under its first row.
"""

from __future__ import annotations

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from validation.reference import sheets
from validation.reference.laws import gravity_vector
from validation.reference.parameters import SHEET_ENTRIES

GRID = (5, 3)  # nodes down and across
ASPECT = 2.5  # length over width
HELD, FREE = np.arange(GRID[1]), np.arange(GRID[1], GRID[0] * GRID[1])
ROW, STEPS = 5e-3, 10  # s; Runge-Kutta steps in a row
# further numbers of a variant: the scene's, then what no cause of the library stands for, then when a gust blows [s]
OTHERS = ("gravity", "tilt0", "tilt1", "wind0", "wind1", "wind2", "offset0", "offset1", "offset2")
BEYOND = ("weave", "magnet", "gust")
NAMES = (*SHEET_ENTRIES, *OTHERS, *BEYOND, "gust_at")
AT = {name: k for k, name in enumerate(NAMES)}
MAGNET = np.array([0.15, 0.05, -0.1])  # m, from the lowest node in the middle
QUICK = {"xla_llvm_disable_expensive_passes": True}  # compiles faster
LANES, TURNS = 32, 12  # variants side by side; Newton's steps to an equilibrium
KEPT = Path(__file__).resolve().parents[1] / "out" / "jax"  # compiled programs, not in the repository

jax.config.update("jax_enable_x64", True)


@functools.cache
def layout() -> tuple[sheets.Sheets, np.ndarray, np.ndarray]:
    """The sheet, its nodes' parts of the area, and their places in a strip of area 1."""
    size = (np.sqrt(ASPECT), 1.0 / np.sqrt(ASPECT))
    entry = {"grid": {"nodes": GRID, "size": size}, "u_axis": [0, 0, -1], "v_axis": [0, 1, 0]}
    sheet, nodes = sheets.build([entry], [{key: AT[key] for key in SHEET_ENTRIES}], 0)
    return sheet, nodes["fraction"], nodes["q0"]


def force(p, time, x, v):
    """Forces (n, 3) on all nodes."""
    sheet, fraction, unit = layout()
    mass = fraction * p[AT["area"]] * p[AT["area_density"]]
    out = mass[:, None] * gravity_vector(p[AT["gravity"]], p[AT["tilt0"] : AT["tilt1"] + 1])

    def energy(x):
        # a weave that is stiffer down the strip than across it
        strain = sheets.green(sheet, x, sheets.values(sheet, p)["area"])[:, 0, 0]
        down = jnp.sum(sheet.share * strain**2) * p[AT["area"]] * p[AT["thickness"]] * p[AT["youngs_modulus"]]
        return sheets.energy(sheet, x, p) + 0.5 * p[AT["weave"]] * down

    out -= jax.grad(energy)(x) + jax.grad(sheets.dissipation, 2)(sheet, x, v, p)
    out += sheets.drag(sheet, x, v, p[AT["wind0"] : AT["wind2"] + 1], p)
    last = np.zeros((len(unit), 1))
    last[-2] = 1.0
    away = jnp.asarray(unit[-2]) * jnp.sqrt(p[AT["area"]]) + MAGNET - x[-2]
    out += last * p[AT["magnet"]] * away / (0.01 + jnp.sum(away**2))
    blown = p[AT["gust"]] * jnp.exp(-0.5 * ((time - p[AT["gust_at"]]) / 0.04) ** 2)
    return out + mass[:, None] * blown * np.array([1.0, 0.0, 0.0])


def whole(p, free, held):
    """All nodes; the hand is beside where it is told to be by its offset."""
    return jnp.concatenate([held + p[AT["offset0"] : AT["offset2"] + 1], free])


def masses(p):
    return (layout()[1][FREE] * p[AT["area"]] * p[AT["area_density"]])[:, None]


def at_rest(p, held):
    """Free nodes in equilibrium, and the last Newton step."""
    unit = layout()[2]
    begin = jnp.asarray(unit[FREE]) * jnp.sqrt(p[AT["area"]]) + jnp.mean(held, axis=0) - jnp.mean(unit[HELD], axis=0) * jnp.sqrt(p[AT["area"]])

    def residual(y):
        x = whole(p, y.reshape(-1, 3), held)
        return force(p, -1e3, x, 0.0 * x)[FREE].ravel()

    def newton(_, carried):
        y, _ = carried
        step = jnp.linalg.solve(jax.jacfwd(residual)(y), residual(y))
        step *= jnp.minimum(1.0, 0.02 / jnp.max(jnp.abs(step)))
        return y - step, jnp.max(jnp.abs(step))

    y, last = jax.lax.fori_loop(0, TURNS, newton, (begin.ravel(), 0.0))
    return y.reshape(-1, 3), last


def rates(p, time, x, v, held, speed):
    """Velocities and accelerations of the free nodes."""
    still = 0.0 * p[:3]
    v_all = jnp.concatenate([speed + still, v])
    return v, force(p, time, whole(p, x, held), v_all)[FREE] / masses(p)


def runge_kutta(p, time, x, v, held, speed, h):
    rate = lambda a, y: rates(p, time + a * h, y[0], y[1], held + a * h * speed, speed)
    add = lambda a, k: (x + a * h * k[0], v + a * h * k[1])
    k1 = rate(0.0, (x, v))
    k2 = rate(0.5, add(0.5, k1))
    k3 = rate(0.5, add(0.5, k2))
    k4 = rate(1.0, add(1.0, k3))
    total = tuple((a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return add(1.0, total)


def midpoint(p, time, x, v, held, speed, h):
    def residual(new):
        bar = 0.5 * (v + new.reshape(-1, 3))
        _, a = rates(p, time + 0.5 * h, x + 0.5 * h * bar, bar, held + 0.5 * h * speed, speed)
        return (new.reshape(-1, 3) - v - h * a).ravel()

    inverse = jnp.linalg.inv(jax.jacfwd(residual)(v.ravel()))
    new = jax.lax.fori_loop(0, 6, lambda _, y: y - inverse @ residual(y), v.ravel()).reshape(-1, 3)
    return x + 0.5 * h * (v + new), new


def simulate(p, table, rule, steps):
    """Free nodes and velocities (rows, n, 3) of a variant, and the last step to its equilibrium."""
    begin, last = at_rest(p, table[0])
    one, h = {"true": runge_kutta, "scene": midpoint}[rule], ROW / steps
    speeds = (table[1:] - table[:-1]) / ROW

    def row(y, own):
        k, held, speed = own
        step = lambda i, y: one(p, k * ROW + i * h, *y, held + i * h * speed, speed, h)
        y = jax.lax.fori_loop(0, steps, step, y)
        return y, y

    _, (x, v) = jax.lax.scan(row, (begin, 0.0 * begin), (jnp.arange(len(speeds)), table[:-1], speeds))
    return jnp.concatenate([begin[None], x]), jnp.concatenate([0.0 * begin[None], v]), last


@functools.cache
def program(rule: str, steps: int):
    """A compiled program for lanes of variants; kept on disk."""
    jax.config.update("jax_compilation_cache_dir", str(KEPT))
    many = lambda p, record, tables: jax.vmap(lambda p, r: simulate(p, tables[r], rule, steps))(p, record)
    return jax.jit(many, compiler_options=QUICK)


def run(rule: str, p: np.ndarray, record: np.ndarray, tables: np.ndarray, steps: int = STEPS) -> list[np.ndarray]:
    """Free nodes (B, rows, n, 3), velocities, and last steps to equilibria (B,) of B variants with the numbers p (B, NAMES)."""
    parts, width = [], LANES if len(record) > 8 else 8
    for first in range(0, len(record), width):
        own = np.minimum(np.arange(first, first + width), len(record) - 1)
        parts.append([np.asarray(a)[: len(record) - first] for a in program(rule, steps)(p[own], record[own], tables)])
    return [np.concatenate(a) for a in zip(*parts, strict=True)]
