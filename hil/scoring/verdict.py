"""The one word for how a run ended, the same in lists, reports, campaigns and on the command line."""

from __future__ import annotations

PERCHED = "perched"
ATTACHED = "attached, outside tolerance"
MISSED = "missed"
INCOMPLETE = "incomplete"

NOT_HELD = "the magnet did not hold"  # event of the vehicle's driver after a contact at which it should have held

FINISHED = "finished"  # the state of a manifest whose attempt says something about the policy


def verdict_word(*, attached: bool, within_tolerance: bool, outcome: str, state: str = FINISHED) -> str:
    """`perched`: attached and within tolerance. `missed`: not attached, also where the contact was within tolerance
    (the paper's rule bounds neither the impact speed nor the magnet's reach). `incomplete`: nothing was decided, or
    the run did not end by itself (`state` of its manifest)."""
    if outcome == INCOMPLETE or state != FINISHED:
        return INCOMPLETE
    if attached:
        return PERCHED if within_tolerance else ATTACHED
    return MISSED
