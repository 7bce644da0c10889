"""A byte wire over a serial port (telemetry radio, USB, UART), on the kernel's terminal interface (POSIX)."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import termios
from pathlib import Path

from hil.wires import WireError

_AT_ONCE = 65536
_USB_PORTS = Path("/sys/bus/usb-serial/devices")
BACKLOG = 16384  # bytes waiting to be sent before whole items are dropped: 1.5 s at 115200 baud


class SerialWire:
    """One serial port, 8N1, raw, without flow control. A stream: `receive` gives pieces as they came.

    An item that would not fit into the backlog is dropped whole and counted in `dropped`, so that the other end never
    receives half a frame. A port that disappears (unplugged) sets `lost` to the reason; nothing is raised in flight.
    `remark` states why received bytes come late on it; empty if they do not.
    """

    def __init__(self, device: str | Path, baud: int = 921600) -> None:
        """Open and lock `device`. Raises WireError if it is missing, busy, forbidden or cannot do `baud`."""
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            known = sorted(int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdecimal())
            raise WireError(f"{baud} baud is not a rate of serial ports here; use one of {', '.join(map(str, known))}")
        self.dropped = 0
        self.lost = self.remark = ""
        self._out = bytearray()
        self._device = str(device)
        try:
            self._fd = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise WireError(_open_error(self._device, error)) from None
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _make_raw(self._fd, speed)
            self.remark = shorten_latency(self._device)
        except (OSError, termios.error) as error:
            os.close(self._fd)
            self._fd = -1
            raise WireError(_open_error(self._device, error)) from None

    def send(self, data: bytes) -> None:
        """Queue `data` and write what the port takes now."""
        if self._fd < 0:
            raise WireError(f"the wire on {self._device} is closed")
        if self.lost or len(self._out) + len(data) > BACKLOG:
            self.dropped += 1
        else:
            self._out += data
        self._write()

    def receive(self) -> list[bytes]:
        """Received bytes in one piece; empty if there are none."""
        if self._fd < 0 or self.lost:
            return []
        self._write()
        try:
            data = os.read(self._fd, _AT_ONCE)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError as error:
            self.lost = f"{self._device} is gone ({error.strerror})"
            return []
        return [data] if data else []

    def close(self) -> None:
        """Close the port; may be called twice."""
        if self._fd >= 0:
            with contextlib.suppress(OSError):
                os.close(self._fd)
            self._fd = -1

    def _write(self) -> None:
        while self._out and not self.lost:
            try:
                count = os.write(self._fd, self._out)
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                self.lost = f"{self._device} is gone ({error.strerror})"
                return
            del self._out[:count]


def _make_raw(fd: int, speed: int) -> None:
    control = termios.tcgetattr(fd)[6]
    control[termios.VMIN] = control[termios.VTIME] = 0
    flags = termios.CS8 | termios.CREAD | termios.CLOCAL
    termios.tcsetattr(fd, termios.TCSANOW, [termios.IGNBRK, 0, flags, 0, speed, speed, control])
    termios.tcflush(fd, termios.TCIOFLUSH)


def shorten_latency(device: str, ports: Path = _USB_PORTS) -> str:
    """Have an FTDI adapter pass on what it received after 1 ms in place of 16 ms (its latency timer).

    Returns why it keeps its time, with the remedy; empty if it is 1 ms, and for a port without such a timer. `ports`:
    the kernel's folder of USB serial ports.
    """
    timer = ports / Path(device).resolve().name / "latency_timer"
    try:
        before = int(timer.read_text())
    except (OSError, ValueError):
        return ""
    if before <= 1:
        return ""
    try:
        timer.write_text("1\n")
        now = int(timer.read_text())
    except (OSError, ValueError):
        now = before
    if now <= 1:
        return ""
    return f"{device} keeps what it receives for {now} ms (FTDI latency timer): echo 1 | sudo tee {timer}"


def _open_error(device: str, error: OSError | termios.error) -> str:
    number = error.args[0] if error.args else None
    if number == errno.ENOENT:
        there = sorted(str(path) for pattern in ("ttyACM*", "ttyUSB*") for path in Path("/dev").glob(pattern))
        return f"there is no serial port {device}; plugged in now: {', '.join(there) or 'none'}"
    if number in (errno.EACCES, errno.EPERM):
        return f"{device} may not be opened by this user; join the group that owns it (often dialout) and log in again"
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{device} is in use by another program; stop it first"
    if number in (errno.ENOTTY, errno.EINVAL):
        return f"{device} is not a serial port, or it cannot do that baud rate"
    return f"{device} cannot be opened: {error}"
