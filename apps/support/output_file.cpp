#include "output_file.h"

#include <fstream>
#include <random>
#include <utility>

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

Error io_error(const fs::path& file, const std::string& what) {
    return {ErrorCode::io_failure, "Cannot write '" + file.string() + "': " + what + "."};
}

// Next to the target, so that renaming stays within one file system.
fs::path sibling(const fs::path& target) {
    std::random_device random;
    std::string name = ".unseen-";
    for (int i = 0; i < 12; ++i) name += "0123456789abcdef"[random() % 16];
    return target.parent_path() / (name + ".tmp");
}

} // namespace

OutputFile::OutputFile(fs::path target, fs::path temporary)
    : target_(std::move(target)), temporary_(std::move(temporary)) {}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : target_(std::move(other.target_)), temporary_(std::exchange(other.temporary_, {})) {}

OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
    std::swap(target_, other.target_);
    std::swap(temporary_, other.temporary_); // the old one goes with `other`
    return *this;
}

OutputFile::~OutputFile() {
    std::error_code ignored;
    if (!temporary_.empty()) fs::remove(temporary_, ignored);
}

Result<OutputFile> OutputFile::create(const fs::path& target) {
    std::error_code code;
    const fs::file_status status = fs::status(target, code);
    if (target.filename().empty() || fs::is_directory(status)) return io_error(target, "it is a folder; name a file");
    if (fs::exists(status) && !fs::is_regular_file(status)) {
        return io_error(target, "it is no regular file; give another name");
    }
    // A link stays a link: the file behind it is replaced.
    const fs::path real_target = fs::exists(status) ? fs::canonical(target, code) : target;
    if (code && fs::exists(status)) return io_error(target, code.message());
    OutputFile file(real_target, sibling(real_target));
    if (auto written = file.write(""); !written) return written.error();
    return file;
}

Result<void> OutputFile::write(std::string_view text) {
    std::ofstream stream(temporary_, std::ios::binary | std::ios::trunc);
    if (!stream) return io_error(target_, "the folder is missing or not writable");
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) return io_error(target_, "the disk is full or was taken away");
    return {};
}

Result<void> OutputFile::commit() {
    std::error_code code;
    fs::rename(temporary_, target_, code);
    if (code) return io_error(target_, code.message());
    temporary_.clear();
    return {};
}

} // namespace unseen::app
