"""Items of this host: bus, clocks, and a recorder that cannot write or loses messages."""

import re
from dataclasses import replace

import pytest

from hil.bench import bus as bench_bus
from hil.bench.reading import NotApplicable, Unavailable
from hil.bus import clock as bus_clock
from hil.bus.leaf import BusError, open_hub
from hil.check import items_host
from hil.check.catalogue import checks
from hil.check.judge import Outcome
from hil.viewer.view import free_port
from tests.unit.hil.check.preflight import ITEMS, result, roomy


def test_bus_item_passes_with_a_bus_and_is_unknown_without(context, monkeypatch):
    reading = checks()["host.bus"].function(context)
    assert isinstance(reading.value, float)
    assert 0.0 < reading.value < 50.0  # a busy machine may take its time; the preflight's limit is 5 ms
    assert re.search(r"\d+ of 20 pictures", reading.detail)
    monkeypatch.setattr(bench_bus, "_picture_arrives", lambda *_: False)
    lost = checks()["host.bus"].function(context)
    assert (lost.ok, "0 of 20 pictures" in lost.detail) == (False, True)

    def refuse(endpoint):
        raise BusError(f"the hub cannot listen on {endpoint}")

    monkeypatch.setattr(bench_bus, "open_hub", refuse)
    with pytest.raises(Unavailable, match="cannot listen"):
        result(context, "host.bus")
    assert ITEMS["host.bus", ""].optional


@pytest.mark.parametrize(("gigabytes", "outcome"), [(1.9, Outcome.FAIL), (5.0, Outcome.MARGINAL), (50.0, Outcome.PASS)])
def test_a_disk_with_too_little_room_for_a_run_fails(context, monkeypatch, gigabytes, outcome):
    roomy(monkeypatch, gigabytes)
    assert result(context, "host.disk").outcome is outcome


def test_a_disk_that_cannot_be_written_fails_the_recorder(context, monkeypatch):
    def full(*args, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(items_host, "Recorder", full)
    assert result(context, "host.recorder").outcome is Outcome.FAIL


def test_a_recorder_that_loses_messages_fails(context, monkeypatch):
    class Lossy(items_host.Recorder):
        def __call__(self, now_ns, topic, message):
            if now_ns != 990_000_000:
                super().__call__(now_ns, topic, message)

    monkeypatch.setattr(items_host, "Recorder", Lossy)
    judged = result(context, "host.recorder")
    assert (judged.outcome, "4999 of 5000" in judged.reason) == (Outcome.FAIL, True)


def test_clock_item_passes_on_one_host(context):
    for check in ("host.clock", "host.date"):
        with pytest.raises(NotApplicable, match="--endpoint"):
            result(context, check)


def test_clock_item_measures_the_clock_of_the_hub_host(context, monkeypatch):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    there = replace(context, endpoint=endpoint, _kept={})
    with pytest.raises(Unavailable, match="no hub answers"):
        result(there, "host.clock")
    monkeypatch.setattr(bus_clock, "clock_id", lambda: b"another host")
    with open_hub(endpoint):
        monkeypatch.setattr(bus_clock, "clock_id", lambda: b"this host")
        reading = checks()["host.clock"].function(there)
        assert isinstance(reading.value, float)
        assert 0.0 < reading.value < 50.0 and reading.detail.startswith("offset ")
        assert result(there, "host.date").outcome is Outcome.PASS
    far = bus_clock.Clock(10**12, 9_000_000, -2 * 10**9, False)
    there._kept["clocks"] = far
    assert result(there, "host.clock").outcome is Outcome.FAIL
    assert result(there, "host.date").outcome is Outcome.MARGINAL
    there._kept["clocks"] = far._replace(shared=True)
    assert result(there, "host.clock").outcome is Outcome.PASS
