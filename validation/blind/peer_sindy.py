"""What is left of effects outside the library given to pysindy, beside the forms that pliant reports of it.

    python -m venv sindy && sindy/bin/pip install -r tests/requirements.txt pysindy==2.1.0
    sindy/bin/python -m validation.blind.peer_sindy KEPT [--nulls 20] [--json FILE]

KEPT is the folder of a batch that has been answered (`validation.blind.batch`). Taken are all its pendulums, carts and arms with an effect
outside the library, and the first nulls. The readings are differentiated by pysindy, smoothed; `mj_inverse` of the scene's model, with the
free numbers as pliant's baseline fitted them, says which force each joint lacks; and `STLSQ` seeks it among the functions of time, position
and velocity that pliant tries (`FEATURES`). What a library has anyhow (a constant, q, v, sign v, the command) is projected off both.

Its chances are the best we found: point by point, or hardly smoothed and integrated against bumps (the weak form, in which smoothing makes no
error of the motion's own); which way (`WAYS`), and which threshold, is what foretells most of the force on the held-out record, and only what
foretells a tenth of it there counts as a form. Lone readings that leave their neighbours are mended; what touches a gap is left out.
An error of a sensor is no force and has no function here; a gust comes at another time in every record, for which a function of time stands.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from validation.blind import chains, peer, peer_model, score
from validation.blind.peer_model import Plant, Record

try:
    import pysindy
except ImportError:
    pysindy = None

# samples that are smoothed by a cubic, and width of the bumps [s], None for points
WAYS = ((11, None), (21, None), (5, 0.1), (5, 0.2), (5, 0.3))
THRESHOLDS = np.geomspace(0.02, 0.6, 12)  # of coefficients of features of unit length, over the length of the force
ROWS = 20  # of the held-out record, at least
LEAST = 0.1  # part of the squares on the held-out record
WAVES = 16
HATS = 6
# effect -> what its form depends on, and whether it turns over with the velocity
EXPECTED = {
    "magnet": ("position", False), "ripple": ("position", False), "slack": ("position", False), "rough": ("position", True),
    "warm": ("time", True), "gust": ("time", False), "drift": ("time", False), "play": ("velocity", False),
}  # fmt: skip
RIPPLE = 2 * np.pi / 8.0  # rad, the period of a hidden ripple


class Form(NamedTuple):
    """What a force or an error depends on, of which joint; `period` where it repeats with the position."""

    joint: str
    of: str
    turning: bool
    period: float | None
    text: str


class Motion(NamedTuple):
    """A record, smoothed: times, positions, velocities, commands of all joints, the forces that are missing; whether no gap is near."""

    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    force: np.ndarray
    good: np.ndarray


# ---- The force that is missing ---------------------------------------------------------------------------------------------------


def cleaned(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Readings with those that are missing, or that leave the four around them by eight times the scatter, put on a line."""
    there = np.isfinite(q)
    q = np.interp(t, t[there], q[there])
    off = np.zeros_like(q)
    off[2:-2] = q[2:-2] - (4.0 * (q[1:-3] + q[3:-1]) - q[:-4] - q[4:]) / 6.0
    lone = np.abs(off) > 8.0 * 1.4826 * np.median(np.abs(off))
    worst = lone & (np.abs(off) >= np.maximum(np.roll(np.abs(off), 1), np.roll(np.abs(off), -1)))
    return np.interp(t, t[~worst], q[~worst])


def motion(plant: Plant, values: dict[str, float], record: Record, window: int) -> Motion:
    """A record differentiated, and what each joint lacks."""
    t = record.times
    filled = np.stack([cleaned(t, q) for q in record.readings.T], axis=1)
    missing = np.convolve((~np.isfinite(record.readings)).any(axis=1), np.ones(window), "same") > 0.5
    even = np.linspace(t[0], t[-1], len(t))  # where the clock shakes, the smoothing wants even steps
    q = np.stack([np.interp(even, t, x) for x in filled.T], axis=1)
    derivative = pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": window, "polyorder": 3})
    v = np.asarray(derivative(q, even))
    a = np.asarray(derivative(v, even))
    rubbing = {f"{joint['name']}.friction": values[f"{joint['name']}.friction"] for joint in plant.joints}
    model = peer_model.fill(peer_model.build(plant), plant.scene, values | dict.fromkeys(rubbing, 0.0))
    data, force = mujoco.MjData(model), np.zeros_like(q)
    u = np.stack([np.interp(even, record.stamps, x) for x in record.commands.T], axis=1)
    for k in range(len(even)):
        data.qpos[:], data.qvel[:], data.qacc[:], data.ctrl[:] = q[k], v[k], a[k], u[k]
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        mujoco.mj_fwdActuation(model, data)
        force[k] = needed - data.qfrc_actuator + np.array(list(rubbing.values())) * np.sign(v[k])
    inside = slice(window // 2, len(even) - window // 2)  # at the ends it is no derivative
    driven = {motor["joint"]: x for motor, x in zip(plant.motors, u.T, strict=True)}
    pushed = np.stack([driven.get(joint["name"], np.zeros(len(even))) for joint in plant.joints], axis=1)
    return Motion(even[inside], q[inside], v[inside], pushed[inside], force[inside], ~missing[inside])


def features(joint: str, m: Motion, k: int, spans: tuple[float, float, float]) -> tuple[list[Form], np.ndarray, np.ndarray]:
    """Functions of a joint's time, position and velocity, as pliant tries them: forms, columns, and the columns of what a library has."""
    q, v, t, (low, high, last) = m.q[:, k], m.v[:, k], m.times, spans
    sign, out = np.sign(v), []

    def add(of: str, turning: bool, text: str, x: np.ndarray, period: float | None = None) -> None:
        out.append((Form(joint, of, turning, period, text), x))

    add("time", False, "t", t)
    for h in range(HATS):
        add("time", False, f"hat {h} of t", np.maximum(0.0, 1.0 - np.abs(t / last * (HATS - 1) - h)))
    for text, x in (("q²", q**2), ("q³", q**3), ("|q|", np.abs(q))):
        add("position", False, text, x)
    for text, x in (("v²", v**2), ("v³", v**3)):
        add("velocity", False, text, x)
    add("velocity", False, "v|v|", v * np.abs(v))
    add("time", True, "t sign v", t * sign)
    add("position", True, "|q| sign v", np.abs(q) * sign)
    for waves in range(1, WAVES + 1):
        period = (high - low) / waves
        for name, wave in (("sin", np.sin), ("cos", np.cos)):
            x = wave(2 * np.pi * q / period)
            add("position", False, f"{name} of q, {1e3 * period:.0f} milli", x, period)
            add("position", True, f"{name} of q, {1e3 * period:.0f} milli, times sign v", x * sign, period)
    known = np.stack([np.ones_like(q), q, v, sign, m.u[:, k]], axis=1)
    return [form for form, _ in out], np.stack([x for _, x in out], axis=1), known


def weak(times: np.ndarray, span: float) -> np.ndarray:
    """Rows that integrate against bumps (1 - x²)² of a width, half of it apart."""
    middles = np.arange(times[0] + span / 2, times[-1] - span / 2 + 1e-9, span / 4)
    x = (times - middles[:, None]) / (span / 2)
    rows = np.where(np.abs(x) < 1.0, (1.0 - x**2) ** 2, 0.0)
    return rows / rows.sum(axis=1, keepdims=True)


class Found(NamedTuple):
    """The part of the squares foretold on the held-out record, and the terms, those that take most first."""

    share: float
    terms: list[Form]


def sought(plant: Plant, motions: list[Motion], held_out: Motion, k: int, span: float | None) -> Found:
    """The sparse law of a joint's missing force."""
    spans = (min(m.q[:, k].min() for m in motions), max(m.q[:, k].max() for m in motions), max(m.times[-1] for m in motions))
    def project(m: Motion) -> np.ndarray:
        rows = np.eye(len(m.times)) if span is None else weak(m.times, span)
        return rows[~((rows > 0.0) & ~m.good).any(axis=1)]

    parts = []
    for m in (*motions, held_out):
        forms, x, known = features(plant.joints[k]["name"], m, k, spans)
        w = project(m)
        parts.append((w @ x, w @ known, w @ m.force[:, k]))
    if len(parts[-1][0]) < ROWS:
        return Found(0.0, [])
    x, known, y = (np.concatenate([part[i] for part in parts[:-1]]) for i in range(3))
    other, base, target = parts[-1]
    x_known, y_known = np.linalg.lstsq(known, x, rcond=None)[0], np.linalg.lstsq(known, y, rcond=None)[0]
    x, y, other, target = x - known @ x_known, y - known @ y_known, other - base @ x_known, target - base @ y_known
    length = np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    best = Found(0.0, [])
    for threshold in THRESHOLDS:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-3, max_iter=30)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # where nothing is left of the law
            optimizer.fit(x / length, (y / np.linalg.norm(y))[:, None])
        c = np.asarray(optimizer.coef_).ravel()
        if not np.any(c):
            break
        foretold = (other / length) @ c * np.linalg.norm(y)
        share = 1.0 - np.sum((target - foretold) ** 2) / np.sum(target**2)
        if share > best.share:
            order = np.argsort(-np.abs(c))
            best = Found(float(share), [forms[i] for i in order if c[i] != 0.0])
    return best


def asked(folder: Path, report: dict) -> dict:
    """The best law of any joint of a case."""
    began, plant = time.process_time(), peer_model.read(folder)
    values = peer_model.scene_values(plant.scene) | {p["path"]: p["estimate"] for p in report["baseline"]}
    best, how = Found(0.0, []), ""
    for window, span in WAYS:
        fit = [motion(plant, values, record, window) for record in plant.fitted()]
        other = motion(plant, values, plant.held_out(), window)
        for k in range(len(plant.joints)):
            found = sought(plant, fit, other, k, span)
            if found.share > best.share:
                best, how = found, f"window {window}" if span is None else f"bumps of {span} s"
    told = best.terms if best.share > LEAST else []
    return {"share": best.share, "how": how, "forms": told, "seconds": time.process_time() - began}


# ---- Whether it is the hidden one -------------------------------------------------------------------------------------------------


def read(form: dict) -> Form:
    """A form of pliant's remainder, from its words."""
    words = form["what"]
    period = re.search(r"repeats every ([0-9.]+) m(?:rad|m) of the position", words)
    by_place = re.search(r"of the position|on the position", words)
    of = "time" if re.search(r"with the time|on the time|pushes for", words) else "position" if by_place else "velocity"
    joint = form["object"].removeprefix("position of ")
    return Form(joint, of, "turns over" in words, 1e-3 * float(period[1]) if period else None, words)


def worth(case: dict, forms: list[Form]) -> str:
    """What forms are worth; the first is what is told. `right` needs the joint, what it depends on, and the period of a ripple."""
    if not forms:
        return "none"
    if case["kind"] == "null":
        return "false"
    effect, _, joint = case["hidden"][0]["effect"].partition(":")
    fits = lambda f: f.joint == joint and (f.of, f.turning) == EXPECTED[effect]
    exact = lambda f: fits(f) and (effect != "ripple" or (f.period is not None and abs(f.period / RIPPLE - 1.0) < 0.15))
    return "right" if exact(forms[0]) else "among them" if any(exact(f) for f in forms) else "wrong"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kept", type=Path, help="the folder that a batch kept")
    parser.add_argument("--nulls", type=int, default=20)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    if pysindy is None:
        print("this needs pysindy, in an environment of its own: pip install -r tests/requirements.txt pysindy==2.1.0", file=sys.stderr)
        return 2
    results: list[dict] = []
    of_chain = lambda case, _: case["system"] in chains.SYSTEMS
    for row, _ in peer.chosen(peer.kept(options.kept), {"outside": 10**6, "null": options.nulls}, of_chain, lambda _: True):
        case, report = row["case"], row["report"]
        if report is None:
            continue
        theirs = asked(row["folder"], report)
        ours = [read(form) for form in report["remainder"]["forms"]]
        judged = {"ours": worth(case, ours), "theirs": worth(case, theirs["forms"])}
        results.append({"case": case, "verdict": report["verdict"], "forms": [f.text for f in ours], "sindy": theirs} | judged)
        terms = ", ".join(f"{f.joint} {f.text}" for f in theirs["forms"][:3])
        print(f"{case['index']:4d} {case['system']:9s} {score.hidden_name(case) or '-':16s} λ {case['lam']:6g} {case['noise']:9s}"
              f" pliant {report['verdict']:15s} {judged['ours']:10s} pysindy {judged['theirs']:10s} {theirs['share']:5.2f}"
              f" ({theirs['how']}: {terms}) {theirs['seconds']:.0f} s", flush=True)  # fmt: skip
    for kind in ("outside", "null"):
        own = [r for r in results if r["case"]["kind"] == kind]
        print(f"{kind}: {len(own)}; pliant {dict(Counter(r['ours'] for r in own))}; pysindy {dict(Counter(r['theirs'] for r in own))}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
