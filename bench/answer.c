/* answer PORT: a minimal controller for the load: it accepts any login, and is always idle.
 *
 * Whoever asks waits for the answer, so that one read is one request; anything else ends it. A
 * connection that begins with a piece of a file is a bulk stream: what comes is counted alone, and
 * answered once by the reply to a login, when as many bytes have come as its first eight say. */
#include "exchange.h"
#include "loopback.h"

static uint64_t bulk_bytes[MOST_SOCKETS]; /* number of expected bytes */

static void answer(int epoll, int fd)
{
    static char data[65536];
    const struct exchange *asked;
    ssize_t size = read(fd, data, sizeof data);
    if (size <= 0) {
        must(!epoll_ctl(epoll, EPOLL_CTL_DEL, fd, NULL), "epoll_ctl");
        close(fd);
        bulk_bytes[fd] = 0;
        return;
    }
    if (!bulk_bytes[fd] && size > 3 + 8 && (unsigned char)data[1] == PIECE_OPCODE)
        memcpy(&bulk_bytes[fd], data + 3, sizeof *bulk_bytes);
    if (bulk_bytes[fd]) {
        must((uint64_t)size <= bulk_bytes[fd], "too many bytes");
        if (bulk_bytes[fd] -= (uint64_t)size)
            return;
        asked = &LOGIN;
    } else {
        asked = size == (ssize_t)STATUS.request_bytes ? &STATUS : &LOGIN;
        must(size == (ssize_t)asked->request_bytes && !memcmp(data, asked->request, (size_t)size),
             "an unknown request");
    }
    must(send(fd, asked->reply, asked->reply_bytes, MSG_NOSIGNAL) > 0, "send");
}

int main(int count, char **arguments)
{
    if (count != 2) {
        fprintf(stderr, "usage: answer PORT\n");
        return 2;
    }
    serve(arguments[1], watch, answer);
}
