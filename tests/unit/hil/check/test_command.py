import contextlib
import json
import re
import time

import pytest

from hil.check import records
from hil.check.command import run_checklist
from hil.check.judge import Outcome, Reading
from hil.check.records import RecordError
from hil.recording.provenance import ProvenanceError
from tests.unit.hil.check.console import Console, check_request
from tests.unit.hil.check.made_up import registered

LIST = """
title = "made up"
kind = "preflight"
[[group]]
title = "one"
[[group.item]]
check = "test.step"
args = { n = 0 }
[[group.item]]
ask = "First question?"
[[group.item]]
check = "test.step"
args = { n = 2 }
[[group]]
title = "two"
[[group.item]]
ask = "How long?"
unit = "s"
max = 0.6
[[group.item]]
check = "test.step"
args = { n = 4 }
[[group.item]]
ask = "Last question?"
must = true
"""
QUESTIONS = {1: "First question?", 3: "How long?", 5: "Last question?"}
KEYS = "stop here"


@pytest.fixture
def listed(tmp_path):
    (tmp_path / "list.toml").write_text(LIST)

    def step(context, *, n: int):
        (tmp_path / f"reached-{n}").touch()
        while (tmp_path / f"hold-{n}").exists():
            time.sleep(0.01)
        return Reading(n, ok=not (tmp_path / f"bad-{n}").exists(), detail="as the test wants it")

    with registered("test.step", step):
        yield tmp_path


def start(folder, **more) -> Console:
    terminal = {k: more.pop(k) for k in ("columns", "term", "NO_COLOR") if k in more}
    return Console(check_request(folder, folder / "list.toml", **more), **terminal)


def answer(console: Console, place: int) -> None:
    console.wait_for(QUESTIONS[place])
    console.wait_for(KEYS)
    if place == 3:
        console.type("m")
        console.wait_for("Value in s: ")
        console.type("0,4\n")
    else:
        console.type("p")


def finish(console: Console, places=(1, 3, 5), sign: str = "y") -> tuple[int, str]:
    for place in places:
        answer(console, place)
    console.wait_for("leave it unsigned")
    console.type(sign)
    return console.end()


def test_completed_and_signed_off_list_is_a_go(listed):
    code, text = finish(start(listed, junit_file=listed / "out.xml"))
    assert code == 0
    assert "GO, sealed by Ann" in text
    record = records.read(listed / "record.json")
    assert record.genuine()
    assert [e.outcome for e in record.entries] == [Outcome.PASS] * 6
    assert record.entries[3].value == 0.4
    assert "<testsuites" in (listed / "out.xml").read_text()


def test_go_without_sign_off_is_incomplete(listed):
    code, text = finish(start(listed), sign="n")
    assert (code, "not signed off" in text) == (4, True)
    assert records.read(listed / "record.json").state == "incomplete"


@pytest.mark.parametrize("place", range(6))
def test_kill_9_at_any_item_keeps_the_record_for_resuming(listed, place):
    hold = listed / f"hold-{place}"
    if place % 2 == 0:
        hold.touch()
    console = start(listed)
    for question in [p for p in (1, 3, 5) if p < place]:
        answer(console, question)
    if place % 2 == 0:
        end = time.monotonic() + 30
        while not (listed / f"reached-{place}").exists():
            assert time.monotonic() < end
            time.sleep(0.01)
    else:
        console.wait_for(QUESTIONS[place])
    console.kill()
    left = records.read(listed / "record.json")
    assert left.state == "incomplete"
    assert [e.outcome for e in left.entries] == [Outcome.PASS] * place + [Outcome.PENDING] * (6 - place)
    hold.unlink(missing_ok=True)
    for path in listed.glob("reached-*"):
        path.unlink()
    unanswered = [p for p in (1, 3, 5) if p >= place]
    code, text = finish(start(listed, operator="Bob"), unanswered)
    assert code == 0, text
    record = records.read(listed / "record.json")
    manual = {p: record.entries[p].operator for p in (1, 3, 5)}
    assert manual == {p: "Bob" if p in unanswered else "Ann" for p in (1, 3, 5)}
    assert len(list(listed.glob("reached-*"))) == 3  # automatic items ran again, all of them


def test_ctrl_c_at_a_question_keeps_the_record_for_resuming(listed):
    console = start(listed)
    answer(console, 1)
    console.wait_for(QUESTIONS[3])
    console.wait_for(KEYS)
    console.type("\x03")
    code, text = console.end()
    assert (code, "ABORTED" in text) == (3, True)
    assert records.read(listed / "record.json").entries[1].outcome is Outcome.PASS


def test_hangup_of_the_terminal_keeps_the_record(listed):
    console = start(listed)
    answer(console, 1)
    console.wait_for(QUESTIONS[3])
    console.hang_up()
    assert records.read(listed / "record.json").entries[1].outcome is Outcome.PASS


@pytest.mark.parametrize("typed", ["p", "ppppp\nyyy\n"])
def test_keys_typed_ahead_are_discarded(listed, typed):
    (listed / "hold-0").touch()
    console = start(listed)
    end = time.monotonic() + 30
    while not (listed / "reached-0").exists():
        assert time.monotonic() < end
        time.sleep(0.01)
    console.type(typed)  # during the automatic item, before the question is there
    time.sleep(0.2)
    (listed / "hold-0").unlink()
    console.wait_for(QUESTIONS[1])
    console.wait_for(KEYS)
    time.sleep(0.5)
    assert records.read(listed / "record.json").entries[1].outcome is Outcome.PENDING
    console.type("p")
    console.wait_for(QUESTIONS[3])
    console.kill()


def test_failed_item_with_a_reason_is_a_no_go(listed):
    console = start(listed)
    console.wait_for(QUESTIONS[1])
    console.wait_for(KEYS)
    console.type("f")
    console.wait_for("why?")
    console.type("blade is cracked\n")
    console.wait_for("try what did not pass again")
    console.type("q")
    console.wait_for("leave it unsigned")
    console.type("y")
    code, text = console.end()
    assert (code, "NO-GO, sealed by Ann" in text) == (1, True)
    record = records.read(listed / "record.json")
    assert record.entries[1].reason == "blade is cracked"
    assert record.entries[3].outcome is Outcome.PENDING


def test_failed_item_can_be_repeated_after_repair(listed):
    (listed / "bad-2").touch()
    console = start(listed)
    answer(console, 1)
    console.wait_for("did not pass")
    console.wait_for(KEYS)
    (listed / "bad-2").unlink()
    console.type("r")
    code, _ = finish(console, (3, 5))
    assert code == 0
    assert "FAIL" in records.read(listed / "record.json").entries[2].history[0]


def test_must_item_cannot_be_skipped(listed):
    console = start(listed)
    answer(console, 1)
    answer(console, 3)
    shown = console.wait_for(QUESTIONS[5]) + console.wait_for(KEYS)
    assert "skip" not in shown[shown.index(QUESTIONS[5]) :]
    console.type("s")
    time.sleep(0.2)
    assert records.read(listed / "record.json").entries[5].outcome is Outcome.PENDING
    console.kill()


@pytest.mark.parametrize(("columns", "more"), [(60, {"NO_COLOR": "1"}), (80, {}), (60, {"term": "dumb"})])
def test_works_with_60_columns_no_colours_and_a_dumb_terminal(listed, columns, more):
    console = start(listed, columns=columns, **more)
    shown = console.wait_for(QUESTIONS[1]) + console.wait_for(KEYS)
    codes = re.findall(r"\x1b\[([0-9;]*)m", shown)
    if more:
        assert not any(part in ("31", "32", "33", "35", "41") for code in codes for part in code.split(";"))
    if "term" in more:
        assert "\x1b[2J" not in shown
    plain = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", shown)
    assert max(len(line.rstrip()) for line in plain.splitlines()) <= columns
    console.kill()


class TestWithoutATerminal:
    def test_manual_items_are_unknown_and_the_result_incomplete(self, listed, monkeypatch, capsys):
        monkeypatch.setattr("sys.stdin", open("/dev/null"))  # noqa: SIM115, PTH123
        assert run_checklist(check_request(listed, listed / "list.toml", operator=None)) == 4
        assert "there is no operator to ask" in capsys.readouterr().out
        assert records.read(listed / "record.json").entries[1].outcome is Outcome.UNKNOWN

    def automatic(self, folder):
        (folder / "auto.toml").write_text(LIST[: LIST.index("[[group.item]]\nask")])
        return folder / "auto.toml"

    @pytest.mark.parametrize(("sign", "code"), [(True, 0), (False, 4)])
    def test_a_list_of_automatic_items_can_be_signed_on_the_command_line(self, listed, capsys, sign, code):
        path = self.automatic(listed)
        assert run_checklist(check_request(listed, path, sign=sign)) == code

    def test_json_output_is_only_the_record(self, listed, capsys):
        assert run_checklist(check_request(listed, self.automatic(listed), sign=True, as_json=True)) == 0
        printed = capsys.readouterr()
        assert json.loads(printed.out) == records.read(listed / "record.json").as_dict()
        assert "GO, sealed by Ann" in printed.err

    def test_a_failure_is_never_signed_on_the_command_line(self, listed, capsys):
        (listed / "bad-0").touch()
        assert run_checklist(check_request(listed, self.automatic(listed), sign=True)) == 1
        assert records.read(listed / "record.json").sign_off is None

    def test_recent_open_record_is_resumed_and_fresh_begins_a_new_one(self, listed, capsys):
        for fresh, count in ((False, 1), (False, 1), (True, 2)):
            run_checklist(check_request(listed, listed / "list.toml", record=None, fresh=fresh))
            assert len(list((listed / "checks").glob("*.json"))) == count
        printed = capsys.readouterr().err
        assert "resuming" in printed and "0 answers kept" in printed

    @pytest.mark.parametrize(
        ("more", "message"),
        [
            ({"rig": "simm"}, 'did you mean "sim"'),
            ({"scenario": "hard-1"}, 'did you mean "hard-i"'),
            ({"policy": "plannr"}, "use vision"),
            ({"policy": "nowhere.onnx"}, "cannot be read"),
            ({"list_name": "prefligt"}, 'did you mean "preflight"'),
            ({"list_name": "nowhere.toml"}, "cannot be read"),
        ],
    )
    def test_usage_error_is_one_line_and_leaves_no_record(self, listed, capsys, more, message):
        with pytest.raises((ValueError, ProvenanceError)) as error:
            run_checklist(check_request(listed, listed / "list.toml", **more))
        assert message in str(error.value)
        assert len(str(error.value).splitlines()) == 1
        assert not (listed / "record.json").exists()

    def test_record_for_another_subject_or_signed_off_is_not_resumed(self, listed, capsys):
        path = self.automatic(listed)
        asked = check_request(listed, path, sign=True)
        assert run_checklist(check_request(listed, path)) == 4
        with pytest.raises(RecordError, match="another scenario"):
            run_checklist(check_request(listed, path, scenario="hard-i"))
        assert run_checklist(asked) == 0
        with pytest.raises(RecordError, match="already signed"):
            run_checklist(asked)
        with contextlib.suppress(OSError):
            (listed / "record.json").write_text("rubbish")
        with pytest.raises(RecordError, match="not a checklist record"):
            run_checklist(asked)

    def test_two_terminals_do_not_work_on_one_record(self, listed, capsys):
        console = start(listed)
        console.wait_for(QUESTIONS[1])
        with pytest.raises(RecordError, match="another terminal"):
            run_checklist(check_request(listed, listed / "list.toml"))
        console.kill()
        assert run_checklist(check_request(listed, listed / "list.toml")) == 4
