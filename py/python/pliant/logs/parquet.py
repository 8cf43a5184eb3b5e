"""Parquet files, and LeRobot's data sets of them: a record per episode."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ._libraries import library
from .arrays import table_of
from .table import MOST_ELEMENTS, Options, Table, mistake, short

EPISODE = "episode_index"


def read(path: Path, options: Options) -> list[Table]:
    """The records of one file: one, or one per value of a column `episode_index`."""
    arrays, notes = _arrays(path)
    return _episodes(path.stem, str(path), arrays, options, {}, notes)


def is_lerobot(folder: Path) -> bool:
    """Whether a folder is a data set of LeRobot, by its `meta/info.json`."""
    return (folder / "meta" / "info.json").is_file()


def read_lerobot(folder: Path, options: Options) -> list[Table]:
    """The episodes of a data set (version 2 or 3), their columns named by `features` of `meta/info.json`."""
    info_path = folder / "meta" / "info.json"
    try:
        features = json.loads(info_path.read_text(encoding="utf-8"))["features"]
        given = {key: names for key, feature in features.items() if (names := _names(feature))}
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        what = f"does not describe the data set ({type(error).__name__}: {error})"
        fix = "copy the data set's `meta` again, or convert its Parquet files one by one"
        raise mistake(str(info_path), what, "the file is damaged, or of another version", fix) from error
    files = sorted(folder.glob("data/**/*.parquet"))
    if not files:
        cause = "only part of the data set was downloaded"
        raise mistake(str(folder), "has no data/chunk-…/*.parquet", cause, "download its folder `data` too")
    parts, notes = [], []
    for path in files:
        arrays, new = _arrays(path)
        if parts and arrays.keys() != parts[0].keys():
            differ = sorted(arrays.keys() ^ parts[0].keys())
            fix = "convert the files one by one"
            raise mistake(str(path), f"has other columns than {files[0].name}: {short(differ)}", "two data sets were mixed", fix)
        parts.append(arrays)
        notes.extend(note for note in new if note not in notes)
    whole = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return _episodes(folder.resolve().name, str(folder), whole, options, given, notes, "s")


def _names(feature: dict[str, Any]) -> list[str]:
    """Names of a feature's elements: a list, or a list under some key (`motors`, `axes`); none if they do not name all elements."""
    names = feature.get("names")
    if isinstance(names, dict):
        lists = [value for value in names.values() if isinstance(value, list)]
        names = lists[0] if len(lists) == 1 else list(names)
    size = int(np.prod(feature.get("shape", [0])))
    return [str(name) for name in names] if names and len(names) == size > 1 else []


def _episodes(name: str, where: str, arrays: dict, options: Options, given: dict, notes: list[str], unit: str | None = None) -> list[Table]:
    if EPISODE not in arrays:
        tables = [table_of(name, where, arrays, options, given, unit)]
    else:
        tables = []
        for episode in np.unique(arrays[EPISODE]):
            rows = arrays[EPISODE] == episode
            part = {key: array[rows] for key, array in arrays.items()}
            tables.append(table_of(f"{name}_episode_{int(episode):06d}", f"{where}: episode {episode}", part, options, given, unit))
    for table in tables:
        table.notes.extend(notes)
    return tables


def _arrays(path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of a file that hold numbers, structs as `field.sub`, and notes of the others."""
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    try:
        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
            wanted = [field.name for field in schema if _has_numbers(pyarrow, field.type)]
            table = file.read(columns=wanted)
    except (pyarrow.ArrowException, OSError) as error:
        cause = "the file is damaged, encrypted, or compressed by a codec that pyarrow does not have"
        raise mistake(str(path), f"cannot be read: {error}", cause, "copy it again, or write it again with pyarrow") from error
    other = [field.name for field in schema if field.name not in wanted]
    notes = [f"{short(other)}: left out, no numbers"] if other else []
    while any(pyarrow.types.is_struct(field.type) for field in table.schema):
        table = table.flatten()
    arrays = {}
    for key, column in zip(table.column_names, table.columns, strict=True):
        if not _has_numbers(pyarrow, column.type):
            notes.append(f"{key}: left out, no numbers")
        elif (array := _array(pyarrow, path, key, column)) is None:
            notes.append(f"{key}: left out, more than {MOST_ELEMENTS} numbers per sample")
        else:
            arrays[key] = array
    return arrays, notes


def _has_numbers(pyarrow: Any, kind: Any) -> bool:
    types = pyarrow.types
    if types.is_struct(kind):
        return any(_has_numbers(pyarrow, field.type) for field in kind)
    if _is_list(types, kind):
        kind = kind.value_type
        return types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind)
    tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal, types.is_timestamp, types.is_duration)
    return any(test(kind) for test in tests)


def _is_list(types: Any, kind: Any) -> bool:
    return types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)


def _array(pyarrow: Any, path: Path, key: str, column: Any) -> np.ndarray | None:
    """A column as an array (T,) or (T, k), NaN where it has none; None if its lists are too long."""
    types, compute = pyarrow.types, library("pyarrow.compute")
    if types.is_timestamp(column.type) or types.is_duration(column.type):
        return column.cast(pyarrow.timestamp("ns") if types.is_timestamp(column.type) else pyarrow.duration("ns")).to_numpy()
    if not _is_list(types, column.type):
        if column.null_count or types.is_decimal(column.type) or types.is_boolean(column.type):
            column = column.cast(pyarrow.float64())
        return column.to_numpy()
    sizes = compute.list_value_length(column).to_numpy()
    first = sizes[0] if len(sizes) else 0
    differs = np.flatnonzero(sizes != first)
    if len(differs):
        k = int(differs[0])
        found = "none" if np.isnan(sizes[k]) else f"{int(sizes[k])}"
        what = f"column {key}: its lists differ in length: {first:g} numbers in row 0, {found} in row {k}"
        raise mistake(str(path), what, "samples were lost, or it is no reading of a fixed set of joints", "drop the column, or fill it up")
    if first > MOST_ELEMENTS:
        return None
    flat = compute.list_flatten(column).cast(pyarrow.float64()).to_numpy()
    return flat.reshape(len(sizes), int(first))
