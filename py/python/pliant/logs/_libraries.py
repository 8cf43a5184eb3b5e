"""What the optional extra `logs` installs, imported when it is first used."""

from importlib import import_module
from typing import Any

PACKAGES = {
    "google": "protobuf",
    "mcap_protobuf": "mcap-protobuf-support",
}


def library(name: str) -> Any:
    """The module `name` of a library that reads logs; ImportError says what to install."""
    try:
        return import_module(name)
    except ImportError as error:
        root = name.partition(".")[0]
        package = PACKAGES.get(root, root)
        text = f"pliant.logs needs {package}, which cannot be imported ({error}); install it by `pip install pliant[logs]`"
        raise ImportError(text, name=error.name) from error
