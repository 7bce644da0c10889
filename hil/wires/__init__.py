"""Wires that leave the process: UDP, serial, CAN. They obey the protocols of `hil/contract/wire.py` and never block."""


class WireError(RuntimeError):
    """A wire could not be opened; the text says which, why, and the remedy."""
