"""Signed frames: equal to pymavlink's, accepted once, refused."""

import pytest

from tests.unit.vehicle.px4.driver.driver_bench import Bench
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES, Packer, Parser
from vehicle.px4.driver.signing import Signer
from vehicle.px4.driver.types import Signing

SECOND = 1_000_000_000


KEY = bytes(range(32))
SIGNING = Signing(KEY, epoch_ns=1_790_000_000 * SECOND, link_id=3)
MESSAGE = MESSAGES["PING"]


def pymavlink_signer():
    mav = px4.mavlink.MAVLink(None, srcSystem=245, srcComponent=190)
    mav.signing.secret_key, mav.signing.link_id, mav.signing.sign_outgoing = KEY, 3, True
    mav.signing.timestamp = (SIGNING.epoch_ns + 7 * SECOND - 1_420_070_400 * SECOND) // 10_000
    return mav


def test_signed_frames_equal_pymavlink_s():
    theirs, ours, signer = pymavlink_signer(), Packer(245, 190), Signer(SIGNING)
    for i in range(5):
        expected = bytes(px4.mavlink.MAVLink_ping_message(5 + i, 6, 0, 0).pack(theirs))
        theirs.seq += 1
        assert signer.sign(ours.pack(MESSAGE, 5 + i, 6, 0, 0), MESSAGE.crc_extra, 7 * SECOND) == expected


def test_pymavlink_accepts_signed_frames_and_refuses_a_replay():
    mav, signer = pymavlink_signer(), Signer(SIGNING)
    frame = signer.sign(Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0), MESSAGE.crc_extra, 7 * SECOND)
    assert [m.get_type() for m in mav.parse_buffer(frame) or []] == ["PING"]
    assert mav.signing.goodsig_count == 1
    with pytest.raises(px4.mavlink.MAVError, match="signature"):
        mav.parse_buffer(frame)


def signed(stamp_ns=7 * SECOND, key=KEY):
    signer = Signer(Signing(key, epoch_ns=SIGNING.epoch_ns))
    return signer.sign(Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0), MESSAGE.crc_extra, stamp_ns)


def frames(data):
    return Parser().feed(data)


def test_validly_signed_frames_are_accepted_once():
    signer, (frame,) = Signer(SIGNING), frames(signed())
    assert signer.accepts(frame, 7 * SECOND)
    assert not signer.accepts(frame, 7 * SECOND), "the same frame again is a replay"
    (later,) = frames(signed(8 * SECOND))
    assert signer.accepts(later, 8 * SECOND)
    assert signer.refused == 1


@pytest.mark.parametrize(
    "data",
    [
        signed(key=bytes(range(1, 33))),
        signed()[:-1] + bytes((signed()[-1] ^ 1,)),
        signed(stamp_ns=-90 * SECOND),  # recorded long ago
        Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0),
    ],
    ids=["other key", "changed", "old", "unsigned"],
)
def test_invalidly_signed_frames_are_refused(data):
    signer, (frame,) = Signer(SIGNING), frames(data)
    assert not signer.accepts(frame, 7 * SECOND)
    assert signer.refused == 1


def test_unsigned_frames_may_be_allowed():
    (frame,) = frames(Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0))
    assert Signer(Signing(KEY, 0, require=False)).accepts(frame, 0)


def test_a_key_has_32_bytes_and_is_not_printed():
    with pytest.raises(ValueError, match="32 bytes"):
        Signing(b"short", 0)
    assert KEY.hex() not in repr(SIGNING) and "\\x1f" not in repr(SIGNING)


def test_a_driver_that_demands_signatures_does_not_fly_with_an_unsigned_px4():
    bench = Bench(signing=SIGNING)
    bench.run(6.0)
    assert bench.link.phase == "connect"
    assert bench.link.counters["unsigned_frames"] > 100
    assert all(frame[2] == 1 for frame in bench.uplink)


def test_signed_commands_to_a_px4_that_does_not_sign():
    bench = Bench(signing=Signing(KEY, SIGNING.epoch_ns, require=False)).to("arm")
    assert all(frame[2] == 1 for frame in bench.uplink)
