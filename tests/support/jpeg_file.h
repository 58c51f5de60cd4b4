// JPEG files to be read. Needs libjpeg.
#pragma once

#include <cstdio> // what jpeglib.h counts on
#include <cstdlib>
#include <string>
#include <vector>

#include <jpeglib.h>

#include <unseen/perception/image.h>

namespace unseen::support {

// Of an image of three channels, 0 to 1.
inline std::string jpeg(const perception::Image& image) {
    jpeg_compress_struct info{};
    jpeg_error_mgr errors{};
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&info, &bytes, &size);
    info.image_width = static_cast<JDIMENSION>(image.width);
    info.image_height = static_cast<JDIMENSION>(image.height);
    info.input_components = 3;
    info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 95, TRUE);
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height) {
        std::vector<JSAMPLE> row;
        for (int i = 0; i < 3 * image.width; ++i)
            row.push_back(static_cast<JSAMPLE>(
                255 *
                image.values[static_cast<std::size_t>(static_cast<int>(info.next_scanline) * 3 * image.width + i)]));
        JSAMPROW rows = row.data();
        jpeg_write_scanlines(&info, &rows, 1);
    }
    jpeg_finish_compress(&info);
    std::string out(reinterpret_cast<const char*>(bytes), size);
    jpeg_destroy_compress(&info);
    std::free(bytes);
    return out;
}

} // namespace unseen::support
