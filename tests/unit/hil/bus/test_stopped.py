"""A stopped hub (SIGSTOP, or a host that swaps) does not block a sender."""

import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from hil.bus.leaf import HEALTH, Bus
from hil.contract import messages as m

HUB = """
import sys, time
from hil.bus.leaf import open_hub
with open_hub(sys.argv[1]):
    print("up", flush=True)
    time.sleep(120)
"""


@pytest.fixture
def hub():
    """(endpoint, process) of a hub in a process of its own."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{one.getsockname()[1]}"
    process = subprocess.Popen([sys.executable, "-c", HUB, endpoint], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline() == b"up\n"
    yield endpoint, process
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.mark.parametrize("way", ["say", "publish"])
def test_publish_does_not_block_on_a_stopped_hub(hub, way):
    endpoint, process = hub
    picture = m.Image(0, 640, 480, 1, bytes(640 * 480), 0)
    received = threading.Event()
    with Bus(endpoint) as bus, Bus(endpoint) as reader:  # without a reader nothing would be sent at all
        reader.on_table(HEALTH + "*", lambda _: received.set())
        arrivals = reader.ages(["camera/image"])

        def speak(times):
            for number in range(times):
                if way == "say":
                    bus.send_table(HEALTH + "policy", {"filler": "x" * 30_000, "number": number})
                else:
                    bus.publish(number, "camera/image", picture)

        until = time.monotonic() + 10.0
        while not (received.is_set() or arrivals):
            assert time.monotonic() < until, "no message was received"
            speak(1)
            time.sleep(0.02)
        process.send_signal(signal.SIGSTOP)
        # far more than sockets and queues on the way can hold: a blocked sender waits 5 s, until Zenoh drops it
        talk = threading.Thread(target=speak, args=(4_000 if way == "say" else 800,), daemon=True)
        talk.start()
        talk.join(3.0)
        waits = talk.is_alive()
        process.send_signal(signal.SIGCONT)
        talk.join(20.0)
    assert not waits
