// Images of luminance or light, and their files.
#pragma once

#include <cstdint>
#include <filesystem>

#include <unseen/perception/display.h>
#include <unseen/vdtree/function_ref.h>

namespace unseen::perception {

// Row-major from the top left, `channels` values a pixel: 1 (luminance) or 3 (linear or encoded RGB).
struct Image {
    int width = 0;
    int height = 0;
    int channels = 1;
    std::vector<float> values;

    float& at(int x, int y, int c = 0) { return values[index(x, y, c)]; }
    float at(int x, int y, int c = 0) const { return values[index(x, y, c)]; }
    std::size_t index(int x, int y, int c) const {
        return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) *
                   static_cast<std::size_t>(channels) +
               static_cast<std::size_t>(c);
    }
};

// What a file held. PNG: code values 0..1 (8 or 16 bit), grey or RGB, alpha dropped. PFM and EXR: absolute
// luminance in cd/m2 (grey, "Y"), or RGB radiance in cd/m2 whose Rec. 709 luminance is meant.
struct ImageFile {
    Image image;
    bool is_absolute = false; // PFM, EXR
    int bits = 8;             // of PNG
};

// Told apart by content. Sizes are checked against the file before anything is allocated; at most 32768 pixels a
// side; non-finite values are an error that names the pixel.
Result<ImageFile> read_image(const std::filesystem::path& file);

// Decodes the bytes of a file; `name` is for messages.
Result<ImageFile> decode_image(std::string_view bytes, const std::filesystem::path& name);

// Decodes an image and hands over its rows from the top, so that it need not fit into memory as floats. The image that
// `take` receives and that is returned has a size and no values. An error of `take` ends decoding.
using TakeRow = FunctionRef<Result<void>(const ImageFile& image, int y, std::span<const float> row)>;
// `keeps_alpha`: what a PNG has of it is one channel more, from 0 to 1.
Result<ImageFile> decode_rows(std::string_view bytes, const std::filesystem::path& name, const TakeRow& take,
                              bool keeps_alpha = false);

// Whether the bytes begin like a file of one of these formats.
bool is_image(std::string_view bytes);

// The most pixels that a compressed image of this size may claim to have.
std::uint64_t most_pixels_in(std::uint64_t file_bytes);

// By ending: .png (values are code values 0..1, 8 bit), .pfm and .exr (float as they are). Written to a temporary
// name, then renamed.
Result<void> write_image(const std::filesystem::path& file, const Image& image);

// Luminance in cd/m2 as the display shows it: PNG codes are decoded, weighted (Rec. 709) and mapped; absolute
// files are weighted only.
Image to_luminance(const ImageFile& file, const Display& display);
// The same as linear RGB in cd/m2; one channel of luminance where all pixels are grey.
Image to_light(const ImageFile& file, const Display& display);

} // namespace unseen::perception
