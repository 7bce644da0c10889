"""Forged data with fixed seeds: messages that decode and mean nothing, damaged bytes, tables of JSON."""

import dataclasses
import os
import random
import typing

FACTOR = int(os.environ.get("PERCH_HIL_ATTACK", "1"))  # of the number of cases

INTS = (0, 1, -1, 7, 10**9, 2**31, 2**32, 2**53, 2**62, 2**63 - 1, -(2**63))
FLOATS = (0.0, -0.0, 1.0, -1.0, 9.81, 1e-300, 1e300, -1e300, float("nan"), float("inf"), float("-inf"), 2.0**63)
TEXTS = ("", "x", "director", "gate", "\x1b[31m", "=1+1", "\0", "../../..", "ä€😀", "x" * 10_000)


def rng(name):
    """Random numbers of one test."""
    return random.Random(f"perch-hil attack {name}")


def message(kind, random_):
    """A message of dataclass `kind` with arbitrary values of the right types."""
    hints = typing.get_type_hints(kind)
    return kind(*(_value(hints[field.name], random_) for field in dataclasses.fields(kind)))


def _value(hint, random_):
    if typing.get_origin(hint) is tuple:
        kinds = typing.get_args(hint)
        if Ellipsis in kinds:
            kinds = (kinds[0],) * random_.choice((0, 1, 7, 8, 80))
        return tuple(_value(kind, random_) for kind in kinds)
    if hint is bool:
        return random_.random() < 0.5
    if hint is int:
        return random_.choice((*INTS, random_.getrandbits(63)))
    if hint is float:
        return random_.choice((*FLOATS, random_.uniform(-10, 10)))
    if hint is bytes:
        return random_.randbytes(random_.choice((0, 1, 100, 5000)))
    return random_.choice(TEXTS)


def damaged(data, random_):
    """`data` with bits flipped, cut off, doubled, or replaced."""
    data = bytearray(data)
    for _ in range(random_.choice((1, 1, 2, 8))):
        if not data:
            return random_.randbytes(20)
        at = random_.randrange(len(data))
        what = random_.randrange(5)
        if what == 0:
            data[at] ^= 1 << random_.randrange(8)
        elif what == 1:
            del data[at:]
        elif what == 2:
            data[at:at] = random_.randbytes(random_.choice((1, 4, 60)))
        elif what == 3:
            data[at : at + 4] = random_.choice((b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff"))
        else:
            data += data[at:]
    return bytes(data[: 1 << 20])


def json_value(random_, depth=0):
    """Any value that JSON can carry."""
    kind = random_.randrange(8 if depth < 3 else 6)
    if kind == 0:
        return random_.choice((None, True, False))
    if kind == 1:
        return random_.choice((*INTS, 2**80, -(2**80)))
    if kind == 2:
        return random_.choice(FLOATS)
    if kind < 6:
        return random_.choice((*TEXTS, "go", "brain", "ready", "a.zenoh"))
    count = random_.randrange(4)
    if kind == 6:
        return [json_value(random_, depth + 1) for _ in range(count)]
    return {random_.choice(TEXTS[:6]): json_value(random_, depth + 1) for _ in range(count)}
