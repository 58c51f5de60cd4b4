#include <unseen/vdtree/internal/input_file.h>

#include <algorithm>
#include <cerrno>
#include <exception>
#include <system_error>

#include <poll.h>
#include <sys/stat.h>

#include "files/descriptor.h"

namespace unseen {

namespace {

enum class Excess { cut, refused }; // of bytes beyond the most

class Input {
public:
    Input(std::string name, int descriptor) : name_(std::move(name)), descriptor_(descriptor) {}

    Result<std::string> read(std::uint64_t most_bytes, Excess excess, bool takes_pipes) const {
        struct stat status {};
        if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0)
            return failure(errno == ENOENT ? "there is no such file; check the name." : system_reason());
        if (S_ISDIR(status.st_mode)) return failure("it is a folder; give the name of a file.");
        const bool is_stdin = descriptor_ == STDIN_FILENO, is_regular = S_ISREG(status.st_mode);
        if (!is_regular && !(takes_pipes && (S_ISFIFO(status.st_mode) || is_stdin)))
            return failure("it is no regular file; give the name of one.");
        const auto size = is_regular ? static_cast<std::uint64_t>(status.st_size) : 0;
        if (size > most_bytes && excess == Excess::refused) return too_long(most_bytes);
        const Error too_large = {ErrorCode::unsupported,
                                 name_ + ": reading it needs more memory than there is; give a smaller file."};
        if (std::min(size, most_bytes) > machine_memory()) return too_large;
        try {
            std::string bytes;
            bytes.reserve(std::min(size, most_bytes) + 1); // and the read that finds the end
            const auto done = append_to(bytes, most_bytes, excess);
            if (!done) return done.error();
            if (bytes.size() < std::min(size, most_bytes))
                return failure("it ended early; it may have been changed meanwhile, so try again.");
            if (!is_regular && !is_stdin && bytes.empty())
                return failure("no program writes to this pipe; start that program first.");
            return bytes;
        } catch (const std::exception&) { // bad_alloc, or length_error beyond the longest string
            return too_large;
        }
    }

private:
    static std::string system_reason() { return std::generic_category().message(errno) + "."; }
    Error failure(const std::string& why) const {
        return {ErrorCode::io_failure, "Cannot read '" + name_ + "': " + why};
    }
    Error too_long(std::uint64_t most_bytes) const {
        return {ErrorCode::malformed_data,
                name_ + ": is larger than " + std::to_string(most_bytes >> 20) + " MiB, which no such file is."};
    }

    Result<void> append_to(std::string& bytes, std::uint64_t most_bytes, Excess excess) const {
        for (;;) {
            const std::size_t before = bytes.size();
            bytes.resize(before < bytes.capacity() ? bytes.capacity() : before + before / 2 + (std::size_t{1} << 16));
            const ssize_t got = ::read(descriptor_, bytes.data() + before, bytes.size() - before);
            bytes.resize(before + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
            if (bytes.size() > most_bytes && excess == Excess::refused) return too_long(most_bytes);
            if (bytes.size() > most_bytes) bytes.resize(most_bytes);
            if (got == 0 || (bytes.size() == most_bytes && excess == Excess::cut)) return {};
            if (got > 0) continue;
            struct pollfd pipe = {descriptor_, POLLIN, 0};
            if (errno != EAGAIN || ::poll(&pipe, 1, -1) < 0) return failure(system_reason());
        }
    }

    std::string name_;
    int descriptor_;
};

Result<std::string> read_input(const std::filesystem::path& file, std::uint64_t most_bytes, Excess excess,
                               bool takes_pipes) {
    const vdtree::Descriptor descriptor(file);
    return Input(file.string(), descriptor.get()).read(most_bytes, excess, takes_pipes);
}

} // namespace

std::uint64_t machine_memory() {
    return static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

Result<std::string> read_regular_file(const std::filesystem::path& file, std::uint64_t most_bytes) {
    return read_input(file, most_bytes, Excess::cut, false);
}

Result<std::string> read_file_or_pipe(const std::filesystem::path& file, std::uint64_t most_bytes) {
    return read_input(file, most_bytes, Excess::refused, true);
}

Result<std::string> read_text_file(const std::filesystem::path& file, std::uint64_t most_bytes) {
    auto text = file == "-" ? Input("stdin", STDIN_FILENO).read(most_bytes, Excess::refused, true)
                            : read_file_or_pipe(file, most_bytes);
    constexpr const char* byte_order_mark = "\xef\xbb\xbf";
    if (text && text->starts_with(byte_order_mark)) text->erase(0, 3);
    return text;
}

} // namespace unseen
