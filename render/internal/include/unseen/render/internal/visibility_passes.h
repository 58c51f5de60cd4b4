// Finds the pixels of a picture that differ visibly from a reference: the passes of a judge that works by bands of a
// pyramid. They know neither display nor observer: perception::judge_tables() makes their tables.
#pragma once

#include <cstdint>

#include <unseen/render/target.h>

namespace unseen {
struct JudgeTables;
}

namespace unseen::render {

// A picture in memory that becomes a texture. Move-only; keeps a handle to the context.
class LuminanceImage {
public:
    // Row-major from the top left. Fails on a size below 1x1 or beyond this GL's limits, on another number of values, and if
    // memory runs out. Does not check the values.
    static Result<LuminanceImage> create(const Context& context, int width, int height, std::span<const float> cdm2);
    LuminanceImage(LuminanceImage&&) noexcept = default;
    LuminanceImage& operator=(LuminanceImage&&) noexcept = default;

    Result<void> set(std::span<const float> cdm2); // of the same size
    LuminanceTexture texture() const noexcept;

private:
    struct Impl;
    explicit LuminanceImage(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

struct LuminanceExtent {
    float least = 0, largest = 0; // cd/m2
};
// Waits for the GPU. Fails on a NaN, infinite or negative luminance, naming the first pixel; `which` is the picture's name
// in the message.
Result<LuminanceExtent> luminance_extent(const Context& context, const LuminanceTexture& picture, const char* which);

struct VisibilitySummary {
    double largest = 0; // V
    std::uint64_t visible_pixels = 0;
};

// Prepares a reference once, and judges any number of pictures against it. Everything is made on demand: the reference's
// weights and the planes for judging in the first judge(), the threshold map in the first map_thresholds(). The same
// pictures give the same bits on the same GPU. Move-only; keeps a handle to the context.
//
// Memory, in bytes a pixel: 4 for the reference; for judging 11 for its weights, 11 more while it is prepared, and some 35;
// 4 for each threshold map and 25 more while it is mapped. From the first set_reference() on, temporary memory is kept.
class VisibilityPasses {
public:
    // Copies the reference. Fails on tables for another size, beyond this GL's limits, and if memory
    // runs out. The tables' luminances must span the reference's; see luminance_extent().
    static Result<VisibilityPasses> create(const Context& context, const JudgeTables& tables,
                                           const LuminanceTexture& reference);
    VisibilityPasses(VisibilityPasses&&) noexcept = default;
    VisibilityPasses& operator=(VisibilityPasses&&) noexcept = default;

    // Sets another reference, of the same size and within the tables' luminances. Does not wait, and makes no textures from
    // the second time on. Fails like create(); then the reference stays.
    Result<void> set_reference(const LuminanceTexture& reference);

    // Judges a picture of the reference's size. Does not wait.
    Result<void> judge(const LuminanceTexture& test);

    // Results for the last judged picture; these wait for the GPU. Fail if none was judged, and if a luminance of it was
    // negative or not finite; the message names the first such pixel.
    Result<VisibilitySummary> summary() const;
    Result<std::vector<float>> read_visibility() const; // V by pixel, row-major from the top left

    // Maps the just visible step of luminance, cd/m2, by pixel of this reference. Maps of several references are kept by
    // number, 0 to 15; one of the same number is overwritten.
    Result<void> map_thresholds(int number = 0);
    Result<std::vector<float>> read_thresholds(int number = 0) const; // fails where there is no map yet
    unsigned thresholds_texture(int number = 0) const noexcept;       // 0 before there is a map

    int full_screen_passes() const noexcept;      // since create()
    std::uint64_t texture_bytes() const noexcept; // of all textures except the tables

private:
    struct Impl;
    explicit VisibilityPasses(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
