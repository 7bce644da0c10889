"""Every command of the pages: run in a folder of its own, or, with a reason, only parsed and looked at."""

import glob
import importlib.util
import itertools
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.assembly.rig import Rig
from hil.cli.main import app
from tests.paths import FIRMWARE_RUN, GOLDEN_RUN, ROOT
from tests.unit.docs.command_line import knows, look_at_values, options, parse
from tests.unit.docs.pages import PAGES, Typed, inline, typed

# Beginning of perch-hil's arguments -> why it is parsed only, and what runs it.
PARSED_ONLY = {
    r"run .*--live": "real time, or a real device: `make live`",
    r"run .*--view|runs view (?!.*--save)": "opens a window",
    r"run .*--seeds": "many flights: tests/e2e/test_scenarios.py",
    r"run (hard-i|normal-ii)": "flights with pictures: tests/e2e/test_scenarios.py",
    r"campaign|refly": "many flights: tests/e2e/test_campaign.py",
    r"check .*--rig|rig check \w+\.toml": "needs the device: tests/unit/hil/bench, tests/e2e/test_live_devices.py",
    r"bus (hub|node|status)": "needs another process: tests/e2e/test_live_hosts.py",
    r"policy train": "an hour: `make train`, tests/unit/hil/cli/test_train.py",
    r"policy evaluate": "minutes: `make train`, tests/unit/hil/cli/test_train.py",
    r"runs replay": "needs receipts: tests/e2e/test_scenarios.py",
    r"results$": "hours: `make results`, tests/unit/hil/results",
    r"px4": "serves until it is ended: tests/contract/test_mavsdk.py",
    r"vehicle (health|log|set|reboot)": "needs an autopilot: tests/unit/hil/bench/test_ground.py",
    r"soak": "minutes: `make soak`",
    r"camera calibrate": "needs pictures: tests/unit/hil/cli/test_camera.py",
}
# Beginning of another command -> why it is not run.
OTHER = {
    r"sudo ip link set can0": "needs a CAN interface",
    r"\(umask 077|openssl": "writes a key",
    r"pip install": "its extras are looked up in pyproject.toml",
    r"python3\.11 -m venv|\. \.venv": "makes and enters an environment",
    r"ray (start|stop)": "starts a cluster: tests/e2e/test_cluster.py",
    r"make ": "its target is looked up in the Makefile",
    r"cp ": "run by the test",
    r"cat > ": "run by the test",
}
RAY = importlib.util.find_spec("ray") is not None  # its commands are parsed where it is installed
EXIT_CODES = {"check": (0, 4)}  # incomplete where no operator is there to answer
EVERY = [line for page in PAGES for line in typed(page)]


def reason(line: Typed, reasons: dict[str, str]) -> str | None:
    text = " ".join(line.perch) if line.perch is not None else line.text
    return next((why for start, why in reasons.items() if re.match(start, text)), None)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with what the pages take for granted: runs, a policy, a scenario, trained policies."""
    monkeypatch.chdir(tmp_path)
    for name in ("scenarios", "policies"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("RUN", "A", "B", "20260101T000000Z_hard-i_sim-seed0"):
        shutil.copytree(GOLDEN_RUN, tmp_path / "runs" / name)
    network = ROOT / "policies" / "checkpoints" / "vision.onnx"
    for name in ("mine.onnx", *(f"training_runs/{stage}/policy.onnx" for stage in ("state", "vision", "watch-long"))):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(network, tmp_path / name)
    shutil.copy(ROOT / "scenarios" / "simple_i.toml", tmp_path / "my_scenario.toml")
    flown = tmp_path / "runs" / "FIRMWARE"
    shutil.copytree(FIRMWARE_RUN, flown)
    (flown / "firmware.ulg").rename(tmp_path / "flight.ulg")
    return tmp_path


def check(line: Typed, run: bool) -> None:
    """Carry out one line as far as it can be."""
    words = line.words
    if line.perch is not None:
        given = [sorted(glob.glob(word)) or [word] if "*" in word else [word] for word in line.perch]  # noqa: PTH207
        arguments = list(itertools.chain.from_iterable(given))
        look_at_values(got := parse(arguments))
        if run and reason(line, PARSED_ONLY) is None:
            result = CliRunner().invoke(app, arguments)
            assert result.exit_code in EXIT_CODES.get(got.get("command", ""), (0,)), result.output
            if line.writes:
                Path(line.writes).write_text(result.stdout, encoding="utf-8")
    elif line.body:
        Path(line.text.split()[-1]).write_text(line.body, encoding="utf-8")
    elif words[0] == "cp":
        shutil.copy(words[1], words[2])
    elif words[0] == "make":
        subprocess.run(["make", "-n", *words[1:]], cwd=ROOT, check=True, capture_output=True)
    elif words[0] == "ray" and RAY:
        from ray.scripts.scripts import cli

        cli.commands[words[1]].make_context(words[1], words[2:])
    elif words[:2] == ["pip", "install"]:
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        named = re.findall(r"\.\[(.*?)\]", line.text)
        assert set(named) <= extras.keys() and words[-1].startswith(".")
        assert all((ROOT / words[at + 1]).is_file() for at, word in enumerate(words) if word == "-c")
    else:
        assert reason(line, OTHER), f"{line.page}: {line.text}: neither run nor excused"


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_of_a_page_works_in_the_order_of_the_page(page, folder):
    for line in typed(page):
        try:
            check(line, run=True)
        except Exception as error:
            raise AssertionError(f"{page.name}: {line.text}: {error}") from error


def test_every_exemption_of_a_command_is_still_needed():
    used = {reason(line, PARSED_ONLY if line.perch is not None else OTHER) for line in EVERY}
    unused = {why for why in (*PARSED_ONLY.values(), *OTHER.values())} - used
    assert unused <= {PARSED_ONLY[r"soak"]}


@pytest.mark.parametrize(
    "wrong",
    [
        "perch-hil run simple-i --camrea model",
        "perch-hil run simpel-i",
        "perch-hil run simple-i --rig nowhere.toml",
        "perch-hil run simple-i --policy nowhere.onnx",
        "perch-hil runs report runs/NONE",
        "perch-hil runs replay runs/RUN --ignore believe.rho",
        "perch-hil rigs list",
        "perch-hil policy train --recipe immitate",
        "perch-hil bus node brian --scenario hard-i",
        "perch-hil bus status --endpoint 192.168.1.10",
        "perch-hil check prefligt",
        "make trian",
        pytest.param("ray start --haed", marks=pytest.mark.skipif(not RAY, reason="ray is not installed")),
        "pip install -e '.[veiw]'",
        "rsync a b",
    ],
)
def test_a_wrong_option_name_or_path_would_be_found(wrong, folder):
    with pytest.raises(Exception):  # noqa: B017
        check(Typed("page", wrong), run=True)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_options_and_links_in_sentences_exist(page, folder):
    known = options()
    for code in inline(page):
        words = Typed(page.name, code).words if code.startswith("perch-hil") else []
        plain = [word for word in words[1:] if word.islower() and word.isidentifier()]
        if words and len(plain) == len(words) - 1:
            assert knows(plain), code
        elif words:
            look_at_values(parse(words[1:]))
        options_of = () if code.startswith(("docker ", "pip ")) else re.findall(r"(?<![\w-])--[a-z][a-z-]*", code)
        for option in options_of:
            assert option in known, f"{page.name}: {code}"
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert target.startswith("https://") or (page.parent / target).exists(), f"{page.name}: {target}"
    for path in (code for code in inline(page) if re.fullmatch(r"[\w-]+(/[\w.-]+)+/?", code)):
        if path.split("/")[0] in ("hil", "policies", "vehicle", "groundcar", "scenarios", "kernel", "docs"):
            assert (ROOT / path).exists(), f"{page.name}: {path}"


def test_rigs_page_names_every_key_of_every_table():
    text = (ROOT / "docs" / "rigs-and-links.md").read_text()
    for name, field in Rig.model_fields.items():
        if not hasattr(field.annotation, "model_fields"):
            assert f"`{name}`" in text, name
        else:
            (row,) = re.findall(rf"^\| `\[{name}\]` \|(.*)\|$", text, re.M)
            keys = set(field.annotation.model_fields) - {"calibration"}
            assert keys <= set(re.findall(r"`(\w+)`", row)), name
