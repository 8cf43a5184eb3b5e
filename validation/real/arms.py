"""Scenes and logs of measured arms, as `pliant diagnose` takes them; nothing of the data is kept here.

    python -m validation.real.arms {silverbox,double_pendulum,simple_pendulum} FOLDER
    pliant diagnose FOLDER/scene.toml

`silverbox`: an electronic oscillator, y'' + d y' + k y + k₃ y³ = g u in volts; a sliding mass of 1 kg stands for it, a volt for a
metre. The scene is linear. Commands are linear between samples in pliant, which attenuates a frequency f by sinc²(f/f_s): the
input's spectrum is divided by that.

`double_pendulum`, `simple_pendulum`: the measured torques drive, the angles are observed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from validation.real.deform_dlo import data_folder

SILVERBOX_RATE = 1e7 / 2**14  # Hz
SUBSTEPS = 8
# (first sample, samples, role) of SNLS80mV: multisines (fitted; the last one held out), and the arrow
SILVERBOX = (
    (41_000, 1500, "fit"),
    (52_000, 1500, "fit"),
    (63_000, 1500, "fit"),
    (120_000, 8192, "held_out"),
    (100, 40_000, "held_out"),
)


def entry(table: str, **keys: object) -> str:
    """A [[table]] of TOML."""

    def value(x: object) -> str:
        return (
            f'"{x}"'
            if isinstance(x, str)
            else str(x).lower()
            if isinstance(x, bool)
            else str(x)
        )

    return f"[[{table}]]\n" + "".join(
        f"{key} = {value(x)}\n" for key, x in keys.items()
    )


def head(step: float, more: str = "") -> str:
    """The beginning of a scene."""
    return f'schema_version = 1\n[time]\nstep = {step!r}\nduration = 1.0\nintegrator = "midpoint"\n{more}'


def table(path: Path, columns: dict[str, np.ndarray]) -> None:
    """A CSV file."""
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        "%.9g",
        ",",
        header=",".join(columns),
        comments="",
    )


def silverbox(data: Path, folder: Path, which: tuple = SILVERBOX) -> Path:
    """The oscillator. Its resonance and damping are guesses, to be refitted."""
    v = np.load(data / "silverbox" / "silverbox.npz")["SNLS80mV"].astype(float)
    u, y = (v - v.mean(axis=0)).T
    spectrum = np.fft.rfft(u)
    spectrum /= np.sinc(np.fft.rfftfreq(len(u))) ** 2
    u = np.fft.irfft(spectrum, len(u))
    records = ""
    for k, (first, n, role) in enumerate(which):
        rows = slice(first, first + n)
        table(
            folder / f"run{k}.csv",
            {"t": np.arange(n) / SILVERBOX_RATE, "y": y[rows], "u": u[rows]},
        )
        records += entry("experiment.record", file=f"run{k}.csv", role=role)
    stiffness = (2 * np.pi * 70.0) ** 2
    free = [
        ("spring.stiffness", 0.5 * stiffness, 2 * stiffness),
        ("spring.damping", 1.0, 100.0),
        ("drive.gain", 0.3 * stiffness, 3 * stiffness),
    ]
    path = folder / "scene.toml"
    path.write_text(
        head(1 / SILVERBOX_RATE / SUBSTEPS, "[gravity]\nmagnitude = 0.0\n")
        + entry("body", name="mass", mass=1.0, inertia=[1.0, 1.0, 1.0, 0, 0, 0])
        + entry(
            "body.joint",
            name="spring",
            kind="prismatic",
            axis=[1, 0, 0],
            stiffness=stiffness,
            damping=20.0,
        )
        + entry("actuator", name="drive", joint="spring", kind="torque", gain=stiffness)
        + '[experiment]\ntime = { column = "t" }\n'
        + entry("experiment.joint", joint="spring", column="y", noise_floor=1e-5)
        + entry("experiment.input", actuator="drive", columns=["u"])
        + records
        + freed(free),
        encoding="utf-8",
    )
    return path


def freed(free: list[tuple[str, float, float]]) -> str:
    """[experiment.fit]"""
    return (
        "[experiment.fit]\nfree = ["
        + ", ".join(
            f'{{ path = "{path}", lower = {low}, upper = {high} }}'
            for path, low, high in free
        )
        + "]\n"
    )


def recordings(data: Path, rate: float) -> list[dict[str, np.ndarray]]:
    """The double pendulum's, resampled to `rate` [Hz]: angles by interpolation, torques by their mean over a sample, which keeps their
    impulse. (Their own clock, 500 Hz, jitters by up to 3.6 ms.)"""
    archive = np.load(data / "dfki_double_pendulum" / "sysid_C1_20230629.npz")
    names, out = [str(name) for name in archive["columns15"]], []
    for key in archive.files:
        if not key.startswith("2023") or archive[key].shape[1] != len(names):
            continue
        raw = dict(zip(names, archive[key].astype(float).T, strict=True))
        keep = np.concatenate([[True], np.diff(raw["time"]) > 0])
        clock = raw["time"][keep]
        t = np.arange(0.5 / rate, clock[-1] - 0.5 / rate, 1 / rate)
        columns = {"t": t - t[0]}
        for j in (1, 2):
            columns[f"pos_meas{j}"] = np.interp(t, clock, raw[f"pos_meas{j}"][keep])
            torque = raw[f"tau_meas{j}"][keep]
            impulse = np.concatenate(
                [[0.0], np.cumsum(np.diff(clock) * (torque[1:] + torque[:-1]) / 2)]
            )
            ends = np.interp(t[:, None] + np.array([-0.5, 0.5]) / rate, clock, impulse)
            columns[f"tau_meas{j}"] = rate * (ends[:, 1] - ends[:, 0])
        out.append(columns)
    return out


PENDULUM_RATE = 200.0  # Hz
HELD_OUT = (2, 4)  # of five recordings


def double_pendulum(
    data: Path, folder: Path, seconds: float = 4.0, held_out: tuple[int, ...] = HELD_OUT
) -> Path:
    """Two links of 0.2 and 0.3 m, as in the published set 1.0 but without friction. Mass and spread of each are refitted, which is all a
    plane double pendulum has (the levers are held, so masses stand for m r); no cause is needed for a wrong inertia."""
    records = ""
    for n, columns in enumerate(recordings(data, PENDULUM_RATE)):
        samples = round(seconds * PENDULUM_RATE) + 1
        table(
            folder / f"run{n}.csv",
            {name: column[:samples] for name, column in columns.items()},
        )
        records += entry(
            "experiment.record",
            file=f"run{n}.csv",
            role="held_out" if n in held_out else "fit",
        )
    text = head(1 / PENDULUM_RATE)
    rotor = 36 * 6.29e-5  # kg·m², behind a gear of 6
    for j, (name, m, r, i) in enumerate(
        (("upper", 0.523, 0.2, 0.0319), ("lower", 0.626, 0.2557, 0.0509))
    ):
        about = i - m * r * r
        where = {"parent": "upper", "position": [0, 0, -0.2]} if j else {}
        joint = ("shoulder", "elbow")[j]
        inertia = [about, about, 0.01 * about, 0, 0, 0]
        text += entry(
            "body",
            name=name,
            **where,
            mass=m,
            center_of_mass=[0, 0, -r],
            inertia=inertia,
        )
        text += entry(
            "body.joint", name=joint, kind="revolute", axis=[0, -1, 0], armature=rotor
        )
    text += "".join(
        entry("actuator", name=f"motor_{j}", joint=j, kind="torque")
        for j in ("shoulder", "elbow")
    )
    text += '[experiment]\ntime = { column = "t" }\nlead_in = 0.3\n'
    for j, name in enumerate(("shoulder", "elbow")):
        text += entry(
            "experiment.joint", joint=name, column=f"pos_meas{j + 1}", noise_floor=4e-4
        )
        text += entry(
            "experiment.input", actuator=f"motor_{name}", columns=[f"tau_meas{j + 1}"]
        )
    free = [("upper.mass", 0.2, 3.0), ("lower.mass", 0.05, 5.0)]
    free += [("upper.spread[2]", 1e-3, 0.5), ("lower.spread[2]", 1e-3, 0.5)]
    path = folder / "scene.toml"
    path.write_text(text + records + freed(free), encoding="utf-8")
    return path


def simple_pendulum(data: Path, folder: Path) -> Path:
    """A link of 0.5 m: the inertia and weight of their model, without friction."""
    source = np.genfromtxt(
        data / "dfki_simple_pendulum" / "energy_shaping_measured.csv",
        delimiter=",",
        names=True,
    )
    records, rate = "", 200.0
    t, q, tau = source["time"], source["position"], source["torque"]
    # the swing-up; later it stands on its head, where it is chaotic
    for n, (first, count, role) in enumerate(
        ((40, 280, "fit"), (320, 280, "fit"), (600, 240, "held_out"))
    ):
        rows = slice(first, first + count)
        table(
            folder / f"run{n}.csv",
            {"t": t[rows] - t[first], "q": q[rows], "tau": tau[rows]},
        )
        records += entry("experiment.record", file=f"run{n}.csv", role=role)
    path = folder / "scene.toml"
    path.write_text(
        head(0.5 / rate)
        + entry(
            "body",
            name="link",
            mass=0.573,
            center_of_mass=[0, 0, -0.49],
            inertia=[0.0054, 0.0054, 1e-4, 0, 0, 0],
        )
        + entry("body.joint", name="pivot", kind="revolute", axis=[0, -1, 0])
        + entry("actuator", name="motor", joint="pivot", kind="torque")
        + '[experiment]\ntime = { column = "t" }\n'
        + entry("experiment.joint", joint="pivot", column="q", noise_floor=4e-4)
        + entry("experiment.input", actuator="motor", columns=["tau"])
        + records,
        encoding="utf-8",
    )
    return path


CASES = {
    "silverbox": silverbox,
    "double_pendulum": double_pendulum,
    "simple_pendulum": simple_pendulum,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", choices=CASES)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    data = data_folder()
    if data is None:
        raise SystemExit("the measurements are absent: set PLIANT_DATA to their folder")
    args.folder.mkdir(parents=True, exist_ok=True)
    print(CASES[args.case](data, args.folder))


if __name__ == "__main__":
    main()
