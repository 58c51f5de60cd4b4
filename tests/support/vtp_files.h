// VTP files as strings: the quad of mesh_files.h with two arrays of point data, in every encoding.
#pragma once

#include <array>
#include <charconv>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "mesh_files.h"

namespace vtp_files {

using mesh_files::bytes;

inline std::string base64(const std::string& data) {
    constexpr const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t i = 0; i < data.size(); i += 3) {
        std::uint32_t bits = 0;
        for (std::size_t k = 0; k < 3; ++k)
            bits = bits << 8 | (i + k < data.size() ? static_cast<unsigned char>(data[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k) text += i + k <= data.size() ? digits[bits >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

// A zlib stream that stores up to 65535 bytes as they are.
inline std::string zlib_stored(const std::string& data) {
    std::uint32_t a = 1, b = 0;
    for (const char c : data) {
        a = (a + static_cast<unsigned char>(c)) % 65521;
        b = (b + a) % 65521;
    }
    const auto size = static_cast<std::uint16_t>(data.size());
    return "\x78\x01\x01" + mesh_files::little(size) + mesh_files::little(static_cast<std::uint16_t>(~size)) + data +
           bytes(b << 16 | a, std::endian::big);
}

enum class Format { ascii, binary, raw, base64 };

struct Style {
    Format format = Format::ascii;
    bool is_compressed = false, has_wide_headers = false;
    std::endian order = std::endian::little;
    std::size_t block_bytes = 16; // of what is compressed
};

// Collects arrays; what is appended stands behind the rest.
class VtpFile {
public:
    explicit VtpFile(Style style) : style_(style) {}

    template <class T>
    std::string array(const std::string& type, const std::string& name, int components, const std::vector<T>& values) {
        std::string start = "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
                            std::to_string(components) + "\" format=\"";
        if (style_.format == Format::ascii) {
            std::string text;
            for (const T value : values) text += number(value) + " ";
            return start + "ascii\">\n" + text + "\n</DataArray>\n";
        }
        std::string data;
        for (const T value : values) data += bytes(value, style_.order);
        if (style_.format == Format::binary) return start + "binary\">\n" + encoded(data, true) + "\n</DataArray>\n";
        const std::string at = std::to_string(appended_.size());
        appended_ += encoded(data, style_.format == Format::base64);
        return start + "appended\" offset=\"" + at + "\"/>\n";
    }

    std::string whole(const std::string& pieces) const {
        std::string file = std::string("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
                                       "byte_order=\"") +
                           (style_.order == std::endian::little ? "LittleEndian" : "BigEndian") + "\" header_type=\"" +
                           (style_.has_wide_headers ? "UInt64" : "UInt32") + "\"" +
                           (style_.is_compressed ? " compressor=\"vtkZLibDataCompressor\"" : "") + ">\n<PolyData>\n" +
                           pieces + "</PolyData>\n";
        if (style_.format == Format::raw || style_.format == Format::base64)
            file += std::string("<AppendedData encoding=\"") + (style_.format == Format::raw ? "raw" : "base64") +
                    "\">\n_" + appended_ + tail_of_appended();
        return file + "</VTKFile>";
    }
    static std::string tail_of_appended() { return "\n</AppendedData>\n"; }

private:
    template <class T>
    static std::string number(T value) {
        if constexpr (std::is_floating_point_v<T>) {
            std::array<char, 64> digits;
            return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
        } else {
            return std::to_string(value);
        }
    }
    std::string header(std::uint64_t value) const {
        return style_.has_wide_headers ? bytes(value, style_.order)
                                       : bytes(static_cast<std::uint32_t>(value), style_.order);
    }
    // Headers of compressed data are encoded apart from them.
    std::string encoded(const std::string& data, bool is_base64) const {
        const auto coded = [&](const std::string& part) { return is_base64 ? base64(part) : part; };
        if (!style_.is_compressed) return coded(header(data.size()) + data);
        std::vector<std::string> blocks;
        for (std::size_t at = 0; at < data.size(); at += style_.block_bytes)
            blocks.push_back(zlib_stored(data.substr(at, style_.block_bytes)));
        std::string head =
            header(blocks.size()) + header(style_.block_bytes) + header(data.size() % style_.block_bytes);
        std::string body;
        for (const std::string& block : blocks) {
            head += header(block.size());
            body += block;
        }
        return coded(head) + coded(body);
    }

    Style style_;
    std::string appended_;
};

inline const std::vector<double> heights = {0.1, -1e300, std::numeric_limits<double>::quiet_NaN(), 4};
inline const std::vector<std::int16_t> labels = {7, -32768, 32767, 0};

inline std::string vtp_quad(Style style) {
    VtpFile file(style);
    std::string piece = "<Piece NumberOfPoints=\"4\" NumberOfPolys=\"1\">\n<PointData Scalars=\"height\">\n";
    piece += file.array("Float64", "height", 1, heights);
    piece += file.array("Int16", "label", 1, labels);
    piece += "</PointData>\n<Points>\n" +
             file.array<float>("Float32", "Points", 3, {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) + "</Points>\n<Polys>\n";
    piece += file.array<std::int32_t>("Int32", "connectivity", 1, {0, 1, 2, 3});
    piece += file.array<std::int32_t>("Int32", "offsets", 1, {4}) + "</Polys>\n</Piece>\n";
    return file.whole(piece);
}

// One small file of every kind: name and bytes.
inline std::vector<std::pair<std::string, std::string>> samples() {
    return {{"ascii.vtp", vtp_quad({Format::ascii})},
            {"binary.vtp", vtp_quad({Format::binary, false, true, std::endian::big})},
            {"binary_zlib.vtp", vtp_quad({Format::binary, true})},
            {"raw.vtp", vtp_quad({Format::raw})},
            {"raw_zlib.vtp", vtp_quad({Format::raw, true, true})},
            {"base64_zlib.vtp", vtp_quad({Format::base64, true})}};
}

} // namespace vtp_files
