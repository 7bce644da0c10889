"""CAN frames over a UDP wire: the car's bus between two processes of a simulated run.

A datagram is one frame: identifier (2 bytes, big-endian), then its data. No bus arbitration, no acknowledgement.
"""

from __future__ import annotations

from hil.contract.wire import CanFrame
from hil.wires.udp import UdpWire


class CanOverUdp:
    """A CAN wire on any UDP wire. `rejected` counts datagrams that are not a standard data frame."""

    def __init__(self, wire: UdpWire) -> None:
        self._wire = wire
        self.rejected = 0

    def send(self, frame: CanFrame) -> bool:
        """One frame; False if the network refused it. Raises ValueError for what CAN 2.0 does not have."""
        can_id, data = int(frame.can_id), bytes(frame.data)
        if not 0 <= can_id <= 0x7FF or len(data) > 8:
            raise ValueError(f"CAN frame {can_id:#x} with {len(data)} bytes: 11-bit ids and up to 8 bytes only")
        return self._wire.send(can_id.to_bytes(2, "big") + data)

    def receive(self) -> list[CanFrame]:
        """Frames that have come, oldest first."""
        frames: list[CanFrame] = []
        for item in self._wire.receive():
            can_id = int.from_bytes(item[:2], "big")
            if 2 <= len(item) <= 10 and can_id <= 0x7FF:
                frames.append(CanFrame(can_id, item[2:]))
            else:
                self.rejected += 1
        return frames

    def close(self) -> None:
        """Close the port; may be called twice."""
        self._wire.close()
