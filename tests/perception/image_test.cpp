// Image files: what is written is read again, every variant of the formats that we promise is understood, and nothing
// that a file can contain crashes a reader or makes it allocate out of proportion.
#include <unseen/perception/image.h>
#include <unseen/vdtree/colour.h>

#include <bit>

#include <unistd.h>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <half.h>
#include <png.h>

#include "largest_allocation.h"
#include "testing.h"

namespace unseen::perception {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<unsigned char>;

class ImageFiles : public testing::Test {
protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("unseen_image_test_" + std::to_string(::getpid()));
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    fs::path path(const std::string& name) const { return folder_ / name; }
    fs::path store(const std::string& name, const Bytes& bytes) const {
        fs::remove(path(name)); // rewriting in place makes some file systems wait for the disk
        std::ofstream(path(name), std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
        return path(name);
    }
    static Bytes load(const fs::path& file) {
        std::ifstream stream(file, std::ios::binary);
        return Bytes(std::istreambuf_iterator<char>(stream), {});
    }
    std::size_t file_count() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
    }
    fs::path folder_;
};

// Whole codes, so that 8 bits lose nothing.
Image codes(int width, int height, int channels) {
    Image image{width, height, channels, {}};
    for (int i = 0; i < width * height * channels; ++i)
        image.values.push_back(static_cast<float>((i * 37) % 256) / 255.0F);
    return image;
}
Image radiances(int width, int height, int channels) {
    Image image{width, height, channels, {}};
    for (int i = 0; i < width * height * channels; ++i)
        image.values.push_back(0.37F * static_cast<float>(i) * static_cast<float>(i) + 0.01F);
    return image;
}

void expect_error(const fs::path& file, const std::string& part) {
    const auto read = read_image(file);
    ASSERT_FALSE(read) << file;
    EXPECT_NE(read.error().message.find(file.string()), std::string::npos) << read.error().message;
    EXPECT_NE(read.error().message.find(part), std::string::npos) << read.error().message;
}

TEST_F(ImageFiles, ReadWhatWasWritten) {
    for (const int channels : {1, 3}) {
        for (const char* name : {"a.png", "a.PFM", "a.exr"}) {
            const bool is_png = std::string(name) == "a.png";
            const Image image = is_png ? codes(7, 5, channels) : radiances(7, 83, channels);
            ASSERT_TRUE(write_image(path(name), image).has_value());
            const auto read = require(read_image(path(name)));
            EXPECT_EQ(read->is_absolute, !is_png);
            EXPECT_EQ(read->image.width, image.width);
            EXPECT_EQ(read->image.height, image.height);
            EXPECT_EQ(read->image.channels, channels);
            EXPECT_EQ(read->image.values, image.values) << name;
        }
    }
    EXPECT_EQ(file_count(), 3U); // no temporary name left
}

TEST_F(ImageFiles, AreToldApartByContent) {
    ASSERT_TRUE(write_image(path("a.exr"), radiances(4, 4, 1)).has_value());
    fs::rename(path("a.exr"), path("a.png"));
    EXPECT_TRUE(read_image(path("a.png"))->is_absolute);
}

struct PngVariant {
    int width = 9, height = 6, bits = 8, type = PNG_COLOR_TYPE_GRAY;
    bool interlaced = false, transparency = false, gamma = false;
};

// Raw rows as they stand in the file: row bytes are (7 x + 11 y) masked.
Bytes make_png(const PngVariant& v) {
    Bytes out;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(
        png, &out,
        [](png_structp p, png_bytep data, std::size_t n) {
            auto* bytes = static_cast<Bytes*>(png_get_io_ptr(p));
            bytes->insert(bytes->end(), data, data + n);
        },
        [](png_structp) {});
    png_set_IHDR(png, info, static_cast<png_uint_32>(v.width), static_cast<png_uint_32>(v.height), v.bits, v.type,
                 v.interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    std::array<png_color, 256> palette{};
    for (unsigned i = 0; i < 256; ++i)
        palette[i] = {static_cast<png_byte>(i), static_cast<png_byte>(255 - i), static_cast<png_byte>(i / 2)};
    if (v.type == PNG_COLOR_TYPE_PALETTE) png_set_PLTE(png, info, palette.data(), 1 << v.bits);
    png_byte alpha = 3;
    png_color_16 clear{};
    if (v.transparency) png_set_tRNS(png, info, v.type == PNG_COLOR_TYPE_PALETTE ? &alpha : nullptr, 1, &clear);
    if (v.gamma) png_set_gAMA(png, info, 0.2);
    png_write_info(png, info);
    const std::size_t row_bytes = png_get_rowbytes(png, info);
    Bytes pixels(row_bytes * static_cast<std::size_t>(v.height));
    std::vector<png_bytep> rows;
    for (std::size_t y = 0; y < static_cast<std::size_t>(v.height); ++y) {
        for (std::size_t x = 0; x < row_bytes; ++x)
            pixels[y * row_bytes + x] = static_cast<unsigned char>(7 * x + 11 * y);
        rows.push_back(&pixels[y * row_bytes]);
    }
    png_write_image(png, rows.data());
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    return out;
}
int raw_byte(int x, int y) { return (7 * x + 11 * y) % 256; }

TEST_F(ImageFiles, PngGreyOfEveryDepth) {
    for (const int bits : {1, 2, 4, 8, 16}) {
        for (const bool interlaced : {false, true}) {
            const auto read =
                read_image(store("a.png", make_png({9, 6, bits, PNG_COLOR_TYPE_GRAY, interlaced, false, true})));
            ASSERT_TRUE(read.has_value()) << read.error().message;
            EXPECT_EQ(read->image.channels, 1);
            EXPECT_EQ(read->bits, bits == 16 ? 16 : 8);
            for (int y = 0; y < 6; ++y) {
                for (int x = 0; x < 9; ++x) {
                    const int per_byte = std::max(1, 8 / bits), shift = bits < 8 ? 8 - bits * (x % per_byte + 1) : 0;
                    const int code = bits == 16 ? raw_byte(2 * x, y) * 256 + raw_byte(2 * x + 1, y)
                                                : (raw_byte(x / per_byte, y) >> shift) & ((1 << bits) - 1);
                    EXPECT_FLOAT_EQ(read->image.at(x, y),
                                    static_cast<float>(code) / static_cast<float>((1 << bits) - 1));
                }
            }
        }
    }
}

TEST_F(ImageFiles, PngColourPaletteAndAlpha) {
    auto read = require(read_image(store("a.png", make_png({5, 4, 16, PNG_COLOR_TYPE_RGB, true}))));
    EXPECT_EQ(read->image.channels, 3);
    EXPECT_FLOAT_EQ(read->image.at(2, 3, 1), static_cast<float>(raw_byte(14, 3) * 256 + raw_byte(15, 3)) / 65535.0F);

    read = read_image(store("a.png", make_png({5, 4, 8, PNG_COLOR_TYPE_PALETTE, false, true})));
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(read->image.channels, 3);
    const int index = raw_byte(3, 2);
    EXPECT_FLOAT_EQ(read->image.at(3, 2, 0), static_cast<float>(index) / 255.0F);
    EXPECT_FLOAT_EQ(read->image.at(3, 2, 1), static_cast<float>(255 - index) / 255.0F);

    read = read_image(store("a.png", make_png({5, 4, 8, PNG_COLOR_TYPE_RGB_ALPHA, true})));
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(read->image.channels, 3);
    EXPECT_FLOAT_EQ(read->image.at(1, 0, 2), static_cast<float>(raw_byte(6, 0)) / 255.0F);

    for (const int type : {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA}) {
        read = read_image(store("a.png", make_png({5, 4, 8, type, false, type == PNG_COLOR_TYPE_GRAY})));
        ASSERT_TRUE(read.has_value());
        EXPECT_EQ(read->image.channels, 1);
    }
}

TEST_F(ImageFiles, DamagedPngIsAnErrorAtAnyLength) {
    const Bytes whole = make_png({40, 30, 8, PNG_COLOR_TYPE_RGB});
    for (std::size_t length = 8; length < whole.size(); length += 5) {
        expect_error(store("a.png", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length))),
                     "damaged PNG");
    }
    Bytes wrong = whole;
    wrong[wrong.size() / 2] ^= 1U;
    expect_error(store("a.png", wrong), "damaged PNG");
}

Bytes pfm(const std::string& header, const std::vector<float>& values, bool is_little) {
    Bytes bytes(header.begin(), header.end());
    for (const float v : values) {
        const auto word = std::bit_cast<std::uint32_t>(v);
        for (unsigned i = 0; i < 4; ++i)
            bytes.push_back(static_cast<unsigned char>(word >> (8 * (is_little ? i : 3 - i))));
    }
    return bytes;
}

TEST_F(ImageFiles, PfmOfBothEndiansRunsFromTheBottom) {
    const std::vector<float> values = {1, 2, 3, 4, 5, 6};
    for (const bool is_little : {false, true}) {
        const auto read =
            read_image(store("a.pfm", pfm(is_little ? "Pf\n3 2\n-1.0\n" : "Pf 3 2\t1\n", values, is_little)));
        ASSERT_TRUE(read.has_value()) << read.error().message;
        EXPECT_EQ(read->image.values, (std::vector<float>{4, 5, 6, 1, 2, 3}));
    }
    const auto colour = require(read_image(store("a.pfm", pfm("PF\n1 2\n-1\n", values, true))));
    EXPECT_EQ(colour->image.values, (std::vector<float>{4, 5, 6, 1, 2, 3}));
}

TEST_F(ImageFiles, BadPfmIsAnError) {
    const std::vector<float> six = {1, 2, 3, 4, 5, 6};
    expect_error(store("a.pfm", pfm("Pf\n", {}, true)), "width");
    expect_error(store("a.pfm", pfm("Pf\n3 x\n-1\n", six, true)), "height");
    expect_error(store("a.pfm", pfm("Pf\n-3 2\n-1\n", six, true)), "width");
    expect_error(store("a.pfm", pfm("Pf\n3 2\n0\n", six, true)), "scale");
    expect_error(store("a.pfm", pfm("Pf\n3 2\nnan\n", six, true)), "scale");
    expect_error(store("a.pfm", pfm("Pf\n3 3\n-1\n", six, true)), "36 bytes");
    expect_error(store("a.pfm", pfm("Pf\n3 1\n-1\n", six, true)), "12 bytes");
    expect_error(store("a.pfm", pfm("Pf\n0 2\n-1\n", {}, true)), "empty");
    expect_error(store("a.pfm", pfm("PF\n32768 32768\n-1\n", six, true)), "2^28");
    expect_error(store("a.pfm", pfm("PF\n99999999999999999999 1\n-1\n", six, true)), "width");
    expect_error(store("a.pfm", pfm("PF\n40000 1\n-1\n", six, true)), "32768");
    std::vector<float> holes = six;
    holes[4] = std::numeric_limits<float>::quiet_NaN();
    expect_error(store("a.pfm", pfm("Pf\n3 2\n-1\n", holes, true)), "(1, 0)");
}

template <class Pixel>
fs::path make_exr(const fs::path& file, const std::vector<std::string>& names, Imf::PixelType type,
                  Imf::Compression compression, const std::vector<Pixel>& pixels, int width, int height) {
    Imf::Header header(Imath::Box2i({0, 0}, {99, 99}), Imath::Box2i({-3, 5}, {-3 + width - 1, 5 + height - 1}));
    header.compression() = compression;
    Imf::FrameBuffer frame;
    for (const std::string& name : names) {
        header.channels().insert(name, Imf::Channel(type));
        frame.insert(name, Imf::Slice::Make(type, pixels.data(), header.dataWindow()));
    }
    Imf::OutputFile out(file.string().c_str(), header, 0);
    out.setFrameBuffer(frame);
    out.writePixels(height);
    return file;
}

TEST_F(ImageFiles, ExrOfHalfAndFloatAndEveryLosslessCompression) {
    constexpr int width = 19, height = 70;
    std::vector<Imath::half> halves;
    std::vector<float> floats;
    for (int i = 0; i < width * height; ++i) {
        halves.emplace_back(static_cast<float>(i % 97) * 0.25F);
        floats.push_back(static_cast<float>(i % 97) * 0.25F);
    }
    for (const auto compression : {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION,
                                   Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION}) {
        for (const bool is_half : {false, true}) {
            const fs::path file =
                is_half ? make_exr(path("a.exr"), {"Y"}, Imf::HALF, compression, halves, width, height)
                        : make_exr(path("a.exr"), {"depth"}, Imf::FLOAT, compression, floats, width, height);
            EXPECT_EQ(require(read_image(file))->image.values, floats) << compression;
        }
    }
    const auto colour = require(read_image(
        make_exr(path("a.exr"), {"A", "B", "G", "R"}, Imf::FLOAT, Imf::ZIP_COMPRESSION, floats, width, height)));
    EXPECT_EQ(colour->image.channels, 3);
    EXPECT_EQ(colour->image.at(7, 3, 2), floats[3 * width + 7]);
}

TEST_F(ImageFiles, ExrThatIsNoLuminanceImageIsAnError) {
    const std::vector<float> floats(12, 1.0F);
    expect_error(make_exr(path("a.exr"), {"U", "V"}, Imf::FLOAT, Imf::ZIP_COMPRESSION, floats, 4, 3), "single channel");
    const std::vector<std::uint32_t> ids(12, 1);
    expect_error(make_exr(path("a.exr"), {"Y"}, Imf::UINT, Imf::ZIP_COMPRESSION, ids, 4, 3), "float or half");
    std::vector<float> broken = floats;
    broken[6] = std::numeric_limits<float>::infinity();
    expect_error(make_exr(path("a.exr"), {"Y"}, Imf::FLOAT, Imf::ZIP_COMPRESSION, broken, 4, 3), "(2, 1)");

    Imf::Header header(4, 3);
    header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
    header.setTileDescription(Imf::TileDescription(2, 2, Imf::ONE_LEVEL));
    {
        Imf::TiledOutputFile tiled(path("b.exr").string().c_str(), header, 0);
        Imf::FrameBuffer frame;
        frame.insert("Y", Imf::Slice::Make(Imf::FLOAT, floats.data(), header.dataWindow()));
        tiled.setFrameBuffer(frame);
        tiled.writeTiles(0, tiled.numXTiles() - 1, 0, tiled.numYTiles() - 1);
    }
    expect_error(path("b.exr"), "scan lines");
}

TEST_F(ImageFiles, TruncatedExrIsAnErrorAtAnyLength) {
    ASSERT_TRUE(write_image(path("whole.exr"), radiances(20, 40, 1)).has_value());
    const Bytes whole = load(path("whole.exr"));
    for (std::size_t length = 4; length < whole.size(); length += 7) {
        const auto file = store("a.exr", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)));
        EXPECT_FALSE(read_image(file).has_value()) << length;
    }
}

constexpr std::size_t proportionate = std::size_t{80} << 20; // bytes: the 64 MiB that any file may ask for, and slack

// The data window of an EXR file and the size of a PNG file, overwritten in place.
TEST_F(ImageFiles, LyingSizesAllocateLittle) {
    ASSERT_TRUE(write_image(path("a.exr"), radiances(20, 40, 1)).has_value());
    Bytes exr = load(path("a.exr"));
    const std::string name = "dataWindow";
    const auto at = std::search(exr.begin(), exr.end(), name.begin(), name.end()) - exr.begin() + 11 + 6 + 4;
    for (const std::array<std::int32_t, 4> box : {std::array<std::int32_t, 4>{0, 0, 32767, 8191},
                                                  {0, 0, 16383, 16383},
                                                  {0, 0, 0x7ffffffe, 0},
                                                  {-0x7fffffff - 1, 0, 0x7fffffff, 0},
                                                  {5, 5, 4, 4},
                                                  {0, 0, 19, 32767}}) {
        std::memcpy(exr.data() + at, box.data(), 16);
        largest_allocation = 0;
        EXPECT_FALSE(read_image(store("b.exr", exr)).has_value());
        EXPECT_LT(largest_allocation, proportionate);
    }
    // PNGs whose headers are right in themselves: 16384 x 16129 pixels, a checksum that fits, and no pixels. Of a bit
    // each, deflate could hold them in the 60 kB; what is made of them it could not.
    for (Bytes png :
         {make_png({16384, 1, 16, PNG_COLOR_TYPE_RGB, true}), make_png({16384, 1, 1, PNG_COLOR_TYPE_GRAY})}) {
        png[22] = 0x3f; // height 1 -> 16129
        std::uint32_t crc = 0xffffffffU;
        for (std::size_t i = 12; i < 29; ++i) {
            crc ^= png[i];
            for (int k = 0; k < 8; ++k) crc = (crc & 1U) != 0 ? 0xedb88320U ^ (crc >> 1) : crc >> 1;
        }
        for (unsigned i = 0; i < 4; ++i) png[29 + i] = static_cast<unsigned char>(~crc >> (8 * (3 - i)));
        png.resize(60'000);
        largest_allocation = 0;
        expect_error(store("a.png", png), "16384 x 16129 pixels, which 60000 bytes cannot hold");
        EXPECT_LT(largest_allocation, proportionate);
    }
}

TEST_F(ImageFiles, RandomDamageNeverCrashes) {
    int rounds = 500;
    if (const char* text = std::getenv("UNSEEN_IMAGE_FUZZ_ROUNDS")) rounds = std::atoi(text);
    std::vector<Bytes> seeds = {make_png({17, 9, 8, PNG_COLOR_TYPE_RGB, true}),
                                make_png({17, 9, 4, PNG_COLOR_TYPE_PALETTE}), make_png({5, 9, 16, PNG_COLOR_TYPE_GRAY}),
                                pfm("Pf\n3 2\n-1.0\n", {1, 2, 3, 4, 5, 6}, true)};
    std::vector<float> floats(12 * 40, 0.5F);
    for (const auto c : {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION,
                         Imf::PXR24_COMPRESSION, Imf::B44_COMPRESSION, Imf::DWAA_COMPRESSION}) {
        seeds.push_back(load(make_exr(path("seed.exr"), {"R", "G", "B"}, Imf::FLOAT, c, floats, 12, 40)));
    }
    std::mt19937 random(20240607);
    largest_allocation = 0;
    for (int round = 0; round < rounds; ++round) {
        for (const Bytes& seed : seeds) {
            Bytes bytes = seed;
            const int changes = 1 + static_cast<int>(random() % 6);
            // Headers are short and full of sizes: half of the damage goes there.
            for (int i = 0; i < changes; ++i) {
                const std::size_t range = random() % 2 == 0 ? bytes.size() : std::min<std::size_t>(bytes.size(), 400);
                bytes[random() % range] = static_cast<unsigned char>(random() % 3 == 0 ? 0xff : random());
            }
            if (random() % 8 == 0) bytes.resize(random() % bytes.size() + 1);
            const auto read = read_image(store("fuzz", bytes));
            if (!read) EXPECT_FALSE(read.error().message.empty());
            else EXPECT_EQ(read->image.values.size(), read->image.index(0, read->image.height, 0));
        }
    }
    EXPECT_LT(largest_allocation, proportionate);
}

TEST_F(ImageFiles, MissingEmptyOrForeignFilesAreErrors) {
    expect_error(path("nowhere.png"), "no such file");
    expect_error(folder_, "folder");
    expect_error(store("a.png", {}), "empty");
    expect_error(store("a.png", {'P', '5', '\n'}), "neither PNG");
    expect_error(store("a.png", {'P'}), "neither PNG");
}

TEST_F(ImageFiles, WritingFailsWithoutLeavingAnything) {
    EXPECT_FALSE(write_image(path("no_folder/a.png"), codes(3, 3, 1)));
    EXPECT_FALSE(write_image(path("a.jpg"), codes(3, 3, 1)));
    EXPECT_FALSE(write_image(path("a.png"), codes(3, 3, 2)));
    EXPECT_FALSE(write_image(path("a.png"), Image{}));
    Image broken = codes(3, 3, 1);
    broken.values.pop_back();
    EXPECT_FALSE(write_image(path("a.png"), broken));
    broken.values.push_back(std::numeric_limits<float>::quiet_NaN());
    EXPECT_FALSE(write_image(path("a.pfm"), broken));
    fs::create_directory(path("a.pfm"));
    EXPECT_FALSE(write_image(path("a.pfm"), codes(3, 3, 1))); // cannot replace a folder
    EXPECT_EQ(file_count(), 1U);
}

TEST_F(ImageFiles, PngClampsAndRounds) {
    ASSERT_TRUE(write_image(path("a.png"), {4, 1, 1, {-1, 0.5F, 0.501F, 7}}).has_value());
    const auto read = read_image(path("a.png"));
    EXPECT_EQ(read->image.values, (std::vector<float>{0, 128 / 255.0F, 128 / 255.0F, 1}));
}

TEST(ToLuminance, DecodesCodesAndLeavesAbsoluteValues) {
    const Display display;
    for (const int bits : {8, 16}) {
        const Image grey = to_luminance({{3, 1, 1, {0, 0.3337F, 1}}, false, bits}, display);
        EXPECT_FLOAT_EQ(grey.at(0, 0), static_cast<float>(black_level(display).value()));
        EXPECT_FLOAT_EQ(grey.at(1, 0), static_cast<float>(to_luminance(display, decode(display, 0.3337F)).value()));
        EXPECT_FLOAT_EQ(grey.at(2, 0), static_cast<float>(display.peak.value()));
    }
    const Image colour = to_luminance({{1, 1, 3, {1, 128 / 255.0F, 0}}, false, 8}, display);
    const double linear = rec709_weights[0] + rec709_weights[1] * decode(display, 128 / 255.0);
    EXPECT_FLOAT_EQ(colour.at(0, 0), static_cast<float>(to_luminance(display, linear).value()));
    const Image absolute = to_luminance({{1, 1, 3, {10, 20, 30}}, true, 32}, display);
    EXPECT_FLOAT_EQ(absolute.at(0, 0), static_cast<float>(0.2126 * 10 + 0.7152 * 20 + 0.0722 * 30));
    EXPECT_FLOAT_EQ(to_luminance({{1, 1, 1, {250}}, true, 32}, display).at(0, 0), 250.0F);
}

} // namespace
} // namespace unseen::perception
