// The search for the levels of one camera. Each object is drawn alone at each level, once. A choice of levels is then
// composed from these images by depth, and only in the rectangle of the object that changes, so a search draws nothing.
#pragma once

#include <unseen/perception/display.h>
#include <unseen/session/selection.h>

namespace unseen::session {

// Pixels; the last ones excluded.
struct PixelRect {
    int left = 0, top = 0, right = 0, bottom = 0;

    bool is_empty() const noexcept { return right <= left || bottom <= top; }
    int width() const noexcept { return right - left; }
    int height() const noexcept { return bottom - top; }
    friend bool operator==(const PixelRect&, const PixelRect&) = default;
};
PixelRect united(const PixelRect& a, const PixelRect& b); // around both

// An object alone at one level: the pixels of its rectangle, row by row.
struct LevelImage {
    PixelRect box; // of the pixels that it covers; empty: none
    std::vector<float> values;
    std::vector<float> depth; // near plane / distance along the axis; 0: the object is not there
};

struct ObjectImages {
    std::size_t object = 0;               // of the scene
    std::vector<LevelImage> levels;       // 0: full detail
    std::vector<std::uint32_t> triangles; // by level, falling
};

// A camera's picture in parts. Values are what the quality compares: 8-bit codes of grey for SSIM, else cd/m2.
struct LayeredPicture {
    int width = 0, height = 0;
    std::vector<float> background, background_depth; // by pixel, from the top left
    std::vector<ObjectImages> objects;               // those in sight
};

// All objects at these levels (by entry of picture.objects), by depth; where depths are the same the first one shows.
std::vector<float> put_together(const LayeredPicture& picture, std::span<const int> levels);

// What a picture loses, kept by place so that only what changes is counted anew. A value.
class PictureLoss {
public:
    // `display` counts for thresholds. Of SSIM: at least 11 x 11 pixels. Fails on smaller ones, and on values that are
    // not finite.
    static Result<PictureLoss> create(SelectionQuality quality, int width, int height, std::vector<float> reference,
                                      const perception::Display& display = {});

    double total() const noexcept { return total_; } // of the picture that is held; at first the reference: 0

    // What another picture, which differs from the one held in the rectangle alone, would lose more than that.
    double change(std::span<const float> picture, const PixelRect& changed) const;
    void take(std::span<const float> picture, const PixelRect& changed); // holds that one from now on

    int places() const noexcept { return columns_ * rows_; } // that the loss is summed over
    // How far around a pixel places are that it counts for.
    PixelRect places_of(const PixelRect& changed) const;

private:
    PictureLoss() = default;
    void count(std::span<const float> picture, const PixelRect& places, std::vector<double>& losses) const;

    SelectionQuality quality_ = SelectionQuality::ssim;
    int width_ = 0, height_ = 0;
    int columns_ = 0, rows_ = 0;                            // of places
    std::vector<float> reference_, thresholds_;             // thresholds: cd/m2
    std::vector<double> reference_mean_, reference_square_; // of SSIM's windows
    std::vector<double> losses_;                            // by place
    double total_ = 0;
};

struct FoundSelection {
    std::vector<int> levels; // by entry of the picture's objects
    std::uint64_t triangles = 0;
    double loss = 0;
    bool holds = false; // the budget; else every object has its last level
    std::uint64_t evaluations = 0;
    // By entry, by level from 1 on: what that level loses where all others have full detail.
    std::vector<std::vector<double>> alone;
};

// From full detail, always lowering by one level the object that loses least for each triangle saved, until the budget
// (triangles of objects in sight) holds; then raises again what fits into what is left, most gained first. Ties go to
// more triangles saved, then to the first entry. `measures_alone`: fills in `alone`, one evaluation a level. Fails where
// PictureLoss::create() does.
Result<FoundSelection> select_greedily(const LayeredPicture& picture, SelectionQuality quality,
                                       const perception::Display& display, std::uint64_t budget,
                                       bool measures_alone = false);

// Levels that lose least within the budget: from the finest on, always down where least is lost for each triangle, over
// as many levels as make that least; then up again where it fits. By object: what levels cost, ascending from 0, and
// their triangles, falling.
struct LevelCosts {
    std::vector<double> costs;
    std::span<const std::uint32_t> triangles;
};
std::vector<int> levels_within(std::span<const LevelCosts> objects, std::uint64_t budget);

} // namespace unseen::session
