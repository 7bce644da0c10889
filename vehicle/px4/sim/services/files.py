"""The files that the software PX4 has: those that say what it is, as MAVLink's component information wants them."""

from __future__ import annotations

import json
import lzma
import zlib
from collections.abc import Iterable, Mapping

GENERAL, PARAMETERS = "etc/extras/component_general.json.xz", "etc/extras/parameters.json.xz"
_PARAMETER_METADATA = 1  # COMP_METADATA_TYPE


def crc(data: bytes) -> int:
    """The CRC-32 that MAVLink FTP and component information use: of value 0 at the start, not inverted at the end."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def metadata(parameters: Iterable[tuple[str, float | int]]) -> Mapping[str, bytes]:
    """Path -> content. `parameters`: names and values, whose kinds and defaults the file tells."""
    listed = [
        {"name": name, "type": "Int32" if isinstance(value, int) else "Float", "default": value}
        for name, value in parameters
    ]
    described = _packed({"version": 1, "parameters": listed})
    types = [{"type": _PARAMETER_METADATA, "uri": f"mftp://{PARAMETERS}", "fileCrc": crc(described)}]
    return {GENERAL: _packed({"version": 1, "metadataTypes": types}), PARAMETERS: described}


def _packed(table: object) -> bytes:
    return lzma.compress(json.dumps(table, separators=(",", ":")).encode(), check=lzma.CHECK_CRC32)
