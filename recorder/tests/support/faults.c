/* Faults of the system for the processes of a recorder; loaded with LD_PRELOAD.

   The test changes a shared file, which is mapped here: FAULTS_CONTROL. Writes fail only to files in
   the folder FAULTS_FOLDER. Times of files are those of the kernel: its clock is not changed. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

struct faults {
    int64_t clock_offset_ns, write_errno, sync_errno, delay_us;
};

static const struct faults none;
static const volatile struct faults *faults = &none;
static const char *folder;

__attribute__((constructor)) static void load(void) {
    const char *path = getenv("FAULTS_CONTROL");
    int descriptor = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    folder = getenv("FAULTS_FOLDER");
    if (descriptor < 0 || !folder) return;
    void *shared = mmap(NULL, sizeof none, PROT_READ, MAP_SHARED, descriptor, 0);
    if (shared != MAP_FAILED) faults = shared;
    close(descriptor);
}

/* Delay the operation on a file in the folder; return whether it fails. */
static int fails(int descriptor, int64_t number) {
    char link[64], path[4096];
    if (!number && !faults->delay_us) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t size = readlink(link, path, sizeof path - 1);
    if (size < 0) return 0;
    path[size] = 0;
    if (strncmp(path, folder, strlen(folder))) return 0;
    if (faults->delay_us) usleep(faults->delay_us);
    errno = number;
    return number != 0;
}

#define REAL(name) \
    static __typeof__(name) *real; \
    if (!real) real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

ssize_t write(int descriptor, const void *data, size_t size) {
    REAL(write);
    return fails(descriptor, faults->write_errno) ? -1 : real(descriptor, data, size);
}

ssize_t writev(int descriptor, const struct iovec *parts, int count) {
    REAL(writev);
    return fails(descriptor, faults->write_errno) ? -1 : real(descriptor, parts, count);
}

int fsync(int descriptor) {
    REAL(fsync);
    return fails(descriptor, faults->sync_errno) ? -1 : real(descriptor);
}

int fdatasync(int descriptor) {
    REAL(fdatasync);
    return fails(descriptor, faults->sync_errno) ? -1 : real(descriptor);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    REAL(clock_gettime);
    int result = real(clock, now);
    if (!result && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
        int64_t now_ns = now->tv_sec * INT64_C(1000000000) + now->tv_nsec + faults->clock_offset_ns;
        now->tv_sec = now_ns / 1000000000;
        now->tv_nsec = now_ns % 1000000000;
    }
    return result;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    (void)zone;
    struct timespec found;
    int result = clock_gettime(CLOCK_REALTIME, &found);
    now->tv_sec = found.tv_sec;
    now->tv_usec = found.tv_nsec / 1000;
    return result;
}

time_t time(time_t *result) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (result) *result = now.tv_sec;
    return now.tv_sec;
}
