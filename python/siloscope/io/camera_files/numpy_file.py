"""Calibrations that a script stored by NumPy: ``np.savez("calib.npz", mtx=…, dist=…)``, or a matrix as ``.npy``."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.errors import InputError

MAGICS = (b"PK\x03\x04", b"\x93NUMPY")

LARGEST = 1 << 20
"""Bytes that a calibration's arrays have at most."""

NAMES = {
    "K": (
        "k",
        "mtx",
        "camera_matrix",
        "cameramatrix",
        "intrinsics",
        "intrinsic",
        "intrinsic_matrix",
        "camera_mtx",
        "m",
    ),
    "dist": ("dist", "d", "dist_coeffs", "distcoeffs", "distortion", "distortion_coefficients", "dist_coef"),
}
"""What scripts call the matrix and the coefficients, in lower case."""


def is_numpy(path: Path) -> bool:
    """Whether a file is NumPy's."""
    try:
        with path.open("rb") as file:
            return file.read(6).startswith(MAGICS)
    except OSError:
        return False


def numpy_fields(path: Path) -> dict[str, Any]:
    """The named fields of a calibration in a NumPy file; raises `InputError` where it has none, or is damaged."""
    arrays = {name.lower(): array for name, array in _arrays(path).items()}
    found: dict[str, Any] = {}
    for field, names in NAMES.items():
        array = next((arrays[name] for name in names if name in arrays), None)
        if array is not None:
            found[field] = array.tolist() if field == "K" else array.ravel().tolist()
    found |= {side: int(arrays[side]) for side in ("width", "height") if side in arrays and arrays[side].size == 1}
    if np.shape(found.get("K", 0)) != (3, 3):
        known = ", ".join(arrays) or "nothing"
        raise InputError(f"{path}: has {known}, no camera matrix of 3 x 3; store it as K, and the coefficients as dist")
    return found


def _arrays(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"{path}: is too long for a calibration; give a file with the camera's matrix")
        stored = np.load(path, allow_pickle=False)
        if isinstance(stored, np.ndarray):
            return {"k": stored}
        with stored:
            entries = stored.zip.infolist()
            if sum(entry.file_size for entry in entries) > LARGEST:
                raise InputError(f"{path}: is too long for a calibration; give a file with the camera's matrix")
            return {name: stored[name] for name in stored.files if stored[name].dtype.kind in "fiu"}
    except (ValueError, EOFError, KeyError, OSError, zipfile.BadZipFile, NotImplementedError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: damaged NumPy file ({error}); store the calibration again") from None
