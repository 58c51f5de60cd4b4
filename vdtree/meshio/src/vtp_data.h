// Bytes of arrays in VTK's XML format: base64 or raw, as they are or in blocks that zlib has compressed.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/vdtree/internal/budget.h>

namespace unseen::meshio {

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

    // `data` begins with an array, and may go on behind it. In the order of the file. Throws VtkFault where it does not
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
