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


class Client:
    """One client, called back. Raises OSError if it is not there or speaks another protocol."""

    def __init__(self, host, port):
        self.socket, self._names = socket.create_connection((host, port), 1.0), []
        self.socket.settimeout(2.0)
        self.socket.sendall(COOKIE)
        if self.socket.recv(24, socket.MSG_WAITALL)[:11] != COOKIE[:11]:
            self.socket.close()
            raise ConnectionError("no cookie of VRPN")
        self.socket.sendall(message(TYPE, 0, text(POSE)))

    def send_poses(self, bodies):
        data = b""
        for name, (position, quaternion) in bodies.items():
            if name not in self._names:
                self._names.append(name)
                data += message(SENDER, self._names.index(name), text(name))
            payload = struct.pack(">ii7d", 0, 0, *position, *quaternion)
            data += message(0, self._names.index(name), payload)
        self.socket.sendall(data)


class VrpnServer:
    """`bodies`: name -> (position, quaternion x, y, z, w), sent whenever `send_poses` is called."""

    def __init__(self):
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind(("127.0.0.1", 0))
        self._udp.settimeout(0.05)
        self.port = self._udp.getsockname()[1]
        self._clients, self._ended = [], threading.Event()
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
                self._clients.append(Client(host.decode(), int(port)))
            except OSError:  # it left before it was called back, or asked twice
                continue

    def send_poses(self, bodies):
        """Send one pose of each body to every client."""
        for client in tuple(self._clients):
            try:
                client.send_poses(bodies)
            except OSError:  # it has left
                self._clients.remove(client)

    def drop_clients(self):
        """The cable is pulled."""
        for client in self._clients:
            client.socket.close()
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
