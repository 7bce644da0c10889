"""Clients that the hub of a closed bus refuses are named with the cause, and output of others is passed on."""

import subprocess
import sys
import time

import pytest

from hil.bus.certificates import make_keys
from hil.bus.leaf import Bus, BusError, credentials_in
from hil.bus.refusals import Refusals, closing_clients, refusal
from tests.unit.hil.bus.test_leaf import free_endpoint

LIMIT_S = 30.0
HUB = """
import sys
from pathlib import Path
from hil.bus.leaf import credentials_in
from hil.live.hub import serve_hub
print("before", flush=True)
serve_hub(sys.argv[1], credentials_in(Path(sys.argv[2]), "hub"), None, with_parent=True)
"""
WARNING = "2026-01-02T03:04:05.000000Z  WARN ThreadId(03) zenoh_link_tls::unicast: "


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (WARNING + "invalid peer certificate: UnknownIssuer. Hint: x", "its certificate is of another authority"),
        (WARNING + "invalid peer certificate: BadSignature. Hint: x", "its certificate is of another authority"),
        (WARNING + "peer sent no certificates. Hint: x", "it has no certificate"),
        (WARNING + "received fatal alert: UnknownCA. Hint: x", "it does not accept this hub: its ca.crt is of"),
        (WARNING + "received corrupt message of type InvalidContentType. Hint: x", "it does not speak TLS"),
        (WARNING + "something else", ""),
        ("hub on tls/127.0.0.1:7447", ""),
        ("a text with UnknownIssuer", ""),
    ],
)
def test_line_of_the_log_is_put_into_words(line, text):
    assert refusal(line).startswith(text)
    assert bool(refusal(line)) == bool(text)


def test_client_that_tries_again_is_reported_once_a_minute():
    now, closing = [0.0], {"10.0.0.9:4001"}
    refusals = Refusals(7447, lambda: now[0], lambda port: set(closing))
    line = WARNING + "peer sent no certificates. Hint: x\n"
    assert refusals.take(line) == "perch-hil: hub: refused a client at 10.0.0.9: it has no certificate\n"
    closing.add("10.0.0.9:4002")
    assert refusals.take(line) == ""
    closing.add("10.0.0.8:4001")
    assert "at 10.0.0.8:" in refusals.take(line)
    now[0] = 61.0
    assert refusals.take(line) == "perch-hil: hub: refused a client: it has no certificate\n"
    assert refusals.take("own line\n") == "own line\n"
    assert refusals.take(WARNING + "other\n") == ""


def test_connections_that_are_being_closed_are_read_from_the_kernel(tmp_path):
    four, six = tmp_path / "tcp", tmp_path / "tcp6"
    rows = ("0100007F:1D17 0900000A:0FA1 06", "0100007F:1D17 0800000A:0FA1 01", "0100007F:1D18 0700000A:0FA1 06")
    four.write_text("head\n" + "".join(f"{i}: {row} 0\n" for i, row in enumerate(rows)))
    six.write_text("head\n0: 00000000000000000000000001000000:1D17 B80D0120000000000000000001000000:0FA1 06 0\n")
    assert closing_clients(0x1D17, (four, six, tmp_path / "none")) == {"10.0.0.9:4001", "2001:db8::1:4001"}


def test_hub_names_the_clients_that_it_refused(tmp_path):
    for name, identities in (("keys", ["hub", "brain"]), ("other", ["brain"])):
        make_keys(tmp_path / name, identities)
    foreign = credentials_in(tmp_path / "other", "brain")._replace(authority=tmp_path / "keys" / "ca.crt")
    endpoint, log = free_endpoint().replace("tcp/", "tls/"), tmp_path / "hub.log"
    with log.open("wb") as file:
        hub = subprocess.Popen([sys.executable, "-c", HUB, endpoint, str(tmp_path / "keys")], stdout=file, stderr=file)
    try:
        until = time.monotonic() + LIMIT_S
        while True:
            try:
                Bus(endpoint, credentials_in(tmp_path / "keys", "brain"), timeout_s=1.0).close()
                break
            except BusError:
                assert time.monotonic() < until
        with pytest.raises(BusError):
            Bus(endpoint, foreign, timeout_s=1.5)
        while "of another authority" not in log.read_text():
            assert time.monotonic() < until, log.read_text()
            time.sleep(0.05)
    finally:
        hub.terminate()
        hub.wait(LIMIT_S)
    lines = log.read_text().splitlines()
    assert lines[0] == "before"
    assert lines[1].startswith("perch-hil: hub: refused a client")
    assert lines[1].endswith("its certificate is of another authority")
