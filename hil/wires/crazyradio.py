"""CRTP through cflib's link drivers: a Crazyradio, or UDP to a Crazyflie that is simulated elsewhere.

A thread hands packets to cflib, whose `send_packet` may wait for seconds while the radio has no answer: `send` never
waits, and says False where too many packets still wait.
"""

from __future__ import annotations

import queue
import re
import threading
from contextlib import suppress
from typing import Any

from hil.wires import WireError

_EXAMPLE = "write radio://0/80/2M/E7E7E7E7E7 (dongle, channel, rate, address) or udp://HOST:19850"
_RADIO = re.compile(r"radio://[0-9A-Za-z]+/(\d{1,3})/(250K|1M|2M)/[0-9A-Fa-f]{2,10}")
_UDP = re.compile(r"udp://[^/:\s]+:(\d{1,5})")
_LAST_CHANNEL = 125
_WAITING = 16  # packets


def check_radio(url: str) -> None:
    """Raises WireError: what is wrong with the address of a Crazyflie."""
    radio, udp = _RADIO.fullmatch(url), _UDP.fullmatch(url)
    if radio is None and udp is None:
        raise WireError(f'"{url}" is not the address of a Crazyflie; {_EXAMPLE}')
    if radio is not None and int(radio[1]) > _LAST_CHANNEL:
        raise WireError(f'"{url}": a Crazyradio has channels 0 to {_LAST_CHANNEL}; {_EXAMPLE}')
    if udp is not None and not 0 < int(udp[1]) < 65536:
        raise WireError(f'"{url}": UDP has ports 1 to 65535; {_EXAMPLE}')


class CrazyradioWire:
    """A byte wire of CRTP packets. `lost` says why it works no more; packets that were not sent are counted."""

    def __init__(self, url: str) -> None:
        """Raises WireError for an address that is none, a missing package, or a radio that is not there."""
        check_radio(url)
        try:
            from cflib.crtp.crtpstack import CRTPPacket
            from cflib.crtp.radiodriver import RadioDriver
            from cflib.crtp.udpdriver import UdpDriver
        except ImportError:
            raise WireError("a Crazyflie needs the package cflib: install perch-hil[crazyflie]") from None
        self._packet: Any = CRTPPacket
        self.url, self.lost, self.send_errors = url, "", 0
        self._driver: Any = RadioDriver() if url.startswith("radio:") else UdpDriver()
        self._closed = False
        try:
            self._driver.connect(url, None, self._failed)
        except Exception as error:  # cflib raises what its USB library does, and Exception itself
            raise WireError(f"{url} cannot be opened: {error}; is the Crazyradio plugged in and readable?") from None
        self._out: queue.Queue[bytes | None] = queue.Queue(_WAITING)
        self._thread = threading.Thread(target=self._carry, name="crazyradio", daemon=True)
        self._thread.start()

    def _failed(self, text: str) -> None:
        self.lost = self.lost or f"{self.url}: {text.strip().splitlines()[0]}"

    def _carry(self) -> None:
        while (data := self._out.get()) is not None:
            self._driver.send_packet(self._packet(header=data[0], data=data[1:]))

    def send(self, data: bytes) -> bool:
        """One packet; False, counted in `send_errors`, if earlier ones still wait."""
        if self._closed:
            raise WireError("this wire to a Crazyflie is closed")
        try:
            self._out.put_nowait(data)
        except queue.Full:
            self.send_errors += 1
            return False
        return True

    def receive(self) -> list[bytes]:
        """Packets that have come, oldest first."""
        items: list[bytes] = []
        while not self._closed and (packet := self._driver.receive_packet(0)) is not None:
            items.append(bytes((packet.header,)) + bytes(packet.data))
        return items

    def close(self) -> None:
        """Close the link; may be called twice."""
        if self._closed:
            return
        self._closed = True
        with suppress(queue.Empty):
            while True:
                self._out.get_nowait()
        self._out.put(None)
        self._thread.join(timeout=5.0)
        self._driver.close()
