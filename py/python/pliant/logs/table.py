"""A record of a log as a table, the clock of its rows, and its CSV file."""

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .._pliant import InputError
from .names import is_clock, words

TIME = "time_s"
# A list of more numbers than this per sample is an image, a scan or a flattened state, not the readings of a robot.
MOST_ELEMENTS = 100
COUNTS_PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
# Periods [counts] from which a clock that does not say its unit is taken to count this unit: the rule of `pliant init`.
LEAST_PERIODS = ((1e6, "ns"), (1e3, "us"), (1.0, "ms"))


@dataclass
class Table:
    """One record.

    name: name of its file without `.csv`. columns: `time_s`, the time since the first row [s], then the others, all of one length, as
    float64; NaN where a cell is empty. Joints are named `JOINT_pos` [rad or m; the log's unit if it has another], `JOINT_vel`,
    `JOINT_effort` [N·m or N] and `JOINT_cmd`. notes: decisions, one line each.
    """

    name: str
    columns: dict[str, np.ndarray]
    notes: list[str] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.columns[TIME])

    @property
    def period(self) -> float:
        """Median time between rows [s]."""
        return float(np.median(np.diff(self.columns[TIME])))


@dataclass(frozen=True)
class Options:
    """What a caller says about a log: see `pliant.logs.read`."""

    clock: str | None = None
    rate: float | None = None
    joints: tuple[str, ...] = ()
    degrees: bool = False
    log_time: bool = False


def mistake(where: str, what: str, cause: str, fix: str) -> InputError:
    """The error for input that cannot be used."""
    return InputError(f"{where}: {what}\n  likely cause: {cause}\n  fix: {fix}")


def short(names: Sequence[str], most: int = 12) -> str:
    """A list of names for a message."""
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def since_start(times: np.ndarray, unit: str) -> np.ndarray:
    """Times [counts of the unit] as seconds since the first; integers are subtracted before they are rounded to float64."""
    times = times - times[0]
    return times.astype(float) / COUNTS_PER_SECOND[unit]


def check_clock(times: np.ndarray, where: str, fix: str) -> None:
    """Raises where times are too few, missing, or do not increase."""
    if len(times) < 2:
        rows = "1 row" if len(times) == 1 else "no rows"
        raise mistake(where, f"has {rows}", "the recording was stopped at once, or this is no log", "give a longer log")
    gone = np.flatnonzero(~np.isfinite(times.astype(float)))
    if len(gone):
        raise mistake(where, f"has no number at row {gone[0]} (counted from 0)", "a lost sample", "choose another clock, or cut the row")
    back = np.flatnonzero(times[1:] <= times[:-1])
    if len(back):
        k = int(back[0]) + 1
        what = f"{'repeats' if times[k] == times[k - 1] else 'runs backwards'} at row {k} (counted from 0): {times[k - 1]}, then {times[k]}"
        more = f"; {len(back)} rows in all" if len(back) > 1 else ""
        raise mistake(where, what + more, "several runs in one log, samples written twice, or a clock that was set", fix)


def clock_in_seconds(times: np.ndarray, name: str, where: str, unit: str | None = None) -> tuple[np.ndarray, str]:
    """A clock's times as seconds since the first row, and a note of its unit.

    The unit is the one given, that of dates and durations of NumPy, the one that the name ends in, or told from the distance of samples.
    """
    if times.dtype.kind in "mM":
        times, unit = times.astype(times.dtype.str[:3] + "[ns]").astype(np.int64), "ns"
    check_clock(times, f"{where}: clock {name}", "cut the log there, name another clock by --clock, or give --rate HZ")
    last = words(name)[-1:]
    if unit is not None:
        why = "by its type"
    elif last and last[0] in COUNTS_PER_SECOND and len(words(name)) > 1:
        unit, why = last[0], "by its name"
    else:
        period = float(np.median(np.diff(times)))
        unit = next((unit for least, unit in LEAST_PERIODS if period >= least), "s")
        why = f"by the distance of its samples, {period:g}"
    return since_start(times, unit), f"{name} -> {TIME} [{unit}], {why}"


def finish(name: str, where: str, time: np.ndarray, columns: dict[str, np.ndarray], notes: list[str]) -> Table:
    """The table of these columns; other clocks are left out, since a log has one."""
    clocks = [column for column in columns if is_clock(column)]
    kept = {column: values for column, values in columns.items() if column not in clocks}
    if clocks:
        notes.append(f"{short(clocks)}: left out, another clock")
    if not kept:
        text = "only images, texts or clocks were recorded, or the file is of another kind"
        raise mistake(where, "has no numbers beside the time", text, "give a log of joints, forces or poses")
    return Table(name, {TIME: time, **kept}, notes)


def write(tables: Sequence[Table], folder: str | os.PathLike[str], *, force: bool = False) -> list[Path]:
    """Writes each table to `folder/NAME.csv` and returns the paths: all of them, or none if one cannot be written.

    The folder is made if it is missing. Files that are there are replaced only with `force`. Numbers are as short as they can be and
    still be read back as the same float64; NaN is an empty cell.
    """
    folder = Path(folder)
    paths = [folder / f"{table.name}.csv" for table in tables]
    for k, path in enumerate(paths):
        if path in paths[:k]:
            cause = "two logs, or two records of one, have the same name"
            raise mistake(str(path), "would be written twice", cause, "convert them one at a time, each with its own --out folder")
        if path.exists() and not force:
            raise mistake(str(path), "is there already", "the log was converted before", "choose another --out folder, or give --force")
    if folder.exists() and not folder.is_dir():
        raise mistake(str(folder), "is no folder", "--out names a file", "name a folder; each record becomes a file in it")
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = [path.with_name(f".{path.name}.{os.getpid()}") for path in paths]
    try:
        for table, path in zip(tables, unfinished, strict=True):
            _write_one(table, path)
        for path, whole in zip(paths, unfinished, strict=True):
            os.replace(whole, path)
    finally:
        for path in unfinished:
            path.unlink(missing_ok=True)
    return paths


def _write_one(table: Table, path: Path) -> None:
    cells = [["" if math.isnan(x) else repr(x) for x in np.asarray(values, dtype=float).tolist()] for values in table.columns.values()]
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(table.columns)
        rows.writerows(zip(*cells, strict=True))
