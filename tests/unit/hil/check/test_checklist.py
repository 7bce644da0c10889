import pytest

from hil.assembly.rig import load_rig
from hil.check.checklist import Checklist, list_checklists, load_checklist
from kernel.toml_errors import ConfigError

GOOD = """
title = "mine"
[[group]]
title = "one"
[[group.item]]
check = "host.disk"
min = 1
[[group.item]]
ask = "Propellers off?"
"""


def write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return str(path)


def test_shipped_checklists_load():
    assert list_checklists() == ["crazyflie", "postflight", "preflight"]
    for name in list_checklists():
        assert load_checklist(name).kind == {"crazyflie": "preflight"}.get(name, name)


def test_own_checklist_clears_only_with_kind_preflight(tmp_path):
    assert load_checklist(write(tmp_path, GOOD)).kind == "other"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "host.disk",
            "host.disc",
            ['group 1 "one", item 1: key "check"', 'did you mean "host.disk"?', "Allowed: board.inclination"],
        ),
        ("min = 1", "minn = 1", ['item 1: unknown key "minn"', 'did you mean "min"?', "Allowed: args, ask, check"]),
        ("min = 1", "args = { distance = 2 }", ['item 1: key "args"', 'unknown argument "distance"', "Allowed: none"]),
        ("min = 1", "min = 3\nmax = 2", ["item 1", "limits must rise"]),
        ("min = 1", 'unit = "km"', ['item 1: key "unit"', "measured in GB"]),
        ("min = 1", 'min = "x"', ['item 1: key "min"', "valid number"]),
        ("min = 1", 'ask = "And?"', ["item 1", 'either "check" (automatic) or "ask" (manual)']),
        ('ask = "Propellers off?"', 'title = "x"', ["item 2", 'either "check" (automatic) or "ask" (manual)']),
        ('title = "mine"', 'title = "mine"\nkind = "prefligt"', ["kind", "preflight"]),
        ('title = "one"', "", ['group 1: key "title" is missing']),
        ("title", "title = = 1", ["not valid TOML"]),
    ],
)
def test_error_of_an_invalid_checklist_names_file_key_and_allowed_values(tmp_path, old, new, message):
    with pytest.raises(ConfigError) as error:
        load_checklist(write(tmp_path, GOOD.replace(old, new, 1)))
    for words in ["mine.toml", *message]:
        assert words in str(error.value)


def test_all_faults_of_a_checklist_are_reported_together(tmp_path):
    text = GOOD.replace("host.disk", "host.disc") + '[[group.item]]\ncheck = "vehicle.parameter"\n'
    with pytest.raises(ConfigError) as error:
        load_checklist(write(tmp_path, text))
    assert "host.disc" in str(error.value)
    assert "vehicle.parameter needs the argument name" in str(error.value)


@pytest.mark.parametrize("args", ["{ name = 3 }", '{ name = "A", nam = "B" }'])
def test_check_argument_of_a_wrong_type_or_name_is_refused(tmp_path, args):
    text = GOOD.replace('check = "host.disk"', f'check = "vehicle.parameter"\nargs = {args}')
    with pytest.raises(ConfigError, match=r"must be str|did you mean"):
        load_checklist(write(tmp_path, text))


def test_an_unknown_list_and_two_groups_of_one_name_are_refused(tmp_path):
    with pytest.raises(ConfigError, match='did you mean "preflight"'):
        load_checklist("prefligt")
    group = GOOD[GOOD.index("[[group]]") :]
    with pytest.raises(ConfigError, match="two groups are called one"):
        load_checklist(write(tmp_path, GOOD + group))


def test_items_for_another_kind_of_rig_are_left_out():
    rig = load_rig("sim")
    items = [item for group in load_checklist("preflight").group for item in group.item]
    assert {item.when for item in items} == {"any", "simulated", "real"}
    for item in items:
        assert item.applies(rig) == (item.when != "real")


def test_items_apply_by_slot_on_a_rig_with_one_real_device():
    rig = load_rig("sim")
    car = rig.groundcar.model_copy(update={"kind": "can"})
    mixed = rig.model_copy(update={"groundcar": car})
    items = {item.check or item.ask: item for group in load_checklist("preflight").group for item in group.item}
    assert not mixed.simulated
    assert items["vehicle.kill"].applies(mixed)
    assert items["Car's path clear for 2 m ahead? It drives now."].applies(mixed)
    assert not items["Propellers off, or vehicle tied down?"].applies(mixed)


def test_item_keys_are_unique_and_the_digest_follows_the_content():
    preflight = load_checklist("preflight")
    keys = [key for _, _, key in preflight.places()]
    assert len(set(keys)) == len(keys)
    changed = Checklist.model_validate({**preflight.model_dump(), "title": "other"})
    assert changed.sha256() != preflight.sha256() == load_checklist("preflight").sha256()
