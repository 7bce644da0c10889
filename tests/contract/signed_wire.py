"""An autopilot that demands MAVLink 2 signatures, in front of the software PX4: pymavlink judges what comes in."""

import hashlib

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Parser

mavlink = px4.mavlink
LINK = 7


class SignedWire:
    """The PX4's end of a wire. Only frames that pymavlink accepts get through; what goes out is signed."""

    def __init__(self, wire, key, stamp):
        """`stamp`: the date in units of 10 us since 2015, as signatures carry it."""
        self._wire, self._key, self._stamp = wire, key, stamp
        self._mav = mavlink.MAVLink(None)
        self._mav.robust_parsing = True
        self._mav.signing.secret_key = key
        self._mav.signing.timestamp = stamp
        self._mav.signing.allow_unsigned_callback = lambda mav, msg_id: False
        self._parser = Parser()
        self.accepted, self.refused = [], 0

    def send(self, data):
        self._wire.send(b"".join(self._signed(frame) for frame in self._parser.feed(data)))

    def receive(self):
        good = []
        for data in self._wire.receive():
            for message in self._mav.parse_buffer(data) or []:
                if message.get_type() == "BAD_DATA":
                    self.refused += 1
                else:
                    self.accepted.append(message.get_type())
                    good.append(bytes(message.get_msgbuf()))
        return good

    def close(self):
        self._wire.close()

    def _signed(self, frame):
        self._stamp += 1
        head = bytearray(frame.raw[:-2])
        head[2] |= 1
        crc = mavlink.x25crc(bytes(head[1:]))
        crc.accumulate(bytes([frame.message.crc_extra]))
        body = bytes(head) + crc.crc.to_bytes(2, "little") + bytes([LINK]) + self._stamp.to_bytes(6, "little")
        return body + hashlib.sha256(self._key + body).digest()[:6]
