import pytest

from groundcar.scout.params import PARAMS_PATH, load_scout


def test_the_manual_s_limits_and_the_urdf_s_geometry():
    params = load_scout()
    assert (params.limits.speed, params.limits.turn_rate) == (3.0, 2.5235)
    assert (params.geometry.wheelbase, params.geometry.track) == (0.464, 0.4165)
    assert params.protocol.watchdog == 0.5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("track = 0.4165", "trak = 0.4165", "trak"),
        ("speed = 3.0", "speed = 4.0", "limits.speed"),
        ("command_max_age = 0.1", "command_max_age = 0.6", "command_max_age"),
        ("delay = 0.03", "delay = nan", "response.delay"),
        ("[limits]", "[limits", "scout.toml"),
    ],
)
def test_faults_in_the_file_are_named(tmp_path, old, new, message):
    text = PARAMS_PATH.read_text()
    assert old in text
    path = tmp_path / "scout.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=message):
        load_scout(path)
