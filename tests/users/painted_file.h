// Images for materials.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include <unseen/perception/image.h>

#include "user_file.h"

namespace unseen::app::testing {

class PaintedFileTest : public UserFileTest {
protected:
    // A PNG of blocks of 8 x 8 pixels, row by row from the top, `across` a row; sRGB codes of grey.
    std::string blocks(const std::vector<int>& codes, int across) const {
        const int width = 8 * across, height = 8 * static_cast<int>(codes.size()) / across;
        perception::Image image{width, height, 3, {}};
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                for (int c = 0; c < 3; ++c)
                    image.values.push_back(static_cast<float>(codes[static_cast<std::size_t>(y / 8 * across + x / 8)]) /
                                           255);
        const auto written = perception::write_image(path("made.png"), image);
        if (!written) throw std::runtime_error(written.error().message);
        const std::string png = read_text(path("made.png"));
        fs::remove(path("made.png"));
        return png;
    }
    std::string tiles() const { return blocks({120, 220, 180, 140, 150, 240, 100, 200, 190}, 3); }
    std::string glaze() const { return blocks({200, 120, 150, 230}, 2); }
};

} // namespace unseen::app::testing
