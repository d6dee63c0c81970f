/* Data of the forwarding benchmark: a login, the polled status, and pieces of files. */
#ifndef EXCHANGE_H
#define EXCHANGE_H

#include <stddef.h>

struct exchange {
    const char *request, *reply;
    size_t request_bytes, reply_bytes;
};

#define EXCHANGE(request, reply) {request, reply, sizeof request - 1, sizeof reply - 1}

static const struct exchange
    LOGIN = EXCHANGE("\xAA\x01\x08" "password" "\xCC", "\xCC\x01\x01" "1" "\xAA"),
    STATUS = EXCHANGE("\xAA\x09\x00\xCC", "\xCC\x09\x02" "00" "\xAA");

/* The largest frame, AA 52 FF, 255 bytes and CC; a bulk stream consists of them. */
enum { PIECE_BYTES = 259, PIECE_OPCODE = 0x52 };

#endif
