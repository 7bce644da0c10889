"""The interlock attacked: all that a go is for is changed in turn, and a signed record is damaged byte by byte."""

import os
import random
import shutil

import pytest

from hil.check import records
from hil.check import subject as check_subject
from hil.check.checklist import load_checklist
from hil.check.interlock import NotClearedError, refusal
from hil.check.records import RecordError
from hil.check.subject import list_subject, subject
from hil.recording.provenance import code_digests
from kernel.toml_errors import read_toml
from policies.flying import shipped
from scenarios.spec import FOLDER as SCENARIOS
from scenarios.spec import load
from tests.unit.hil.check.cleared import NOW, ONE_QUESTION, Site

CASES = 400 * int(os.environ.get("PERCH_HIL_ATTACK", "1"))
SKELETON = ("kernel", "hil", "vehicle", "groundcar", "policies", "scenarios")


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path)


@pytest.fixture
def code(tmp_path, monkeypatch):
    """A tree of code for which the go is given."""
    root = tmp_path / "tree"
    for name in SKELETON:
        (root / name).mkdir(parents=True)
        (root / name / "module.py").write_text("x = 1\n")
    monkeypatch.setattr(check_subject, "code_digests", lambda: code_digests(root))
    return root


def refused(site, **more) -> str:
    with pytest.raises(NotClearedError) as error:
        site.clear(**more)
    assert len(str(error.value).splitlines()) == 1
    return str(error.value)


def replace(site, name, old, new):
    text = (site.folder / name).read_text()
    assert old in text
    site.file(name, text.replace(old, new))


def heavier(site):
    mass = read_toml(site.folder / "frame.toml")["body"]["mass"]
    replace(site, "frame.toml", f"mass = {mass}", f"mass = {mass + 0.01}")


CHANGES = {
    "the airframe's mass": (heavier, "for another airframe"),
    "the signing key": (lambda s: s.file("vehicle.key", "j" * 32), "for another MAVLink signing key"),
    "the policy's file": (lambda s: s.file("policy.onnx", "another network"), "for another policy"),
    "one's own scenario": (lambda s: replace(s, "mine.toml", "title = ", 'title = "" # '), "for another scenario"),
    "a limit of the list": (lambda s: replace(s, "list.toml", "Well?", "Well, well?"), "for another checklist"),
    "a title of the list": (lambda s: replace(s, "list.toml", '"g"', '"h"'), "for another checklist"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_go_is_refused_after_a_change_of_any_file_that_it_is_for_and_the_line_names_it(site, change):
    alter, told = CHANGES[change]
    site.go()
    assert site.clear().kind == "checklist"
    alter(site)
    assert told in refused(site)


@pytest.mark.parametrize(
    ("slot", "changes"),
    [
        ("vehicle", {"url": "udp://:14541"}),
        ("vehicle", {"system": 2}),
        ("vehicle", {"hover_speed": 0.09}),
        ("gate", {"speed": 12.0}),
        ("car_gate", {"speed": 1.0}),
        ("policy", {"guidance": False}),
        ("camera", {"exposure_ms": 2.5}),
        ("mocap", {"delay_ms": 6.0}),
    ],
)
def test_go_is_refused_after_a_change_of_any_table_of_the_rig(site, slot, changes):
    site.go()
    table = getattr(site.rig, slot).model_copy(update=changes)
    assert "for another rig: its file was changed since" in refused(site, rig=site.rig.model_copy(update={slot: table}))


@pytest.mark.parametrize("package", SKELETON)
@pytest.mark.parametrize("name", ["module.py", "new.py", "data.json"])
def test_go_is_refused_after_a_change_of_code_and_the_package_is_named(site, code, package, name):
    site.go()
    assert site.clear().kind == "checklist"
    (code / package / name).write_text("x = 2\n")
    assert f"for other code: {package} changed since" in refused(site)


def test_go_is_refused_after_a_change_of_the_motion_predictor(site, tmp_path, monkeypatch):
    (tmp_path / "checkpoints").mkdir()
    shutil.copy(shipped.policy_data("planner")["predictor"], tmp_path / "checkpoints" / "predictor.npz")
    monkeypatch.setattr(shipped, "CHECKPOINTS", tmp_path / "checkpoints")
    site.go(policy="planner")
    assert site.clear(policy="planner").kind == "checklist"
    (tmp_path / "checkpoints" / "predictor.npz").write_bytes(b"another")
    assert "for another policy: planner predictor" in refused(site, policy="planner")


def test_own_file_of_a_published_name_is_cleared_only_if_its_content_is_the_published_one(site):
    site.go(scenario="hard-i")
    text = (SCENARIOS / "hard_i.toml").read_text()
    copy = site.file("hard-i.toml", text)
    assert site.clear(scenario=str(copy)).kind == "checklist"
    limit = load("hard-i").time_limit
    changed = "".join(line for line in text.splitlines(True) if not line.startswith("time_limit"))
    site.file("hard-i.toml", f"time_limit = {limit + 1}\n" + changed)
    assert load(str(copy)).name == "hard-i"
    assert "for another scenario class: hard, not hard-i" in refused(site, scenario=str(copy))


def test_list_of_one_question_clears_only_a_rig_that_names_it(site):
    site.go()
    project = site.rig.model_copy(update={"preflight": "preflight"})
    easy = load_checklist(str(site.file("easy.toml", ONE_QUESTION)))
    site.go(rig=project, checklist=easy)
    assert 'for another checklist: the rig wants "Preflight"' in refused(site, rig=project)


def test_no_damaged_byte_of_a_record_clears_anything_but_what_was_signed(site):
    path = site.go()
    whole, signed = path.read_bytes(), records.read(path)
    checklist = load_checklist(site.rig.preflight)
    wanted = list_subject(checklist, subject("field", site.rig, site.policy, load(site.scenario)))
    assert refusal(signed, wanted, NOW, bound=True) == ""
    draw, cleared = random.Random(1), 0
    for _ in range(CASES):
        damaged = bytearray(whole)
        for _ in range(draw.choice((1, 1, 1, 2, 8))):
            damaged[draw.randrange(len(damaged))] = draw.randrange(256)
        path.write_bytes(damaged)
        try:
            record = records.read(path)
        except RecordError as error:
            assert len(str(error).splitlines()) == 1
            continue
        if refusal(record, wanted, NOW, bound=True) == "":
            cleared += 1
            assert record.content() == signed.content() and record.sign_off == signed.sign_off
    assert cleared < CASES // 4


def test_truncated_record_is_no_record(site):
    path = site.go()
    whole = path.read_bytes()
    for end in range(0, len(whole) - 2, max(1, len(whole) * 10 // CASES)):
        path.write_bytes(whole[:end])
        with pytest.raises(RecordError):
            records.read(path)
    assert "no preflight record" in refused(site)
