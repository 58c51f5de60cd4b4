// Decodes images to texels: JPEG by libjpeg, the others by perception.
#include "texture_image.h"

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <new>

#include <jerror.h>
#include <jpeglib.h>

#include <unseen/perception/image.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/input_file.h>

namespace unseen::session {
namespace {

using vdtree::Texel;
using vdtree::Texture;

constexpr int most_scans = 100; // of a progressive JPEG: more only take time

Error malformed(const std::filesystem::path& name, const std::string& what) {
    return {ErrorCode::malformed_data, name.string() + ": " + what};
}

Result<void> check_size(const std::filesystem::path& name, std::uint64_t width, std::uint64_t height) {
    const std::string size = std::to_string(width) + " x " + std::to_string(height);
    if (width == 0 || height == 0) return malformed(name, "the header gives an empty image (" + size + ").");
    if (width > vdtree::largest_texture_side || height > vdtree::largest_texture_side)
        return malformed(name, "the image has " + size + " pixels, and a texture at most " +
                                   std::to_string(vdtree::largest_texture_side) + " a side; scale it down.");
    return {};
}

// ---- JPEG

// libjpeg leaves by longjmp: every object with a destructor lives in here, and each step is run by itself.
struct JpegReader {
    jpeg_decompress_struct info{};
    jpeg_error_mgr errors{};
    jpeg_progress_mgr progress{};
    std::jmp_buf jump;
    std::array<char, JMSG_LENGTH_MAX> message{};
    bool is_damaged = false; // by a warning: data are missing, and were made up
    std::string_view bytes;
    JSAMPROW row = nullptr;

    JpegReader() = default;
    JpegReader(const JpegReader&) = delete;
    JpegReader& operator=(const JpegReader&) = delete;
    ~JpegReader() { jpeg_destroy_decompress(&info); }
};

JpegReader& reader_of(j_common_ptr info) { return *static_cast<JpegReader*>(info->client_data); }

[[noreturn]] void on_jpeg_error(j_common_ptr info) {
    JpegReader& reader = reader_of(info);
    info->err->format_message(info, reader.message.data());
    std::longjmp(reader.jump, 1);
}
void on_jpeg_message(j_common_ptr info, int level) {
    JpegReader& reader = reader_of(info);
    const bool is_harmless =
        level >= 0 || info->err->msg_code == JWRN_EXTRANEOUS_DATA; // bytes between parts, as cameras leave them
    if (is_harmless || reader.is_damaged) return;
    reader.is_damaged = true;
    info->err->format_message(info, reader.message.data());
}
void on_jpeg_progress(j_common_ptr info) {
    JpegReader& reader = reader_of(info);
    if (reader.info.input_scan_number <= most_scans) return;
    std::snprintf(reader.message.data(), reader.message.size(), "more than %d scans", most_scans);
    std::longjmp(reader.jump, 1);
}

bool guarded(JpegReader& reader, void (*step)(JpegReader&)) {
    if (setjmp(reader.jump) != 0) return false;
    step(reader);
    return true;
}

void begin(JpegReader& r) {
    r.info.err = jpeg_std_error(&r.errors);
    r.errors.error_exit = on_jpeg_error;
    r.errors.emit_message = on_jpeg_message;
    r.info.client_data = &r;
    jpeg_create_decompress(&r.info);
    r.progress.progress_monitor = on_jpeg_progress;
    r.info.progress = &r.progress;
    jpeg_mem_src(&r.info, reinterpret_cast<const unsigned char*>(r.bytes.data()),
                 static_cast<unsigned long>(r.bytes.size()));
    jpeg_read_header(&r.info, TRUE);
}
void start(JpegReader& r) {
    r.info.out_color_space = JCS_RGB;
    jpeg_start_decompress(&r.info);
}
void read_row(JpegReader& r) { jpeg_read_scanlines(&r.info, &r.row, 1); }
void finish(JpegReader& r) { jpeg_finish_decompress(&r.info); }

Result<Texture> decode_jpeg(std::string_view bytes, const std::filesystem::path& name) {
    JpegReader reader;
    reader.bytes = bytes;
    const auto complain = [&] { return malformed(name, "damaged JPEG: " + std::string(reader.message.data()) + "."); };
    if (!guarded(reader, begin)) return complain();
    const std::uint64_t width = reader.info.image_width, height = reader.info.image_height;
    if (const auto ok = check_size(name, width, height); !ok) return ok.error();
    if (width * height > perception::most_pixels_in(bytes.size()))
        return malformed(name, "the header gives " + std::to_string(width) + " x " + std::to_string(height) +
                                   " pixels, which " + std::to_string(bytes.size()) + " bytes cannot hold.");
    if (reader.info.jpeg_color_space == JCS_CMYK || reader.info.jpeg_color_space == JCS_YCCK)
        return malformed(name, "its colours are those of four inks; convert it to RGB.");
    if (!guarded(reader, start)) return complain();
    Texture texture;
    texture.width = static_cast<std::uint32_t>(width);
    texture.height = static_cast<std::uint32_t>(height);
    texture.texels.reserve(static_cast<std::size_t>(width * height));
    std::vector<JSAMPLE> row(static_cast<std::size_t>(width) * 3);
    reader.row = row.data();
    while (reader.info.output_scanline < reader.info.output_height) {
        const JDIMENSION before = reader.info.output_scanline;
        if (!guarded(reader, read_row) || reader.info.output_scanline == before) return complain();
        if (reader.is_damaged)
            return malformed(name,
                             "damaged JPEG at row " + std::to_string(before) + ": " + reader.message.data() + ".");
        for (std::size_t i = 0; i < row.size(); i += 3) texture.texels.push_back({row[i], row[i + 1], row[i + 2], 255});
    }
    if (!guarded(reader, finish) || reader.is_damaged) return complain();
    return texture;
}

// ---- all others

std::uint8_t code_of(double encoded) { return static_cast<std::uint8_t>(std::clamp(encoded, 0.0, 1.0) * 255 + 0.5); }

Result<Texture> decode_codes(std::string_view bytes, const std::filesystem::path& name) {
    Texture texture;
    const auto take = [&](const perception::ImageFile& file, int y, std::span<const float> row) -> Result<void> {
        const auto width = static_cast<std::uint32_t>(file.image.width),
                   height = static_cast<std::uint32_t>(file.image.height);
        if (y == 0) {
            if (const auto ok = check_size(name, width, height); !ok) return ok;
            texture.width = width, texture.height = height;
            texture.texels.reserve(std::size_t{width} * height);
        }
        const auto channels = static_cast<std::size_t>(file.image.channels);
        for (std::size_t i = 0; i < row.size(); i += channels) {
            Texel texel{0, 0, 0, 255};
            if (channels % 2 == 0) texel[3] = code_of(static_cast<double>(row[i + channels - 1]));
            for (std::size_t c = 0; c < 3; ++c) {
                const float value = row[channels <= 2 ? i : i + c];
                if (!(value >= 0 && value <= 1))
                    return malformed(name, "the value of pixel (" + std::to_string(i / channels) + ", " +
                                               std::to_string(y) + ") is " + std::to_string(value) +
                                               ", and a texture has values from 0 to 1; scale them.");
                texel[c] =
                    code_of(file.is_absolute ? linear_to_srgb(static_cast<double>(value)) : static_cast<double>(value));
            }
            texture.texels.push_back(texel);
        }
        return {};
    };
    const auto decoded = perception::decode_rows(bytes, name, take, true);
    return decoded ? Result<Texture>(std::move(texture)) : decoded.error();
}

void turn_upside_down(Texture& texture) {
    for (std::uint32_t y = 0; y < texture.height / 2; ++y) {
        const auto row = texture.texels.begin() + static_cast<std::ptrdiff_t>(std::size_t{y} * texture.width);
        std::swap_ranges(row, row + texture.width,
                         texture.texels.end() - static_cast<std::ptrdiff_t>((std::size_t{y} + 1) * texture.width));
    }
}

} // namespace

Result<Texture> decode_texture(std::string_view bytes, const std::filesystem::path& name, bool from_top) {
    const auto decode = [&]() -> Result<Texture> {
        if (bytes.empty()) return malformed(name, "is empty, not an image.");
        if (bytes.starts_with("\xFF\xD8\xFF")) return decode_jpeg(bytes, name);
        if (!perception::is_image(bytes))
            return malformed(name, "is neither PNG, JPEG, PFM nor EXR (told by its first bytes).");
        return decode_codes(bytes, name);
    };
    try {
        auto texture = decode();
        if (texture && !from_top) turn_upside_down(*texture);
        return texture;
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::unsupported,
                     name.string() + ": needs more memory than this machine has; scale the image down."};
    }
}

Result<Texture> read_texture(const std::filesystem::path& file, bool from_top) {
    const auto bytes = read_regular_file(file);
    return bytes ? decode_texture(*bytes, file, from_top) : bytes.error();
}

} // namespace unseen::session
