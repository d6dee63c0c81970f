/* answer PORT: as little of a controller as a load needs: it accepts any login, and is always idle.
 *
 * Whoever asks waits for the answer, so that one read is one request; anything else ends it. */
#include "exchange.h"
#include "loopback.h"

static void answer(int epoll, int fd)
{
    unsigned char request[64];
    ssize_t size = read(fd, request, sizeof request);
    if (size <= 0) {
        must(!epoll_ctl(epoll, EPOLL_CTL_DEL, fd, NULL), "epoll_ctl");
        close(fd);
        return;
    }
    const struct exchange *asked = size == (ssize_t)STATUS.request_bytes ? &STATUS : &LOGIN;
    must(size == (ssize_t)asked->request_bytes && !memcmp(request, asked->request, (size_t)size),
         "an unknown request");
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
