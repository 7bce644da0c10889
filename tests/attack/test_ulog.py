"""Damaged logs of PX4: what is read is finite in time and numbers, or the file is refused in one line."""

import contextlib
import os

import numpy as np
import pytest

from hil.report.recorded.ulog import ULogError, read_ulog
from tests.paths import FIRMWARE_RUN

FACTOR = max(1, round(float(os.environ.get("PERCH_HIL_ATTACK", "1"))))
BEFORE_DATA = 40_000  # definitions and parameters stand in front


def damaged(data, rng):
    """Bytes changed, cut out, repeated or zeroed, or the end missing; half of it before the samples."""
    found = bytearray(data)
    at = int(rng.integers(16, BEFORE_DATA if rng.integers(2) else len(data)))
    size, kind = int(rng.integers(1, 400)), int(rng.integers(5))
    if kind == 0:
        found[at : at + 8] = rng.integers(256, size=8, dtype=np.uint8).tobytes()
    elif kind == 1:
        del found[at : at + size]
    elif kind == 2:
        found[at:at] = found[at : at + size]
    elif kind == 3:
        found[at : at + size] = bytes(size)
    else:
        del found[at:]
    return bytes(found)


@pytest.mark.parametrize("seed", range(3))
def test_damaged_log_is_read_in_part_or_refused(tmp_path, seed, capsys):
    rng, path, read = np.random.default_rng(seed), tmp_path / "d.ulg", 0
    whole = (FIRMWARE_RUN / "firmware.ulg").read_bytes()
    for _ in range(8 * FACTOR):
        path.write_bytes(damaged(whole, rng))
        with contextlib.suppress(ULogError):
            log = read_ulog(path)
            read += 1
            assert all(np.diff(topic.us).min(initial=1) > 0 for topic in log.topics.values())
    assert read > 4 * FACTOR
    assert capsys.readouterr().out == ""
