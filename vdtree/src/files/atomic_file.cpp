// Temporary file and rename, with POSIX calls because their errors say why.
#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/errors.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <random>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace unseen::vdtree {

namespace fs = std::filesystem;

namespace {

// A name can be taken by another process; a folder in which this many random names are taken has another problem.
constexpr int max_name_attempts = 16;
// What temporaries are called.
constexpr std::string_view temporary_begin = ".unseen-", temporary_end = ".tmp";
constexpr std::size_t temporary_digits = 12;
// One write(2) moves at most 2^31 - 4096 bytes on Linux; smaller pieces keep the loop simple.
constexpr std::size_t max_write_bytes = std::size_t{1} << 30;

Error io_error(const fs::path& file, const std::string& what, int cause) {
    return {ErrorCode::io_failure,
            "Cannot " + what + " '" + file.string() + "': " + std::generic_category().message(cause) + "."};
}

// ---- the temporaries of this process, for signal handlers, which may neither lock nor allocate

struct ListedName {
    enum Use { unused, being_named, named };
    std::atomic<Use> use = unused;
    std::array<char, PATH_MAX> text;
};
static_assert(std::atomic<ListedName::Use>::is_always_lock_free);
std::array<ListedName, 32> temporaries;

// Its place in the list; -1 where the list is full.
int list(const fs::path& file) {
    const std::string& name = file.native();
    for (std::size_t i = 0; i < temporaries.size() && name.size() < PATH_MAX; ++i) {
        ListedName& entry = temporaries[i];
        ListedName::Use expected = ListedName::unused;
        if (!entry.use.compare_exchange_strong(expected, ListedName::being_named)) continue;
        std::copy_n(name.c_str(), name.size() + 1, entry.text.begin());
        entry.use = ListedName::named;
        return static_cast<int>(i);
    }
    return -1;
}

void unlist(int place) {
    if (place >= 0) temporaries[static_cast<std::size_t>(place)].use = ListedName::unused;
}

// ----

// Does not contain the target's name, which may already be as long as a name can be.
fs::path random_sibling(const fs::path& target, std::random_device& random) {
    static constexpr char digits[] = "0123456789abcdefghijklmnopqrstuv";
    std::string name(temporary_begin);
    for (std::size_t i = 0; i < temporary_digits; ++i) name += digits[random() % 32];
    return target.parent_path() / (name + std::string(temporary_end));
}

bool is_temporary(const fs::path& file) {
    const std::string name = file.filename().string();
    return name.size() == temporary_begin.size() + temporary_digits + temporary_end.size() &&
           name.starts_with(temporary_begin) && name.ends_with(temporary_end);
}

// Tells others that the file's writer lives. False where one of them has removed it just before. Where the file system
// knows no locks, nobody gets one, and nothing is removed.
bool claim(int descriptor) {
    ::flock(descriptor, LOCK_EX);
    struct stat status {};
    return ::fstat(descriptor, &status) != 0 || status.st_nlink > 0;
}

// A link stays a link: the file behind it is replaced.
Result<fs::path> follow(const fs::path& target) {
    std::error_code failure;
    if (!fs::exists(target, failure)) return target;
    fs::path real = fs::canonical(target, failure);
    if (failure) return io_error(target, "resolve", failure.value());
    return real;
}

} // namespace

Result<AtomicFile> AtomicFile::create(const fs::path& target) {
    std::error_code failure;
    const fs::file_status status = fs::status(target, failure);
    if (failure == std::errc::filename_too_long) return io_error(target, "create", failure.value());
    const std::string cannot = "Cannot write to '" + target.string() + "'";
    if (target.filename().empty() || fs::is_directory(status))
        return invalid_argument(cannot + ": it is a folder; give the name of a file.");
    if (fs::exists(status) && !fs::is_regular_file(status))
        return invalid_argument(cannot + ": it is no regular file; give another name.");
    // Renaming would go against what others are told with it.
    if (fs::exists(status) && ::faccessat(AT_FDCWD, target.c_str(), W_OK, AT_EACCESS) != 0)
        return Error{ErrorCode::io_failure, cannot + ", which is there: " + std::generic_category().message(errno) +
                                                ". Allow it, remove the file, or give another name."};
    const Result<fs::path> real_target = follow(target);
    if (!real_target) return real_target.error();

    // Who may not read what is replaced, may not read it meanwhile.
    const mode_t mode = fs::exists(status) ? 0600 : 0666;
    std::random_device random;
    for (int attempt = 0; attempt < max_name_attempts; ++attempt) {
        fs::path temporary = random_sibling(*real_target, random);
        const int place = list(temporary); // before it is there: a signal may come at any time
        const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
        const int cause = errno;
        if (descriptor >= 0 && claim(descriptor))
            return AtomicFile(descriptor, *real_target, std::move(temporary), place);
        unlist(place);
        if (descriptor >= 0) ::close(descriptor);
        else if (cause != EEXIST) return io_error(target, "create", cause);
    }
    return io_error(target, "create", EEXIST);
}

void AtomicFile::remove_orphans(const fs::path& target) {
    const Result<fs::path> real_target = follow(target);
    if (!real_target) return;
    const fs::path folder = real_target->parent_path();
    std::error_code failure;
    for (fs::directory_iterator i(folder.empty() ? fs::path(".") : folder, failure), end; !failure && i != end;
         i.increment(failure)) {
        if (!is_temporary(i->path())) continue;
        const int descriptor = ::open(i->path().c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
        if (descriptor < 0) continue;
        if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) ::unlink(i->path().c_str());
        ::close(descriptor);
    }
}

void AtomicFile::remove_all() noexcept {
    for (const ListedName& entry : temporaries)
        if (entry.use == ListedName::named) ::unlink(entry.text.data());
}

AtomicFile::AtomicFile(int descriptor, fs::path target, fs::path temporary, int place)
    : descriptor_(descriptor), target_(std::move(target)), temporary_(std::move(temporary)), place_(place) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept { *this = std::move(other); }

AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    std::swap(target_, other.target_);
    std::swap(temporary_, other.temporary_);
    std::swap(place_, other.place_);
    return *this; // `other` removes what was here
}

AtomicFile::~AtomicFile() { discard(); }

void AtomicFile::discard() noexcept {
    if (temporary_.empty()) return; // moved away, or renamed
    if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
    ::unlink(std::exchange(temporary_, {}).c_str());
    unlist(std::exchange(place_, -1));
}

Result<void> AtomicFile::write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(descriptor_, bytes.data(), std::min(bytes.size(), max_write_bytes));
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) return io_error(target_, "write", errno);
        bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
    return {};
}

Result<void> AtomicFile::write(std::string_view bytes) { return write(std::as_bytes(std::span(bytes))); }

Result<void> AtomicFile::commit() {
    const auto failed = [this](const std::string& what) {
        const int cause = errno;
        discard();
        return io_error(target_, what, cause);
    };
    constexpr mode_t permissions = 0777;
    struct stat replaced {};
    if (::stat(target_.c_str(), &replaced) == 0) {
        [[maybe_unused]] const int kept = ::fchown(descriptor_, replaced.st_uid, replaced.st_gid); // as far as it may
        ::fchmod(descriptor_, replaced.st_mode & permissions);
    }
    // The data must be on the disk before the name is, or a power cut could leave the name with an empty file.
    if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != ENOTSUP) return failed("write");
    // Closed only under its final name: the lock goes with it, and what is not locked others take for left behind.
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) return failed("replace");
    temporary_.clear();
    unlist(std::exchange(place_, -1));
    if (::close(std::exchange(descriptor_, -1)) != 0) return io_error(target_, "write", errno);
    return {};
}

} // namespace unseen::vdtree
