"""What reading a device comes to when it gives no value."""

from __future__ import annotations


class Unavailable(Exception):
    """There is no data: the item is UNKNOWN, with this text as its reason."""


class NotApplicable(Exception):
    """The item says nothing about this rig: SKIPPED, with this text as its reason."""
