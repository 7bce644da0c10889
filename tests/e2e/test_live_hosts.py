"""Two hosts: one runs hub, supervisor and devices, the other decides. The bus between them is closed by keys.

Two network namespaces with a wire between them, the other host with a monotonic clock of its own; where that is not
allowed, two loopback addresses.
"""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.host.replay import replay_run
from hil.recording.reader import Recording
from tests.paths import ROOT

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]

PERCH = str(Path(sys.executable).with_name("perch-hil"))
RUN = ("--camera", "model")
AHEAD_S = 5000  # the other host has been up for so much longer
LIMIT_S = 240.0


class Hosts:
    """Two hosts, `here` and `there`; `apart` if they have their own networks and clocks."""

    def __init__(self, names=()):
        self.names, self.apart = names, bool(names)
        self.address = "10.77.11.1" if names else "127.0.0.2"
        self.here = ["ip", "netns", "exec", names[0]] if names else []
        other = ["unshare", "--time", "--monotonic", str(AHEAD_S), "--fork", "--kill-child"]
        self.there = ["ip", "netns", "exec", names[1], *other] if names else []

    def cut(self):
        subprocess.run(["ip", "-n", self.names[1], "link", "set", "eth0", "down"], check=True)


def _ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True, timeout=10)


@pytest.fixture
def hosts(tmp_path):
    names = [f"perch-{tmp_path.name[-12:]}-{side}" for side in "ab"]
    try:
        for name in names:
            _ip("netns", "add", name)
        _ip("link", "add", "eth0", "netns", names[0], "type", "veth", "peer", "name", "eth0", "netns", names[1])
        for number, name in enumerate(names, 1):
            _ip("-n", name, "addr", "add", f"10.77.11.{number}/24", "dev", "eth0")
            for link in ("eth0", "lo"):
                _ip("-n", name, "link", "set", link, "up")
        made = Hosts(names)
        subprocess.run([*made.there, "true"], check=True, capture_output=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        made = Hosts()
    yield made
    for name in names:
        subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


@pytest.fixture
def keys(hosts, tmp_path):
    """host -> its folder, with the files of the services on that host only."""
    whole = tmp_path / "keys"
    subprocess.run([PERCH, "keys", str(whole), "--host", hosts.address], check=True, capture_output=True)
    here, there = shutil.copytree(whole, tmp_path / "here"), tmp_path / "there"
    there.mkdir()
    for name in ("brain.crt", "brain.key"):
        (here / name).rename(there / name)
    shutil.copy(whole / "ca.crt", there)
    (here / "ca.key").unlink()
    return here, there


@pytest.fixture
def start(hosts, tmp_path):
    """Starts `perch-hil ...` on a host; `.output()` is its output once it has ended."""
    running = []

    def started(host, *words):
        log = tmp_path / f"{words[0]}.log"
        process = subprocess.Popen(
            [*host, PERCH, *words],
            cwd=tmp_path,
            stdout=log.open("wb"),
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        process.output = lambda: log.read_text()
        running.append(process)
        return process

    yield started
    for process in running:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()


def both(hosts, keys, start, tmp_path, *, node_seed=3, policies=("vision", "vision")):
    endpoint = f"tls/{hosts.address}:17447"
    run = start(
        hosts.here, "run", "simple-i", *RUN, "--seed", "3", "--live", "--pictures", "none", "--remote", "brain",
        "--endpoint", endpoint, "--keys", str(keys[0]), "--out", "runs", "--policy", str(policies[0]),
    )  # fmt: skip
    node = start(
        hosts.there, "node", "brain", "--scenario", "simple-i", *RUN, "--seed", str(node_seed), "--endpoint", endpoint,
        "--keys", str(keys[1]), "--receipts", str(tmp_path / "receipts"), "--wait", "120", "--policy", str(policies[1]),
    )  # fmt: skip
    return run, node


def folder(tmp_path):
    (found,) = (tmp_path / "runs").iterdir()
    return found


def test_run_completes_with_the_policy_service_on_another_host(hosts, keys, start, tmp_path):
    run, node = both(hosts, keys, start, tmp_path)
    assert run.wait(LIMIT_S) in (0, 1), run.output()
    assert node.wait(30) == 0, node.output()
    path = folder(tmp_path)
    table = json.loads((path / "live.json").read_text())
    assert table["ended"]["trouble"] == ""
    clock = table["services"]["brain"]["clock"]
    if hosts.apart:
        assert not clock["shared"]
        assert abs(clock["offset_ns"] + AHEAD_S * 1e9) < 2 * clock["error_ns"] + 1e6
        assert "brain: on another host; its clock is +" in run.output()
        events = [entry.message.text for entry in Recording(path).messages(["event"])]
        assert any(text.startswith("brain: on another host") for text in events)
    else:
        assert clock["shared"]
    actions = [entry for entry in Recording(path).messages(["policy/action"])]
    assert len(actions) > 100
    assert all(abs(entry.message.stamp_ns - entry.log_ns) < 1e9 for entry in actions)  # one time for both
    shutil.copy(tmp_path / "receipts" / "receipts-brain.mcap", path)
    replayed = [topic for topic in replay_run(path, ["policy"]).topics if topic.topic == "policy/action"]
    assert replayed[0].compared > 100


def test_a_node_of_another_run_is_refused(hosts, keys, start, tmp_path):
    run, node = both(hosts, keys, start, tmp_path, node_seed=4)
    assert run.wait(LIMIT_S) == 3
    assert "brain was started for another run" in run.output()
    assert node.wait(30) == 0


def test_a_node_with_another_policy_file_of_the_same_name_is_refused(hosts, keys, start, tmp_path):
    files = []
    for side, network in (("own", "vision"), ("other", "plain/vision")):
        files.append(tmp_path / side / "mine.onnx")
        files[-1].parent.mkdir()
        shutil.copy(ROOT / "policies" / "checkpoints" / f"{network}.onnx", files[-1])
    run, node = both(hosts, keys, start, tmp_path, policies=files)
    assert run.wait(LIMIT_S) == 3
    (line,) = [line for line in run.output().splitlines() if line.startswith("perch-hil: ")]
    assert "brain has another policy file on its host" in line
    manifest = json.loads((folder(tmp_path) / "manifest.json").read_text())
    assert manifest["digests"]["policy file"] == manifest["policy"]["sha256"]
    assert manifest["digests"]["policy file"][:12] in line
    assert node.wait(30) == 0


def until(condition, limit_s=LIMIT_S):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.1)


def recording(tmp_path, enough=200_000):
    """Whether the attempt is recorded: the schemas alone, written before the run begins, take some 50 kB."""
    return any(path.stat().st_size > enough for path in (tmp_path / "runs").glob("*/run.mcap"))


def test_cut_connection_is_reported_on_both_hosts_and_both_end(hosts, keys, start, tmp_path):
    if not hosts.apart:
        pytest.skip("there is no wire to cut between loopback addresses")
    run, node = both(hosts, keys, start, tmp_path)
    until(lambda: recording(tmp_path) or run.poll() is not None)
    hosts.cut()
    assert run.wait(LIMIT_S) == 3, run.output()
    assert "could not run: brain" in run.output()
    assert node.wait(60) == 3, node.output()
    assert "brain: aborted" in node.output()
    assert "nothing received from supervisor and hub" in node.output()
    assert Recording(folder(tmp_path)).complete


def test_node_ends_when_its_host_process_is_killed(hosts, keys, start, tmp_path):
    run, node = both(hosts, keys, start, tmp_path)
    until(lambda: recording(tmp_path) or run.poll() is not None)
    run.kill()  # the supervisor itself: `ip netns exec` has become it
    run.wait(10)
    assert node.wait(60) == 3, node.output()
    assert "nothing received from supervisor and hub" in node.output()
    until(lambda: not served(tmp_path), 60.0)
    assert sum(1 for _ in Recording(folder(tmp_path)).messages(["truth/vehicle"])) > 50


def served(tmp_path):
    """Processes that still serve the run."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:
            continue
        if b"hil.live.main" in words and any(word.startswith(str(tmp_path).encode()) for word in words):
            found.append(words)
    return found
