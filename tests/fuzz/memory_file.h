// A file that exists in memory only, for readers that take a name.
#pragma once

#include <cstdlib>
#include <string>
#include <string_view>

#include <sys/mman.h>
#include <unistd.h>

namespace unseen::fuzz {

class MemoryFile {
public:
    MemoryFile() : descriptor_(::memfd_create("fuzz", 0)) {
        if (descriptor_ < 0) std::abort();
    }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;
    ~MemoryFile() { ::close(descriptor_); }

    std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }
    void hold(std::string_view bytes) {
        const auto size = static_cast<ssize_t>(bytes.size());
        if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, bytes.data(), bytes.size(), 0) != size)
            std::abort();
    }

private:
    int descriptor_;
};

} // namespace unseen::fuzz
