/* Sockets on 127.0.0.1, for the programs of the forwarding benchmark.
 *
 * Lives here: how they listen, connect, wait and give up. Whoever started a server holds its
 * standard input open; it ends when that closes, and so cannot outlive the benchmark. */
#ifndef LOOPBACK_H
#define LOOPBACK_H

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

enum { MOST_SOCKETS = 4096, MOST_EVENTS = 64 };

static inline void must(int holds, const char *what)
{
    if (!holds) {
        perror(what);
        exit(1);
    }
}

static inline int prompt_socket(int fd)
{
    int on = 1;
    must(fd >= 0 && fd < MOST_SOCKETS, "socket");
    must(!setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on), "TCP_NODELAY");
    return fd;
}

static inline struct sockaddr_in loopback(const char *port)
{
    return (struct sockaddr_in){.sin_family = AF_INET,
                                .sin_port = htons((uint16_t)atoi(port)),
                                .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
}

static inline int listen_on(const char *port)
{
    struct sockaddr_in address = loopback(port);
    int on = 1, fd = socket(AF_INET, SOCK_STREAM, 0);
    must(fd >= 0, "socket");
    must(!setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on), "SO_REUSEADDR");
    must(!bind(fd, (struct sockaddr *)&address, sizeof address), "bind");
    must(!listen(fd, MOST_SOCKETS), "listen");
    return fd;
}

static inline int connect_to(const char *port)
{
    struct sockaddr_in address = loopback(port);
    int fd = prompt_socket(socket(AF_INET, SOCK_STREAM, 0));
    must(!connect(fd, (struct sockaddr *)&address, sizeof address), "connect");
    return fd;
}

static inline void watch(int epoll, int fd)
{
    struct epoll_event event = {.events = EPOLLIN, .data.fd = fd};
    must(!epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event), "epoll_ctl");
}

/* Accepts forever; the caller handles the accepted sockets. */
static inline void serve(const char *port, void (*accepted)(int epoll, int fd),
                         void (*readable)(int epoll, int fd))
{
    struct epoll_event events[MOST_EVENTS];
    int listener = listen_on(port), epoll = epoll_create1(0);
    watch(epoll, STDIN_FILENO);
    watch(epoll, listener);
    for (;;) {
        int count = epoll_wait(epoll, events, MOST_EVENTS, -1);
        for (int i = 0; i < count; i++) {
            int fd = events[i].data.fd;
            if (fd == STDIN_FILENO)
                exit(0);
            if (fd == listener)
                accepted(epoll, prompt_socket(accept(listener, NULL, NULL)));
            else
                readable(epoll, fd);
        }
    }
}

#endif
