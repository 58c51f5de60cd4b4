// Text files that appear whole or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <vdtree/result.h>

namespace unseen::app {

// A text that waits under a temporary name beside its target. Made before long work, it finds out early whether the
// folder can be written to; commit() renames it, and without commit() it is removed. Move-only.
class OutputFile {
public:
    // Fails where the folder cannot be written to and where the target is anything but a regular file.
    static Result<OutputFile> create(const std::filesystem::path& target);
    OutputFile(OutputFile&& other) noexcept;
    OutputFile& operator=(OutputFile&& other) noexcept;
    ~OutputFile();

    Result<void> write(std::string_view text); // replaces what was written before
    Result<void> commit();

private:
    OutputFile(std::filesystem::path target, std::filesystem::path temporary);

    std::filesystem::path target_;
    std::filesystem::path temporary_; // empty once committed or moved from
};

} // namespace unseen::app
