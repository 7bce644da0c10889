"""The run's stage and its error events, as the supervisor follows them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from hil.bus.leaf import Bus, Mailbox
from hil.contract.messages import Event, Stage
from hil.host.failure import why_no_attempt
from hil.live.messages.authors import attributed

_MOST = 100  # errors that are kept, the newest


class RunEvents:
    """Receives stages and events; `progress(now_ns, stage)` is called with each stage message."""

    def __init__(self, bus: Bus, progress: Callable[[int, str], None]) -> None:
        self._mailbox, self._progress = Mailbox(urgent=()), progress
        bus.subscribe("supervisor", ("run/stage", "event"), self._mailbox)
        self.stage = "prepare"
        self.errors: deque[str] = deque(maxlen=_MOST)
        self._causes: deque[tuple[str, str]] = deque(maxlen=_MOST)  # source and text of those that explain a failure

    def take(self) -> None:
        """Take what has arrived since the last call."""
        for delivery in self._mailbox.drain():
            if delivery.topic == "run/stage":
                stage: Stage = delivery.message
                self.stage = stage.name
                self._progress(stage.stamp_ns, stage.name)
            else:
                self.note(attributed(delivery).message)

    def note(self, event: Event) -> None:
        """Keep an error."""
        if event.severity == "error":
            self.errors.append(f"{event.source}: {event.text}")
            if event.source in ("director", "vehicle_link"):
                self._causes.append((event.source, event.text))

    def failure(self, troubled: bool) -> str:
        """Texts of the errors that made the run fail; empty if the run did not fail.

        `troubled`: the supervisor has ended the run, for a reason of its own.
        """
        if not troubled:
            why = why_no_attempt(list(self._causes))
            if why or self.stage == "ended":
                return why
        return "; ".join(list(self.errors)[-3:])

    def close(self) -> None:
        self._mailbox.close()
