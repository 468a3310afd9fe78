// A library for LD_PRELOAD that lets one call of the program fail, or kills the program there
// (faults.py). The environment says which:
//   FAULT_KIND    open, read, write, sync, close, rename, stat, allocate, or io for all of these but
//                 the last two
//   FAULT_NUMBER  the call of this kind that fails, from 1; 0 only counts
//   FAULT_MODE    once, from (this call and all that follow), or kill; once-done and from-done carry
//                 out the renames and second names that they say have failed, as servers of NFS do
//                 whose answers get lost
//   FAULT_ERROR   the number of the error; without it each kind has one of its own
//   FAULT_FOLDER  only calls for files below this folder count
//   FAULT_COUNT   the file in which the number of such calls is written when the program ends
//   FAULT_LARGE   allocations of more bytes than this count
//   FAULT_FREE    the bytes that every file system says it has left; -1 lets it tell the truth
//   FAULT_RESERVE "lies": file systems say that they have reserved room, and have not; or the error
//                 that they answer instead
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <unistd.h>

void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);

static atomic_long g_count;
static long g_number, g_large, g_free = -1;
static int g_error;
static const char *g_kind = "", *g_mode = "", *g_folder = "", *g_reserve = NULL;

__attribute__((constructor)) static void begin(void) {
  const char* number = getenv("FAULT_NUMBER");
  g_number = number ? atol(number) : 0;
  const char* large = getenv("FAULT_LARGE");
  g_large = large ? atol(large) : 1 << 20;
  if (getenv("FAULT_ERROR")) g_error = atoi(getenv("FAULT_ERROR"));
  if (getenv("FAULT_FREE")) g_free = atol(getenv("FAULT_FREE"));
  g_reserve = getenv("FAULT_RESERVE");
  if (getenv("FAULT_KIND")) g_kind = getenv("FAULT_KIND");
  if (getenv("FAULT_MODE")) g_mode = getenv("FAULT_MODE");
  if (getenv("FAULT_FOLDER")) g_folder = getenv("FAULT_FOLDER");
}

__attribute__((destructor)) static void end(void) {
  const char* path = getenv("FAULT_COUNT");
  char text[32];
  if (!path) return;
  const int file = (int)syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  const int length = snprintf(text, sizeof text, "%ld", atomic_load(&g_count));
  (void)!syscall(SYS_write, file, text, length);
}

// Counts a call, and says whether it has to fail.
static int must_fail(const char* kind) {
  const int is_io = strcmp(kind, "allocate") != 0 && strcmp(kind, "stat") != 0;
  if (strcmp(g_kind, kind) != 0 && !(is_io && strcmp(g_kind, "io") == 0)) return 0;
  const long count = atomic_fetch_add(&g_count, 1) + 1;
  if (g_number == 0 || count < g_number) return 0;
  if (strcmp(g_mode, "kill") == 0) raise(SIGKILL);
  return count == g_number || strncmp(g_mode, "from", 4) == 0;
}

static int is_done_all_the_same(void) { return strstr(g_mode, "-done") != NULL; }

static int path_fails(const char* kind, const char* path) {
  if (!*g_folder || strncmp(path, g_folder, strlen(g_folder)) != 0) return 0;
  return must_fail(kind);
}

static int file_fails(const char* kind, int file) {
  char link[64], path[4096];
  if (!*g_folder) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length <= 0) return 0;
  path[length] = 0;
  return path_fails(kind, path);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL(code, value)  \
  do {                     \
    errno = g_error ? g_error : (code); \
    return value;                       \
  } while (0)

#define OPEN(name)                                              \
  int name(const char* path, int flags, ...) {                  \
    va_list more;                                               \
    va_start(more, flags);                                      \
    const mode_t mode = va_arg(more, mode_t);                   \
    va_end(more);                                               \
    if (path_fails("open", path)) FAIL(EACCES, -1);             \
    return NEXT(name)(path, flags, mode);                       \
  }
OPEN(open)
OPEN(open64)

#define OPEN_STREAM(name)                                       \
  FILE* name(const char* path, const char* mode) {              \
    if (path_fails("open", path)) FAIL(EACCES, NULL);           \
    return NEXT(name)(path, mode);                              \
  }
OPEN_STREAM(fopen)
OPEN_STREAM(fopen64)

ssize_t read(int file, void* out, size_t bytes) {
  if (file_fails("read", file)) FAIL(EIO, -1);
  return NEXT(read)(file, out, bytes);
}
#define READ_AT(name)                                                 \
  ssize_t name(int file, void* out, size_t bytes, off_t offset) {     \
    if (file_fails("read", file)) FAIL(EIO, -1);                      \
    return NEXT(name)(file, out, bytes, offset);                      \
  }
READ_AT(pread)
READ_AT(pread64)

ssize_t write(int file, const void* data, size_t bytes) {
  if (file_fails("write", file)) FAIL(ENOSPC, -1);
  return NEXT(write)(file, data, bytes);
}
// The C library writes streams by calls of its own.
size_t fwrite(const void* data, size_t size, size_t count, FILE* file) {
  if (file_fails("write", fileno(file))) FAIL(ENOSPC, 0);
  return NEXT(fwrite)(data, size, count, file);
}
#define WRITE_AT(name)                                                     \
  ssize_t name(int file, const void* data, size_t bytes, off_t offset) {   \
    if (file_fails("write", file)) FAIL(ENOSPC, -1);                       \
    return NEXT(name)(file, data, bytes, offset);                          \
  }
WRITE_AT(pwrite)
WRITE_AT(pwrite64)

#define SYNC(name)                               \
  int name(int file) {                           \
    if (file_fails("sync", file)) FAIL(EIO, -1); \
    return NEXT(name)(file);                     \
  }
SYNC(fsync)
SYNC(fdatasync)

// The descriptor is closed all the same, as the system closes it.
int close(int file) {
  const int fails = file_fails("close", file);
  const int result = NEXT(close)(file);
  if (fails) FAIL(EIO, -1);
  return result;
}

#define NAME_ANOTHER(name)                                       \
  int name(const char* from, const char* to) {                   \
    const int fails = path_fails("rename", from);                \
    if (fails && is_done_all_the_same()) NEXT(name)(from, to);   \
    if (fails) FAIL(EIO, -1);                                    \
    return NEXT(name)(from, to);                                 \
  }
NAME_ANOTHER(rename)
NAME_ANOTHER(link)

#define LOOK_AT(name, type)                                  \
  int name(const char* path, struct type* status) {          \
    if (path_fails("stat", path)) FAIL(ESTALE, -1);          \
    return NEXT(name)(path, status);                         \
  }
LOOK_AT(stat, stat)
LOOK_AT(lstat, stat)
LOOK_AT(stat64, stat64)
LOOK_AT(lstat64, stat64)

#define TELL_SPACE(name, type)                                                   \
  int name(const char* path, struct type* status) {                              \
    const int result = NEXT(name)(path, status);                                 \
    if (g_free >= 0)                                                             \
      status->f_bfree = status->f_bavail = (fsblkcnt_t)g_free / status->f_frsize; \
    return result;                                                               \
  }
TELL_SPACE(statvfs, statvfs)
TELL_SPACE(statvfs64, statvfs64)

// FAULT_RESERVE is "lies", or the number of what a file system answers that cannot reserve anything.
#define RESERVE(name)                                                                \
  int name(int file, int mode, off_t offset, off_t bytes) {                          \
    if (!g_reserve || mode != 0) return NEXT(name)(file, mode, offset, bytes);       \
    if (strcmp(g_reserve, "lies") == 0) return ftruncate(file, offset + bytes);      \
    FAIL(atoi(g_reserve), -1);                                                       \
  }
RESERVE(fallocate)
RESERVE(fallocate64)

static int allocation_fails(size_t bytes) { return g_large > 0 && bytes > (size_t)g_large && must_fail("allocate"); }

void* malloc(size_t bytes) {
  if (allocation_fails(bytes)) FAIL(ENOMEM, NULL);
  return __libc_malloc(bytes);
}
void* calloc(size_t count, size_t bytes) {
  if (allocation_fails(count * bytes)) FAIL(ENOMEM, NULL);
  return __libc_calloc(count, bytes);
}
void* realloc(void* old, size_t bytes) {
  if (allocation_fails(bytes)) FAIL(ENOMEM, NULL);
  return __libc_realloc(old, bytes);
}
void* memalign(size_t alignment, size_t bytes) {
  if (allocation_fails(bytes)) FAIL(ENOMEM, NULL);
  return __libc_memalign(alignment, bytes);
}
void* aligned_alloc(size_t alignment, size_t bytes) { return memalign(alignment, bytes); }
int posix_memalign(void** out, size_t alignment, size_t bytes) {
  void* block = memalign(alignment, bytes);
  if (!block) return ENOMEM;
  *out = block;
  return 0;
}
