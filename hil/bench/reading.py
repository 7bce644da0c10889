"""Exceptions that state why reading a device gave no value."""

from __future__ import annotations


class Unavailable(Exception):
    """There is no data: the item is UNKNOWN, with this text as its reason."""


class NotApplicable(Exception):
    """The item does not apply to this rig: SKIPPED, with this text as its reason."""
