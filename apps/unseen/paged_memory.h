// Work on more data than memory holds: large blocks lie in a file, and the process keeps only so many of their pages.
//
// The command's operator new hands out blocks of such a file while paging is on; what uses them need not know. A thread
// looks at what the process holds and, above the limit, lets go of pages of the blocks, round and round; their contents
// stay with the file, and who touches such a page gets it back. So results never depend on the limit, only time does.
#pragma once

#include <cstdint>
#include <filesystem>
#include <new>
#include <string>

#include <unseen/vdtree/result.h>

namespace unseen::app {

// Thrown by operator new where the disk has no room for a block.
class DiskFull : public std::bad_alloc {
public:
    explicit DiskFull(std::string text) : text_(std::move(text)) {}
    const char* what() const noexcept override { return text_.c_str(); }

private:
    std::string text_;
};

// Blocks of at least so many bytes are paged. Lower, and short-lived blocks cost calls to the system; higher, and what
// stays in memory, which grows with the mesh, is more.
inline constexpr std::size_t least_paged_block = std::size_t{128} << 10;

// Paged blocks begin at multiples of this.
inline constexpr std::size_t paged_alignment = std::size_t{64} << 10;

// From now on until the end of the process, about `limit` bytes stay resident, what is not paged included; for moments
// it may be a hundred megabytes more, until the thread that looks has its turn. The file lies in `folder`, without a
// name: nothing is left of it, however the process ends. Its disk space is reserved block by block, so that a full disk
// is a DiskFull and nothing worse. Once a process. Fails where the folder cannot have such a file or lies in memory
// itself.
Result<void> start_paging(const std::filesystem::path& folder, std::uint64_t limit);

// Further blocks come from memory as usual. Those that were handed out stay as they are.
void page_no_more();

// What the last DiskFull said; empty where there was none. For who only learns that there was no memory.
std::string disk_full_complaint();

// For operator new and delete. Null where nothing is paged; false for what is no paged block.
void* allocate_paged(std::size_t size);
bool release_paged(void* block) noexcept;

} // namespace unseen::app
