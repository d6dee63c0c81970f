"""A small controller that shares no code with scaraspec; it serves the login and most queries."""

import socketserver
import sys
import time

VERSION = b"2.7.1"
REPLIES = {
    0x04: b"192.168.1.2|255.255.255.0|192.168.1.1",
    0x08: VERSION,
    0x09: b"00",
    0x0A: b"0",
    0x0B: b"0",
    0x0D: b"",
    0x13: b"",
    0x0F: b"31|30|29|28",
    0x34: b"0|0|0",
    0x37: b"0|0|0|0|0|0",
    0x38: b"250|0|200|0|0|0",
    0x3C: b"10|20|30|0",
    0x42: b"1|00000000",
    0x44: b"1|1.5",
    0x49: b"1|0000000000000000",
}


class Session(socketserver.StreamRequestHandler):
    """One connection."""

    def handle(self) -> None:
        logged_in = False
        while start := self.rfile.read(1):
            if start != b"\xaa":
                continue
            opcode, length = self.rfile.read(2)
            data, end = self.rfile.read(length), self.rfile.read(1)
            if end != b"\xcc":
                continue
            if opcode == 0x01:
                logged_in = data == b"password"
                self.reply(opcode, b"%d" % logged_in)
            elif logged_in and opcode == 0x07:
                self.reply(opcode, time.strftime("%Y%m%d%H%M%S").encode())
            elif logged_in and opcode in REPLIES:
                self.reply(opcode, REPLIES[opcode])

    def reply(self, opcode: int, data: bytes) -> None:
        self.wfile.write(bytes((0xCC, opcode, len(data))) + data + b"\xaa")


class Controller(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True


if __name__ == "__main__":
    Controller(("127.0.0.1", int(sys.argv[1])), Session).serve_forever()
