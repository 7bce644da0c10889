"""The MAVLink 2 signing key from its file."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def read_signing_key(path: str) -> bytes:
    """The content of the key file. Raises ValueError if it cannot be read or other users may read or write it."""
    try:
        with Path(path).open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            key = file.read(1024)
    except OSError as error:
        raise ValueError(f"{path}: the signing key cannot be read: {error.strerror}") from None
    if stat.S_IMODE(mode) & 0o077:
        raise ValueError(
            f"{path}: other users may use the signing key (mode {stat.S_IMODE(mode):04o}): chmod 600 {path}, "
            "and make a new key if others can have read it"
        )
    return key
