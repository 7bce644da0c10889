"""The campaign page's table of faults: fault x scenario, with a count for each class and links to the runs."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from hil.campaign.classes import Classified
from hil.report.drawing.section import table
from hil.scoring.flight_class import CLASSES, DEFINITIONS, UNSAFE

_SHORT = {name: name.split(" ")[0] for name in CLASSES}


def fault_section(flights: Sequence[Classified]) -> Markup:
    """The table with what its classes mean; empty without flights."""
    if not flights:
        return Markup("")
    scenarios = sorted({flight.scenario for flight in flights})
    policies = sorted({flight.policy for flight in flights})
    rows: list[tuple[object, ...]] = []
    for fault in sorted({flight.fault for flight in flights}):
        for policy in policies:
            mine = [flight for flight in flights if (flight.fault, flight.policy) == (fault, policy)]
            if mine:
                cells = [_cell([flight for flight in mine if flight.scenario == name]) for name in scenarios]
                rows.append((fault, *([policy] if len(policies) > 1 else []), *cells))
    head = ("fault", *(["policy"] if len(policies) > 1 else []), *scenarios)
    counted = [flight for flight in flights if flight.counts]
    unsafe = sum(flight.flight_class == UNSAFE for flight in counted)
    said = Markup('<p class="{}">{} flights with faults, {} of them unsafe; {} more do not count.</p>').format(
        "alert warn" if unsafe else "small", len(counted), unsafe, len(flights) - len(counted)
    )
    meanings = Markup("").join(
        Markup("<dt>{}</dt><dd>{}</dd>").format(name, text) for name, text in DEFINITIONS.items()
    )
    return said + table(head, rows, "left") + Markup('<dl class="small">{}</dl>').format(meanings)


def _cell(flights: Sequence[Classified]) -> Markup:
    """Counts by class; unfolded, the runs by their seeds."""
    if not flights:
        return Markup("–")
    parts, links = [], []
    for name in CLASSES:
        mine = [flight for flight in flights if flight.counts and flight.flight_class == name]
        if mine:
            weight = "b" if name == UNSAFE else "span"
            parts.append(Markup(f"<{weight}>{{}} {{}}</{weight}>").format(len(mine), _SHORT[name]))
            links.append(Markup("<div>{}: {}</div>").format(name, Markup(" ").join(map(_link, mine))))
    out = [flight for flight in flights if not flight.counts]
    if out:
        parts.append(Markup('<span class="small">{} not counted</span>').format(len(out)))
        links.append(Markup("<div>the fault did not happen: {}</div>").format(Markup(" ").join(map(_link, out))))
    return Markup("<details><summary>{}</summary>{}</details>").format(Markup(", ").join(parts), Markup("").join(links))


def _link(flight: Classified) -> Markup:
    return Markup('<a href="{}/" title="{}">{}</a>').format(flight.name, "; ".join(flight.why), flight.seed)
