#include "paged_memory.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <linux/magic.h>
#include <sys/mman.h>
#include <sys/vfs.h>
#include <unistd.h>

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

// Blocks begin and end at multiples of this; all page sizes divide it.
constexpr std::size_t granule = paged_alignment;
// Freed blocks up to this in all keep their disk space for the next of their size: rounds of work ask for the same
// sizes again.
constexpr std::size_t most_kept = std::size_t{32} << 20;
// The file is as long as all blocks there may ever be, and empty but for those that are in use.
constexpr std::size_t longest_file = std::size_t{1} << 40, shortest_file = std::size_t{1} << 32;

// How often the pager looks, far from the limit and near it. A read of one page may bring sixteen, so that two threads
// may come by a hundred megabytes in a millisecond or two.
constexpr std::chrono::microseconds far_interval{2000}, near_interval{200};
// The pager begins this share of the limit below it, or so many bytes, for what is touched before it looks, and ends
// twice as far below.
constexpr std::uint64_t margin_share = 12, least_margin = std::uint64_t{12} << 20;
// Between two looks at how much is resident, pages are let go of in so much of the file.
constexpr std::size_t sweep_step = std::size_t{4} << 20;

Error failure(const fs::path& folder, const std::string& what, int cause) {
    return {ErrorCode::io_failure, "Cannot " + what + " in '" + folder.string() +
                                       "' for --memory: " + std::generic_category().message(cause) + "."};
}

class Pager {
public:
    // Does not take the memory's ownership: the mapping stays until the process ends, like the pager itself.
    Pager(int file, std::byte* begin, std::size_t length, std::uint64_t limit, std::string folder)
        : file_(file), begin_(begin), length_(length), folder_(std::move(folder)) {
        const std::uint64_t margin = std::max(limit / margin_share, least_margin);
        high_ = limit > margin ? limit - margin : 0;
        low_ = high_ > margin ? high_ - margin : 0;
        statm_ = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
        page_ = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
        std::thread([this] { watch(); }).detach();
    }

    bool owns(const void* block) const {
        const auto at = reinterpret_cast<std::uintptr_t>(block), begin = reinterpret_cast<std::uintptr_t>(begin_);
        return at >= begin && at - begin < length_;
    }

    void* allocate(std::size_t size) {
        if (size > length_) throw std::bad_alloc();
        size = (size + granule - 1) / granule * granule;
        make_room(size);
        const std::lock_guard lock(mutex_);
        std::size_t at = 0;
        if (const auto kept = kept_.find(size); kept != kept_.end()) {
            at = kept->second;
            kept_.erase(kept);
            kept_bytes_ -= size;
        } else {
            at = find_place(size);
            reserve(at, size);
        }
        try {
            used_.emplace(at, size);
        } catch (...) {
            give_up(at, size);
            throw;
        }
        return begin_ + at;
    }

    // What the last DiskFull said.
    std::string complaint() {
        const std::lock_guard lock(mutex_);
        return complaint_;
    }

    void release(void* block) noexcept {
        const std::size_t at = static_cast<std::size_t>(static_cast<std::byte*>(block) - begin_);
        const std::lock_guard lock(mutex_);
        const auto used = used_.find(at);
        const std::size_t size = used->second;
        used_.erase(used);
        if (size <= most_kept - kept_bytes_) {
            kept_.emplace(size, at);
            kept_bytes_ += size;
        } else {
            give_up(at, size);
        }
    }

private:
    // First fit: the file stays short, and the sweep with it.
    std::size_t find_place(std::size_t size) {
        for (auto gap = free_.begin(); gap != free_.end(); ++gap) {
            const auto [at, room] = *gap;
            if (room < size) continue;
            free_.erase(gap);
            if (room > size) free_.emplace(at + size, room - size);
            return at;
        }
        const std::size_t end = end_;
        if (size > length_ - end) throw std::bad_alloc();
        end_ = end + size;
        return end;
    }

    void reserve(std::size_t at, std::size_t size) {
        int failed = ::posix_fallocate(file_, static_cast<off_t>(at), static_cast<off_t>(size));
        while (failed == EINTR) failed = ::posix_fallocate(file_, static_cast<off_t>(at), static_cast<off_t>(size));
        if (failed == 0) return;
        give_up(at, size);
        complaint_ = "there is no room for " + std::to_string(size >> 20) + " MiB more of temporary data in '" +
                     folder_ + "' (" + std::generic_category().message(failed) +
                     "): free some, or write the tree to another disk.";
        throw DiskFull(complaint_);
    }

    // Disk space and pages go back to the system.
    void give_up(std::size_t at, std::size_t size) {
        if (::fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(at),
                        static_cast<off_t>(size)) != 0)
            ::madvise(begin_ + at, size, MADV_DONTNEED);
        auto gap = free_.emplace(at, size).first;
        if (const auto after = std::next(gap); after != free_.end() && gap->first + gap->second == after->first) {
            gap->second += after->second;
            free_.erase(after);
        }
        if (gap != free_.begin())
            if (const auto before = std::prev(gap); before->first + before->second == gap->first) {
                before->second += gap->second;
                free_.erase(gap);
            }
    }

    void watch() {
        for (;;) {
            const std::uint64_t now = resident();
            if (now > high_) sweep(low_);
            std::this_thread::sleep_for(now < low_ / 2 ? far_interval : near_interval);
        }
    }

    // Before a block is handed out, so that the pager need not keep pace with who fills it.
    void make_room(std::size_t size) {
        const std::uint64_t room = std::min<std::uint64_t>(size, low_ / 4);
        if (resident() + room > high_) sweep(low_ - room);
    }

    // Once around at most: what is then still there is no page of ours.
    void sweep(std::uint64_t goal) {
        const std::lock_guard lock(sweep_mutex_);
        const std::size_t end = end_;
        for (std::size_t swept = 0; swept < end && resident() > goal; swept += sweep_step) {
            if (hand_ >= end) hand_ = 0;
            // Of a shared mapping, only the view of the pages goes; what they hold is the file's.
            ::madvise(begin_ + hand_, std::min(sweep_step, end - hand_), MADV_DONTNEED);
            hand_ += sweep_step;
        }
    }

    // Bytes of memory that the process has; 0 where the system does not tell.
    std::uint64_t resident() const {
        char text[128] = {};
        if (::pread(statm_, text, sizeof(text) - 1, 0) <= 0) return 0;
        unsigned long long all = 0, pages = 0;
        return std::sscanf(text, "%llu %llu", &all, &pages) == 2 ? pages * page_ : 0;
    }

    int file_, statm_ = -1;
    std::byte* begin_;
    std::size_t length_;
    std::string folder_;
    std::uint64_t high_, low_, page_;
    std::mutex sweep_mutex_;
    std::size_t hand_ = 0; // of the clock

    std::mutex mutex_;
    std::atomic<std::size_t> end_ = 0;             // of what has ever been in use
    std::map<std::size_t, std::size_t> used_;      // size by place
    std::map<std::size_t, std::size_t> free_;      // likewise
    std::multimap<std::size_t, std::size_t> kept_; // place by size
    std::size_t kept_bytes_ = 0;
    std::string complaint_;
};

// Both are set once. `giving_pager` becomes null when nothing more is to be paged.
std::atomic<Pager*> pager = nullptr;
std::atomic<Pager*> giving_pager = nullptr;

bool lies_in_memory(const fs::path& folder) {
    struct statfs status {};
    if (::statfs(folder.c_str(), &status) != 0) return false;
    return status.f_type == TMPFS_MAGIC || status.f_type == RAMFS_MAGIC;
}

int open_nameless(const fs::path& folder) {
    const int file = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file >= 0 || (errno != EOPNOTSUPP && errno != EISDIR)) return file;
    std::string name = (folder / ".unseen-XXXXXXXXXXXX.tmp").string();
    const int named = ::mkostemps(name.data(), 4, O_CLOEXEC);
    if (named >= 0) ::unlink(name.c_str());
    return named;
}

} // namespace

Result<void> start_paging(const fs::path& folder_or_none, std::uint64_t limit) {
    const fs::path folder = folder_or_none.empty() ? fs::path(".") : folder_or_none;
    if (lies_in_memory(folder))
        return Error{ErrorCode::io_failure,
                     "'" + folder.string() + "' lies in memory: with --memory, write the tree to a disk."};
    const int file = open_nameless(folder);
    if (file < 0) return failure(folder, "make a temporary file", errno);
    std::size_t length = longest_file;
    while (::ftruncate(file, static_cast<off_t>(length)) != 0) {
        const int cause = errno;
        length /= 2;
        if (length >= shortest_file) continue;
        ::close(file);
        return failure(folder, "make a large temporary file", cause);
    }
    void* begin = MAP_FAILED;
    for (; begin == MAP_FAILED && length >= shortest_file; length /= 2) {
        begin = ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE, file, 0);
        if (begin != MAP_FAILED) break;
    }
    if (begin == MAP_FAILED) {
        const int cause = errno;
        ::close(file);
        return failure(folder, "map a temporary file", cause);
    }
    pager = new Pager(file, static_cast<std::byte*>(begin), length, limit, folder.string());
    giving_pager = pager.load();
    return {};
}

void page_no_more() { giving_pager = nullptr; }

std::string disk_full_complaint() {
    Pager* asked = pager.load(std::memory_order_acquire);
    return asked ? asked->complaint() : std::string();
}

void* allocate_paged(std::size_t size) {
    Pager* giving = giving_pager.load(std::memory_order_acquire);
    return giving ? giving->allocate(size) : nullptr;
}

bool release_paged(void* block) noexcept {
    Pager* owner = pager.load(std::memory_order_acquire);
    if (!owner || !owner->owns(block)) return false;
    owner->release(block);
    return true;
}

} // namespace unseen::app
