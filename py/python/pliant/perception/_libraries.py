"""What the optional extra `perception` installs, imported when it is first used."""

from importlib import import_module
from typing import Any


def library(name: str) -> Any:
    """The module `name` of SciPy or scikit-image; ImportError says what to install."""
    try:
        return import_module(name)
    except ImportError as error:
        package = {"skimage": "scikit-image"}.get(name.partition(".")[0], name.partition(".")[0])
        text = f"pliant.perception needs {package}, which cannot be imported ({error}); install it by `pip install pliant[perception]`"
        raise ImportError(text, name=error.name) from error
