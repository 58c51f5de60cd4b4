// An open file for reading, closed in the end.
#pragma once

#include <filesystem>

#include <fcntl.h>
#include <unistd.h>

namespace unseen::vdtree {

class Descriptor {
public:
    // Does not wait for the writer of a pipe.
    explicit Descriptor(const std::filesystem::path& file)
        : fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    int get() const { return fd_; } // below 0: it could not be opened, see errno

private:
    int fd_;
};

} // namespace unseen::vdtree
