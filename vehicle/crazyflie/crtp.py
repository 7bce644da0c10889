"""CRTP, the Crazyflie's protocol (version 12): ports, channels, commands, one packet as bytes.

A packet is a header byte (port in the upper four bits, two bits that are set, channel in the lower two) and up to 30
bytes of data, little-endian. Over UDP one datagram is one packet. Source: Bitcraze, "CRTP" of the firmware's
documentation.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

PROTOCOL_VERSION = 12
MOST_DATA = 30  # bytes of data in one packet
UDP_PORT = 19850  # the first of Bitcraze's simulator link

_ALWAYS_SET = 0x0C


class Port(IntEnum):
    """Ports: one per service of the firmware."""

    CONSOLE = 0
    PARAMETERS = 2
    SETPOINT = 3
    MEMORY = 4
    LOG = 5
    LOCALIZATION = 6
    SETPOINT_GENERIC = 7
    HIGH_LEVEL = 8
    SUPERVISOR = 9
    PLATFORM = 13
    LINK = 15


class Link(IntEnum):
    """Channels of Port.LINK."""

    ECHO = 0
    SOURCE = 1
    SINK = 2
    NULL = 3


class Platform(IntEnum):
    """Channels of Port.PLATFORM."""

    COMMAND = 0
    VERSION = 1


class Version(IntEnum):
    """Commands of Platform.VERSION."""

    PROTOCOL = 0
    FIRMWARE = 1
    DEVICE = 2


class Table(IntEnum):
    """Commands on channel 0 of the log's and the parameters' port."""

    ITEM = 2
    INFO = 3


class Log(IntEnum):
    """Channels of Port.LOG."""

    TABLE = 0
    CONTROL = 1
    DATA = 2


class LogControl(IntEnum):
    """Commands of Log.CONTROL."""

    DELETE = 2
    START = 3  # period in 10 ms
    STOP = 4
    RESET = 5
    CREATE = 6
    APPEND = 7
    START_MS = 8  # period in ms


class Parameters(IntEnum):
    """Channels of Port.PARAMETERS."""

    TABLE = 0
    READ = 1
    WRITE = 2
    OTHER = 3


class ParameterCommand(IntEnum):
    """Commands of Parameters.OTHER."""

    SET_BY_NAME = 0
    GET_EXTENDED_TYPE = 7
    GET_DEFAULT = 8


class SupervisorChannel(IntEnum):
    """Channels of Port.SUPERVISOR."""

    INFO = 0
    COMMAND = 1


class SupervisorCommand(IntEnum):
    """Commands of SupervisorChannel.COMMAND; an answer has the high bit set."""

    ARM = 1
    RECOVER = 2
    EMERGENCY_STOP = 3
    EMERGENCY_STOP_WATCHDOG = 4


STATE_BITFIELD = 0x0C  # the one request of SupervisorChannel.INFO that asks for all bits
ANSWER = 0x80


class Info(IntEnum):
    """Bits of the supervisor's state (log variable supervisor.info)."""

    CAN_BE_ARMED = 0
    ARMED = 1
    AUTO_ARMED = 2
    CAN_FLY = 3
    FLYING = 4
    TUMBLED = 5
    LOCKED = 6
    CRASHED = 7
    HIGH_LEVEL_ACTIVE = 8
    TRAJECTORY_FINISHED = 9
    HIGH_LEVEL_DISABLED = 10


class Errno(IntEnum):
    """Error numbers in answers."""

    NO_ENTRY = 2
    TOO_BIG = 7
    NO_COMMAND = 8
    NO_MEMORY = 12
    READ_ONLY = 13
    BUSY = 16
    EXISTS = 17
    INVALID = 22


class Packet(NamedTuple):
    """One CRTP packet."""

    port: int
    channel: int
    data: bytes = b""

    @property
    def null(self) -> bool:
        """Whether it carries nothing: the link's own packet, which every service ignores."""
        return self.port == Port.LINK and self.channel == Link.NULL


def pack(packet: Packet) -> bytes:
    """One datagram. Raises ValueError for a port, a channel or data that a packet cannot hold."""
    if not (0 <= packet.port <= 15 and 0 <= packet.channel <= 3):
        raise ValueError(f"CRTP port {packet.port}, channel {packet.channel}: ports are 0..15, channels 0..3")
    if len(packet.data) > MOST_DATA:
        raise ValueError(f"CRTP packet with {len(packet.data)} bytes of data: {MOST_DATA} at most")
    return bytes((packet.port << 4 | _ALWAYS_SET | packet.channel,)) + packet.data


def unpack(datagram: bytes) -> Packet | None:
    """The packet in a datagram; None if it cannot be one (empty, or too long)."""
    if not 1 <= len(datagram) <= 1 + MOST_DATA:
        return None
    return Packet(datagram[0] >> 4, datagram[0] & 3, bytes(datagram[1:]))
