"""HDF5 files: a record per numbered group (robomimic's `data/demo_0`), or one per file (ACT's `observations/qpos`)."""

import re
from pathlib import Path
from typing import Any

from ._libraries import library
from .arrays import table_of
from .table import Options, Table, mistake


def read(path: Path, options: Options) -> list[Table]:
    """The records of the file, in the order of their numbers."""
    h5py = library("h5py")
    try:
        with h5py.File(path, "r") as file:
            groups = _records(h5py, file)
            if not groups:
                return [_table(h5py, path.stem, path, file, options)]
            return [_table(h5py, f"{path.stem}_{group.name.rpartition('/')[2]}", path, group, options) for group in groups]
    except OSError as error:
        cause = "the file is damaged, still being written, or compressed by a filter that h5py does not have"
        raise mistake(str(path), f"cannot be read: {error}", cause, "copy it again, or repack it with `h5repack -f GZIP=4`") from error


def _records(h5py: Any, file: Any) -> list[Any]:
    """The groups with numbered names, all that there are in the root or in one group of it; none if the file is one record."""
    for parent in (file, *(child for child in file.values() if isinstance(child, h5py.Group))):
        groups = [child for child in parent.values() if isinstance(child, h5py.Group)]
        numbers = [re.fullmatch(r"[A-Za-z_\-]*(\d+)", group.name.rpartition("/")[2]) for group in groups]
        if groups and len(groups) == len(parent) and all(numbers):
            return [group for _, group in sorted(zip((int(n[1]) for n in numbers if n), groups, strict=True), key=lambda pair: pair[0])]
    return []


def _table(h5py: Any, name: str, path: Path, group: Any, options: Options) -> Table:
    arrays, notes = {}, []

    def visit(key: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.shape == ():
            return
        if item.ndim <= 2 and item.dtype.kind in "fiub":
            arrays[key.replace("/", ".")] = item[()]
        else:
            notes.append(f"{key}: left out, {'no numbers' if item.ndim <= 2 else f'its shape is {item.shape}'}")

    group.visititems(visit)
    where = str(path) if group.name == "/" else f"{path}: {group.name}"
    table = table_of(name, where, arrays, options)
    table.notes.extend(notes)
    return table
