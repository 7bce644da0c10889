"""Messages of a chunk as arrays."""

import random
import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.recording.blocks import joined, split

MESSAGES = st.lists(st.tuples(st.integers(0, 65535), st.integers(0, 2**63 - 1), st.binary(max_size=20)), max_size=20)


def chunk(messages):
    return b"".join(
        struct.pack("<BQHIQQ", 5, 22 + len(data), channel, i, t, t) + data
        for i, (channel, t, data) in enumerate(messages)
    )


def content(block):
    parts = zip(block.channel.tolist(), block.log_ns.tolist(), block.start.tolist(), block.end.tolist(), strict=True)
    return [(channel, t, block.data[start:end].tobytes()) for channel, t, start, end in parts]


@given(MESSAGES)
def test_split_finds_every_message(messages):
    block, whole = split(chunk(messages))
    assert whole and content(block) == messages and block.sequence.tolist() == list(range(len(messages)))
    assert content(block.compact()) == messages
    data, offsets = block.packed()
    assert data.tobytes() == b"".join(m[2] for m in messages) and len(offsets) == len(messages) + 1


@given(MESSAGES, st.data())
def test_a_chunk_cut_within_a_message_gives_those_before_it(messages, data):
    whole = chunk(messages)
    cut = data.draw(st.integers(0, len(whole)))
    block, _ = split(whole[:cut])
    assert content(block) == messages[: len(block.log_ns)]


@given(MESSAGES, MESSAGES)
def test_joined_blocks_are_in_the_order_of_publication(first, second):
    block = joined([split(chunk(first))[0], split(chunk(second))[0]])
    assert content(block) == sorted([*first, *second], key=lambda message: message[1])


def test_arbitrary_bytes_are_no_crash():
    rng = random.Random(1)
    for _ in range(2000):
        data = bytearray(rng.randbytes(rng.randrange(60)))
        if rng.random() < 0.7 and len(data) > 9:
            data[:9] = struct.pack("<BQ", 5, rng.choice([0, 5, 22, 30, 2**63, 2**64 - 1]))
        block, _ = split(bytes(data))
        assert all(0 <= a <= b <= len(data) for a, b in zip(block.start, block.end, strict=True))
        assert np.array_equal(block.compact().end, np.cumsum(block.end - block.start))
