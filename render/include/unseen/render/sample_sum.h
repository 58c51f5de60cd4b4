// Antialiasing: the mean of many draws, each of which samples another point of the pixels.
#pragma once

#include <unseen/render/draw.h>

namespace unseen::render {

// The N-rooks pattern: n points in the unit square, one in each of n rows and n columns.
std::vector<glm::dvec2> n_rooks(int n, std::uint32_t seed);

struct Sampling {
    int samples = 16;                      // N-rooks samples a pixel, 1..256
    std::uint32_t seed = 1;                // of the sample pattern; use the same for images to compare
    float background = default_background; // relative luminance, grey, 0..1
    // As in Camera. With several samples, the maps of the last casters are redrawn for each sample with their texels
    // shifted, so edges of shadows are as smooth as those of surfaces.
    Shadows* shadows = nullptr;
};

// Two targets in 32-bit float: samples are drawn into one and added up in the other. It adds differences from the
// background, so background pixels are exact with any number of samples. Equal draws give equal bits. Move-only.
class SampleSum {
public:
    static Result<SampleSum> create(const Context& context, int width, int height); // 36 bytes a pixel
    SampleSum(SampleSum&&) noexcept = default;
    SampleSum& operator=(SampleSum&&) noexcept = default;

    int width() const noexcept;
    int height() const noexcept;

    // Starts over, and draws and adds all samples. Touches only pixels that may show an item.
    Result<void> draw(std::span<const Item> items, const vdtree::View& view, const Sampling& sampling);

    // The mean of the samples: linear RGB and relative luminance, row-major from the top left. Waits for the GPU. Valid until
    // the next call.
    Result<std::span<const glm::vec4>> mean();

private:
    struct Impl;
    explicit SampleSum(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
