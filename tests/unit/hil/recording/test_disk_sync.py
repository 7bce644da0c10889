"""A recording is brought onto the disk at a fixed interval, by a thread that its writer does not wait for."""

import errno
import os
import threading
import time

import pytest

from hil.recording import disk_sync
from hil.recording.disk_sync import DiskSync
from hil.recording.recorder import Recorder
from tests.unit.hil.recording.recorded_flight import flight

LIMIT_S = 10.0


def until(condition):
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_file_is_synced_again_and_again_and_once_after_its_end(tmp_path, monkeypatch):
    synced, sync = [], os.fdatasync
    monkeypatch.setattr(disk_sync.os, "fdatasync", lambda fd: (synced.append(os.fstat(fd).st_size), sync(fd)))
    path = tmp_path / "run.mcap"
    with Recorder(path) as recorder, DiskSync(path, 0.01) as disk:
        until(lambda: disk.count >= 2)
        for entry in flight(2.0):
            recorder(*entry)
        recorder.close()
    assert synced[-1] == path.stat().st_size
    assert disk.fault == ""


def test_writer_does_not_wait_for_a_slow_disk(tmp_path, monkeypatch):
    started, released = threading.Event(), threading.Event()
    monkeypatch.setattr(disk_sync.os, "fdatasync", lambda _: (started.set(), released.wait(LIMIT_S)))
    path = tmp_path / "run.mcap"
    with Recorder(path) as recorder:
        disk = DiskSync(path, 0.01).__enter__()
        assert started.wait(LIMIT_S)
        began = time.monotonic()
        for entry in flight(1.0):
            recorder(*entry)
        assert time.monotonic() - began < LIMIT_S / 2
        released.set()
        disk.__exit__()


def test_disk_that_cannot_sync_is_reported(tmp_path, monkeypatch):
    def broken(_):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(disk_sync.os, "fdatasync", broken)
    path = tmp_path / "run.mcap"
    path.write_bytes(b"x")
    with DiskSync(path, 0.01) as disk:
        until(lambda: disk.fault)
    assert disk.fault == f"{path} cannot be brought onto the disk: Input/output error"
    with pytest.raises(FileNotFoundError):
        DiskSync(tmp_path / "none")
