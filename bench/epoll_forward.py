"""epoll_forward PORT TARGET: a forwarder without an event loop, the limit for Python itself.

Per message one epoll_wait, one read, one write, as `forward.c`; it records nothing. Ends when its
standard input closes.
"""

import os
import select
import socket
import sys


def main(port: int, target: int) -> None:
    """Forward until standard input closes."""
    listener = socket.create_server(("127.0.0.1", port))
    peers: dict[int, int] = {}
    sockets: dict[int, socket.socket] = {}
    epoll = select.epoll()
    epoll.register(sys.stdin.fileno(), select.EPOLLIN)
    epoll.register(listener.fileno(), select.EPOLLIN)
    poll, read, write = epoll.poll, os.read, os.write
    while True:
        for descriptor, _ in poll():
            peer = peers.get(descriptor)
            if peer is not None:
                if data := read(descriptor, 65536):
                    write(peer, data)
                else:
                    for end in (descriptor, peer):
                        epoll.unregister(end)
                        sockets.pop(end).close()
                        del peers[end]
            elif descriptor == listener.fileno():
                client, _ = listener.accept()
                upstream = socket.create_connection(("127.0.0.1", target))
                for one, other in ((client, upstream), (upstream, client)):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    sockets[one.fileno()], peers[one.fileno()] = one, other.fileno()
                    epoll.register(one.fileno(), select.EPOLLIN)
            elif descriptor == sys.stdin.fileno():
                return


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
