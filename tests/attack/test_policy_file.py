"""Damaged policy files: each is opened and tried, or refused in one line; none ends the process."""

import contextlib
import os

import numpy as np
import pytest

from policies.flying.contract import ContractError
from policies.flying.external_data import external_files
from policies.flying.onnx_file import open_policy
from policies.flying.trial import try_policy
from tests.unit.policies.flying.made_networks import write

FACTOR = max(1, round(float(os.environ.get("PERCH_HIL_ATTACK", "1"))))


def damaged(data, rng):
    """`data` with one to four bytes changed, a part cut out or repeated, or its end missing; most changes are outside
    the weights, which fill most of the file."""
    found = bytearray(data)
    kind, at = rng.integers(4), int(rng.integers(len(data)))
    if kind == 0:
        outside = [*range(200), *range(len(data) - 1500, len(data))]
        for place in rng.choice(outside, rng.integers(1, 5)):
            found[place] = rng.integers(256)
    elif kind == 1:
        del found[at : at + int(rng.integers(1, 60))]
    elif kind == 2:
        found[at:at] = found[at : at + int(rng.integers(1, 60))]
    else:
        del found[at:]
    return bytes(found)


@pytest.mark.parametrize("seed", range(4))
def test_damaged_policy_file_is_tried_or_refused_in_one_line(tmp_path, seed):
    path, rng, refused = write(tmp_path / "p.onnx"), np.random.default_rng(seed), 0
    whole = path.read_bytes()
    for _ in range(60 * FACTOR):
        path.write_bytes(damaged(whole, rng))
        try:
            try_policy(open_policy(path))
        except ContractError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 20 * FACTOR


@pytest.mark.parametrize("seed", range(4))
def test_any_bytes_are_read_for_external_data_or_raise_value_error(seed):
    rng = np.random.default_rng(seed)
    for _ in range(500 * FACTOR):
        data = rng.integers(256, size=int(rng.integers(200)), dtype=np.uint8).tobytes()
        with contextlib.suppress(ValueError):
            assert all(name.isprintable() or name for name in external_files(b"\x3a" + bytes([len(data) & 127]) + data))
