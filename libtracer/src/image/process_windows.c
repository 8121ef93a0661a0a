/* Windows: see process.h. */
#include "image/process.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#define WIN32_LEAN_AND_MEAN
#define PSAPI_VERSION 2 /* of the system's own library */
#include <windows.h>

#include <psapi.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/process_launch.h"

/* Characters of the longest path that the system knows, the end included. */
#define MAX_LONG_PATH 32768
/* Of programs. */
#define EXTENSION ".exe"
/* Characters of the name of a pipe or a block. */
#define NAME_LENGTH 80
/* The system's buffer of a pipe: some messages. */
#define PIPE_BYTES 65536
/* A list of one attribute takes less. */
#define ATTRIBUTES_BYTES 256
/* The exit code of what was ended by us. */
#define KILLED_CODE 0x564bu
/* For a process whose stream has ended to be gone, so that its exit code is known. */
#define END_MILLISECONDS 200
/* As milliseconds this is a number of 32 bits. */
#define MAX_WAIT_SECONDS 1e6

/* ---- text ---- */

/* UTF-8 as UTF-16, to be freed; NULL without memory or for what is no text. */
static wchar_t *wide_of(const char *text) {
    const int size = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, NULL, 0);
    wchar_t *wide = size > 0 ? trc_alloc((size_t)size, sizeof *wide) : NULL;
    if (wide)
        MultiByteToWideChar(CP_UTF8, 0, text, -1, wide, size);
    return wide;
}

static char *utf8_of(const wchar_t *wide) {
    const int size = WideCharToMultiByte(CP_UTF8, 0, wide, -1, NULL, 0, NULL, NULL);
    char *text = size > 0 ? trc_alloc((size_t)size, 1) : NULL;
    if (text)
        WideCharToMultiByte(CP_UTF8, 0, wide, -1, text, size, NULL, NULL);
    return text;
}

/* ---- streams ---- */

/* A pipe of which reads and writes can be given up. */
struct stream {
    HANDLE pipe;
    HANDLE event; /* of the read or write under way */
};

static void close_handle(HANDLE handle) {
    if (handle && handle != INVALID_HANDLE_VALUE)
        CloseHandle(handle);
}

static void stream_close(struct stream *stream) {
    close_handle(stream->pipe);
    close_handle(stream->event);
}

/* Bytes that were read or written before the time was over; is_lost_out: the stream has ended. */
static DWORD finish(struct stream *stream, OVERLAPPED *under_way, bool has_begun, double seconds,
                    bool *is_lost_out) {
    DWORD bytes = 0;
    *is_lost_out = !has_begun && GetLastError() != ERROR_IO_PENDING;
    if (*is_lost_out)
        return 0;
    /* Rounded up, or the last part of a millisecond would be spent in turning round. */
    const DWORD wait = (DWORD)ceil(fmin(fmax(seconds, 0.0), MAX_WAIT_SECONDS) * 1e3);
    if (!has_begun && WaitForSingleObject(stream->event, wait) != WAIT_OBJECT_0)
        CancelIoEx(stream->pipe, under_way);
    if (!GetOverlappedResult(stream->pipe, under_way, &bytes, TRUE))
        *is_lost_out = GetLastError() != ERROR_OPERATION_ABORTED;
    return bytes;
}

/* Messages are far smaller than a pipe's buffer: one that does not go at once never will. */
static bool send_bytes(struct stream *stream, const void *bytes, size_t size) {
    OVERLAPPED under_way = {.hEvent = stream->event};
    bool is_lost;
    const bool has_begun = WriteFile(stream->pipe, bytes, (DWORD)size, NULL, &under_way);
    return finish(stream, &under_way, has_begun, 0.0, &is_lost) == size && !is_lost;
}

static enum trc_received receive_bytes(struct stream *stream, void *bytes, size_t size,
                                       double seconds) {
    const double deadline = trc_seconds() + seconds;
    for (size_t count = 0; count < size;) {
        OVERLAPPED under_way = {.hEvent = stream->event};
        bool is_lost;
        const bool has_begun =
            ReadFile(stream->pipe, (char *)bytes + count, (DWORD)(size - count), NULL, &under_way);
        const double left = deadline - trc_seconds();
        const DWORD got = finish(stream, &under_way, has_begun, left, &is_lost);
        if (is_lost)
            return TRC_RECEIVED_ENDED;
        count += got;
        if (!got && trc_seconds() >= deadline)
            return TRC_RECEIVED_LATE;
    }
    return TRC_RECEIVED;
}

/* ---- the launcher: what processes are started with ---- */

/* There are no copies of a process here as POSIX's fork makes them: each is started anew. */
struct trc_launcher {
    atomic_uint refs; /* one of whoever started it, one of each process */
    wchar_t *program; /* absolute */
    wchar_t *script;  /* NULL: none */
    HANDLE job;       /* its processes end with it, and it ends with the host */
    atomic_bool is_sound;
};

struct trc_process {
    struct trc_launcher *launcher; /* held */
    HANDLE process;
    HANDLE job; /* inside that of the launcher, for the limit of memory; NULL: there is none */
    uint64_t own_bytes; /* committed at its start */
    struct stream stream;
    HANDLE block;
    void *shared;
};

static void launcher_release(struct trc_launcher *launcher) {
    if (atomic_fetch_sub_explicit(&launcher->refs, 1, memory_order_acq_rel) != 1)
        return;
    close_handle(launcher->job);
    trc_free(launcher->program);
    trc_free(launcher->script);
    trc_free(launcher);
}

static void limit_job(HANDLE job, DWORD flags, uint64_t memory_bytes) {
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION limits = {.ProcessMemoryLimit = (SIZE_T)memory_bytes};
    limits.BasicLimitInformation.LimitFlags = flags;
    SetInformationJobObject(job, JobObjectExtendedLimitInformation, &limits, sizeof limits);
}

static HANDLE create_job(void) {
    const HANDLE job = CreateJobObjectW(NULL, NULL);
    if (job)
        limit_job(job,
                  JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE | JOB_OBJECT_LIMIT_DIE_ON_UNHANDLED_EXCEPTION,
                  0);
    return job;
}

trc_status trc_launcher_start(const char *program, const char *script,
                              struct trc_launcher **launcher_out) {
    struct trc_launcher *launcher = trc_alloc_zeroed(1, sizeof *launcher);
    if (launcher) {
        atomic_init(&launcher->refs, 1);
        atomic_init(&launcher->is_sound, true);
        launcher->program = wide_of(program);
        launcher->script = script ? wide_of(script) : NULL;
        launcher->job = trc_memory_should_fail() ? NULL : create_job();
    }
    if (!launcher || !launcher->program || (script && !launcher->script) || !launcher->job) {
        if (launcher)
            launcher_release(launcher);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to start %s", program);
    }
    const DWORD found = GetFileAttributesW(launcher->program);
    if (found == INVALID_FILE_ATTRIBUTES || (found & FILE_ATTRIBUTE_DIRECTORY)) {
        launcher_release(launcher);
        return trc_fail(TRC_ERROR_UNSUPPORTED, "%s cannot be started: No such file", program);
    }
    *launcher_out = launcher;
    return TRC_OK;
}

bool trc_launcher_is_sound(const struct trc_launcher *launcher) {
    return atomic_load(&launcher->is_sound);
}

void trc_launcher_end(struct trc_launcher *launcher) {
    atomic_store(&launcher->is_sound, false);
    TerminateJobObject(launcher->job, KILLED_CODE);
    launcher_release(launcher);
}

/* ---- processes ---- */

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a process that reads images");
}

/* Of a pipe and a block that no one else has made: processes of this host count. */
static void make_names(wchar_t pipe[NAME_LENGTH], wchar_t block[NAME_LENGTH]) {
    static atomic_uint count;
    LARGE_INTEGER now;
    QueryPerformanceCounter(&now);
    const unsigned number = atomic_fetch_add(&count, 1);
    (void)swprintf(pipe, NAME_LENGTH, L"\\\\.\\pipe\\volley-%lx-%x-%llx", GetCurrentProcessId(),
                   number, now.QuadPart);
    (void)swprintf(block, NAME_LENGTH, L"Local\\volley-%lx-%x-%llx", GetCurrentProcessId(), number,
                   now.QuadPart);
}

/* The library's end in stream, the process's in *given_out. */
static bool create_stream(const wchar_t *name, struct stream *stream, HANDLE *given_out) {
    SECURITY_ATTRIBUTES inherited = {.nLength = sizeof inherited, .bInheritHandle = TRUE};
    stream->event = CreateEventW(NULL, TRUE, FALSE, NULL);
    stream->pipe = CreateNamedPipeW(
        name, PIPE_ACCESS_DUPLEX | FILE_FLAG_OVERLAPPED | FILE_FLAG_FIRST_PIPE_INSTANCE,
        PIPE_TYPE_BYTE | PIPE_REJECT_REMOTE_CLIENTS, 1, PIPE_BYTES, PIPE_BYTES, 0, NULL);
    *given_out =
        CreateFileW(name, GENERIC_READ | GENERIC_WRITE, 0, &inherited, OPEN_EXISTING, 0, NULL);
    return stream->event && stream->pipe != INVALID_HANDLE_VALUE &&
           *given_out != INVALID_HANDLE_VALUE;
}

static bool create_block(const wchar_t *name, size_t bytes, struct trc_process *process) {
    process->block = CreateFileMappingW(INVALID_HANDLE_VALUE, NULL, PAGE_READWRITE,
                                        (DWORD)((uint64_t)bytes >> 32), (DWORD)bytes, name);
    const bool is_new = process->block && GetLastError() != ERROR_ALREADY_EXISTS;
    process->shared =
        is_new ? MapViewOfFile(process->block, FILE_MAP_ALL_ACCESS, 0, 0, bytes) : NULL;
    return process->shared != NULL;
}

/* "program" -I "script" block bytes; to be freed. */
static wchar_t *command_line(const struct trc_launcher *launcher, const wchar_t *block,
                             size_t bytes) {
    const size_t script_length = launcher->script ? wcslen(launcher->script) : 0;
    const size_t length = wcslen(launcher->program) + script_length + 2 * NAME_LENGTH;
    wchar_t *line = trc_alloc(length, sizeof *line);
    if (line)
        (void)swprintf(line, length,
                       launcher->script ? L"\"%ls\" -I \"%ls\" %ls %llu" : L"\"%ls\"%ls %ls %llu",
                       launcher->program, launcher->script ? launcher->script : L"", block,
                       (unsigned long long)bytes);
    return line;
}

/* Starts it in the job, with the stream for its standard input and output, and nothing else of the
 * host's. */
static bool spawn(const struct trc_launcher *launcher, wchar_t *line, HANDLE stream,
                  HANDLE *process_out) {
    char room[ATTRIBUTES_BYTES];
    SIZE_T size = sizeof room;
    STARTUPINFOEXW start = {.StartupInfo = {.cb = sizeof start,
                                            .dwFlags = STARTF_USESTDHANDLES,
                                            .hStdInput = stream,
                                            .hStdOutput = stream}};
    PROCESS_INFORMATION made;
    start.lpAttributeList = (LPPROC_THREAD_ATTRIBUTE_LIST)room;
    if (!InitializeProcThreadAttributeList(start.lpAttributeList, 1, 0, &size))
        return false;
    const bool is_made =
        UpdateProcThreadAttribute(start.lpAttributeList, 0, PROC_THREAD_ATTRIBUTE_HANDLE_LIST,
                                  &stream, sizeof stream, NULL, NULL) &&
        CreateProcessW(launcher->program, line, NULL, NULL, TRUE,
                       CREATE_NO_WINDOW | CREATE_SUSPENDED | EXTENDED_STARTUPINFO_PRESENT, NULL,
                       NULL, &start.StartupInfo, &made);
    DeleteProcThreadAttributeList(start.lpAttributeList);
    if (!is_made)
        return false;
    /* Outside of the job it would outlive the host. */
    if (!AssignProcessToJobObject(launcher->job, made.hProcess) ||
        ResumeThread(made.hThread) == (DWORD)-1) {
        TerminateProcess(made.hProcess, KILLED_CODE);
        CloseHandle(made.hProcess);
        made.hProcess = NULL;
    }
    CloseHandle(made.hThread);
    *process_out = made.hProcess;
    return made.hProcess != NULL;
}

static void process_free(struct trc_process *process) {
    if (process->process)
        TerminateProcess(process->process, KILLED_CODE);
    close_handle(process->process);
    close_handle(process->job);
    stream_close(&process->stream);
    if (process->shared)
        UnmapViewOfFile(process->shared);
    close_handle(process->block);
    launcher_release(process->launcher);
    trc_free(process);
}

/* OUT_OF_MEMORY, or UNSUPPORTED if it cannot be started. */
static trc_status process_start(struct trc_process *process, size_t shared_bytes) {
    wchar_t pipe[NAME_LENGTH], block[NAME_LENGTH];
    HANDLE given = NULL;
    make_names(pipe, block);
    wchar_t *line = command_line(process->launcher, block, shared_bytes);
    trc_status status = TRC_OK;
    if (!line || trc_memory_should_fail() || !create_stream(pipe, &process->stream, &given) ||
        !create_block(block, shared_bytes, process))
        status = no_memory();
    else if (!spawn(process->launcher, line, given, &process->process))
        status = trc_fail(TRC_ERROR_UNSUPPORTED, "it cannot be started: error %lu", GetLastError());
    close_handle(given);
    trc_free(line);
    return status;
}

/* Prepares trc_process_limit_memory: a process that cannot have a job of its own goes without. */
static void measure_own(struct trc_process *process) {
    PROCESS_MEMORY_COUNTERS counters = {.cb = sizeof counters};
    if (!GetProcessMemoryInfo(process->process, &counters, sizeof counters))
        return;
    process->own_bytes = counters.PagefileUsage;
    process->job = CreateJobObjectW(NULL, NULL);
    if (process->job && !AssignProcessToJobObject(process->job, process->process)) {
        CloseHandle(process->job);
        process->job = NULL;
    }
}

trc_status trc_process_create(struct trc_launcher *launcher, size_t shared_bytes, double seconds,
                              struct trc_process **process_out) {
    struct trc_process *process = trc_alloc_zeroed(1, sizeof *process);
    if (!process)
        return no_memory();
    atomic_fetch_add_explicit(&launcher->refs, 1, memory_order_relaxed);
    process->launcher = launcher;
    trc_status status = process_start(process, shared_bytes);
    if (status == TRC_OK) {
        struct trc_launch_answer hello;
        const enum trc_received received =
            receive_bytes(&process->stream, &hello, sizeof hello, seconds);
        const char *reason = received == TRC_RECEIVED_ENDED    ? "it has ended"
                             : received == TRC_RECEIVED_LATE   ? "it does not answer"
                             : hello.magic != TRC_LAUNCH_MAGIC ? "it answers nonsense"
                                                               : NULL;
        if (reason)
            status = trc_fail(TRC_ERROR_UNSUPPORTED, "%s", reason);
        else
            measure_own(process);
    }
    if (status == TRC_ERROR_UNSUPPORTED)
        atomic_store(&launcher->is_sound, false);
    if (status != TRC_OK)
        process_free(process);
    else
        *process_out = process;
    return status;
}

struct trc_process_exit trc_process_destroy(struct trc_process *process) {
    struct trc_process_exit exit = {.is_known = false};
    DWORD code = 0;
    /* Whatever has ended its stream is mostly about to end. */
    if (!PeekNamedPipe(process->stream.pipe, NULL, 0, NULL, NULL, NULL))
        WaitForSingleObject(process->process, END_MILLISECONDS);
    exit.is_known = WaitForSingleObject(process->process, 0) == WAIT_OBJECT_0 &&
                    GetExitCodeProcess(process->process, &code) && code != KILLED_CODE;
    exit.code = (int32_t)code;
    process_free(process);
    return exit;
}

void trc_process_limit_memory(struct trc_process *process, uint64_t bytes) {
    const uint64_t room = SIZE_MAX - process->own_bytes;
    if (process->job)
        limit_job(process->job, JOB_OBJECT_LIMIT_PROCESS_MEMORY,
                  process->own_bytes + (bytes < room ? bytes : room));
}

void *trc_process_shared(const struct trc_process *process) { return process->shared; }

bool trc_process_send(struct trc_process *process, const void *bytes, size_t size) {
    return send_bytes(&process->stream, bytes, size);
}

enum trc_received trc_process_receive(struct trc_process *process, void *bytes, size_t size,
                                      double seconds) {
    return receive_bytes(&process->stream, bytes, size, seconds);
}

bool trc_process_is_idle(const struct trc_process *process) {
    DWORD waiting = 0;
    return PeekNamedPipe(process->stream.pipe, NULL, 0, NULL, &waiting, NULL) && !waiting;
}

/* ---- files ---- */

/* Before an absolute path: the system takes more than 260 characters then. */
#define LONG_PREFIX L"\\\\?\\"
#define LONG_SHARE_PREFIX L"\\\\?\\UNC\\" /* in place of the two backslashes of a share */

/* The absolute path, to be freed, if it is long in the form that may be: not all programs know
 * that. NULL without memory. */
static wchar_t *long_path(const char *path) {
    wchar_t *wide = wide_of(path);
    const DWORD size = wide ? GetFullPathNameW(wide, 0, NULL, NULL) : 0;
    const size_t room = sizeof LONG_SHARE_PREFIX / sizeof(wchar_t);
    wchar_t *absolute = size ? trc_alloc(size, sizeof *absolute) : NULL;
    wchar_t *prefixed = size ? trc_alloc(room + size, sizeof *prefixed) : NULL;
    if (absolute && prefixed && GetFullPathNameW(wide, size, absolute, NULL)) {
        const bool is_prefixed = !wcsncmp(absolute, LONG_PREFIX, wcslen(LONG_PREFIX));
        const bool stays = is_prefixed || wcslen(absolute) < MAX_PATH;
        const bool is_share = !stays && !wcsncmp(absolute, L"\\\\", 2);
        wcscpy(prefixed, stays ? L"" : is_share ? LONG_SHARE_PREFIX : LONG_PREFIX);
        wcscat(prefixed, absolute + (is_share ? 2 : 0));
    } else {
        trc_free(prefixed);
        prefixed = NULL;
    }
    trc_free(absolute);
    trc_free(wide);
    return prefixed;
}

/* NULL if it is a file that can be read, or why it is not. */
static const char *look(const wchar_t *path, uint64_t *bytes_out) {
    WIN32_FILE_ATTRIBUTE_DATA found;
    if (!GetFileAttributesExW(path, GetFileExInfoStandard, &found)) {
        const DWORD error = GetLastError();
        return error == ERROR_FILE_NOT_FOUND || error == ERROR_PATH_NOT_FOUND
                   ? "No such file or directory"
                   : "it cannot be looked at";
    }
    /* A device may never end. */
    if (found.dwFileAttributes & (FILE_ATTRIBUTE_DIRECTORY | FILE_ATTRIBUTE_DEVICE))
        return "it is not a file";
    const HANDLE file =
        CreateFileW(path, GENERIC_READ, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE,
                    NULL, OPEN_EXISTING, FILE_ATTRIBUTE_NORMAL, NULL);
    if (file == INVALID_HANDLE_VALUE)
        return "Permission denied";
    const bool is_on_disk = GetFileType(file) == FILE_TYPE_DISK;
    CloseHandle(file);
    *bytes_out = (uint64_t)found.nFileSizeHigh << 32 | found.nFileSizeLow;
    return is_on_disk ? NULL : "it is not a file";
}

trc_status trc_file_look(const char *path, char **absolute_out, uint64_t *bytes_out) {
    wchar_t *wide = long_path(path);
    char *absolute = wide ? utf8_of(wide) : NULL;
    const char *reason = absolute ? look(wide, bytes_out) : NULL;
    trc_free(wide);
    if (!absolute)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a path");
    if (reason) {
        trc_free(absolute);
        return trc_fail(TRC_ERROR_IMAGE, "cannot read the image %s: %s", path, reason);
    }
    *absolute_out = absolute;
    return TRC_OK;
}

/* The path of the module that holds this function, without its last part; NULL without memory. */
static wchar_t *library_folder(void) {
    HMODULE module;
    if (!GetModuleHandleExW(GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS |
                                GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT,
                            (const wchar_t *)(uintptr_t)&library_folder, &module))
        return NULL;
    wchar_t *path = trc_alloc(MAX_LONG_PATH, sizeof *path);
    const DWORD length = path ? GetModuleFileNameW(module, path, MAX_LONG_PATH) : 0;
    wchar_t *slash = length && length < MAX_LONG_PATH ? wcsrchr(path, L'\\') : NULL;
    if (!slash) {
        trc_free(path);
        return NULL;
    }
    slash[1] = L'\0';
    return path;
}

char *trc_file_beside_library(const char *name) {
    wchar_t *folder = library_folder();
    char *text = folder ? utf8_of(folder) : NULL;
    const size_t bytes = text ? strlen(text) + strlen(name) + sizeof EXTENSION : 0;
    char *path = text ? trc_alloc(bytes, 1) : NULL;
    if (path)
        (void)snprintf(path, bytes, "%s%s%s", text, name, EXTENSION);
    trc_free(text);
    trc_free(folder);
    return path;
}

uint64_t trc_memory_available(void) {
    MEMORYSTATUSEX memory = {.dwLength = sizeof memory};
    return GlobalMemoryStatusEx(&memory) ? memory.ullAvailPhys : UINT64_MAX;
}
