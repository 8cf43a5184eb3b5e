"""Logs of robots as tables that pliant reads: MCAP, bags of ROS, Parquet, LeRobot data sets, HDF5, npz.

    import pliant.logs

    tables = pliant.logs.read("run.mcap")            # a table per record
    pliant.logs.write(tables, "csv")                 # csv/run.csv; then: pliant init --model arm.urdf --log csv/run.csv

`python -m pliant.logs FILE … --out FOLDER` does the same and prints what it assumed. The libraries that read the formats are those of the
optional extra (`pip install pliant[logs]`), imported when a file needs them; npz needs none.
"""

import os
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from .table import Options, Table, mistake, write

__all__ = ["Table", "read", "write"]

READERS = {
    ".mcap": "mcap_file",
    ".db3": "rosbag",
    ".bag": "rosbag",
    ".parquet": "parquet",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".npz": "npz",
    ".npy": "npz",
}


def read(
    path: str | os.PathLike[str],
    clock: str | None = None,
    rate: float | None = None,
    joints: Sequence[str] | None = None,
    *,
    degrees: bool = False,
    log_time: bool = False,
) -> list[Table]:
    """The records of a log, one table each; time in s from its first row, other numbers in the log's units.

    clock: the topic whose times are the rows, or the column of the time. rate: samples per second [Hz] of arrays without a time. joints:
    names for the elements of arrays without names, as many as they have. degrees: positions and velocities of joints are in degrees.
    log_time: count by the time of recording, not by header stamps. InputError for a log that cannot be used; ImportError without its
    library.
    """
    path = Path(path)
    options = Options(clock, rate, tuple(joints or ()), degrees, log_time)
    if rate is not None and not 0.0 < rate < float("inf"):
        raise mistake("--rate", f"is {rate:g} Hz", "it is the number of samples per second", "give a positive number")
    if not path.exists():
        raise mistake(str(path), "is not there", "the path is wrong", "check the path; relative ones start at the current folder")
    if path.is_dir():
        from . import parquet, rosbag

        if rosbag.is_bag(path):
            return rosbag.read(path, options)
        if parquet.is_lerobot(path):
            return parquet.read_lerobot(path, options)
        what = "is a folder with neither metadata.yaml (ROS 2) nor meta/info.json (LeRobot)"
        raise mistake(str(path), what, "it holds logs, but is none", "name the files in it")
    if path.suffix.lower() in (".csv", ".txt", ".tsv"):
        fix = "give it to `pliant init --log`; docs/from-csv.md says how its columns are matched"
        raise mistake(str(path), "is a table of text, which pliant reads directly", "there is nothing to convert", fix)
    module = READERS.get(path.suffix.lower())
    if module is None:
        cause = f"its name ends in none of {', '.join(READERS)}"
        raise mistake(str(path), "is of an unknown format", cause, "convert it to one of these, or to CSV")
    return import_module(f".{module}", __name__).read(path, options)
