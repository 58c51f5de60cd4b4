// Cells of elevations in a pyramid of minima, of which a question takes a few.
#include <algorithm>
#include <cmath>
#include <limits>

#include <unseen/perception/masking.h>

namespace unseen::perception {
namespace {

constexpr std::size_t most_bands = 16; // as many as judges have
// Pixels around what a node covers: outlines move by less than a pixel without being seen.
constexpr int margin_px = 1;
// A question looks at so many cells along each axis at most.
constexpr int cells_a_side = 3;

Error refused(const std::string& what) { return {ErrorCode::invalid_argument, "masking: " + what}; }

Result<void> check(const vdtree::View& view, const Elevations& of, const Elevations& first) {
    if (of.cell_px < 1 || of.columns < 1 || of.rows < 1) return refused("there are no cells");
    if (of.columns != (view.width + of.cell_px - 1) / of.cell_px ||
        of.rows != (view.height + of.cell_px - 1) / of.cell_px)
        return refused("the cells do not cover the view's window");
    if (of.bands.empty() || of.bands.size() > most_bands) return refused("elevations are of 1 to 16 bands");
    if (of.cell_px != first.cell_px || of.bands != first.bands) return refused("pictures differ in cells or bands");
    for (std::size_t i = 0; i < of.bands.size(); ++i)
        if (!(of.bands[i].value() > 0) || (i > 0 && !(of.bands[i] < of.bands[i - 1])))
            return refused("frequencies must be above 0, and fall");
    if (of.elevation.size() !=
        of.bands.size() * static_cast<std::size_t>(of.columns) * static_cast<std::size_t>(of.rows))
        return refused("there are not as many elevations as bands by cells");
    for (std::size_t i = 0; i < of.elevation.size(); ++i)
        if (!(of.elevation[i] >= 1 && std::isfinite(of.elevation[i])))
            return refused("elevation " + std::to_string(i) + " must be 1 or more, and finite");
    return {};
}

} // namespace

Result<MaskingPicture> MaskingPicture::create(const vdtree::View& view, std::span<const Elevations> pictures) {
    if (const auto valid = vdtree::validate(view); !valid) return valid.error();
    if (pictures.empty()) return refused("there is no picture");
    for (const Elevations& picture : pictures)
        if (const auto ok = check(view, picture, pictures.front()); !ok) return ok.error();
    auto grids = std::make_shared<Grids>();
    grids->view = view;
    grids->cell_px = pictures.front().cell_px;
    grids->bands = pictures.front().bands;
    Grid finest{pictures.front().columns, pictures.front().rows, pictures.front().elevation};
    for (const Elevations& picture : pictures.subspan(1))
        for (std::size_t i = 0; i < finest.least.size(); ++i)
            finest.least[i] = std::min(finest.least[i], picture.elevation[i]);
    grids->levels.push_back(std::move(finest));
    while (grids->levels.back().columns > 1 || grids->levels.back().rows > 1) {
        const Grid& fine = grids->levels.back();
        Grid coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
        for (std::size_t band = 0; band < grids->bands.size(); ++band)
            for (int y = 0; y < coarse.rows; ++y)
                for (int x = 0; x < coarse.columns; ++x) {
                    const auto at = [&](int column, int row) {
                        return fine.least[(band * static_cast<std::size_t>(fine.rows) +
                                           static_cast<std::size_t>(std::min(row, fine.rows - 1))) *
                                              static_cast<std::size_t>(fine.columns) +
                                          static_cast<std::size_t>(std::min(column, fine.columns - 1))];
                    };
                    coarse.least.push_back(std::min(
                        {at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)}));
                }
        grids->levels.push_back(std::move(coarse));
    }
    return MaskingPicture(std::move(grids));
}

void MaskingPicture::least(const vdtree::Footprint& of, std::span<float> elevation) const noexcept {
    const Grids& all = *grids_;
    std::fill(elevation.begin(), elevation.end(), 1.0f);
    const double width = all.view.width, height = all.view.height;
    if (!(of.nearest > 0) || !(of.right >= 0 && of.bottom >= 0 && of.left <= width && of.top <= height)) return;
    // What is outside of the window is seen by nobody.
    const auto cell_of = [&](double px, int cells) {
        return std::clamp(static_cast<int>(std::floor(px)) / all.cell_px, 0, cells - 1);
    };
    const auto within = [](double px, double size) { return std::clamp(px, 0.0, size); };
    const int columns = all.levels.front().columns, rows = all.levels.front().rows;
    const int left = cell_of(within(of.left - margin_px, width), columns),
              right = cell_of(within(of.right + margin_px, width), columns),
              top = cell_of(within(of.top - margin_px, height), rows),
              bottom = cell_of(within(of.bottom + margin_px, height), rows);
    std::size_t level = 0;
    while ((right >> level) - (left >> level) >= cells_a_side || (bottom >> level) - (top >> level) >= cells_a_side)
        ++level;
    const Grid& grid = all.levels[level];
    for (std::size_t band = 0; band < elevation.size() && band < all.bands.size(); ++band) {
        float least = std::numeric_limits<float>::max();
        for (int y = top >> level; y <= bottom >> level; ++y)
            for (int x = left >> level; x <= right >> level; ++x)
                least = std::min(least,
                                 grid.least[(band * static_cast<std::size_t>(grid.rows) + static_cast<std::size_t>(y)) *
                                                static_cast<std::size_t>(grid.columns) +
                                            static_cast<std::size_t>(x)]);
        elevation[band] = least;
    }
}

} // namespace unseen::perception
