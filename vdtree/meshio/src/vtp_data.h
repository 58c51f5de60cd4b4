// Arrays in VTK's XML format: the names of types, and bytes in base64 or raw, as they are or in blocks that zlib has
// compressed.
#pragma once

#include <array>
#include <bit>
#include <optional>

#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/internal/budget.h>

namespace unseen::meshio {

inline constexpr std::array<const char*, 10> vtp_names{"Int8",   "UInt8", "Int16",  "UInt16",  "Int32",
                                                       "UInt32", "Int64", "UInt64", "Float32", "Float64"};

inline const char* vtp_name(ValueType type) { return vtp_names[static_cast<std::size_t>(type) - 1]; }

// Nothing for types that hold no numbers of whole bytes: Bit, String.
inline std::optional<ValueType> vtp_type(std::string_view name) {
    for (std::size_t i = 0; i < vtp_names.size(); ++i)
        if (name == vtp_names[i]) return static_cast<ValueType>(i + 1);
    return std::nullopt;
}

// What the file's first element says.
struct VtpEncoding {
    std::endian order = std::endian::little;
    bool has_wide_headers = false; // of 64 bits, else of 32
    std::string compressor = {};   // empty: none
};

class VtpDecoder {
public:
    // All arrays of a file together may become so many bytes: an array's bytes may be compressed, and may be meant by
    // any number of arrays.
    VtpDecoder(VtpEncoding encoding, Budget budget) : encoding_(std::move(encoding)), budget_(budget) {}

    // `data` begins with an array, and may go on behind it. In the order of the file. Fails if it does not
    // hold exactly so many bytes; nothing is allocated that it cannot hold.
    std::vector<std::byte> decode(std::string_view data, bool is_base64, std::uint64_t bytes);

    const VtpEncoding& encoding() const { return encoding_; }

private:
    class Stream;
    std::uint64_t header(Stream& stream) const;
    std::vector<std::byte> inflate(Stream& stream, std::uint64_t bytes);
    void spend(std::uint64_t bytes);

    VtpEncoding encoding_;
    Budget budget_;
};

} // namespace unseen::meshio
