// Files that appear whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

// A file written under a temporary name in the folder of its target. commit() renames it to the target, with the
// permissions of the file that it replaces; without commit() the destructor removes it, so a failed writer leaves
// neither a part nor a changed target behind. A process that is killed leaves the temporary; it holds a lock on it as
// long as it lives, so that others know.
class AtomicFile {
public:
    // Fails where the folder is missing or not writable, where the name is too long, and where the target exists but may
    // not be written to, or is no regular file (a folder, a device): renaming would replace it.
    static Result<AtomicFile> create(const std::filesystem::path& target);

    // Removes temporaries in the folder of the target whose writers are no more. As far as it may; nothing is reported.
    static void remove_orphans(const std::filesystem::path& target);

    // Removes the temporaries of this process, whose files must not be used any more. For handlers of signals that end
    // the process: async-signal-safe. Of more than 32 at a time, some are left.
    static void remove_all() noexcept;

    AtomicFile(AtomicFile&& other) noexcept;
    AtomicFile& operator=(AtomicFile&& other) noexcept;
    ~AtomicFile();

    // Appends. Unbuffered: hand over large pieces.
    Result<void> write(std::span<const std::byte> bytes);
    Result<void> write(std::string_view bytes);

    // Brings the bytes to the disk and renames. The file is closed afterwards, whatever happened.
    Result<void> commit();

private:
    AtomicFile(int descriptor, std::filesystem::path target, std::filesystem::path temporary, int place);
    void discard() noexcept;

    int descriptor_ = -1;
    std::filesystem::path target_;
    std::filesystem::path temporary_;
    int place_ = -1; // in the list of temporaries; -1: not in it
};

} // namespace unseen::vdtree
