/* Processes for the library, made by forking from one that has its libraries loaded: see system.h.
 */
#define _GNU_SOURCE
#include "system.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "image/process_launch.h"

/* Without a request for so long a process ends, and with no process left the program. */
#define IDLE_MILLISECONDS 120000
#define MAX_PROCESSES 256
/* Above the program's own stream. */
#define FIRST_FOREIGN_DESCRIPTOR (TRC_LAUNCH_DESCRIPTOR + 1)
#define DESCRIPTORS_WITHOUT_LIMIT 65536

/* The processes that were made and not yet ended by request. */
static pid_t processes[MAX_PROCESSES];

void system_prepare(void) {
    const struct rlimit none = {0, 0};
    (void)setrlimit(RLIMIT_CORE, &none);
    (void)prctl(PR_SET_DUMPABLE, 0);
    /* One heap for all threads: each takes 64 MB of address space otherwise. */
    (void)mallopt(M_ARENA_MAX, 1);
#ifdef SYS_close_range
    if (syscall(SYS_close_range, FIRST_FOREIGN_DESCRIPTOR, ~0u, 0) == 0)
        return;
#endif
    const long limit = sysconf(_SC_OPEN_MAX);
    for (int i = FIRST_FOREIGN_DESCRIPTOR; i < (limit > 0 ? limit : DESCRIPTORS_WITHOUT_LIMIT); i++)
        close(i);
}

size_t system_count_threads(void) {
    size_t count = 0;
    DIR *tasks = opendir("/proc/self/task");
    if (!tasks)
        return 0;
    for (const struct dirent *entry; (entry = readdir(tasks));)
        count += entry->d_name[0] != '.';
    (void)closedir(tasks);
    return count;
}

/* ---- streams ---- */

static bool receive_all(int stream, void *bytes, size_t size) {
    for (size_t count = 0; count < size;) {
        const ssize_t got = recv(stream, (char *)bytes + count, size - count, 0);
        if (got == 0 || (got < 0 && errno != EINTR))
            return false;
        count += got > 0 ? (size_t)got : 0;
    }
    return true;
}

static bool send_all(int stream, const void *bytes, size_t size) {
    for (size_t count = 0; count < size;) {
        const ssize_t sent = send(stream, (const char *)bytes + count, size - count, MSG_NOSIGNAL);
        if (sent < 0 && errno != EINTR)
            return false;
        count += sent > 0 ? (size_t)sent : 0;
    }
    return true;
}

/* Whether something comes within the time that a process may be idle. */
static bool await_request(int stream) {
    struct pollfd wait = {stream, POLLIN, 0};
    int found;
    do {
        found = poll(&wait, 1, IDLE_MILLISECONDS);
    } while (found < 0 && errno == EINTR);
    return found != 0;
}

bool connection_receive(struct connection *connection, void *bytes, size_t size, bool idle) {
    if (idle && !await_request(connection->stream))
        return false;
    return receive_all(connection->stream, bytes, size);
}

bool connection_send(struct connection *connection, const void *bytes, size_t size) {
    return send_all(connection->stream, bytes, size);
}

/* ---- limits ---- */

/* Sanitizers reserve most of the address space. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RESERVES_ADDRESSES 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define RESERVES_ADDRESSES 1
#endif
#endif

/* Address space of a process before it has read anything, 0 if unknown. */
static uint64_t own;

static uint64_t address_space(void) {
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    if (!file)
        return 0;
    if (fscanf(file, "%lu", &pages) != 1)
        pages = 0;
    (void)fclose(file);
    return (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

void system_limit_memory(uint64_t bytes) {
#ifdef RESERVES_ADDRESSES
    (void)bytes;
#else
    struct rlimit limit;
    if (!own || getrlimit(RLIMIT_AS, &limit))
        return;
    limit.rlim_cur = bytes < RLIM_INFINITY - own ? own + bytes : RLIM_INFINITY;
    if (limit.rlim_cur > limit.rlim_max)
        limit.rlim_cur = limit.rlim_max;
    (void)setrlimit(RLIMIT_AS, &limit);
#endif
}

/* ---- the launcher ---- */

static void close_both(const int descriptors[2]) {
    close(descriptors[0]);
    close(descriptors[1]);
}

/* The next request and the descriptors that come with one to create, else -1. */
static bool receive_request(struct trc_launch_request *request, int descriptors[2]) {
    struct iovec part = {request, sizeof *request};
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(2 * sizeof(int))];
    } control;
    struct msghdr message = {.msg_iov = &part,
                             .msg_iovlen = 1,
                             .msg_control = control.bytes,
                             .msg_controllen = sizeof control.bytes};
    ssize_t got;
    do {
        got = recvmsg(TRC_LAUNCH_DESCRIPTOR, &message, MSG_CMSG_CLOEXEC);
    } while (got < 0 && errno == EINTR);
    descriptors[0] = descriptors[1] = -1;
    const struct cmsghdr *header = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    if (header && header->cmsg_type == SCM_RIGHTS && header->cmsg_len == CMSG_LEN(2 * sizeof(int)))
        memcpy(descriptors, CMSG_DATA(header), 2 * sizeof(int));
    if (got <= 0)
        return false;
    const size_t rest = sizeof *request - (size_t)got;
    return receive_all(TRC_LAUNCH_DESCRIPTOR, (char *)request + got, rest) &&
           request->magic == TRC_LAUNCH_MAGIC;
}

/* In the new process. It ends with the launcher, in whatever it is. */
static _Noreturn void run_process(const int descriptors[2], uint64_t shared_bytes, pid_t launcher,
                                  void (*serve)(struct connection *connection)) {
    close(TRC_LAUNCH_DESCRIPTOR);
    struct connection connection = {.stream = descriptors[0], .shared_bytes = shared_bytes};
    connection.shared =
        mmap(NULL, shared_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptors[1], 0);
    close(descriptors[1]);
    const bool is_ready = connection.shared != MAP_FAILED &&
                          prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && getppid() == launcher;
    own = address_space();
    if (is_ready)
        serve(&connection);
    _exit(is_ready ? EXIT_SUCCESS : EXIT_FAILURE);
}

static struct trc_launch_answer create(const struct trc_launch_request *request,
                                       const int descriptors[2],
                                       void (*serve)(struct connection *connection)) {
    struct trc_launch_answer answer = {.magic = TRC_LAUNCH_MAGIC};
    size_t place = 0;
    while (place < MAX_PROCESSES && processes[place])
        place++;
    const pid_t launcher = getpid();
    const pid_t child = place < MAX_PROCESSES ? fork() : -1;
    if (child == 0)
        run_process(descriptors, request->shared_bytes, launcher, serve);
    close_both(descriptors);
    if (child < 0) {
        answer.error = place < MAX_PROCESSES ? errno : EAGAIN;
        return answer;
    }
    processes[place] = child;
    answer.process = child;
    return answer;
}

static struct trc_launch_answer end(const struct trc_launch_request *request) {
    struct trc_launch_answer answer = {.magic = TRC_LAUNCH_MAGIC, .error = ESRCH};
    for (size_t i = 0; i < MAX_PROCESSES; i++) {
        if (!processes[i] || processes[i] != request->process)
            continue;
        int status = 0;
        (void)kill(processes[i], SIGKILL); /* no more than a formality if it is dead already */
        while (waitpid(processes[i], &status, 0) < 0 && errno == EINTR) {
        }
        processes[i] = 0;
        answer.error = 0;
        answer.exit_signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
        answer.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
    }
    return answer;
}

static bool any_process_lives(void) {
    for (size_t i = 0; i < MAX_PROCESSES; i++) {
        siginfo_t found = {.si_pid = 0};
        if (processes[i] &&
            waitid(P_PID, (id_t)processes[i], &found, WEXITED | WNOHANG | WNOWAIT) == 0 &&
            found.si_pid == 0)
            return true;
    }
    return false;
}

int system_launch(void (*serve)(struct connection *connection)) {
    for (;;) {
        struct trc_launch_request request;
        int descriptors[2];
        if (!await_request(TRC_LAUNCH_DESCRIPTOR)) {
            if (any_process_lives())
                continue;
            return EXIT_SUCCESS;
        }
        if (!receive_request(&request, descriptors))
            return EXIT_SUCCESS;
        const bool creates = request.kind == TRC_LAUNCH_CREATE && descriptors[1] >= 0;
        const struct trc_launch_answer answer =
            creates ? create(&request, descriptors, serve) : end(&request);
        if (!send_all(TRC_LAUNCH_DESCRIPTOR, &answer, sizeof answer))
            return EXIT_SUCCESS;
    }
}
