"""A record given as arrays over time (npz, HDF5, Parquet) as a table."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from .names import Field, counted, final, is_clock, of_array, quantity
from .table import MOST_ELEMENTS, Options, Table, clock_in_seconds, finish, mistake, short

# Columns of data sets that count rows, and say nothing of the robot.
BOOKKEEPING = frozenset(("frame_index", "episode_index", "index", "task_index"))


def table_of(
    name: str,
    where: str,
    arrays: Mapping[str, np.ndarray],
    options: Options,
    given: Mapping[str, Sequence[str]] | None = None,
    unit: str | None = None,
) -> Table:
    """The table of arrays (T,) or (T, k) by their names, whose parts are separated by dots.

    given: names of elements. unit: that of the clock, if it is known.
    """
    numbers, notes = _numbers(arrays)
    clock, time, text = _time(where, numbers, options, unit)
    notes.insert(0, text)
    columns: dict[Field, np.ndarray] = {}
    others = {key: array for key, array in numbers.items() if key != clock}
    for key, array in others.items():
        if len(array) != len(time):
            if quantity(_last(key)) is not None:
                what = f"{key} has {len(array)} rows, but the time {len(time)}"
                raise mistake(where, what, "one of them was recorded longer, or belongs to another run", "cut them to the same samples")
            notes.append(f"{key}: left out, {len(array)} rows where the time has {len(time)}")
            continue
        size = array.shape[1] if array.ndim == 2 else 1
        elements = (given or {}).get(key, ())
        fields = of_array(key, size, options.joints, elements)
        taken = [column.name for column in columns]
        twice = next((f.name for k, f in enumerate(fields) if f.name in taken or f in fields[:k]), None)
        if twice is not None:
            notes.append(f"{key}: {twice} is there already; its elements are counted")
            fields = counted(key, size)
        elif size > 1 and len(elements) != size and not fields[0].joint:
            notes.append(f"{key}: {size} elements without names, counted from 0; --joints or --names give joints' names")
        columns.update(zip(fields, array.reshape(len(array), -1).T.astype(float), strict=True))
    named, more = final(columns, options.degrees)
    return finish(name, where, time, named, notes + more)


def _last(key: str) -> str:
    return key.rpartition(".")[2]


def _numbers(arrays: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """The arrays that can be columns, and notes of the others."""
    out, notes = {}, []
    for key, array in arrays.items():
        why = None
        if _last(key) in BOOKKEEPING:
            continue
        if array.dtype.kind not in ("fiubmM" if is_clock(_last(key)) else "fiub"):
            why = "no numbers"
        elif array.ndim not in (1, 2):
            why = f"its shape is {array.shape}"
        elif array.ndim == 2 and array.shape[1] > MOST_ELEMENTS:
            why = f"{array.shape[1]} numbers per sample"
        if why is None:
            out[key] = array[:, 0] if array.ndim == 2 and array.shape[1] == 1 else array
        else:
            notes.append(f"{key}: left out, {why}")
    return out, notes


def _time(where: str, arrays: Mapping[str, np.ndarray], options: Options, unit: str | None) -> tuple[str | None, np.ndarray, str]:
    """The name of the clock, its times [s], and a note."""
    names = list(arrays)
    if not names:
        cause = "the log has only images or texts, or is of another kind"
        raise mistake(where, "has no numbers over time", cause, "give a log of joints, forces or poses")
    clocks = [key for key in names if arrays[key].ndim == 1 and is_clock(_last(key))]
    if options.clock is not None:
        if options.clock not in arrays or arrays[options.clock].ndim != 1:
            cause = f"there are {short([key for key in names if arrays[key].ndim == 1]) or 'no columns'}"
            raise mistake(where, f"has no column {options.clock} to be the clock", cause, "name one of them by --clock")
        clocks = [options.clock]
    elif options.rate is not None:
        rows = _rows(where, arrays)
        return None, np.arange(rows) / options.rate, f"time_s: {rows} rows at {options.rate:g} Hz, as given"
    if not clocks:
        cause = f"no name is a word for time; there are {short(names)}"
        raise mistake(where, "has no time", cause, "name the clock by --clock NAME, or the samples per second by --rate HZ")
    if len(clocks) > 1:
        raise mistake(where, f"has several clocks: {short(clocks)}", "each part was recorded with its own", "choose one by --clock NAME")
    (clock,) = clocks
    return clock, *clock_in_seconds(arrays[clock], clock, where, unit)


def _rows(where: str, arrays: Mapping[str, np.ndarray]) -> int:
    """The length that most arrays have."""
    counts = Counter(len(array) for array in arrays.values())
    ((rows, most), *_) = counts.most_common(1)
    if 2 * most <= len(arrays):
        what = f"its {len(arrays)} arrays have {len(counts)} different lengths, and no length is that of most"
        raise mistake(where, what, "each array is a record of its own, or they were cut differently", "write a file per record")
    return rows
