// Pieces of text and numbers that become a file when all of them are there.
#pragma once

#include <array>
#include <cctype>
#include <charconv>

#include <unseen/vdtree/internal/atomic_file.h>

namespace unseen::meshio {

// Collects small pieces for a file; remembers the first failure.
class FileOutput {
public:
    explicit FileOutput(vdtree::AtomicFile file) : file_(std::move(file)) { buffer_.reserve(buffer_bytes + 256); }

    void text(std::string_view piece) {
        if (piece.size() < buffer_bytes) buffer_.append(piece);
        if (buffer_.size() >= buffer_bytes || piece.size() >= buffer_bytes) flush();
        if (piece.size() >= buffer_bytes && status_) status_ = file_.write(piece);
    }
    template <class Value>
    void number(Value value) { // in decimal, with the digits that bring back the same value
        std::array<char, 64> digits;
        const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
        text({digits.data(), end});
    }
    // Each with a space before it.
    void numbers(const auto& values, int count) {
        for (int i = 0; i < count; ++i) {
            text(" ");
            number(values[i]);
        }
    }
    template <class Value>
    void binary(Value value) { // little-endian, as in memory
        text({reinterpret_cast<const char*>(&value), sizeof value});
    }

    Result<void> finish() {
        flush();
        return status_ ? file_.commit() : status_;
    }

private:
    static constexpr std::size_t buffer_bytes = std::size_t{1} << 20;

    void flush() {
        if (status_) status_ = file_.write(std::string_view(buffer_));
        buffer_.clear();
    }

    vdtree::AtomicFile file_;
    std::string buffer_;
    Result<void> status_;
};

// A name that stands in a line of its own and comes back as it was, but for characters that would end the line.
inline std::string one_line(const std::string& name) {
    std::string line;
    for (const char c : name) line += std::iscntrl(static_cast<unsigned char>(c)) ? '_' : c;
    if (line.ends_with('\\')) line.back() = '_';
    return line;
}

// The ending of a file's name, in lower case.
std::string lower_ending(const std::filesystem::path& file);

} // namespace unseen::meshio
