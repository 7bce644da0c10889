"""The state of a CAN bus from its error frames, as Linux delivers them (linux/can/error.h)."""

from __future__ import annotations

BUS_OFF, RESTARTED, CONTROLLER = 0x40, 0x100, 0x04  # classes, bits of an error frame's identifier
PASSIVE, ACTIVE = 0x30, 0x40  # bits of data[1] with class CONTROLLER
_NAMES = {
    0x01: "transmit timeout",
    0x02: "lost arbitration",
    CONTROLLER: "controller",
    0x08: "protocol violation",
    0x10: "transceiver",
    0x20: "no acknowledgement",
    BUS_OFF: "bus off",
    0x80: "bus error",
    RESTARTED: "restarted",
}
ONLY_ERRORS = 20  # error frames without a data frame between them that count as trouble


class BusErrors:
    """Counts error frames by class in `counts`; `trouble` is the present trouble of the bus."""

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self._off = self._passive = False
        self._in_a_row = 0
        self._last = ""

    def error_frame(self, identifier: int, data: bytes) -> None:
        """One error frame: its class bits and its data."""
        for bit, name in _NAMES.items():
            if identifier & bit:
                self.counts[name] = self.counts.get(name, 0) + 1
                self._last = name
        self._in_a_row += 1
        if identifier & RESTARTED:
            self._off = self._passive = False
            self._in_a_row = 0
        if identifier & BUS_OFF:
            self._off = True
        if identifier & CONTROLLER and len(data) > 1 and data[1] & (PASSIVE | ACTIVE):
            self._passive = not data[1] & ACTIVE

    def data_frame(self) -> None:
        """A data frame came: the bus is on."""
        self._in_a_row = 0
        self._off = False

    @property
    def trouble(self) -> str:
        """What is wrong with the bus now; empty if nothing is. The text is the same while the trouble lasts."""
        if self._off:
            return "bus off: the controller has left the bus after too many errors (wiring, termination, bit rate?)"
        if self._passive:
            return "error passive: frames are repeated without success (is another node on the bus powered?)"
        if self._in_a_row >= ONLY_ERRORS:
            return f"only error frames come ({self._last}): wiring, termination or bit rate?"
        return ""
