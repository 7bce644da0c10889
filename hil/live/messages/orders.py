"""The supervisor's orders, as every service takes them: from one supervisor, and well formed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_MOST_NS = 1 << 62


class Orders:
    """Orders in the order of their arrival. From the first "go" on only those of the supervisor that gave it count."""

    def __init__(self, service: str, session: str) -> None:
        """`service` and `session` of the process that obeys."""
        self._service, self._session = service, session
        self._waiting: list[dict[str, Any]] = []
        self._leader: str | None = None
        self.refused = ""  # why the newest order that does not count was refused

    def put(self, table: Mapping[str, Any]) -> bool:
        """Keep an order (called by the bus's threads). False: it is none, or of another supervisor.

        The fields of what is kept: `order`, and of a "go" `epoch_ns`, of an "abort" `why`.
        """
        order, sender = table.get("order"), str(table.get("session"))
        if self._leader is not None and sender != self._leader:
            self.refused = f'"{order}" of a second supervisor was not obeyed: end one of the two runs on this bus'
            return False
        if order not in ("watch", "go", "abort", "stop"):
            return False
        if order == "go":
            epoch_ns = table.get("epoch_ns")
            if not isinstance(epoch_ns, int) or abs(epoch_ns) > _MOST_NS:
                return False
            self._leader = sender
        if order != "watch" and table.get("service") in (None, self._service):
            self._waiting.append(dict(table))
        return True

    def take(self) -> list[dict[str, Any]]:
        """What has arrived since the last call."""
        taken = self._waiting[:]
        del self._waiting[: len(taken)]
        return taken

    def displaced(self, go: Mapping[str, Any]) -> str:
        """Why this process may not serve after the order `go`; empty if it may.

        The order names the session of each service that the supervisor runs with: of two processes of one service one.
        """
        sessions = go.get("sessions")
        named = sessions.get(self._service, self._session) if isinstance(sessions, dict) else self._session
        if named == self._session:
            return ""
        return f"another process serves this run as {self._service}: end one of them"
