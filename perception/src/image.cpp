// Luminance images and their files: PNG by libpng, EXR by OpenEXR, PFM by hand. A file is read into memory whole; what
// its header claims is checked against its length before anything is allocated for it, and pixels grow as they decode.
#include <unseen/perception/image.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <exception>
#include <limits>
#include <optional>

#include <Iex.h>
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <png.h>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

namespace unseen::perception {
namespace {

constexpr std::uint64_t largest_side = 32768;                   // pixels
constexpr std::uint64_t largest_count = std::uint64_t{1} << 28; // pixels
// No compressed byte of PNG or EXR's deflate can grow to more than 1032 bytes; its other methods stay near that.
constexpr std::uint64_t largest_expansion = 2048;
constexpr std::uint64_t small_buffer = std::uint64_t{1} << 26; // bytes that any file may ask for
constexpr std::uint64_t most_exr_channels = 64;                // of one file; more is no picture

using Bytes = std::vector<unsigned char>;        // written
using ByteView = std::span<const unsigned char>; // read

Error malformed(const std::filesystem::path& file, const std::string& what) {
    return {ErrorCode::malformed_data, file.string() + ": " + what};
}
Error io_error(const std::filesystem::path& file, const std::string& what) {
    return {ErrorCode::io_failure, file.string() + ": " + what};
}
Error unsupported(const std::filesystem::path& file, const std::string& what) {
    return {ErrorCode::unsupported, file.string() + ": " + what};
}

std::string too_many_pixels(std::uint64_t width, std::uint64_t height, std::uint64_t file_bytes) {
    return "the header gives " + std::to_string(width) + " x " + std::to_string(height) + " pixels, which " +
           std::to_string(file_bytes) + " bytes cannot hold";
}

// Sizes as a header gives them, before they are believed.
std::optional<std::string> size_complaint(std::uint64_t width, std::uint64_t height, std::uint64_t file_bytes) {
    const std::string size = std::to_string(width) + " x " + std::to_string(height);
    if (width == 0 || height == 0) return "the header gives an empty image (" + size + ")";
    if (width > largest_side || height > largest_side) {
        return "the header gives " + size + " pixels; at most 32768 a side can be read, so scale the image down";
    }
    if (width * height > largest_count) {
        return "the header gives " + size + " pixels; at most 2^28 in all can be read, so scale the image down";
    }
    if (width * height > most_pixels_in(file_bytes)) return too_many_pixels(width, height, file_bytes);
    return std::nullopt;
}

// Hands over a row, whose values must be finite.
Result<void> hand_over(const std::filesystem::path& file, const ImageFile& header, int y, std::span<const float> row,
                       const TakeRow& take) {
    for (std::size_t i = 0; i < row.size(); ++i) {
        if (std::isfinite(row[i])) continue;
        const std::size_t x = i / static_cast<std::size_t>(header.image.channels);
        return malformed(file, "the value of pixel (" + std::to_string(x) + ", " + std::to_string(y) +
                                   ") is not a finite number");
    }
    return take(header, y, row);
}

// ---- PNG ----------------------------------------------------------------------------------------------------------

// libpng leaves by longjmp. So every object with a destructor lives out here, and `guarded` runs one step at a time,
// whose own frame holds nothing to destroy.
struct PngCodec {
    png_structp png = nullptr;
    png_infop info = nullptr;
    std::string message;

    PngCodec() = default;
    PngCodec(const PngCodec&) = delete;
    PngCodec& operator=(const PngCodec&) = delete;
};

struct PngReader : PngCodec {
    ByteView bytes;
    std::size_t position = 0;
    bool is_interlaced = false, keeps_alpha = false;
    std::size_t row_bytes = 0;
    png_bytep row = nullptr;
    png_bytepp rows = nullptr;

    ~PngReader() {
        if (png != nullptr) png_destroy_read_struct(&png, &info, nullptr);
    }
};

struct PngWriter : PngCodec {
    Bytes bytes;
    png_uint_32 width = 0, height = 0;
    int colour_type = 0;
    png_bytepp rows = nullptr;

    ~PngWriter() {
        if (png != nullptr) png_destroy_write_struct(&png, &info);
    }
};

[[noreturn]] void on_png_error(png_structp png, png_const_charp text) {
    static_cast<PngCodec*>(png_get_error_ptr(png))->message = text;
    png_longjmp(png, 1);
}
void on_png_warning(png_structp, png_const_charp) {}

template <class Codec>
bool guarded(Codec& codec, void (*step)(Codec&)) {
    if (setjmp(png_jmpbuf(codec.png)) != 0) return false;
    step(codec);
    return true;
}

void png_read_from_memory(png_structp png, png_bytep to, std::size_t count) {
    auto* reader = static_cast<PngReader*>(png_get_io_ptr(png));
    if (count > reader->bytes.size() - reader->position) png_error(png, "the file ends too early");
    std::memcpy(to, reader->bytes.data() + reader->position, count);
    reader->position += count;
}

void png_read_header(PngReader& r) {
    png_set_read_fn(r.png, &r, png_read_from_memory);
    png_set_user_limits(r.png, largest_side, largest_side);
    png_read_info(r.png, r.info);
}

// To grey or RGB of 8 or 16 bits, perhaps with alpha. Gamma and colour profiles are left alone: code values are wanted as they are.
void png_set_transforms(PngReader& r) {
    png_set_expand(r.png);
    if (!r.keeps_alpha) png_set_strip_alpha(r.png);
    png_set_interlace_handling(r.png);
    png_read_update_info(r.png, r.info);
}

void png_decode_row(PngReader& r) { png_read_row(r.png, r.row, nullptr); }
void png_decode_all(PngReader& r) { png_read_image(r.png, r.rows); }
void png_finish(PngReader& r) { png_read_end(r.png, nullptr); }

void decode_codes(const unsigned char* codes, int bits, std::span<float> row) {
    for (std::size_t i = 0; i < row.size(); ++i) {
        const double code = bits == 16 ? codes[2 * i] * 256 + codes[2 * i + 1] : codes[i];
        row[i] = static_cast<float>(code / (bits == 16 ? 65535 : 255));
    }
}

Result<void> decode_png_rows(PngReader& reader, const std::filesystem::path& file, const ImageFile& header,
                             const TakeRow& take) {
    const auto damaged = [&](const std::string& where) {
        return malformed(file,
                         "damaged PNG at byte " + std::to_string(reader.position) + ", " + where + reader.message);
    };
    const auto height = static_cast<std::size_t>(header.image.height);
    // Interlaced rows arrive in seven passes, so the whole image has to stand.
    Bytes pixels(reader.row_bytes * (reader.is_interlaced ? height : 1));
    std::vector<png_bytep> rows;
    if (reader.is_interlaced) {
        for (std::size_t y = 0; y < height; ++y) rows.push_back(pixels.data() + y * reader.row_bytes);
        reader.rows = rows.data();
        if (!guarded(reader, png_decode_all)) return damaged("");
    }
    std::vector<float> row(header.image.index(0, 1, 0));
    for (std::size_t y = 0; y < height; ++y) {
        reader.row = reader.is_interlaced ? rows[y] : pixels.data();
        if (!reader.is_interlaced && !guarded(reader, png_decode_row))
            return damaged("row " + std::to_string(y) + ": ");
        decode_codes(reader.row, header.bits, row);
        if (auto taken = take(header, static_cast<int>(y), row); !taken) return taken;
    }
    if (!guarded(reader, png_finish)) return damaged("after the pixels: ");
    return {};
}

Result<ImageFile> read_png(const std::filesystem::path& file, ByteView bytes, const TakeRow& take, bool keeps_alpha) {
    PngReader reader;
    reader.bytes = bytes;
    reader.keeps_alpha = keeps_alpha;
    reader.png =
        png_create_read_struct(PNG_LIBPNG_VER_STRING, static_cast<PngCodec*>(&reader), on_png_error, on_png_warning);
    if (reader.png != nullptr) reader.info = png_create_info_struct(reader.png);
    if (reader.info == nullptr) return io_error(file, "libpng could not be started");
    const auto complain = [&](const std::string& what) {
        return malformed(file, "damaged PNG at byte " + std::to_string(reader.position) + ", " + what);
    };
    if (!guarded(reader, png_read_header)) return complain(reader.message);

    const std::uint64_t width = png_get_image_width(reader.png, reader.info);
    const std::uint64_t height = png_get_image_height(reader.png, reader.info);
    if (const auto complaint = size_complaint(width, height, bytes.size())) return malformed(file, *complaint);
    const std::uint64_t raw = height * (1 + png_get_rowbytes(reader.png, reader.info));
    if (raw / largest_expansion > bytes.size()) return malformed(file, too_many_pixels(width, height, bytes.size()));
    reader.is_interlaced = png_get_interlace_type(reader.png, reader.info) != PNG_INTERLACE_NONE;
    if (!guarded(reader, png_set_transforms)) return complain(reader.message);
    reader.row_bytes = png_get_rowbytes(reader.png, reader.info);

    ImageFile header;
    header.bits = png_get_bit_depth(reader.png, reader.info) == 16 ? 16 : 8;
    header.image.width = static_cast<int>(width);
    header.image.height = static_cast<int>(height);
    header.image.channels = png_get_channels(reader.png, reader.info);
    const int alpha = reader.keeps_alpha && header.image.channels % 2 == 0 ? 1 : 0;
    if (header.image.channels - alpha != 1 && header.image.channels - alpha != 3)
        return complain("neither grey nor RGB");
    if (auto decoded = decode_png_rows(reader, file, header, take); !decoded) return decoded.error();
    return header;
}

void png_write_to_memory(png_structp png, png_bytep from, std::size_t count) {
    auto* writer = static_cast<PngWriter*>(png_get_io_ptr(png));
    bool is_stored = true;
    try {
        writer->bytes.insert(writer->bytes.end(), from, from + count);
    } catch (const std::exception&) { // must not pass through libpng's C frames
        is_stored = false;
    }
    if (!is_stored) png_error(png, "out of memory");
}
void png_flush_nothing(png_structp) {}

void png_write_all(PngWriter& w) {
    png_set_write_fn(w.png, &w, png_write_to_memory, png_flush_nothing);
    png_set_user_limits(w.png, largest_side, largest_side);
    png_set_IHDR(w.png, w.info, w.width, w.height, 8, w.colour_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(w.png, w.info);
    png_write_image(w.png, w.rows);
    png_write_end(w.png, w.info);
}

Result<Bytes> encode_png(const std::filesystem::path& file, const Image& image) {
    Bytes codes;
    codes.reserve(image.values.size());
    for (const float v : image.values)
        codes.push_back(static_cast<unsigned char>(std::lround(255 * std::clamp(v, 0.0F, 1.0F))));
    std::vector<png_bytep> rows;
    for (int y = 0; y < image.height; ++y) rows.push_back(codes.data() + image.index(0, y, 0));

    PngWriter writer;
    writer.png =
        png_create_write_struct(PNG_LIBPNG_VER_STRING, static_cast<PngCodec*>(&writer), on_png_error, on_png_warning);
    if (writer.png != nullptr) writer.info = png_create_info_struct(writer.png);
    if (writer.info == nullptr) return io_error(file, "libpng could not be started");
    writer.width = static_cast<png_uint_32>(image.width);
    writer.height = static_cast<png_uint_32>(image.height);
    writer.colour_type = image.channels == 1 ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGB;
    writer.rows = rows.data();
    if (!guarded(writer, png_write_all)) return io_error(file, "libpng: " + writer.message);
    return std::move(writer.bytes);
}

// ---- PFM ----------------------------------------------------------------------------------------------------------

// The three whitespace-separated words after the magic; one white character ends the header.
struct PfmHeader {
    int channels = 1;
    std::uint64_t width = 0, height = 0;
    double scale = 0;
    std::size_t data = 0; // byte at which the pixels begin
};

bool is_white(unsigned char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

// The next word of the header, empty where there is none or where it is longer than any number need be.
std::string_view next_word(ByteView bytes, std::size_t& position) {
    constexpr std::size_t longest = 64;
    while (position < bytes.size() && is_white(bytes[position])) ++position;
    const std::size_t begin = position;
    while (position < bytes.size() && !is_white(bytes[position])) {
        if (++position - begin > longest) return {};
    }
    return {reinterpret_cast<const char*>(bytes.data()) + begin, position - begin};
}

template <class Number>
bool parse(std::string_view word, Number& number) {
    const auto parsed = number_from<Number>(word);
    if (parsed) number = *parsed;
    return parsed.has_value();
}

Result<PfmHeader> parse_pfm_header(const std::filesystem::path& file, ByteView bytes) {
    PfmHeader header;
    header.channels = bytes[1] == 'F' ? 3 : 1;
    std::size_t position = 2;
    const auto complain = [&](const char* what) {
        return malformed(file, std::string("the PFM header has no valid ") + what + " before byte " +
                                   std::to_string(position));
    };
    if (!parse(next_word(bytes, position), header.width)) return complain("width");
    if (!parse(next_word(bytes, position), header.height)) return complain("height");
    if (!parse(next_word(bytes, position), header.scale) || !std::isfinite(header.scale) || header.scale == 0)
        return complain("scale (negative: little-endian, positive: big-endian)");
    if (const auto complaint = size_complaint(header.width, header.height, bytes.size()))
        return malformed(file, *complaint);
    header.data = position + 1;
    const std::uint64_t need = header.width * header.height * static_cast<std::uint64_t>(header.channels) * 4;
    const std::uint64_t have = bytes.size() > header.data ? bytes.size() - header.data : 0;
    if (have != need)
        return malformed(file, "the PFM header asks for " + std::to_string(need) + " bytes of pixels, the file holds " +
                                   std::to_string(have));
    return header;
}

float float_at(const unsigned char* bytes, bool is_little) {
    std::uint32_t word = 0;
    for (unsigned i = 0; i < 4; ++i) word |= std::uint32_t{bytes[i]} << (8 * (is_little ? i : 3 - i));
    return std::bit_cast<float>(word);
}

// The size of the scale is not applied: programs disagree on its meaning, and ours are absolute values.
Result<ImageFile> read_pfm(const std::filesystem::path& file, ByteView bytes, const TakeRow& take) {
    const auto pfm = parse_pfm_header(file, bytes);
    if (!pfm) return pfm.error();
    ImageFile header;
    header.is_absolute = true;
    header.bits = 32;
    header.image = {static_cast<int>(pfm->width), static_cast<int>(pfm->height), pfm->channels, {}};
    std::vector<float> row(header.image.index(0, 1, 0));
    for (int y = 0; y < header.image.height; ++y) {
        const std::size_t from_bottom = static_cast<std::size_t>(header.image.height - 1 - y);
        const unsigned char* line = bytes.data() + pfm->data + 4 * row.size() * from_bottom;
        for (std::size_t i = 0; i < row.size(); ++i) row[i] = float_at(line + 4 * i, pfm->scale < 0);
        if (auto taken = hand_over(file, header, y, row, take); !taken) return taken.error();
    }
    return header;
}

Bytes encode_pfm(const Image& image) {
    const std::string header = std::string(image.channels == 3 ? "PF" : "Pf") + "\n" + std::to_string(image.width) +
                               " " + std::to_string(image.height) + "\n-1.0\n";
    Bytes bytes(header.begin(), header.end());
    bytes.reserve(header.size() + 4 * image.values.size());
    const std::size_t row = image.index(0, 1, 0);
    for (int y = image.height - 1; y >= 0; --y) {
        for (std::size_t i = 0; i < row; ++i) {
            const auto word = std::bit_cast<std::uint32_t>(image.values[image.index(0, y, 0) + i]);
            for (unsigned k = 0; k < 4; ++k) bytes.push_back(static_cast<unsigned char>((word >> (8 * k)) & 255U));
        }
    }
    return bytes;
}

// ---- EXR ----------------------------------------------------------------------------------------------------------

class MemoryInput : public Imf::IStream {
public:
    explicit MemoryInput(ByteView bytes) : Imf::IStream("image"), bytes_(bytes) {}
    bool read(char to[], int count) override {
        if (count < 0 || static_cast<std::uint64_t>(count) > bytes_.size() - position_)
            throw Iex::InputExc("the file ends too early");
        std::memcpy(to, bytes_.data() + position_, static_cast<std::size_t>(count));
        position_ += static_cast<std::uint64_t>(count);
        return position_ < bytes_.size();
    }
    std::uint64_t tellg() override { return position_; }
    void seekg(std::uint64_t position) override {
        if (position > bytes_.size()) throw Iex::InputExc("an offset points behind the end of the file");
        position_ = position;
    }

private:
    ByteView bytes_;
    std::uint64_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
public:
    MemoryOutput() : Imf::OStream("image") {}
    void write(const char from[], int count) override {
        const std::size_t end = static_cast<std::size_t>(position_) + static_cast<std::size_t>(count);
        if (bytes.size() < end) bytes.resize(end);
        std::memcpy(bytes.data() + position_, from, static_cast<std::size_t>(count));
        position_ = end;
    }
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }
    Bytes bytes;

private:
    std::uint64_t position_ = 0;
};

// A walk over the header's attributes that believes nothing. OpenEXR allocates what an attribute's length, the data
// window and the channel list claim, so those are settled against the file before it is called.
class ExrHeaderCheck {
public:
    ExrHeaderCheck(const std::filesystem::path& file, ByteView bytes) : file_(file), bytes_(bytes) {}

    Result<void> run() {
        const std::uint32_t version = word(4);
        if ((version & 255U) != 2) return unsupported(file_, "is an EXR file of another version than 2");
        if ((version & 0x1A00U) != 0) {
            return unsupported(file_, "is a tiled, deep or multi-part EXR file; save it as one part of scan lines");
        }
        std::size_t position = 8;
        while (true) {
            const auto name = text(position);
            if (!name) return truncated(position);
            if (name->empty()) break;
            const auto type = text(position);
            if (!type || bytes_.size() - position < 4) return truncated(position);
            const std::uint64_t size = word(position);
            position += 4;
            if (size > bytes_.size() - position) return truncated(position);
            if (auto ok = attribute(*name, *type, position, static_cast<std::size_t>(size)); !ok) return ok;
            position += static_cast<std::size_t>(size);
        }
        return check_sizes(bytes_.size() - position);
    }

private:
    Result<void> truncated(std::size_t position) const {
        return malformed(file_, "the EXR header runs past the end of the file at byte " + std::to_string(position));
    }
    std::uint32_t word(std::size_t position) const {
        std::uint32_t value = 0;
        for (unsigned i = 0; i < 4; ++i) value |= std::uint32_t{bytes_[position + i]} << (8 * i);
        return value;
    }
    // A zero-terminated name of at most 255 characters.
    std::optional<std::string_view> text(std::size_t& position) const {
        const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(position);
        const auto limit = begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(bytes_.size() - position, 256));
        const auto end = std::find(begin, limit, 0);
        if (end == limit) return std::nullopt;
        const std::string_view found(reinterpret_cast<const char*>(bytes_.data()) + position,
                                     static_cast<std::size_t>(end - begin));
        position += found.size() + 1;
        return found;
    }

    // OpenEXR reads what a known type needs, whatever length the file gives; where the two differ it would go on in the
    // middle of an attribute and see another header than this walk.
    bool has_its_length(std::string_view type, std::size_t position, std::size_t size) const {
        static constexpr std::pair<std::size_t, std::string_view> types_of_length[] = {
            {1, " compression deepImageState envmap lineOrder "},
            {4, " float int "},
            {8, " double rational timecode v2f v2i "},
            {9, " tiledesc "},
            {12, " v3f v3i "},
            {16, " box2f box2i v2d "},
            {24, " v3d "},
            {28, " keycode "},
            {32, " chromaticities "},
            {36, " m33f "},
            {64, " m44f "},
            {72, " m33d "},
            {128, " m44d "}};
        const std::string word_of_type = " " + std::string(type) + " ";
        for (const auto& [length, types] : types_of_length)
            if (types.find(word_of_type) != types.npos) return size == length;
        if (type == "floatvector") return size % 4 == 0;
        if (type != "preview") return true;
        return size >= 8 && std::uint64_t{4} * word(position) * word(position + 4) == size - 8;
    }

    Result<void> attribute(std::string_view name, std::string_view type, std::size_t position, std::size_t size) {
        if (!has_its_length(type, position, size))
            return malformed(file_, "the EXR attribute at byte " + std::to_string(position) + " has a wrong length");
        if (name == "dataWindow" && type == "box2i") {
            std::array<std::int64_t, 4> box{};
            for (std::size_t i = 0; i < 4; ++i) box[i] = std::bit_cast<std::int32_t>(word(position + 4 * i));
            const std::int64_t width = box[2] - box[0] + 1, height = box[3] - box[1] + 1;
            if (width <= 0 || height <= 0) return malformed(file_, "the EXR data window is empty");
            if (auto complaint = size_complaint(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height),
                                                bytes_.size()))
                return malformed(file_, *complaint);
            width_ = static_cast<std::uint64_t>(width);
            height_ = static_cast<std::uint64_t>(height);
        } else if (name == "compression" && type == "compression") {
            compression_ = bytes_[position];
        } else if (type == "chlist" && !count_channels(position, position + size)) {
            return malformed(file_, "the EXR channel list at byte " + std::to_string(position) + " is damaged");
        }
        return {};
    }

    bool count_channels(std::size_t position, std::size_t end) {
        constexpr std::size_t after_name = 16; // type, linearity, sampling rates
        std::uint64_t count = 0;
        while (true) {
            const auto name = text(position);
            if (!name || position > end) return false;
            if (name->empty()) break;
            ++count;
            if (end - position < after_name) return false;
            position += after_name;
        }
        channels_ = std::max(channels_, count);
        return position == end;
    }

    Result<void> check_sizes(std::uint64_t rest) const {
        if (width_ == 0) return malformed(file_, "the EXR header has no data window");
        if (channels_ > most_exr_channels) {
            return unsupported(file_, "has " + std::to_string(channels_) + " channels; keep Y or R, G and B");
        }
        const std::uint64_t lines = lines_per_chunk();
        const std::uint64_t chunks = (height_ + lines - 1) / lines;
        if (chunks * 8 > rest)
            return malformed(file_, "the EXR header promises " + std::to_string(chunks) + " chunks, but only " +
                                        std::to_string(rest) + " bytes follow it");
        if (lines * width_ * channels_ * 4 > std::max(small_buffer, bytes_.size() * largest_expansion))
            return malformed(file_, "a chunk of the EXR file would be out of proportion to its " +
                                        std::to_string(bytes_.size()) + " bytes");
        return {};
    }

    std::uint64_t lines_per_chunk() const {
        switch (compression_) {
        case Imf::NO_COMPRESSION:
        case Imf::RLE_COMPRESSION:
        case Imf::ZIPS_COMPRESSION: return 1;
        case Imf::ZIP_COMPRESSION:
        case Imf::PXR24_COMPRESSION: return 16;
        case Imf::DWAB_COMPRESSION: return 256;
        default: return 32;
        }
    }

    const std::filesystem::path& file_;
    ByteView bytes_;
    std::uint64_t width_ = 0, height_ = 0, channels_ = 0;
    unsigned compression_ = 0;
};

// Luminance where there is one, else colour, else the only channel.
Result<std::vector<std::string>> choose_channels(const std::filesystem::path& file, const Imf::ChannelList& list) {
    std::vector<std::string> all;
    for (auto it = list.begin(); it != list.end(); ++it) all.emplace_back(it.name());
    std::vector<std::string> chosen;
    if (list.findChannel("Y") != nullptr) chosen = {"Y"};
    else if (list.findChannel("R") != nullptr && list.findChannel("G") != nullptr && list.findChannel("B") != nullptr)
        chosen = {"R", "G", "B"};
    else if (all.size() == 1) chosen = all;
    else return unsupported(file, "has neither a channel Y, nor R, G and B, nor a single channel");
    for (const std::string& name : chosen) {
        const Imf::Channel& channel = list[name.c_str()];
        if (channel.type == Imf::UINT || channel.xSampling != 1 || channel.ySampling != 1)
            return unsupported(file, "channel " + name + " is not float or half at full resolution");
    }
    return chosen;
}

// Decodes a strip of rows at a time.
Result<void> read_exr_pixels(Imf::InputFile& input, const std::vector<std::string>& channels,
                             const std::filesystem::path& file, const ImageFile& header, const TakeRow& take) {
    constexpr int strip_rows = 32; // lines of a usual chunk, so that none is decoded twice
    const auto window = input.header().dataWindow();
    const std::size_t pixel_bytes = channels.size() * sizeof(float), row_values = header.image.index(0, 1, 0);
    std::vector<float> strip(row_values * strip_rows);
    for (int row = 0; row < header.image.height; row += strip_rows) {
        const int rows = std::min(strip_rows, header.image.height - row);
        const int top = window.min.y + row;
        Imf::FrameBuffer frame;
        for (std::size_t c = 0; c < channels.size(); ++c)
            frame.insert(channels[c],
                         Imf::Slice::Make(Imf::FLOAT, strip.data() + c, Imath::V2i(window.min.x, top),
                                          header.image.width, rows, pixel_bytes, row_values * sizeof(float)));
        input.setFrameBuffer(frame);
        input.readPixels(top, top + rows - 1);
        for (int i = 0; i < rows; ++i) {
            const std::span values(strip.data() + row_values * static_cast<std::size_t>(i), row_values);
            if (auto taken = hand_over(file, header, row + i, values, take); !taken) return taken;
        }
    }
    return {};
}

Result<ImageFile> read_exr(const std::filesystem::path& file, ByteView bytes, const TakeRow& take) {
    if (bytes.size() < 8) return malformed(file, "ends within the EXR header");
    if (auto ok = ExrHeaderCheck(file, bytes).run(); !ok) return ok.error();
    try {
        MemoryInput stream(bytes);
        Imf::InputFile input(stream, 0); // decode on this thread
        const auto window = input.header().dataWindow();
        const auto channels = choose_channels(file, input.header().channels());
        if (!channels) return channels.error();
        ImageFile header;
        header.is_absolute = true;
        header.bits = 32;
        header.image = {
            window.max.x - window.min.x + 1, window.max.y - window.min.y + 1, static_cast<int>(channels->size()), {}};
        if (auto read = read_exr_pixels(input, *channels, file, header, take); !read) return read.error();
        return header;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& e) {
        return malformed(file, std::string("damaged EXR: ") + e.what());
    }
}

Result<Bytes> encode_exr(const std::filesystem::path& file, const Image& image) {
    try {
        Imf::Header header(image.width, image.height);
        Imf::FrameBuffer frame;
        const std::size_t pixel_bytes = static_cast<std::size_t>(image.channels) * sizeof(float);
        for (int c = 0; c < image.channels; ++c) {
            const char* name = image.channels == 1 ? "Y" : std::array{"R", "G", "B"}[static_cast<std::size_t>(c)];
            header.channels().insert(name, Imf::Channel(Imf::FLOAT));
            frame.insert(name, Imf::Slice::Make(Imf::FLOAT, image.values.data() + c, Imath::V2i(0, 0), image.width,
                                                image.height, pixel_bytes,
                                                pixel_bytes * static_cast<std::size_t>(image.width)));
        }
        MemoryOutput stream;
        {
            Imf::OutputFile output(stream, header, 0);
            output.setFrameBuffer(frame);
            output.writePixels(image.height);
        } // its destructor writes the table of chunks
        return std::move(stream.bytes);
    } catch (const std::exception& e) {
        return io_error(file, std::string("OpenEXR: ") + e.what());
    }
}

// ---- writing ------------------------------------------------------------------------------------------------------

Result<void> write_bytes(const std::filesystem::path& file, const Bytes& bytes) {
    auto whole = vdtree::AtomicFile::create(file);
    if (!whole) return whole.error();
    if (auto written = whole->write(std::as_bytes(std::span(bytes))); !written) return written;
    return whole->commit();
}

Result<Bytes> encode(const std::filesystem::path& file, const Image& image) {
    std::string ending = file.extension().string();
    for (char& c : ending) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
    if (ending == ".png") return encode_png(file, image);
    if (ending == ".pfm") return encode_pfm(image);
    if (ending == ".exr") return encode_exr(file, image);
    return Error{ErrorCode::invalid_argument,
                 file.string() + ": images are written as .png, .pfm or .exr, not '" + ending + "'"};
}

constexpr std::string_view png_magic = "\x89PNG\r\n\x1a\n", exr_magic = "\x76\x2f\x31\x01";
bool is_pfm(std::string_view bytes) { return bytes.starts_with("Pf") || bytes.starts_with("PF"); }

// decode() costs a power; an 8- or 16-bit file has few codes and many pixels.
class CodeDecoder {
public:
    CodeDecoder(const Display& display, int bits) : display_(display), largest_(bits == 16 ? 65535 : 255) {
        for (int code = 0; code <= largest_; ++code) table_.push_back(decode(display, exact(code)));
    }
    double operator()(float value) const {
        const long code = value >= 0 && value <= 1 ? std::lround(value * static_cast<float>(largest_)) : -1;
        const bool is_code = code >= 0 && static_cast<float>(exact(static_cast<int>(code))) == value;
        return is_code ? table_[static_cast<std::size_t>(code)] : decode(display_, static_cast<double>(value));
    }

private:
    double exact(int code) const { return static_cast<double>(code) / largest_; }
    const Display& display_;
    int largest_;
    std::vector<double> table_;
};

} // namespace

Result<ImageFile> read_image(const std::filesystem::path& file) {
    const auto bytes = read_file_or_pipe(file);
    if (!bytes) return bytes.error();
    return decode_image(*bytes, file);
}

std::uint64_t most_pixels_in(std::uint64_t file_bytes) {
    constexpr std::uint64_t pixels_a_byte = 1024;                 // of a blank PNG of 8 bits, or a blank JPEG
    constexpr std::uint64_t small_image = std::uint64_t{1} << 24; // pixels that any file may ask for
    return std::max(small_image, pixels_a_byte * file_bytes);
}

Result<ImageFile> decode_image(std::string_view bytes, const std::filesystem::path& file) {
    std::vector<float> values;
    auto header = decode_rows(bytes, file, [&](const ImageFile&, int, std::span<const float> row) -> Result<void> {
        values.insert(values.end(), row.begin(), row.end());
        return {};
    });
    if (header) header->image.values = std::move(values);
    return header;
}

bool is_image(std::string_view bytes) {
    return bytes.starts_with(png_magic) || bytes.starts_with(exr_magic) || is_pfm(bytes);
}

Result<ImageFile> decode_rows(std::string_view bytes, const std::filesystem::path& file, const TakeRow& take,
                              bool keeps_alpha) {
    const ByteView view(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    try {
        if (bytes.starts_with(png_magic)) return read_png(file, view, take, keeps_alpha);
        if (bytes.starts_with(exr_magic)) return read_exr(file, view, take);
        if (is_pfm(bytes)) return read_pfm(file, view, take);
    } catch (const std::bad_alloc&) {
        return unsupported(file, "needs more memory than this machine has");
    }
    if (bytes.empty()) return malformed(file, "is empty, not an image");
    return malformed(file, "is neither PNG, nor PFM, nor EXR (told by its first bytes)");
}

Result<void> write_image(const std::filesystem::path& file, const Image& image) {
    const auto complain = [&](const std::string& what) {
        return Error{ErrorCode::invalid_argument, file.string() + ": " + what};
    };
    if (image.channels != 1 && image.channels != 3)
        return complain("an image to write has 1 or 3 channels, not " + std::to_string(image.channels));
    if (image.width <= 0 || image.height <= 0 || image.width > static_cast<int>(largest_side) ||
        image.height > static_cast<int>(largest_side)) {
        return complain("an image to write has 1 to 32768 pixels a side, not " + std::to_string(image.width) + " x " +
                        std::to_string(image.height));
    }
    if (image.values.size() != image.index(0, image.height, 0))
        return complain("the image says " + std::to_string(image.index(0, image.height, 0)) + " values but holds " +
                        std::to_string(image.values.size()));
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        if (!std::isfinite(image.values[i])) return complain("value " + std::to_string(i) + " is not a finite number");
    }
    auto bytes = encode(file, image);
    if (!bytes) return bytes.error();
    return write_bytes(file, *bytes);
}

Image to_light(const ImageFile& file, const Display& display) {
    const Image& in = file.image;
    bool is_grey = true;
    if (in.channels == 3)
        for (std::size_t i = 0; i < in.values.size(); i += 3)
            is_grey &= in.values[i] == in.values[i + 1] && in.values[i] == in.values[i + 2];
    if (is_grey) return to_luminance(file, display);
    if (file.is_absolute) return in;
    const CodeDecoder code_to_light(display, file.bits);
    Image out{in.width, in.height, in.channels, {}};
    out.values.reserve(in.values.size());
    for (const float code : in.values)
        out.values.push_back(static_cast<float>(to_luminance(display, code_to_light(code)).value()));
    return out;
}

Image to_luminance(const ImageFile& file, const Display& display) {
    const Image& in = file.image;
    Image out{in.width, in.height, 1, {}};
    const auto channels = static_cast<std::size_t>(in.channels);
    const std::size_t pixels = in.values.size() / channels;
    out.values.reserve(pixels);
    const CodeDecoder code_to_light(display, file.bits);
    for (std::size_t p = 0; p < pixels; ++p) {
        double y = 0;
        for (std::size_t c = 0; c < channels; ++c) {
            const float value = in.values[p * channels + c];
            y += (channels == 1 ? 1 : rec709_weights[static_cast<glm::length_t>(c)]) *
                 (file.is_absolute ? static_cast<double>(value) : code_to_light(value));
        }
        out.values.push_back(static_cast<float>(file.is_absolute ? y : to_luminance(display, y).value()));
    }
    return out;
}

} // namespace unseen::perception
