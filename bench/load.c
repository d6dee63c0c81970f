/* load CONNECTIONS SECONDS PORT...: sends requests as fast as replies arrive, and prints the times.
 *
 * The ports have their turns in short slices, so that whatever else the machine does meets all of
 * them; each gets SECONDS in all. Each connection logs in, and has one status request under way
 * while it is its port's turn. Every answer is compared byte for byte. Prints a JSON array of one
 * object a port; round trips of a slice's first moments are counted and not measured. */
#include "clock.h"
#include "exchange.h"
#include "loopback.h"

enum { MOST_CONNECTIONS = 256, MOST_PORTS = 8, MOST_SAMPLES = 1 << 24, SILENCE_MS = 10000 };
static const uint64_t SLICE_NS = 100000000, WARM_UP_NS = 10000000;

struct target {
    int epoll, sockets[MOST_CONNECTIONS];
    uint64_t exchanges, measured;
    uint32_t *samples_ns;
};

static void ask(int fd, const struct exchange *what)
{
    ssize_t size = send(fd, what->request, what->request_bytes, MSG_NOSIGNAL);
    must(size == (ssize_t)what->request_bytes, "send");
}

static void take(int fd, const struct exchange *what)
{
    char reply[64];
    ssize_t size = read(fd, reply, sizeof reply);
    must(size == (ssize_t)what->reply_bytes && !memcmp(reply, what->reply, (size_t)size),
         "a wrong reply");
}

static void open_target(struct target *target, const char *port, int connections)
{
    target->epoll = epoll_create1(0);
    must((target->samples_ns = calloc(MOST_SAMPLES, sizeof(uint32_t))) != NULL, "calloc");
    for (int i = 0; i < connections; i++) {
        int fd = target->sockets[i] = connect_to(port);
        ask(fd, &LOGIN);
        take(fd, &LOGIN);
        target->exchanges++;
        watch(target->epoll, fd);
    }
}

static void run_slice(struct target *target, int connections)
{
    static uint64_t begun_ns[MOST_SOCKETS];
    struct epoll_event events[MOST_EVENTS];
    uint64_t start_ns = now_ns() + WARM_UP_NS, stop_ns = now_ns() + SLICE_NS;
    for (int i = 0; i < connections; i++) {
        begun_ns[target->sockets[i]] = now_ns();
        ask(target->sockets[i], &STATUS);
    }
    for (int open = connections; open;) {
        int ready = epoll_wait(target->epoll, events, MOST_EVENTS, SILENCE_MS);
        must(ready > 0, "no reply");
        for (int i = 0; i < ready; i++) {
            int fd = events[i].data.fd;
            take(fd, &STATUS);
            uint64_t now = now_ns(), took_ns = now - begun_ns[fd];
            target->exchanges++;
            if (begun_ns[fd] >= start_ns && now < stop_ns && target->measured < MOST_SAMPLES)
                target->samples_ns[target->measured++] =
                    took_ns < UINT32_MAX ? (uint32_t)took_ns : UINT32_MAX;
            begun_ns[fd] = now;
            if (now < stop_ns)
                ask(fd, &STATUS);
            else
                open--;
        }
    }
}

static int by_size(const void *one, const void *other)
{
    uint32_t a = *(const uint32_t *)one, b = *(const uint32_t *)other;
    return (a > b) - (a < b);
}

static void tell(struct target *target, double seconds)
{
    uint64_t count = target->measured;
    must(count > 0, "no exchange measured");
    qsort(target->samples_ns, count, sizeof *target->samples_ns, by_size);
    printf("{\"exchanges\": %llu, \"rate\": %.0f, \"p50_ns\": %u, \"p99_ns\": %u}",
           (unsigned long long)target->exchanges, (double)count / seconds,
           target->samples_ns[count / 2], target->samples_ns[count - 1 - count / 100]);
}

int main(int count, char **arguments)
{
    static struct target targets[MOST_PORTS];
    int ports = count - 3, connections = ports > 0 ? atoi(arguments[1]) : 0;
    double seconds = ports > 0 ? atof(arguments[2]) : 0;
    if (ports > MOST_PORTS || connections < 1 || connections > MOST_CONNECTIONS ||
        seconds <= 0 || seconds > 3600) {
        fprintf(stderr, "usage: load CONNECTIONS SECONDS PORT...\n");
        return 2;
    }
    for (int i = 0; i < ports; i++)
        open_target(&targets[i], arguments[3 + i], connections);
    int slices = (int)(seconds * 1e9 / SLICE_NS + 0.5);
    for (int slice = 0; slice < slices * ports; slice++)
        run_slice(&targets[slice % ports], connections);
    for (int i = 0; i < ports; i++) {
        for (int j = 0; j < connections; j++)
            close(targets[i].sockets[j]);
        printf(i ? ", " : "[");
        tell(&targets[i], slices * (SLICE_NS - WARM_UP_NS) / 1e9);
    }
    printf("]\n");
}
