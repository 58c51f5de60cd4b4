// Boxes on the screen, against the farthest depths there: a pyramid of maxima, of which a question takes a few texels.
#include <unseen/vdtree/depth_picture.h>

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/footprint.h>

namespace unseen::vdtree {

void Footprint::add(const Footprint& other) noexcept {
    left = std::min(left, other.left), top = std::min(top, other.top);
    right = std::max(right, other.right), bottom = std::max(bottom, other.bottom);
    nearest = std::min(nearest, other.nearest);
}

Projector::Projector(const View& view)
    : eye_(view.eye), camera_(camera_frame(view)), axis_px_(axis_px(view)),
      focal_px_(view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360))) {}

Footprint Projector::operator()(glm::dvec3 point) const noexcept {
    const glm::dvec3 from_eye = point - eye_;
    const double along = -glm::dot(from_eye, camera_.back), scale = focal_px_ / along;
    if (!(along > 0)) return {.nearest = 0};
    const double x = axis_px_.x + scale * glm::dot(from_eye, camera_.right);
    const double y = axis_px_.y - scale * glm::dot(from_eye, camera_.up);
    return {x, y, x, y, along};
}

namespace {

// Share of a depth: those of pictures are floats, and went through a few roundings.
constexpr double depth_rounding = 1e-5;
// Pixels around what a node covers: outlines move by less than a pixel without being seen.
constexpr int margin_px = 1;
// A query reads at most this many texels along each axis.
constexpr int texels_a_side = 3;
int to_pixel(double px, int size) {
    return static_cast<int>(std::clamp(std::floor(px), -1.0, static_cast<double>(size)));
}

} // namespace

Result<DepthPicture> DepthPicture::create(const View& view, std::span<const float> depth) {
    if (const auto valid = validate_perspective(view, "A depth picture"); !valid) return valid.error();
    const auto pixels = static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
    if (depth.size() != pixels)
        return invalid_argument("A depth picture of this view has " + std::to_string(pixels) + " pixels, not " +
                                std::to_string(depth.size()) + ".");
    for (std::size_t i = 0; i < pixels; ++i)
        if (!(depth[i] > 0)) return invalid_argument("The depth at pixel " + std::to_string(i) + " must be above 0.");
    auto all = std::make_shared<Levels>();
    all->view = view;
    all->levels.push_back({view.width, view.height, {depth.begin(), depth.end()}});
    while (all->levels.back().width > 1 || all->levels.back().height > 1) {
        const Level& fine = all->levels.back();
        Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
        coarse.farthest.reserve(static_cast<std::size_t>(coarse.width) * static_cast<std::size_t>(coarse.height));
        for (int y = 0; y < coarse.height; ++y) {
            const auto row = [&](int at) {
                return fine.farthest.data() + static_cast<std::ptrdiff_t>(std::min(at, fine.height - 1)) * fine.width;
            };
            const float *const above = row(2 * y), *const below = row(2 * y + 1);
            for (int x = 0; x < coarse.width; ++x) {
                const int left = 2 * x, right = std::min(2 * x + 1, fine.width - 1);
                coarse.farthest.push_back(std::max({above[left], above[right], below[left], below[right]}));
            }
        }
        all->levels.push_back(std::move(coarse));
    }
    return DepthPicture(std::move(all));
}

float DepthPicture::farthest(int left, int top, int right, int bottom) const noexcept {
    std::size_t level = 0;
    while ((right >> level) - (left >> level) >= texels_a_side || (bottom >> level) - (top >> level) >= texels_a_side)
        ++level;
    const Level& texels = levels_->levels[level];
    float most = 0;
    for (int y = top >> level; y <= bottom >> level; ++y)
        for (int x = left >> level; x <= right >> level; ++x)
            most = std::max(most, texels.farthest[static_cast<std::size_t>(y) * static_cast<std::size_t>(texels.width) +
                                                  static_cast<std::size_t>(x)]);
    return most;
}

bool DepthPicture::hides(const Footprint& of) const noexcept {
    if (!(of.nearest > 0)) return false;
    const int width = levels_->view.width, height = levels_->view.height;
    const int left = to_pixel(of.left - margin_px, width), right = to_pixel(of.right + margin_px, width);
    const int top = to_pixel(of.top - margin_px, height), bottom = to_pixel(of.bottom + margin_px, height);
    if (right < 0 || bottom < 0 || left >= width || top >= height) return true; // beside the window
    const float shown =
        farthest(std::max(left, 0), std::max(top, 0), std::min(right, width - 1), std::min(bottom, height - 1));
    return static_cast<double>(shown) < of.nearest * (1 - depth_rounding);
}

} // namespace unseen::vdtree
