#include "files/mapped_file.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include <sys/mman.h>
#include <sys/stat.h>

#include <unseen/vdtree/internal/mapped_names.h>

#include "files/descriptor.h"

namespace unseen::vdtree {

namespace {

Error failure(const std::filesystem::path& file, const std::string& why) {
    return {ErrorCode::io_failure, "Cannot open " + file.string() + ": " + why + "."};
}

// What signal handlers may ask for, which may neither lock nor allocate. `end` is set last, and 0 first.
struct NamedPages {
    std::atomic<bool> is_used = false;
    std::atomic<std::uintptr_t> begin = 0, end = 0;
    std::atomic<std::uint64_t> number = 0; // of the file in its file system
    std::atomic<std::int64_t> written_ns = 0;
    std::array<char, PATH_MAX> name;
};
static_assert(std::atomic<std::uintptr_t>::is_always_lock_free);
std::array<NamedPages, 32> named_pages;

std::int64_t written_ns(const struct stat& status) {
    return status.st_mtim.tv_sec * std::int64_t{1'000'000'000} + status.st_mtim.tv_nsec;
}

// Its place in the list; -1 where the list is full.
int note(std::span<const std::byte> bytes, const std::string& name, const struct stat& status) {
    for (std::size_t i = 0; i < named_pages.size() && name.size() < PATH_MAX; ++i) {
        NamedPages& pages = named_pages[i];
        if (pages.is_used.exchange(true)) continue;
        std::copy_n(name.c_str(), name.size() + 1, pages.name.begin());
        pages.number = status.st_ino;
        pages.written_ns = written_ns(status);
        pages.begin = reinterpret_cast<std::uintptr_t>(bytes.data());
        pages.end = pages.begin + bytes.size();
        return static_cast<int>(i);
    }
    return -1;
}

void forget(int place) {
    if (place < 0) return;
    NamedPages& pages = named_pages[static_cast<std::size_t>(place)];
    pages.end = 0;
    pages.is_used = false;
}

} // namespace

Result<std::shared_ptr<const MappedFile>> MappedFile::open(const std::filesystem::path& file) {
    const Descriptor descriptor(file); // the mapping outlives it
    if (descriptor.get() < 0) return failure(file, std::strerror(errno));
    struct stat status {};
    if (::fstat(descriptor.get(), &status) != 0) return failure(file, std::strerror(errno));
    if (!S_ISREG(status.st_mode)) return failure(file, "it is no regular file");
    if (status.st_size == 0) return failure(file, "it is empty");
    const auto size = static_cast<std::size_t>(status.st_size);
    void* start = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, descriptor.get(), 0);
    if (start == MAP_FAILED) return failure(file, std::strerror(errno));
    ::madvise(start, size, MADV_RANDOM); // a hint only
    return std::shared_ptr<const MappedFile>(
        new MappedFile({static_cast<const std::byte*>(start), size},
                       note({static_cast<const std::byte*>(start), size}, file.native(), status)));
}

MappedFile::~MappedFile() {
    forget(place_);
    ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

const char* mapped_file_at(const void* address) noexcept {
    const auto at = reinterpret_cast<std::uintptr_t>(address);
    for (const NamedPages& pages : named_pages)
        if (const std::uintptr_t end = pages.end; at < end && at >= pages.begin) return pages.name.data();
    return nullptr;
}

const char* changed_mapped_file() noexcept {
    for (const NamedPages& pages : named_pages) {
        struct stat status {};
        if (pages.end == 0 || ::stat(pages.name.data(), &status) != 0) continue;
        if (status.st_ino == pages.number && written_ns(status) != pages.written_ns) return pages.name.data();
    }
    return nullptr;
}

} // namespace unseen::vdtree
