#include "files/mapped_file.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace unseen::vdtree {

namespace {

Error failure(const std::filesystem::path& file, const std::string& why) {
    return {ErrorCode::io_failure, "Cannot open " + file.string() + ": " + why + "."};
}

class Descriptor {
public:
    explicit Descriptor(const std::filesystem::path& file)
        : fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    int get() const { return fd_; }

private:
    int fd_;
};

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
    return std::shared_ptr<const MappedFile>(new MappedFile({static_cast<const std::byte*>(start), size}));
}

MappedFile::~MappedFile() { ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size()); }

} // namespace unseen::vdtree
