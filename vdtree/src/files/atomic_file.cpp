// Temporary file and rename, with POSIX calls because their errors say why.
#include <vdtree/internal/atomic_file.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <random>
#include <string>
#include <system_error>
#include <utility>

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
    if (target.filename().empty() || fs::is_directory(status)) {
        return Error{ErrorCode::invalid_argument,
                     "Cannot write to '" + target.string() + "': it is a folder; give the name of a file."};
    }
    if (fs::exists(status) && !fs::is_regular_file(status)) {
        return Error{ErrorCode::invalid_argument,
                     "Cannot write to '" + target.string() + "': it is no regular file; give another name."};
    }
    const Result<fs::path> real_target = follow(target);
    if (!real_target) return real_target.error();

    std::random_device random;
    for (int attempt = 0; attempt < max_name_attempts; ++attempt) {
        fs::path temporary = random_sibling(*real_target, random);
        const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (descriptor >= 0 && claim(descriptor)) return AtomicFile(descriptor, *real_target, std::move(temporary));
        if (descriptor >= 0) ::close(descriptor);
        else if (errno != EEXIST) return io_error(target, "create", errno);
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

AtomicFile::AtomicFile(int descriptor, fs::path target, fs::path temporary)
    : descriptor_(descriptor), target_(std::move(target)), temporary_(std::move(temporary)) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), target_(std::move(other.target_)),
      temporary_(std::move(other.temporary_)) {}

AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept {
    if (this != &other) {
        discard();
        descriptor_ = std::exchange(other.descriptor_, -1);
        target_ = std::move(other.target_);
        temporary_ = std::move(other.temporary_);
    }
    return *this;
}

AtomicFile::~AtomicFile() { discard(); }

void AtomicFile::discard() noexcept {
    if (descriptor_ < 0) return;
    ::close(std::exchange(descriptor_, -1));
    ::unlink(temporary_.c_str());
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
    // The data must be on the disk before the name is, or a power cut could leave the name with an empty file.
    if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != ENOTSUP) {
        const int cause = errno;
        discard();
        return io_error(target_, "write", cause);
    }
    if (::close(std::exchange(descriptor_, -1)) != 0) {
        const int cause = errno;
        ::unlink(temporary_.c_str());
        return io_error(target_, "write", cause);
    }
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) {
        const int cause = errno;
        ::unlink(temporary_.c_str());
        return io_error(target_, "replace", cause);
    }
    return {};
}

} // namespace unseen::vdtree
