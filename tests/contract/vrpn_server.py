"""A VRPN server like that of a motion capture system: it names the tracked bodies and streams their poses.

Written from the protocol: a client asks by UDP to be called back over TCP, both send a cookie, then messages follow,
big-endian, padded to eight bytes.
"""

import socket
import struct
import threading

COOKIE = b"vrpn: ver. 07.38  0".ljust(24, b"\0")
SENDER, TYPE = -1, -2
POSE = "vrpn_Tracker Pos_Quat"


class VrpnServer:
    """`bodies`: name -> (position, quaternion x, y, z, w), sent whenever `send_poses` is called."""

    def __init__(self):
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind(("127.0.0.1", 0))
        self._udp.settimeout(0.05)
        self.port = self._udp.getsockname()[1]
        self._clients, self._names, self._ended = [], [], threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    @property
    def clients(self):
        return len(self._clients)

    def _listen(self):
        while not self._ended.is_set():
            try:
                asked, _ = self._udp.recvfrom(2048)
            except TimeoutError:
                continue
            host, port = asked.split(b"\0")[0].split()
            try:
                client = socket.create_connection((host.decode(), int(port)), 1.0)
                client.sendall(COOKIE)
                client.settimeout(2.0)
                assert client.recv(24, socket.MSG_WAITALL)[:11] == COOKIE[:11]
                client.sendall(message(TYPE, 0, text(POSE)))
                self._names = []
                self._clients = [client]
            except OSError:
                continue

    def send_poses(self, bodies):
        """Send one pose of each body."""
        for client in self._clients:
            data = b""
            for name, (position, quaternion) in bodies.items():
                if name not in self._names:
                    self._names.append(name)
                    data += message(SENDER, self._names.index(name), text(name))
                payload = struct.pack(">ii7d", 0, 0, *position, *quaternion)
                data += message(0, self._names.index(name), payload)
            try:
                client.sendall(data)
            except OSError:  # it has left
                self._clients = []

    def drop_clients(self):
        """The cable is pulled."""
        for client in self._clients:
            client.close()
        self._clients = []

    def close(self):
        self._ended.set()
        self._thread.join()
        self.drop_clients()
        self._udp.close()


def text(words):
    raw = words.encode() + b"\0"
    return struct.pack(">i", len(raw)) + raw


def message(kind, sender, payload):
    head = struct.pack(">iiiiii", 24 + len(payload), 1, 0, sender, kind, 0)
    return head + payload.ljust((len(payload) + 7) // 8 * 8, b"\0")
