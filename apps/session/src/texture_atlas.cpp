#include "texture_atlas.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include <unseen/vdtree/internal/texture_pyramid.h>

namespace unseen::session {
namespace {

using vdtree::Texel;
using vdtree::Texture;
using vdtree::Wrap;

// Texels around a part: mip levels up to the fourth do not reach across.
constexpr std::int64_t border = 16;

// What repeats grows: texels of the atlas for each of the images', and texels in any case.
constexpr std::int64_t most_growth = 64, small_atlas = std::int64_t{1} << 24;

// The part as it is laid: whole copies of its texture, from the copy `first` on.
struct Tile {
    std::size_t part = 0;
    std::int64_t first_u = 0, first_v = 0, copies_u = 1, copies_v = 1;
    std::int64_t width = 0, height = 0; // texels, without borders
    std::int64_t x = 0, y = 0;          // of the first texel in the atlas
};

Error too_large(const AtlasPart& part) {
    return {ErrorCode::unsupported, "The texture of " + part.name + " is repeated from " +
                                        std::to_string(part.used.lo.x) + ", " + std::to_string(part.used.lo.y) +
                                        " to " + std::to_string(part.used.hi.x) + ", " +
                                        std::to_string(part.used.hi.y) +
                                        ": laid beside the others that takes too many texels; scale the images down, "
                                        "or give the mesh one image for all."};
}

Result<Tile> tile_of(const AtlasPart& part, std::size_t number) {
    Tile tile;
    tile.part = number;
    const std::int64_t sizes[] = {part.texture->width, part.texture->height};
    for (int k = 0; k < 2; ++k) {
        const double lo = part.used.is_empty() ? 0 : std::floor(static_cast<double>(part.used.lo[k]));
        const double hi = part.used.is_empty() ? 1 : std::max(std::ceil(static_cast<double>(part.used.hi[k])), lo + 1);
        if (!((hi - lo) * static_cast<double>(sizes[k]) + 2 * border <= vdtree::largest_texture_side) ||
            !(std::abs(lo) < 1e9))
            return too_large(part);
        (k == 0 ? tile.first_u : tile.first_v) = static_cast<std::int64_t>(lo);
        (k == 0 ? tile.copies_u : tile.copies_v) = static_cast<std::int64_t>(hi - lo);
    }
    tile.width = tile.copies_u * sizes[0];
    tile.height = tile.copies_v * sizes[1];
    return tile;
}

// In rows, the highest tiles first. The height that they take.
std::int64_t place_in_rows(std::vector<Tile>& tiles, std::int64_t width) {
    std::int64_t x = 0, y = 0, row = 0;
    for (Tile& tile : tiles) {
        if (x + tile.width + 2 * border > width) x = 0, y += row, row = 0;
        tile.x = x + border;
        tile.y = y + border;
        x += tile.width + 2 * border;
        row = std::max(row, tile.height + 2 * border);
    }
    return y + row;
}

void lay(const Tile& tile, const Texture& from, Texture& to) {
    for (std::int64_t y = -border; y < tile.height + border; ++y) {
        const std::int64_t row = vdtree::wrapped_texel(y + tile.first_v * from.height, from.height, from.wrap_v);
        for (std::int64_t x = -border; x < tile.width + border; ++x) {
            const std::int64_t column = vdtree::wrapped_texel(x + tile.first_u * from.width, from.width, from.wrap_u);
            to.texels[static_cast<std::size_t>((tile.y + y) * to.width + tile.x + x)] =
                from.texels[static_cast<std::size_t>(row * from.width + column)];
        }
    }
}

} // namespace

Result<Atlas> make_atlas(std::span<const AtlasPart> parts) {
    std::vector<Tile> tiles;
    std::int64_t area = 0, widest = 1, of_images = 0;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        auto tile = tile_of(parts[i], i);
        if (!tile) return tile.error();
        area += (tile->width + 2 * border) * (tile->height + 2 * border);
        widest = std::max(widest, tile->width + 2 * border);
        of_images += std::int64_t{parts[i].texture->width} * parts[i].texture->height;
        tiles.push_back(*tile);
    }
    std::stable_sort(tiles.begin(), tiles.end(), [](const Tile& a, const Tile& b) { return a.height > b.height; });
    if (area > std::max(small_atlas, most_growth * of_images)) return too_large(parts[tiles.front().part]);
    const auto square = static_cast<std::int64_t>(std::ceil(std::sqrt(static_cast<double>(area))));
    std::int64_t width = std::max(widest, square), height = place_in_rows(tiles, width);
    if (height > vdtree::largest_texture_side) {
        width = vdtree::largest_texture_side;
        height = place_in_rows(tiles, width);
    }
    if (std::max(width, height) > vdtree::largest_texture_side) return too_large(parts[tiles.front().part]);

    Atlas atlas;
    atlas.texture.width = static_cast<std::uint32_t>(width);
    atlas.texture.height = static_cast<std::uint32_t>(height);
    atlas.texture.wrap_u = atlas.texture.wrap_v = Wrap::clamp;
    atlas.texture.texels.resize(static_cast<std::size_t>(width * height), Texel{255, 255, 255, 255});
    atlas.places.resize(parts.size());
    for (const Tile& tile : tiles) {
        const Texture& from = *parts[tile.part].texture;
        lay(tile, from, atlas.texture);
        const glm::dvec2 size(static_cast<double>(width), static_cast<double>(height)), texels(from.width, from.height);
        const glm::dvec2 first(static_cast<double>(tile.first_u), static_cast<double>(tile.first_v)),
            at(static_cast<double>(tile.x), static_cast<double>(tile.y));
        atlas.places[tile.part] = {texels / size, (at - first * texels) / size};
    }
    return atlas;
}

} // namespace unseen::session
