"""Repeats the last steps of a case that failed in a certification with scaraspec.

    python3 THIS_FILE HOST[:PORT] [--yes]

SCARASPEC_PASSWORD is the password of the controller, by default "password". Exit status: 0 the
recorded behaviour occurred again, 1 another one occurred, 2 the controller cannot be used.
"""

import os
import socket
import sys

# data begins
CASE = PROBLEM = EXPECTED = OBSERVED = EFFECT = WITH_ALL_STEPS = ""
STEPS: list[tuple[str, str, str, str]] = []
# data ends

PORT = 8877
TIMEOUT_S = 5.0
RESULT_S = 30.0
REST_S = 0.5
TAG = 0x90  # the second byte of a final result
STOP = bytes.fromhex("AA 32 00 CC")
LOGIN = "login, request"


def main() -> int:
    """Repeat the steps, and print what is sent and received."""
    for name in ("CASE", "PROBLEM", "EXPECTED", "OBSERVED", "EFFECT", "WITH_ALL_STEPS"):
        print(f"{name.capitalize().replace('_', ' ')}: {globals()[name]}")
    arguments = [argument for argument in sys.argv[1:] if argument != "--yes"]
    if len(arguments) != 1:
        return refuse("name the controller: HOST or HOST:PORT")
    if "ROBOT" in EFFECT and "--yes" not in sys.argv:
        return refuse(f"{EFFECT} If the area is clear, repeat the command with --yes.")
    target = arguments[0].removeprefix("tcp://")
    host, _, port = target.rpartition(":") if ":" in target else (target, "", str(PORT))
    try:
        again = repeat((host, int(port)))
    except OSError as error:
        return refuse(f"the connection to {host} failed: {error}")
    print("\nThe recorded behaviour occurred again." if again else "\nAnother behaviour occurred.")
    return 0 if again else 1


def refuse(problem: str) -> int:
    """Print why nothing is repeated, and return the exit status."""
    print(problem, file=sys.stderr)
    return 2


def repeat(address: tuple[str, int]) -> bool:
    """Send and receive as recorded; return whether the last message is the recorded one.

    A robot that may be moving is stopped at the end.
    """
    links: dict[str, socket.socket] = {}
    again = True
    try:
        for connection, sender, text, recorded_hex in STEPS:
            if connection not in links:
                links[connection] = socket.create_connection(address, TIMEOUT_S)
                if text != LOGIN:
                    exchange(links[connection], LOGIN, password_frame())
            recorded = password_frame() if text == LOGIN else bytes.fromhex(recorded_hex)
            if sender == "A2C":
                print(f"\n{text}\n  {recorded.hex(' ')}")
                links[connection].sendall(recorded)
            else:
                again = receive(links[connection], text, recorded)
        if sender == "A2C":
            again = receive(links[connection], "no reply was recorded", b"")
    finally:
        if "ROBOT" in EFFECT and links:
            exchange([*links.values()][-1], "emergency_stop, request", STOP)
    return again


def exchange(link: socket.socket, text: str, request: bytes) -> None:
    """Send a request and print its reply."""
    print(f"\n{text}")
    link.sendall(request)
    print(f"  reply {read(link, 5, TIMEOUT_S).hex(' ')}")


def receive(link: socket.socket, text: str, recorded: bytes) -> bool:
    """Receive a message, and return whether it is the recorded one."""
    is_result = recorded[1:2] == bytes([TAG])
    received = read(link, len(recorded) or 1, RESULT_S if is_result else TIMEOUT_S)
    if received != recorded:
        received += read(link, 4096, REST_S)
    print(f"\n{text}\n  recorded {recorded.hex(' ')}\n  received {received.hex(' ') or 'nothing'}")
    return received == recorded


def read(link: socket.socket, size_bytes: int, timeout_s: float) -> bytes:
    """Read until there are this many bytes, or no more come."""
    link.settimeout(timeout_s)
    received = b""
    try:
        while len(received) < size_bytes and (part := link.recv(size_bytes - len(received))):
            received += part
    except TimeoutError:
        pass
    return received


def password_frame() -> bytes:
    """Return the login with the password of this controller."""
    password = os.environ.get("SCARASPEC_PASSWORD", "password").encode()
    return bytes([0xAA, 0x01, len(password)]) + password + bytes([0xCC])


if __name__ == "__main__":
    raise SystemExit(main())
