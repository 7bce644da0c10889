"""Files and logs: what a client may list, read and check, and what is refused."""

import json
import lzma
import struct

import pytest

from tests.unit.vehicle.px4.sim.client import Rig
from vehicle.px4.sim.services.files import GENERAL, PARAMETERS, crc
from vehicle.px4.sim.services.ftp import Error, Op

HEAD = struct.Struct("<HBBBBBxI")


@pytest.fixture(scope="module")
def rig():
    return Rig()


class Answer:
    def __init__(self, fields):
        payload = bytes(fields.payload)
        self.sequence, _, self.opcode, size, _, self.complete, _ = HEAD.unpack_from(payload)
        self.data = payload[HEAD.size : HEAD.size + size]
        self.to = fields.target_system, fields.target_component


def ask(rig, opcode, data=b"", offset=0, session=0, sequence=7, size=None, ms=40):
    rig.log.clear()
    head = HEAD.pack(sequence, session, opcode, len(data) if size is None else size, 0, 0, offset)
    rig.send("FILE_TRANSFER_PROTOCOL", 0, 1, 1, (head + data).ljust(251, b"\0"))
    rig.run(ms)
    return [Answer(fields) for fields in rig.of("FILE_TRANSFER_PROTOCOL")]


def refused(answers, why):
    (answer,) = answers
    return answer.opcode == Op.NAK and answer.data == bytes((why,))


def test_folders_list_what_is_in_them(rig):
    listed = [ask(rig, Op.LIST, path)[0].data for path in (b"/", b"etc", b"/etc/extras\0")]
    assert listed[:2] == [b"Detc\0", b"Dextras\0"]
    files = [entry.split(b"\t")[0] for entry in listed[2].split(b"\0")[:-1]]
    assert files == [b"Fcomponent_general.json.xz", b"Fparameters.json.xz"]
    assert refused(ask(rig, Op.LIST, b"/etc/extras", offset=2), Error.EOF)
    assert refused(ask(rig, Op.LIST, b"/none"), Error.NOT_FOUND)


def test_file_is_read_in_a_burst_and_in_pieces_and_its_checksum_is_that_of_the_metadata(rig):
    ask(rig, Op.RESET)
    opened = ask(rig, Op.OPEN_READ, f"/{PARAMETERS}".encode())[0]
    size = int.from_bytes(opened.data, "little")
    assert (opened.opcode, opened.sequence, opened.to) == (Op.ACK, 8, (245, 190))
    content, sequence = b"", 8
    while len(content) < size:
        burst = ask(rig, Op.BURST, offset=len(content), sequence=sequence, ms=200)
        assert [a.sequence for a in burst] == list(range(sequence + 1, sequence + 1 + len(burst)))
        assert [a.complete for a in burst] == [0] * (len(burst) - 1) + [1]
        content, sequence = content + b"".join(a.data for a in burst), burst[-1].sequence
    assert ask(rig, Op.READ, offset=239)[0].data == content[239:478]
    assert refused(ask(rig, Op.READ, offset=size), Error.EOF)
    assert refused(ask(rig, Op.BURST, offset=size), Error.EOF)
    assert ask(rig, Op.CRC, PARAMETERS.encode())[0].data == crc(content).to_bytes(4, "little")
    described = {one["name"]: one for one in json.loads(lzma.decompress(content))["parameters"]}
    assert described["COM_OF_LOSS_T"] == {"name": "COM_OF_LOSS_T", "type": "Float", "default": 1.0}
    assert described["COM_OBL_RC_ACT"]["type"] == "Int32" and len(described) == 887
    assert ask(rig, Op.TERMINATE)[0].opcode == Op.ACK

    assert rig.ask(512, 397.0) == [0]
    told = rig.of("COMPONENT_METADATA")[-1]
    assert told.uri == f"mftp://{GENERAL}"
    ask(rig, Op.OPEN_READ, GENERAL.encode())
    general = ask(rig, Op.READ)[0].data
    assert told.file_crc == crc(general)
    assert json.loads(lzma.decompress(general))["metadataTypes"][0]["fileCrc"] == crc(content)


def test_checksum_begins_with_nothing_and_is_not_inverted():
    assert (crc(b""), crc(b"\0\0"), crc(b"123456789")) == (0, 0, 0x2DFD2D88)


@pytest.mark.parametrize(
    "opcode", [Op.CREATE, Op.WRITE, Op.REMOVE, Op.MAKE_FOLDER, Op.REMOVE_FOLDER, Op.OPEN_WRITE, Op.TRUNCATE, Op.RENAME]
)
def test_files_cannot_be_changed(rig, opcode):
    assert refused(ask(rig, opcode, b"/etc/extras/mine"), Error.PROTECTED)


def test_malformed_requests_are_refused(rig):
    ask(rig, Op.RESET)
    assert refused(ask(rig, Op.LIST, b"/", size=240), Error.SIZE)
    assert refused(ask(rig, 99), Error.UNKNOWN)
    for opcode in (Op.READ, Op.BURST, Op.TERMINATE):
        assert refused(ask(rig, opcode), Error.SESSION)
    assert refused(ask(rig, Op.OPEN_READ, b"\xff\xfe"), Error.NOT_FOUND)
    ask(rig, Op.OPEN_READ, GENERAL.encode())
    assert refused(ask(rig, Op.OPEN_READ, GENERAL.encode()), Error.NO_SESSIONS)
    assert refused(ask(rig, Op.READ, session=1), Error.SESSION)


def test_there_are_no_logs(rig):
    rig.log.clear()
    rig.send("LOG_REQUEST_LIST", 1, 1, 0, 0xFFFF)
    rig.run(12)
    assert [(m.id, m.num_logs, m.last_log_num, m.size) for m in rig.of("LOG_ENTRY")] == [(0, 0, 0, 0)]
