"""Bags of ROS 2 (folders with metadata.yaml, storage mcap or sqlite3; single .db3 files) and of ROS 1 (.bag)."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from ._libraries import library
from .messages import plain
from .streams import table_of
from .table import Options, Table, mistake


def is_bag(folder: Path) -> bool:
    """Whether a folder is a bag of ROS 2."""
    return (folder / "metadata.yaml").is_file()


def read(path: Path, options: Options) -> list[Table]:
    """The one record of the bag."""
    notes: list[str] = []
    name = path.resolve().name if path.is_dir() else path.stem
    return [table_of(name, str(path), _messages(path, notes), options, notes)]


def _messages(path: Path, notes: list[str]) -> Iterator[tuple[str, int, Any]]:
    """Topic, time of recording [ns] and message; notes say which topics are not read."""
    highlevel, typesys = library("rosbags.highlevel"), library("rosbags.typesys")
    # bags before ROS 2 Iron in sqlite3 do not say what their types are: then those of ROS itself are known
    known = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    try:
        reader = highlevel.AnyReader([path], default_typestore=known)
        reader.open()
    except Exception as error:
        cause = "the recording was cut off, a file of it is missing, or it is damaged"
        raise mistake(str(path), f"cannot be read: {error}", cause, "repair it by `ros2 bag reindex`, or copy it again") from error
    with closing(reader):
        undecoded: set[str] = set()
        messages = reader.messages()
        while True:
            try:
                connection, log, data = next(messages)
            except StopIteration:
                return
            except Exception as error:
                cause = "the recording was cut off or is damaged"
                raise mistake(str(path), f"cannot be read: {error}", cause, "repair it, or copy it again") from error
            if connection.topic in undecoded:
                continue
            try:
                message = plain(reader.deserialize(data, connection.msgtype))
            except Exception as error:  # noqa: BLE001 an unknown type, or damaged data
                undecoded.add(connection.topic)
                text = error if str(error) else type(error).__name__
                notes.append(f"{connection.topic}: left out from {log} ns on, {connection.msgtype} cannot be decoded: {text}")
                continue
            yield connection.topic, log, message
