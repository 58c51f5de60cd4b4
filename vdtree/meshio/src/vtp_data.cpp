#include "vtp_data.h"

#include <zlib.h>

#include "mesh_readers.h"
#include "text_scanner.h"
#include "value_types.h"

namespace unseen::meshio {

namespace {

constexpr std::uint64_t most_inflated = 1032; // bytes that zlib makes of one, at most

[[noreturn]] void fail_short() { fail("its data end early; the file is cut short or damaged."); }

[[noreturn]] void fail_length(std::uint64_t found, std::uint64_t expected) {
    fail("it holds ", found, " bytes of data where ", expected, " are needed; the file is damaged.");
}

} // namespace

// Bytes one after the other. Groups of base64 that are padded may be followed by others, for headers are encoded apart.
class VtpDecoder::Stream {
public:
    Stream(std::string_view data, bool is_base64) : data_(data), is_base64_(is_base64) {}

    // No more than these can be left.
    std::uint64_t room() const { return is_base64_ ? data_.size() / 4 * 3 + 3 : data_.size(); }

    void read(void* to, std::size_t count) {
        auto* bytes = static_cast<std::byte*>(to);
        if (!is_base64_) {
            if (count > data_.size()) fail_short();
            if (count > 0) std::memcpy(bytes, data_.data(), count);
            data_.remove_prefix(count);
            return;
        }
        for (std::size_t i = 0; i < count; ++i) {
            if (next_ == group_size_) read_group();
            bytes[i] = group_[next_++];
        }
    }

private:
    // Four characters, of which the last two may be '='.
    void read_group() {
        std::array<int, 4> values{};
        std::size_t digits = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            while (!data_.empty() && is_space(data_.front())) data_.remove_prefix(1);
            if (data_.empty()) fail_short();
            const char c = data_.front();
            data_.remove_prefix(1);
            if (c == '=' && i >= 2) continue;
            values[i] = base64_value(c);
            if (values[i] < 0 || digits != i) fail("its data are no base64; the file is cut short or damaged.");
            ++digits;
        }
        const unsigned bits = static_cast<unsigned>(values[0] << 18 | values[1] << 12 | values[2] << 6 | values[3]);
        group_ = {static_cast<std::byte>(bits >> 16), static_cast<std::byte>(bits >> 8), static_cast<std::byte>(bits)};
        group_size_ = digits - 1;
        next_ = 0;
    }

    std::string_view data_;
    bool is_base64_;
    std::array<std::byte, 3> group_{};
    std::size_t group_size_ = 0, next_ = 0;
};

std::uint64_t VtpDecoder::header(Stream& stream) const {
    std::array<std::byte, 8> raw{};
    const std::size_t size = encoding_.has_wide_headers ? 8 : 4;
    stream.read(raw.data(), size);
    change_order(std::span(raw).first(size), size, encoding_.order);
    return encoding_.has_wide_headers ? load_value<std::uint64_t>(raw.data()) : load_value<std::uint32_t>(raw.data());
}

void VtpDecoder::spend(std::uint64_t bytes) {
    if (!budget_.spend(bytes))
        fail_unsupported("with it the arrays become far more than the file holds; save the file without compression.");
}

std::vector<std::byte> VtpDecoder::decode(std::string_view data, bool is_base64, std::uint64_t bytes) {
    if (bytes == 0) return {};
    Stream stream(data, is_base64);
    if (encoding_.compressor == "vtkZLibDataCompressor") return inflate(stream, bytes);
    if (!encoding_.compressor.empty())
        fail_unsupported(
            "it is compressed by ", encoding_.compressor,
            ", which is not read; save the file with the compressor zlib or none, as ParaView offers them.");
    if (const std::uint64_t found = header(stream); found != bytes) fail_length(found, bytes);
    if (bytes > stream.room()) fail_short();
    spend(bytes);
    std::vector<std::byte> values(bytes);
    stream.read(values.data(), values.size());
    return values;
}

// Number of blocks, bytes of one, of the last one (0: as of the others), and the compressed bytes of each; the blocks.
std::vector<std::byte> VtpDecoder::inflate(Stream& stream, std::uint64_t bytes) {
    const std::uint64_t blocks = header(stream), block_bytes = header(stream), last = header(stream);
    const bool is_whole = blocks > 0 && block_bytes > 0 && last <= block_bytes && blocks - 1 <= bytes / block_bytes &&
                          (blocks - 1) * block_bytes + (last > 0 ? last : block_bytes) == bytes;
    if (!is_whole)
        fail("its ", blocks, " compressed blocks of ", block_bytes, " bytes do not make the ", bytes,
             " that are needed; the file is damaged.");
    if (blocks > stream.room() / sizeof(std::uint32_t)) fail_short();
    std::vector<std::uint64_t> sizes(blocks);
    std::uint64_t compressed = 0;
    for (std::uint64_t& size : sizes) {
        size = header(stream);
        if (size > stream.room() - std::min(compressed, stream.room())) fail_short();
        compressed += size;
    }
    if (bytes / most_inflated > compressed) fail_length(compressed, bytes / most_inflated);
    spend(bytes);
    std::vector<std::byte> values(bytes);
    std::vector<unsigned char> block;
    std::size_t at = 0;
    for (const std::uint64_t size : sizes) {
        block.resize(size);
        stream.read(block.data(), block.size());
        const std::size_t wanted = std::min<std::size_t>(block_bytes, values.size() - at);
        uLongf found = wanted;
        const int state = ::uncompress(reinterpret_cast<Bytef*>(values.data() + at), &found, block.data(), size);
        if (state == Z_MEM_ERROR) throw std::bad_alloc();
        if (state != Z_OK || found != wanted)
            fail("a compressed block of it is damaged, or holds another number of bytes than it should.");
        at += wanted;
    }
    return values;
}

} // namespace unseen::meshio
