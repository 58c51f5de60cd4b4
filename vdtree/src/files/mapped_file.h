// A whole file as memory that is read when it is used, and shared with other processes.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

class MappedFile {
public:
    // Fails for what is no regular file, also for an empty one; a pipe is not waited for.
    static Result<std::shared_ptr<const MappedFile>> open(const std::filesystem::path& file);

    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;
    ~MappedFile();

    // Pages come from the disk one by one, without what lies beside them: for scattered use. Whoever goes through all
    // of it should not do it this way.
    std::span<const std::byte> bytes() const noexcept { return bytes_; }

private:
    MappedFile(std::span<const std::byte> bytes, int place) : bytes_(bytes), place_(place) {}
    std::span<const std::byte> bytes_;
    int place_; // among the names that mapped_file_at() knows; -1: it is not there
};

} // namespace unseen::vdtree
