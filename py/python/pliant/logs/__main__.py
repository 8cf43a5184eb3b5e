"""`python -m pliant.logs FILE_OR_FOLDER … --out FOLDER`: logs of other formats as CSV files."""

import argparse
import sys
from pathlib import Path
from xml.etree import ElementTree

from .._pliant import InputError
from . import read, write
from .table import mistake


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns its exit code: 2 for input that cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m pliant.logs", description="Turn logs of robots into CSV files for `pliant init`.")
    parser.add_argument("logs", nargs="+", metavar="LOG", help="MCAP, ROS bag, Parquet, LeRobot data set, HDF5, npz or npy")
    parser.add_argument("--out", required=True, metavar="FOLDER", help="folder for the CSV files, one per record")
    parser.add_argument("--clock", metavar="NAME", help="topic whose times are the rows, or column of the time")
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples per second of arrays without a time")
    names = parser.add_mutually_exclusive_group()
    names.add_argument("--joints", metavar="A,B,C", help="names for the elements of arrays without names")
    names.add_argument("--names", metavar="FILE", help="the same from a URDF (its moving joints, in its order) or a text file, one a line")
    parser.add_argument("--degrees", action="store_true", help="positions and velocities of joints are in degrees")
    parser.add_argument("--log-time", action="store_true", help="count by the time of recording, not by header stamps")
    parser.add_argument("--force", action="store_true", help="replace CSV files that are there")
    given = parser.parse_args(arguments)
    try:
        joints = joint_names(Path(given.names)) if given.names else [j.strip() for j in (given.joints or "").split(",") if j.strip()]
        tables = []
        for log in given.logs:
            new = read(log, given.clock, given.rate, joints, degrees=given.degrees, log_time=given.log_time)
            for note in dict.fromkeys(note for table in new for note in table.notes):
                print(f"{log}: {note}")
            tables.extend(new)
        paths = write(tables, given.out, force=given.force)
    except (InputError, ImportError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for table, path in zip(tables, paths, strict=True):
        seconds = table.columns["time_s"][-1]
        print(f"wrote {path}: {len(table)} rows, {len(table.columns)} columns, {seconds:.4g} s at {1.0 / table.period:.4g} Hz")
    return 0


def joint_names(path: Path) -> list[str]:
    """The names of joints in a file: those of a URDF that move, or the lines of a text."""
    try:
        text = path.read_text(encoding="utf-8")
        if not text.lstrip().startswith("<"):
            return [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("#")]
        joints = ElementTree.fromstring(text).iterfind("joint")
        return [joint.attrib["name"] for joint in joints if joint.get("type") != "fixed"]
    except (OSError, UnicodeDecodeError, ElementTree.ParseError, KeyError) as error:
        fix = "name a URDF, or a text file with a name per line"
        raise mistake(f"--names {path}", f"cannot be read: {error}", "the path is wrong, or it is no such file", fix) from error


if __name__ == "__main__":
    sys.exit(main())
