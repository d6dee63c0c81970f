/* forward PORT TARGET: a bare forwarder, the limit for anything that relays in user space.
 *
 * Per message one epoll_wait, one read, one write, and nothing else: it records nothing, and a
 * socket that takes nothing stops it. Half-closes are passed on. */
#include "loopback.h"

static const char *target;
static int peers[MOST_SOCKETS];
static char finished[MOST_SOCKETS];

static void accepted(int epoll, int client)
{
    int upstream = connect_to(target);
    peers[client] = upstream;
    peers[upstream] = client;
    finished[client] = finished[upstream] = 0;
    watch(epoll, client);
    watch(epoll, upstream);
}

static void readable(int epoll, int fd)
{
    static char buffer[65536];
    int peer = peers[fd];
    ssize_t size = read(fd, buffer, sizeof buffer);
    for (ssize_t sent = 0, more; sent < size; sent += more)
        if ((more = send(peer, buffer + sent, (size_t)(size - sent), MSG_NOSIGNAL)) < 0)
            size = 0;
    if (size > 0)
        return;
    must(!epoll_ctl(epoll, EPOLL_CTL_DEL, fd, NULL), "epoll_ctl");
    shutdown(peer, SHUT_WR);
    finished[fd] = 1;
    if (finished[peer]) {
        close(fd);
        close(peer);
    }
}

int main(int count, char **arguments)
{
    if (count != 3) {
        fprintf(stderr, "usage: forward PORT TARGET\n");
        return 2;
    }
    target = arguments[2];
    serve(arguments[1], accepted, readable);
}
