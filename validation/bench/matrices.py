"""Writes the scenes of all benchmarked works as files, for the comparison of linear algebra in docs/linear_algebra.md.

`python -m validation.bench.matrices FOLDER` writes `01_rope20_hang.toml` and so on, in the order of BENCHMARKS.md; then
`cargo run --release -p pliant-engine --example linalg_vs_faer -- FOLDER/*.toml` takes the matrix of a step from each of them.
"""

import sys
from pathlib import Path

from validation.bench import bodies, rods_cloth, scenes, touching


def texts() -> dict[str, str]:
    """TOML scenes by name: every scene of `validation.bench` and `validation.bench.rods_cloth`."""
    out = {f"rope20_{kind}": scenes.scene_text(20, kind) for kind in scenes.VELOCITY}
    out |= {f"rope{nodes}_hang": scenes.scene_text(nodes, "hang") for nodes in (200, 1000)}
    out |= {f"bodies{links}": bodies.scene_text(links) for links in (2, 7, 18)}
    out |= {case: touching.scene_text(case) for case in touching.CASES}
    out |= {f"rod20_{kind}": rods_cloth.rod_text(20, kind) for kind in rods_cloth.CONTACTS}
    out |= {f"rod{nodes}_hang": rods_cloth.rod_text(nodes, "hang", 5) for nodes in (100, 1000)}
    out |= {f"cloth10_{kind}": rods_cloth.cloth_text(10, kind) for kind in rods_cloth.CONTACTS}
    out |= {f"cloth{nodes}_hang": rods_cloth.cloth_text(nodes, "hang", 3) for nodes in (20, 30, 50, 70, 100)}
    return out


def main():
    """Write them."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for k, (name, text) in enumerate(texts().items(), 1):
        (folder / f"{k:02}_{name}.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
