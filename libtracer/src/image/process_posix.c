/* Processes, sockets and shared memory of POSIX and Linux: see process.h. */
#define _GNU_SOURCE /* memfd_create, dladdr */
#include "image/process.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/process_launch.h"

/* For the launcher to tell how a process ended: it only has to kill and reap. */
#define END_SECONDS 5.0
/* For the launcher to be gone after it was killed: longer only if it is in the midst of a read from
 * a disk that does not answer. Then it is left to the system. */
#define REAP_SECONDS 1.0
#define REAP_NAP_SECONDS 0.001

struct trc_launcher {
    atomic_uint refs; /* one of whoever started it, one of each process */
    pthread_mutex_t lock;
    pid_t pid;
    int stream;
    atomic_bool is_sound;
};

struct trc_process {
    struct trc_launcher *launcher; /* held */
    int64_t number;
    int stream;
    void *shared;
    size_t shared_bytes;
};

static void close_descriptor(int descriptor) {
    if (descriptor >= 0)
        close(descriptor);
}

/* ---- streams ---- */

/* Ends wherever a host that has closed its standard streams would take it for one of them. */
static int above_standard(int descriptor) {
    if (descriptor < 0 || descriptor > TRC_LAUNCH_DESCRIPTOR)
        return descriptor;
    const int higher = fcntl(descriptor, F_DUPFD_CLOEXEC, TRC_LAUNCH_DESCRIPTOR + 1);
    close(descriptor);
    return higher;
}

static bool create_streams(int ends[2]) {
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends))
        return false;
    ends[0] = above_standard(ends[0]);
    ends[1] = above_standard(ends[1]);
    if (ends[0] >= 0 && ends[1] >= 0)
        return true;
    close_descriptor(ends[0]);
    close_descriptor(ends[1]);
    return false;
}

/* Messages are far smaller than a stream's buffer: one that does not go at once never will. */
static bool send_message(int stream, struct msghdr *message, size_t size) {
    ssize_t sent;
    do {
        sent = sendmsg(stream, message, MSG_NOSIGNAL | MSG_DONTWAIT);
    } while (sent < 0 && errno == EINTR);
    return sent >= 0 && (size_t)sent == size;
}

static bool send_bytes(int stream, const void *bytes, size_t size) {
    struct iovec part = {(void *)bytes, size};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    return send_message(stream, &message, size);
}

/* Whether there is something to read, the end included, before the deadline. */
static bool await(int stream, double deadline) {
    for (;;) {
        const double left = deadline - trc_seconds();
        struct pollfd wait = {stream, POLLIN, 0};
        /* Rounded up, or the last part of a millisecond would be spent in turning round. */
        const int found = poll(&wait, 1, left > 0.0 ? (int)ceil(fmin(left, 1e6) * 1e3) : 0);
        if (found > 0)
            return true;
        if (found == 0 && left <= 0.0)
            return false;
        if (found < 0 && errno != EINTR && errno != EAGAIN)
            return true; /* to be seen by reading */
    }
}

static enum trc_received receive_bytes(int stream, void *bytes, size_t size, double seconds) {
    const double deadline = trc_seconds() + seconds;
    size_t count = 0;
    while (count < size) {
        const ssize_t got = recv(stream, (char *)bytes + count, size - count, MSG_DONTWAIT);
        if (got > 0) {
            count += (size_t)got;
        } else if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
            if (!await(stream, deadline))
                return TRC_RECEIVED_LATE;
        } else {
            return TRC_RECEIVED_ENDED;
        }
    }
    return TRC_RECEIVED;
}

/* ---- the launcher ---- */

static void launcher_free(struct trc_launcher *launcher) {
    close_descriptor(launcher->stream);
    pthread_mutex_destroy(&launcher->lock);
    trc_free(launcher);
}

static void launcher_release(struct trc_launcher *launcher) {
    if (atomic_fetch_sub_explicit(&launcher->refs, 1, memory_order_acq_rel) == 1)
        launcher_free(launcher);
}

/* What the child is to differ in from its parent: standard streams that lead nowhere, its end of
 * the stream, no signal blocked, ignored or aimed at the terminal's group. */
static int describe_child(posix_spawn_file_actions_t *actions, posix_spawnattr_t *attributes,
                          int stream) {
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    int error = posix_spawn_file_actions_addopen(actions, STDIN_FILENO, "/dev/null", O_RDWR, 0);
    error = error ? error : posix_spawn_file_actions_adddup2(actions, STDIN_FILENO, STDOUT_FILENO);
    error = error ? error : posix_spawn_file_actions_adddup2(actions, STDIN_FILENO, STDERR_FILENO);
    error =
        error ? error : posix_spawn_file_actions_adddup2(actions, stream, TRC_LAUNCH_DESCRIPTOR);
    error = error ? error : posix_spawnattr_setsigmask(attributes, &none);
    error = error ? error : posix_spawnattr_setsigdefault(attributes, &all);
    error = error ? error : posix_spawnattr_setpgroup(attributes, 0);
    return error ? error
                 : posix_spawnattr_setflags(attributes, POSIX_SPAWN_SETSIGMASK |
                                                            POSIX_SPAWN_SETSIGDEF |
                                                            POSIX_SPAWN_SETPGROUP);
}

static int spawn(const char *program, const char *script, int stream, pid_t *pid) {
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    int error = posix_spawn_file_actions_init(&actions);
    if (error)
        return error;
    error = posix_spawnattr_init(&attributes);
    if (!error) {
        error = describe_child(&actions, &attributes, stream);
        char *arguments[] = {(char *)program, script ? (char *)"-I" : NULL, (char *)script, NULL};
        if (!error)
            error = posix_spawn(pid, program, &actions, &attributes, arguments, environ);
        posix_spawnattr_destroy(&attributes);
    }
    posix_spawn_file_actions_destroy(&actions);
    return error;
}

trc_status trc_launcher_start(const char *program, const char *script,
                              struct trc_launcher **launcher_out) {
    struct trc_launcher *launcher = trc_alloc_zeroed(1, sizeof *launcher);
    if (!launcher || pthread_mutex_init(&launcher->lock, NULL)) {
        trc_free(launcher);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to start %s", program);
    }
    int ends[2] = {-1, -1};
    int error = trc_memory_should_fail() || !create_streams(ends) ? ENOMEM : 0;
    if (!error)
        error = spawn(program, script, ends[1], &launcher->pid);
    close_descriptor(ends[1]);
    launcher->stream = ends[0];
    atomic_init(&launcher->refs, 1);
    atomic_init(&launcher->is_sound, true);
    if (error) {
        launcher_free(launcher);
        const bool is_memory = error == ENOMEM || error == EAGAIN;
        return trc_fail(is_memory ? TRC_ERROR_OUT_OF_MEMORY : TRC_ERROR_UNSUPPORTED,
                        "%s cannot be started: %s", program, strerror(error));
    }
    *launcher_out = launcher;
    return TRC_OK;
}

bool trc_launcher_is_sound(const struct trc_launcher *launcher) {
    return atomic_load(&launcher->is_sound);
}

/* A number that is not of a living child of ours is not killed: the host may have reaped it, and
 * the system may have given it to another process. */
void trc_launcher_end(struct trc_launcher *launcher) {
    atomic_store(&launcher->is_sound, false);
    shutdown(launcher->stream, SHUT_RDWR);
    pid_t gone = waitpid(launcher->pid, NULL, WNOHANG);
    if (gone == 0)
        kill(launcher->pid, SIGKILL);
    const double deadline = trc_seconds() + REAP_SECONDS;
    while (gone == 0 || (gone < 0 && errno == EINTR)) {
        gone = waitpid(launcher->pid, NULL, WNOHANG);
        if (gone != 0)
            continue;
        if (trc_seconds() > deadline)
            break;
        const struct timespec nap = {0, (long)(REAP_NAP_SECONDS * 1e9)};
        nanosleep(&nap, NULL);
    }
    launcher_release(launcher);
}

/* Sends a request, with two descriptors or NULL, and receives what the launcher answers. NULL, or
 * why there is no answer: the launcher is not sound then, as what it says later would be taken for
 * another answer. */
static const char *ask_launcher(struct trc_launcher *launcher,
                                const struct trc_launch_request *request, const int *descriptors,
                                double seconds, struct trc_launch_answer *answer) {
    struct iovec part = {(void *)request, sizeof *request};
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(2 * sizeof(int))];
    } control;
    memset(&control, 0, sizeof control);
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    if (descriptors) {
        message.msg_control = control.bytes;
        message.msg_controllen = sizeof control.bytes;
        control.header.cmsg_level = SOL_SOCKET;
        control.header.cmsg_type = SCM_RIGHTS;
        control.header.cmsg_len = CMSG_LEN(2 * sizeof(int));
        memcpy(CMSG_DATA(&control.header), descriptors, 2 * sizeof(int));
    }
    pthread_mutex_lock(&launcher->lock);
    enum trc_received received = TRC_RECEIVED_ENDED;
    if (trc_launcher_is_sound(launcher) &&
        send_message(launcher->stream, &message, sizeof *request))
        received = receive_bytes(launcher->stream, answer, sizeof *answer, seconds);
    const char *reason = received == TRC_RECEIVED_ENDED      ? "it has ended"
                         : received == TRC_RECEIVED_LATE     ? "it does not answer"
                         : answer->magic != TRC_LAUNCH_MAGIC ? "it answers nonsense"
                                                             : NULL;
    if (reason)
        atomic_store(&launcher->is_sound, false);
    pthread_mutex_unlock(&launcher->lock);
    return reason;
}

/* ---- processes ---- */

/* Memory that is there, so that no access to it can fail, and that the process cannot take away. */
static int create_shared(size_t bytes) {
    const int block = above_standard(memfd_create("image", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (block < 0)
        return -1;
    int error;
    do {
        error = posix_fallocate(block, 0, (off_t)bytes);
    } while (error == EINTR);
    if (error || fcntl(block, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL)) {
        close(block);
        return -1;
    }
    return block;
}

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a process that reads images");
}

/* The two descriptors that a process gets, and the library's own end. */
struct ends {
    int own, given[2]; /* stream; stream, block */
};

static void close_ends(struct ends *ends) {
    close_descriptor(ends->own);
    close_descriptor(ends->given[0]);
    close_descriptor(ends->given[1]);
}

static bool create_ends(size_t shared_bytes, struct ends *ends, void **shared_out) {
    *ends = (struct ends){-1, {-1, -1}};
    int streams[2];
    if (trc_memory_should_fail() || !create_streams(streams))
        return false;
    ends->own = streams[0];
    ends->given[0] = streams[1];
    ends->given[1] = create_shared(shared_bytes);
    void *shared = MAP_FAILED;
    if (ends->given[1] >= 0)
        shared = mmap(NULL, shared_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, ends->given[1], 0);
    if (shared == MAP_FAILED) {
        close_ends(ends);
        return false;
    }
    *shared_out = shared;
    return true;
}

trc_status trc_process_create(struct trc_launcher *launcher, size_t shared_bytes, double seconds,
                              struct trc_process **process_out) {
    struct trc_process *process = trc_alloc_zeroed(1, sizeof *process);
    struct ends ends;
    if (!process || !create_ends(shared_bytes, &ends, &process->shared)) {
        trc_free(process);
        return no_memory();
    }
    const struct trc_launch_request request = {
        .magic = TRC_LAUNCH_MAGIC, .kind = TRC_LAUNCH_CREATE, .shared_bytes = shared_bytes};
    struct trc_launch_answer answer = {.error = 0};
    const char *reason = ask_launcher(launcher, &request, ends.given, seconds, &answer);
    if (reason || answer.error) {
        munmap(process->shared, shared_bytes);
        close_ends(&ends);
        trc_free(process);
        return reason ? trc_fail(TRC_ERROR_UNSUPPORTED, "%s", reason) : no_memory();
    }
    close_descriptor(ends.given[0]);
    close_descriptor(ends.given[1]);
    atomic_fetch_add_explicit(&launcher->refs, 1, memory_order_relaxed);
    process->launcher = launcher;
    process->number = answer.process;
    process->stream = ends.own;
    process->shared_bytes = shared_bytes;
    *process_out = process;
    return TRC_OK;
}

struct trc_process_exit trc_process_destroy(struct trc_process *process) {
    const struct trc_launch_request request = {
        .magic = TRC_LAUNCH_MAGIC, .kind = TRC_LAUNCH_END, .process = process->number};
    struct trc_launch_answer answer;
    struct trc_process_exit exit = {.is_known = false};
    close_descriptor(process->stream);
    if (!ask_launcher(process->launcher, &request, NULL, END_SECONDS, &answer) && !answer.error) {
        exit.is_known = answer.exit_signal != SIGKILL;
        exit.signal = answer.exit_signal;
        exit.code = answer.exit_code;
    }
    munmap(process->shared, process->shared_bytes);
    launcher_release(process->launcher);
    trc_free(process);
    return exit;
}

void *trc_process_shared(const struct trc_process *process) { return process->shared; }

bool trc_process_send(struct trc_process *process, const void *bytes, size_t size) {
    return send_bytes(process->stream, bytes, size);
}

enum trc_received trc_process_receive(struct trc_process *process, void *bytes, size_t size,
                                      double seconds) {
    return receive_bytes(process->stream, bytes, size, seconds);
}

void trc_process_limit_memory(struct trc_process *process, uint64_t bytes) {
    (void)process, (void)bytes;
}

bool trc_process_is_idle(const struct trc_process *process) {
    char byte;
    const ssize_t got = recv(process->stream, &byte, 1, MSG_DONTWAIT | MSG_PEEK);
    return got < 0 && (errno == EAGAIN || errno == EINTR);
}

/* ---- files ---- */

static trc_status fail_file(const char *path, const char *reason) {
    return trc_fail(TRC_ERROR_IMAGE, "cannot read the image %s: %s", path, reason);
}

/* A path that does not depend on the folder that a process is in; NULL without memory. */
static char *absolute_path(const char *path) {
    char folder[4096] = "";
    if (path[0] != '/' && !getcwd(folder, sizeof folder))
        folder[0] = '\0';
    const size_t bytes = strlen(folder) + 1 + strlen(path) + 1;
    char *absolute = trc_alloc(bytes, 1);
    if (absolute)
        (void)snprintf(absolute, bytes, "%s%s%s", folder, folder[0] ? "/" : "", path);
    return absolute;
}

trc_status trc_file_look(const char *path, char **absolute_out, uint64_t *bytes_out) {
    struct stat found;
    if (stat(path, &found))
        return fail_file(path, strerror(errno));
    /* A pipe or a device may never end. */
    if (!S_ISREG(found.st_mode))
        return fail_file(path, "it is not a file");
    if (access(path, R_OK))
        return fail_file(path, strerror(errno));
    *absolute_out = absolute_path(path);
    if (!*absolute_out)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a path");
    *bytes_out = (uint64_t)found.st_size;
    return TRC_OK;
}

char *trc_file_beside_library(const char *name) {
    Dl_info info;
    if (!dladdr((void *)(uintptr_t)&trc_file_beside_library, &info) || !info.dli_fname)
        return NULL;
    const char *slash = strrchr(info.dli_fname, '/');
    const size_t folder = slash ? (size_t)(slash + 1 - info.dli_fname) : 0;
    const size_t bytes = folder + strlen(name) + 1;
    char *relative = trc_alloc(bytes, 1);
    if (!relative)
        return NULL;
    (void)snprintf(relative, bytes, "%.*s%s", (int)folder, info.dli_fname, name);
    char *absolute = absolute_path(relative);
    trc_free(relative);
    return absolute;
}

uint64_t trc_memory_available(void) {
    FILE *file = fopen("/proc/meminfo", "re");
    if (!file)
        return UINT64_MAX;
    char line[128];
    uint64_t kibibytes = UINT64_MAX >> 10;
    while (fgets(line, sizeof line, file))
        if (sscanf(line, "MemAvailable: %" SCNu64, &kibibytes) == 1)
            break;
    (void)fclose(file);
    return kibibytes << 10;
}
