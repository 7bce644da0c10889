"""Why a run had no attempt, on one line."""

from __future__ import annotations

from collections.abc import Sequence


def why_no_attempt(errors: Sequence[tuple[str, str]]) -> str:
    """`errors`: source and text of the run's error events, oldest first.

    What the director gave up with, and the last error of the vehicle's driver before it, which is its cause; empty if
    the director did not give up.
    """
    gave_up = [i for i, (source, _) in enumerate(errors) if source == "director"]
    if not gave_up:
        return ""
    causes = [text for source, text in errors[: gave_up[0]] if source == "vehicle_link"]
    return ": ".join([errors[gave_up[0]][1], *causes[-1:]])
