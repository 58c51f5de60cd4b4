// Preloaded into the command: a disk that has no room for more than UNSEEN_TEST_ROOM bytes of reserved blocks.
#include <atomic>
#include <cerrno>
#include <cstdlib>

#include <dlfcn.h>
#include <fcntl.h>

namespace {

std::atomic<long long> reserved = 0;

int reserve(const char* name, int file, off_t at, off_t size) {
    static const char* const room = std::getenv("UNSEEN_TEST_ROOM");
    if (room && (reserved += size) > std::atoll(room)) return ENOSPC;
    using Reserve = int (*)(int, off_t, off_t);
    return reinterpret_cast<Reserve>(dlsym(RTLD_NEXT, name))(file, at, size);
}

} // namespace

extern "C" {

int posix_fallocate(int file, off_t at, off_t size) { return reserve("posix_fallocate", file, at, size); }
int posix_fallocate64(int file, off_t at, off_t size) { return reserve("posix_fallocate64", file, at, size); }
}
