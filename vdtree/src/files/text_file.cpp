#include <unseen/vdtree/internal/text_file.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <system_error>

namespace unseen {

Result<std::string> read_text_file(const std::filesystem::path& file, std::size_t most_bytes) {
    errno = 0;
    std::ifstream stream(file, std::ios::binary);
    if (!stream)
        return Error{ErrorCode::io_failure,
                     "Cannot open '" + file.string() + "': " + std::generic_category().message(errno) + "."};
    return read_text(stream, file.string(), most_bytes);
}

Result<std::string> read_text(std::istream& stream, const std::string& name, std::size_t most_bytes) {
    errno = 0;
    std::string text;
    std::array<char, 1u << 16> chunk;
    while (stream.read(chunk.data(), chunk.size()) || stream.gcount() > 0) {
        text.append(chunk.data(), static_cast<std::size_t>(stream.gcount()));
        if (text.size() > most_bytes)
            return Error{ErrorCode::malformed_data, name + ": is larger than " + std::to_string(most_bytes >> 20) +
                                                        " MiB, which no such file is."};
    }
    if (stream.bad())
        return Error{ErrorCode::io_failure,
                     "Cannot read '" + name + "' to its end: " + std::generic_category().message(errno) + "."};
    constexpr const char* byte_order_mark = "\xef\xbb\xbf";
    if (text.starts_with(byte_order_mark)) text.erase(0, 3);
    return text;
}

} // namespace unseen
