"""The process that serves a live run to Foxglove. `python -m hil.viewer.foxglove.feed SPEC` (JSON, see ServerSpec).

It may be slow, hang or end: no control process waits for it. It prints the port once it listens, and at its end how
many messages it showed and how many it was too slow for.
"""

from __future__ import annotations

import json
import os
import signal
import sys

from hil.bus.leaf import BusError, Mailbox
from hil.contract.topics import TOPICS
from hil.recording.foxglove import FoxgloveView
from hil.viewer.foxglove.server import FoxgloveServer
from hil.viewer.foxglove.spec import ServerSpec
from hil.viewer.joining import join

_DEPTH = 2048  # messages of a topic that wait while this process is not scheduled
_PICTURE_NS = 66_000_000  # of previews, as recorded
_TURN_NS = 100_000_000


def serve(spec: ServerSpec, server: FoxgloveServer, stopped: list[bool]) -> int:
    """Show the run until stopped; returns how many messages this process was too slow for. Raises BusError."""
    mailbox = Mailbox(depth=_DEPTH, picture_period_ns=_PICTURE_NS)
    with join(spec.endpoint, spec.keys, stopped, mailbox, [topic for topic, row in TOPICS.items() if row.recorded]):
        last = False
        while not last:
            last = bool(stopped)  # messages received until then are still shown
            mailbox.wait(_TURN_NS)
            for delivery in mailbox.drain():
                server.show(delivery.published_ns, delivery.topic, delivery.message)
    mailbox.close()
    return sum(mailbox.dropped.values()) + sum(mailbox.lost.values()) + server.not_shown


def main() -> int:
    """Read the spec, listen, and serve."""
    spec = ServerSpec(**json.loads(sys.argv[1]))
    stopped: list[bool] = []
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
    view = FoxgloveView(spec.calibrated(), "preview", spec.board_size)
    try:
        server = FoxgloveServer(spec.port, view, spec.name)
    except (OSError, RuntimeError) as error:
        print(f"port {spec.port} of 127.0.0.1 cannot be listened on: {error}", file=sys.stderr, flush=True)
        return 3
    print(server.port, flush=True)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # nothing reads the pipe from here on
    try:
        dropped = serve(spec, server, stopped)
    except BusError as error:
        print(str(error), file=sys.stderr, flush=True)
        return 3
    finally:
        server.close()
    print(json.dumps({"shown": server.shown, "dropped": dropped}), flush=True)
    return 0


if __name__ == "__main__":
    os._exit(main())  # Zenoh's and the SDK's threads are not waited for
