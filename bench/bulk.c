/* bulk TIMES PIECES PORT...: sends pieces of files as fast as possible, and prints the rate.
 *
 * TIMES over, the ports have their turns: a new connection, so many pieces, and the answer that
 * comes when all of them have arrived. Prints a JSON array of each port's bytes a second. */
#include "clock.h"
#include "exchange.h"
#include "loopback.h"

enum { MOST_PORTS = 8, MOST_PIECES = 1 << 20 };

static uint64_t send_all(const char *port, const char *data, size_t size)
{
    char reply[64];
    int fd = connect_to(port);
    uint64_t begun_ns = now_ns();
    for (size_t sent = 0; sent < size;) {
        ssize_t more = send(fd, data + sent, size - sent, MSG_NOSIGNAL);
        must(more > 0, "send");
        sent += (size_t)more;
    }
    must(read(fd, reply, sizeof reply) == (ssize_t)LOGIN.reply_bytes &&
             !memcmp(reply, LOGIN.reply, LOGIN.reply_bytes),
         "a wrong reply");
    uint64_t took_ns = now_ns() - begun_ns;
    close(fd);
    return took_ns;
}

int main(int count, char **arguments)
{
    int ports = count - 3, times = ports > 0 ? atoi(arguments[1]) : 0;
    int pieces = ports > 0 ? atoi(arguments[2]) : 0;
    uint64_t took_ns[MOST_PORTS] = {0};
    if (ports > MOST_PORTS || times < 1 || times > 1000 || pieces < 1 || pieces > MOST_PIECES) {
        fprintf(stderr, "usage: bulk TIMES PIECES PORT...\n");
        return 2;
    }
    uint64_t size = (uint64_t)pieces * PIECE_BYTES;
    char *data = calloc(1, size);
    must(data != NULL, "calloc");
    for (int i = 0; i < pieces; i++) {
        char *piece = data + (size_t)i * PIECE_BYTES;
        piece[0] = (char)0xAA, piece[1] = PIECE_OPCODE, piece[2] = (char)0xFF;
        memcpy(piece + 3, &size, sizeof size);
        piece[PIECE_BYTES - 1] = (char)0xCC;
    }
    for (int i = 0; i < times * ports; i++)
        took_ns[i % ports] += send_all(arguments[3 + i % ports], data, size);
    for (int i = 0; i < ports; i++)
        printf("%s%.0f", i ? ", " : "[", (double)size * times / ((double)took_ns[i] / 1e9));
    printf("]\n");
}
