"""NumPy's files: npz (named arrays) and npy (one array, or one with named fields)."""

import zipfile
from pathlib import Path

import numpy as np

from .arrays import table_of
from .table import Options, Table, mistake


def read(path: Path, options: Options) -> list[Table]:
    """The one record of the file: arrays (T,) or (T, k)."""
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            arrays = {key: loaded[key] for key in loaded.dtype.names} if loaded.dtype.names else {path.stem: loaded}
        else:
            with loaded:
                arrays = {key.replace("/", "."): loaded[key] for key in loaded.files}
    except (ValueError, zipfile.BadZipFile, EOFError, OSError) as error:
        pickled = "pickle" in str(error)
        cause = "it holds Python objects, which are not loaded" if pickled else "the file is damaged, or of another kind"
        fix = "save each array of numbers under its own name with numpy.savez" if pickled else "write it again with numpy.savez"
        raise mistake(str(path), f"cannot be read: {error}", cause, fix) from error
    return [table_of(path.stem, str(path), arrays, options)]
