"""The mission protocol: upload, download and clearing of mission, geofence and rally points, the current item."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.codec import Frame
from vehicle.px4.protocol import MissionResult
from vehicle.px4.sim.services.partner import Handler, Link
from vehicle.px4.sim.services.plan import ALL, MISSION, MOST, Item, Plan, complaint

RETRY_NS, TIMEOUT_NS = 250_000_000, 5_000_000_000  # PX4's
REPEATS, REPEAT_NS = 10, 1_000_000_000  # of MISSION_ITEM_REACHED, besides the first


class _Partner(NamedTuple):
    link: Link
    system: int
    component: int


class Missions:
    """One transfer at a time, whichever link it is on. `now_ns`: PX4's time; `text` sends a STATUSTEXT."""

    def __init__(
        self, plan: Plan, now_ns: Callable[[], int], text: Callable[[int, str], None], links: Iterable[Link]
    ) -> None:
        self._plan, self._now_ns, self._text, self._links = plan, now_ns, text, links
        self._state = ""  # "", receiving, sending
        self._partner: _Partner | None = None
        self._kind, self._count = MISSION, 0
        self._items: list[Item] = []
        self._heard_ns = self._asked_ns = 0
        self._told, self._repeated, self._told_ns = -1, 0, 0

    @property
    def handlers(self) -> dict[str, Handler]:
        """By message name."""
        return {
            "MISSION_COUNT": self._on_count,
            "MISSION_ITEM_INT": self._on_item_int,
            "MISSION_ITEM": self._on_item,
            "MISSION_REQUEST_LIST": self._on_list,
            "MISSION_REQUEST_INT": self._on_request_int,
            "MISSION_REQUEST": self._on_request,
            "MISSION_CLEAR_ALL": self._on_clear,
            "MISSION_SET_CURRENT": self._on_current,
            "MISSION_ACK": self._on_ack,
        }

    def update(self) -> None:
        """Ask again for an item that does not come, give a transfer up, tell which item was reached."""
        now = self._now_ns()
        if self._state == "receiving" and now - self._asked_ns > RETRY_NS and now - self._heard_ns <= TIMEOUT_NS:
            self._ask()
        elif self._state and now - self._heard_ns > TIMEOUT_NS:
            self._text(2, "Operation timeout\t")
            self._state = ""
        plan = self._plan
        if plan.reached != self._told:
            self._told, self._repeated, self._told_ns = plan.reached, 0, now
            self._tell()
        elif plan.reached >= 0 and self._repeated < REPEATS and now - self._told_ns >= REPEAT_NS:
            self._repeated, self._told_ns = self._repeated + 1, now
            self._tell()

    def _tell(self) -> None:
        if self._told >= 0:
            for link in self._links:
                link.send(M["MISSION_ITEM_REACHED"], self._told)

    # upload

    def _on_count(self, link: Link, frame: Frame, m: Any) -> None:
        partner = _Partner(link, frame.system, frame.component)
        again = self._state == "receiving" and partner == self._partner and not self._items
        if self._state and not again:
            self._text(2, "WPM: IGN MISSION_COUNT: Busy\t")
            self._answer(MissionResult.ERROR, m.mission_type, partner)
            return
        self._partner, self._kind, self._count = partner, m.mission_type, m.count
        self._heard_ns = self._now_ns()
        if m.mission_type not in MOST:
            self._answer(MissionResult.INVALID)
        elif m.count > MOST[m.mission_type]:
            self._answer(MissionResult.NO_SPACE)
        elif m.count == 0:
            self._plan.store(m.mission_type, ())
            self._answer(MissionResult.ACCEPTED)
        else:
            self._state, self._items = "receiving", []
            self._ask()

    def _on_item_int(self, link: Link, frame: Frame, m: Any) -> None:
        self._take(link, frame, m, 1.0)

    def _on_item(self, link: Link, frame: Frame, m: Any) -> None:
        self._take(link, frame, m, 1e7)

    def _take(self, link: Link, frame: Frame, m: Any, scale: float) -> None:
        partner = _Partner(link, frame.system, frame.component)
        if partner != self._partner:
            self._text(2, "REJ. MIS ITEM: partner id mismatch\t")
        elif m.mission_type != self._kind:
            self._answer(MissionResult.ERROR)
        elif self._state != "receiving":
            last = self._state == "" and m.seq + 1 == len(self._items) == self._count
            if not last:  # the last one a second time: the answer to it was lost
                self._text(2, f"IGN MISSION_ITEM: {'Busy' if self._state else 'No transfer'}\t")
            self._answer(MissionResult.ACCEPTED if last else MissionResult.ERROR)
        elif m.seq == len(self._items):
            self._add(Item.read(m, scale))

    def _add(self, item: Item) -> None:
        self._heard_ns = self._now_ns()
        why = complaint(self._kind, item)
        if why != MissionResult.ACCEPTED:
            self._text(2, "IGN MISSION_ITEM: Invalid item\t")
            self._end(why)
            return
        self._items.append(item)
        if len(self._items) < self._count:
            self._ask()
        else:
            self._plan.store(self._kind, tuple(self._items))
            self._end(MissionResult.ACCEPTED)

    def _ask(self) -> None:
        assert self._partner is not None
        link, system, component = self._partner
        self._asked_ns = self._now_ns()
        link.send(M["MISSION_REQUEST_INT"], system, component, len(self._items), self._kind)

    def _end(self, result: MissionResult) -> None:
        self._state = ""
        self._answer(result)

    def _answer(self, result: MissionResult, kind: int | None = None, partner: _Partner | None = None) -> None:
        to = partner or self._partner
        assert to is not None
        to.link.send(M["MISSION_ACK"], to.system, to.component, int(result), self._kind if kind is None else kind)

    # download

    def _on_list(self, link: Link, frame: Frame, m: Any) -> None:
        partner = _Partner(link, frame.system, frame.component)
        if self._state == "receiving" or (self._state and (partner, m.mission_type) != (self._partner, self._kind)):
            self._text(6, "Mission download request ignored, already active\t")
            return
        items = self._plan.items.get(m.mission_type, ())
        self._state, self._partner, self._kind = "sending", partner, m.mission_type
        self._items, self._count = list(items), len(items)
        self._heard_ns = self._now_ns()
        link.send(M["MISSION_COUNT"], partner.system, partner.component, len(items), m.mission_type)

    def _on_request_int(self, link: Link, frame: Frame, m: Any) -> None:
        self._give(link, frame, m, "MISSION_ITEM_INT")

    def _on_request(self, link: Link, frame: Frame, m: Any) -> None:
        self._give(link, frame, m, "MISSION_ITEM")

    def _give(self, link: Link, frame: Frame, m: Any, name: str) -> None:
        if _Partner(link, frame.system, frame.component) != self._partner:
            self._text(2, "WPM: REJ. CMD: partner id mismatch\t")
        elif self._state == "receiving":
            self._text(2, "WPM: REJ. CMD: Busy\t")
        elif self._state == "sending" and m.mission_type == self._kind:
            self._heard_ns = self._now_ns()
            if m.seq >= self._count:
                self._end(MissionResult.ERROR)
                self._text(2, "WPM: REJ. CMD: Req. WP was unexpected\t")
                return
            item = self._items[m.seq]
            current = int(self._kind == MISSION and m.seq == self._plan.current)
            x, y, frame_id = item.x, item.y, item.frame
            if name == "MISSION_ITEM" and frame_id != 2:
                x, y, frame_id = x / 1e7, y / 1e7, {5: 0, 6: 3}[frame_id]
            head = (frame.system, frame.component, m.seq, frame_id, item.command, current, item.autocontinue)
            link.send(M[name], *head, *item.params, x, y, item.z, self._kind)

    # the rest

    def _on_ack(self, link: Link, frame: Frame, m: Any) -> None:
        if _Partner(link, frame.system, frame.component) == self._partner and (
            self._state == "sending" or (self._state and m.type == MissionResult.CANCELLED)
        ):
            self._state = ""

    def _on_clear(self, link: Link, frame: Frame, m: Any) -> None:
        if self._state:
            self._text(2, "WPM: IGN CLEAR CMD: Busy\t")
            return
        for kind in MOST if m.mission_type == ALL else (m.mission_type,):
            if kind in MOST:
                self._plan.store(kind, ())
        partner = _Partner(link, frame.system, frame.component)
        self._answer(MissionResult.ACCEPTED, m.mission_type, partner)

    def _on_current(self, link: Link, frame: Frame, m: Any) -> None:
        if self._state:
            self._text(2, "WPM: IGN WP CURR CMD: Busy\t")
        elif m.seq < len(self._plan.mission):
            self._plan.go_to(m.seq)
        else:
            self._text(2, "WPM: WP CURR CMD: Not in list\t")
