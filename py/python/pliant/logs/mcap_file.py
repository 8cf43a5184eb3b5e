"""MCAP files with messages in JSON, protobuf, or ROS 2's CDR."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ._libraries import library
from .messages import plain
from .streams import table_of
from .table import Options, Table, mistake

IDL_LINE = 80 * "=" + "\n"


def read(path: Path, options: Options) -> list[Table]:
    """The one record of the file."""
    notes: list[str] = []
    return [table_of(path.stem, str(path), _messages(path, notes), options, notes)]


def _messages(path: Path, notes: list[str]) -> Iterator[tuple[str, int, Any]]:
    """Topic, time of recording [ns] and message; notes say which topics are not read."""
    reader = library("mcap.reader")
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    try:
        with path.open("rb") as file:
            opened = reader.make_reader(file)
            summary = opened.get_summary()
            codecs = {chunk.compression for chunk in summary.chunk_indexes} if summary else set()
            if unknown := codecs - {"", "lz4", "zstd"}:
                raise ValueError(f"its chunks are compressed by {unknown.pop()}")
            for schema, channel, message in opened.iter_messages():
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(channel, schema, notes)
                decode = decoders[channel.id]
                if decode is None:
                    continue
                try:
                    decoded = plain(decode(message.data))
                except Exception as error:  # noqa: BLE001 each decoder has its own
                    decoders[channel.id] = None
                    notes.append(f"{channel.topic}: left out from {message.log_time} ns on, a message cannot be decoded: {error}")
                    continue
                yield channel.topic, message.log_time, decoded
    except ImportError:
        raise
    except Exception as error:
        what = f"cannot be read: {type(error).__name__}: {error}"
        cause = "the recording was cut off, is damaged, encrypted, or compressed by another codec than lz4 and zstd"
        raise mistake(str(path), what, cause, "repair it by `mcap recover`, or copy it again") from error


def _decoder(channel: Any, schema: Any, notes: list[str]) -> Callable[[bytes], Any] | None:
    """What decodes the messages of a channel; None with a note if nothing does."""
    if channel.message_encoding == "json":
        return json.loads
    try:
        if channel.message_encoding == "protobuf" and schema is not None:
            return library("mcap_protobuf.decoder").DecoderFactory().decoder_for("protobuf", schema)
        if channel.message_encoding == "cdr" and schema is not None and schema.encoding in ("ros2msg", "ros2idl"):
            return _cdr(schema.name, schema.encoding, schema.data.decode())
    except ImportError:
        raise
    except Exception as error:  # noqa: BLE001 a schema that its library does not take
        notes.append(f"{channel.topic}: left out, its schema cannot be read: {error}")
        return None
    encoding = f"{channel.message_encoding}, schema {schema.encoding if schema else 'none'}"
    notes.append(f"{channel.topic}: left out, its encoding ({encoding}) is none of json, protobuf and cdr (ROS 2)")
    return None


def _cdr(name: str, encoding: str, text: str) -> Callable[[bytes], Any]:
    """The decoder of a ROS 2 type, whose definition is in the file."""
    typesys = library("rosbags.typesys")
    if encoding == "ros2msg":
        types = typesys.get_types_from_msg(text, name)
    else:
        parts = [part.partition("\n")[2] if part.startswith("IDL: ") else part for part in text.split(IDL_LINE)]
        types = {}
        for part in parts:
            types.update(typesys.get_types_from_idl(part) if part.strip() else {})
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(types)
    return lambda data: store.deserialize_cdr(data, name)
