"""Writes examples/hidden_effect: a cable held by two moving grippers, with one effect hidden.

    python -m validation.blind.make_example [--out DIR]

The scene believes in a bending damping c_b of 2e-5 N·m²·s; the cable that made the logs has 5e-5, and
EI is 20 % off the scene's guess. λ = |u|² θ² is far above 1000 and the nearest rival's cosine is
printed. Noise: AR(1), φ = 0.7, σ = 1 mm, readings rounded to 0.1 mm.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from validation.blind import measure, oracle, rope_ode
from validation.blind.families import CABLE, TWO_ENDS

FAMILY = replace(
    TWO_ENDS, name="example", nominal=CABLE | {"cb": 2.0e-5}, markers=(3, 5, 7, 10), duration=2.5
)
TRUTH = 5.0e-5  # N·m²·s
GUESS = 1.2e-3  # N·m², the scene's EI; true 1.5e-3
NOISE = measure.Noise(phi=0.7, sigma=1.0e-3)
SEED = 20
COMMENT = """A cable held by two moving grippers, four markers on it. The scene lacks something the real
cable has: `pliant diagnose examples/hidden_effect/scene.toml` says what. bend_stiffness is a guess,
to be refitted. Written by validation/blind/make_example.py, whose simulator is not pliant."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[2] / "examples" / "hidden_effect")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    known = oracle.sensitivity(FAMILY)
    judge = oracle.Oracle(known, NOISE.phi, NOISE.sigma, NOISE.quantum)
    theta = TRUTH - FAMILY.nominal["cb"]
    n_records = len(FAMILY.records)
    p = rope_ode.parameters(FAMILY, [{"cb": TRUTH}] * n_records)
    q, v = rope_ode.simulate(FAMILY, p, np.arange(n_records), known.shape)
    y, y_dot = (oracle.by_record(FAMILY, x, n_records)[0] for x in (q, v))
    rng = np.random.default_rng(SEED)
    logs = []
    for r in range(n_records):
        reading, t = measure.observe(FAMILY, y[r], y_dot[r], measure.Sensor(), NOISE, rng)
        logs.append((f"run{r + 1}.csv", FAMILY.roles[r]))
        measure.write_log(out / logs[-1][0], FAMILY, r, reading, t)
    text = measure.scene_text(FAMILY, known.shape, logs, GUESS, COMMENT)
    (out / "scene.toml").write_text(text, encoding="utf-8")
    u = judge.u["cb"]
    actual = judge.project(judge.whitened(y - known.y))
    print(f"λ = {u @ u * theta**2:.0f} linear, {actual @ actual:.0f} actual")
    print(f"rms of the effect {1e3 * np.sqrt(np.mean((y - known.y) ** 2)):.2f} mm")
    for name, c in sorted(judge.cosines(actual).items(), key=lambda kv: -kv[1]):
        print(f"  ρ {c:.3f}  {name}")
    print("naming rule:", judge.allows_name(u, "internal_damping", theta))
    print(f"mismatch² along the candidates: {max(judge.mismatch_t2().values()):.2f}")
    print(f"{sum(f.stat().st_size for f in out.iterdir()) / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
