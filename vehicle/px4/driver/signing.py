"""MAVLink 2 signing for the driver's frames: sent frames are signed, received frames are checked (MAVLink 2 guide)."""

from __future__ import annotations

import hashlib
import struct

from fastcrc.crc16 import mcrf4xx

from vehicle.px4.codec import V2_MARK, Frame
from vehicle.px4.driver.types import Signing

_EPOCH_2015_NS = 1_420_070_400_000_000_000
_TICK_NS = 10_000  # signatures count time in 10 us
_MINUTE = 6_000_000
_SIGNED = 1  # incompatibility flag
_CRC = struct.Struct("<H")


def is_signed(frame: Frame) -> bool:
    """Whether a received frame carries a signature, valid or not."""
    return frame.raw[0] == V2_MARK and bool(frame.raw[2] & _SIGNED)


class Signer:
    """Signs and checks frames of one link. Timestamps only increase, so a recorded frame is not accepted again."""

    def __init__(self, config: Signing) -> None:
        self._config = config
        self._stamp = 0
        self._streams: dict[tuple[int, int, int], int] = {}
        self.refused = 0

    def sign(self, frame: bytes, crc_extra: int, now_ns: int) -> bytes:
        """The signed form of an unsigned MAVLink 2 frame."""
        self._stamp = max(self._stamp + 1, self._date(now_ns))
        body = frame[:2] + bytes((frame[2] | _SIGNED,)) + frame[3:-2]
        body += _CRC.pack(mcrf4xx(body[1:] + bytes((crc_extra,))))
        body += bytes((self._config.link_id,)) + self._stamp.to_bytes(6, "little")
        return body + self._hash(body)

    def accepts(self, frame: Frame, now_ns: int) -> bool:
        """True for a frame with a valid signature; others are counted in `refused`."""
        good = self._good(frame, now_ns) if is_signed(frame) else not self._config.require
        self.refused += not good
        return good

    def _good(self, frame: Frame, now_ns: int) -> bool:
        raw = frame.raw
        if self._hash(raw[:-6]) != raw[-6:]:
            return False
        stream = (raw[-13], frame.system, frame.component)
        stamp = int.from_bytes(raw[-12:-6], "little")
        newest = self._streams.get(stream)
        if stamp <= newest if newest is not None else stamp + _MINUTE < self._date(now_ns):
            return False
        self._streams[stream] = stamp
        self._stamp = max(self._stamp, stamp)
        return True

    def _date(self, now_ns: int) -> int:
        return max(0, self._config.epoch_ns + now_ns - _EPOCH_2015_NS) // _TICK_NS

    def _hash(self, body: bytes) -> bytes:
        return hashlib.sha256(self._config.key + body).digest()[:6]
