"""What the supervisor follows of a live run itself: its stage, and errors that somebody tells."""

from __future__ import annotations

from collections.abc import Callable

from hil.bus.leaf import Bus, Mailbox
from hil.contract.messages import Event, Stage


class Ear:
    """Listens to stages and events; `progress(now_ns, stage)` is told of each stage message."""

    def __init__(self, bus: Bus, progress: Callable[[int, str], None]) -> None:
        self._mailbox, self._progress = Mailbox(urgent=()), progress
        bus.subscribe("supervisor", ("run/stage", "event"), self._mailbox)
        self.stage = "prepare"
        self.errors: list[str] = []

    def listen(self) -> None:
        """Take in what has come since."""
        for letter in self._mailbox.drain():
            if letter.topic == "run/stage":
                stage: Stage = letter.message
                self.stage = stage.name
                self._progress(stage.stamp_ns, stage.name)
            else:
                event: Event = letter.message
                if event.severity == "error":
                    self.errors.append(f"{event.source}: {event.text}")

    def failure(self, troubled: bool) -> str:
        """What went wrong in the words of those to whom it happened; empty where it was no failure of the run.

        `troubled`: the supervisor has brought the run down, and has its own reason.
        """
        if not troubled:
            said = [error for error in self.errors if error.startswith("director: ")]
            if said or self.stage == "ended":
                return "; ".join(said)
        return "; ".join(self.errors[-3:])

    def close(self) -> None:
        self._mailbox.close()
