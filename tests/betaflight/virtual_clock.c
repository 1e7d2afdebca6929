/* Preloaded into the firmware: its clock is virtual, and its ports are shifted.
 *
 * VIRTUAL_CLOCK names a file with three 64-bit numbers: the time until which the firmware may run [ns],
 * written by the airframe, the time that its main thread has reached [ns], and the number of sensor packets that it
 * has received. The main loop of the firmware sleeps between its
 * turns; each sleep advances its clock by the duration of the sleep without waiting, and waits at the limit. Other
 * threads see the limit. PORT_SHIFT is added to every port, so that several firmwares run on one computer.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define READING_NS 1000 /* the firmware waits for its next period by reading the clock in a loop */
#define STATE_SIZE 144 /* of a packet of sensor values */

struct page { volatile uint64_t limit, reached, states; };

static struct page *page(void) {
    static struct page *mapped;
    const char *path = getenv("VIRTUAL_CLOCK");
    if (!mapped && path) {
        int file = open(path, O_RDWR);
        void *found = mmap(NULL, sizeof *mapped, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
        close(file);
        if (found == MAP_FAILED) abort();
        mapped = found;
    }
    return mapped;
}

/* Advance the firmware's clock, at most to the limit. */
static void advance(struct page *shared, uint64_t ns) {
    uint64_t until = shared->reached + ns;
    shared->reached = until < shared->limit ? until : shared->limit;
}

static int in_main_thread(void) { return gettid() == getpid(); }

int clock_gettime(clockid_t clock, struct timespec *out) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    struct page *shared = clock == CLOCK_MONOTONIC ? page() : NULL;
    if (!shared) return real(clock, out);
    if (in_main_thread()) advance(shared, READING_NS);
    uint64_t ns = in_main_thread() ? shared->reached : shared->limit;
    out->tv_sec = ns / 1000000000u;
    out->tv_nsec = ns % 1000000000u;
    return 0;
}

int nanosleep(const struct timespec *wanted, struct timespec *left) {
    static int (*real)(const struct timespec *, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "nanosleep");
    struct page *shared = in_main_thread() ? page() : NULL;
    if (!shared) return real(wanted, left);
    struct timespec brief = {0, 10000};
    while (shared->reached >= shared->limit) real(&brief, NULL);
    advance(shared, wanted->tv_sec * 1000000000u + wanted->tv_nsec);
    return 0;
}

static void shift(struct sockaddr_in *to) {
    const char *by = getenv("PORT_SHIFT");
    if (by) to->sin_port = htons(ntohs(to->sin_port) + atoi(by));
}

int bind(int socket, const struct sockaddr *address, socklen_t length) {
    static int (*real)(int, const struct sockaddr *, socklen_t);
    if (!real) real = dlsym(RTLD_NEXT, "bind");
    if (address->sa_family != AF_INET) return real(socket, address, length);
    struct sockaddr_in to = *(const struct sockaddr_in *)address;
    shift(&to);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return real(socket, (struct sockaddr *)&to, sizeof to);
}

ssize_t sendto(int socket, const void *data, size_t size, int flags, const struct sockaddr *address, socklen_t length) {
    static ssize_t (*real)(int, const void *, size_t, int, const struct sockaddr *, socklen_t);
    if (!real) real = dlsym(RTLD_NEXT, "sendto");
    if (!address || address->sa_family != AF_INET) return real(socket, data, size, flags, address, length);
    struct sockaddr_in to = *(const struct sockaddr_in *)address;
    shift(&to);
    return real(socket, data, size, flags, (struct sockaddr *)&to, sizeof to);
}

ssize_t recvfrom(int socket, void *data, size_t size, int flags, struct sockaddr *address, socklen_t *length) {
    static ssize_t (*real)(int, void *, size_t, int, struct sockaddr *, socklen_t *);
    if (!real) real = dlsym(RTLD_NEXT, "recvfrom");
    ssize_t received = real(socket, data, size, flags, address, length);
    if (received == STATE_SIZE && page()) page()->states++;
    return received;
}
