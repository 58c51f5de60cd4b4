// Antialiasing: the mean of many draws, each of another point of the pixels.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/render/draw.h>
#include <unseen/render/visibility.h>

namespace unseen::render {

// The N-rooks pattern: n points in the unit square, one in each of n rows and of n columns.
std::vector<glm::dvec2> n_rooks(int n, std::uint32_t seed);

struct Sampling {
    int samples = 16;                      // N-rooks samples a pixel, 1..256
    std::uint32_t seed = 1;                // of the sample pattern: equal for images that are compared
    float background = default_background; // relative luminance, grey, 0..1
    // As of a Camera. With several samples, the maps are drawn anew for each of them, with their texels elsewhere: so
    // edges of shadows are as good as those of surfaces, and not those of texels. They keep their last casters for that.
    Shadows* shadows = nullptr;
};

// Two targets in 32-bit float: one that samples are drawn into, and one that they are added up in. What is added up are
// differences from the background, so background pixels are exact with any number of samples, and equal draws give
// equal bits. Move-only.
class SampleSum {
public:
    static Result<SampleSum> create(const Context& context, int width, int height); // 36 bytes a pixel
    SampleSum(SampleSum&&) noexcept;
    SampleSum& operator=(SampleSum&&) noexcept;
    ~SampleSum();

    int width() const noexcept;
    int height() const noexcept;

    // Begins anew, and draws and adds all samples. Touches only pixels that may show an item.
    Result<void> draw(std::span<const Item> items, const vdtree::View& view, const Sampling& sampling);

    // The same by hand, for frames of several draws: begin(), then for each sample any draws into sample(), the first
    // of which clears it to the background, and add().
    Result<void> begin(float background);
    Target& sample() noexcept;
    Result<void> add(); // fails after 256 samples

    // The mean, the background where nothing was added: linear RGB and relative luminance, row-major from the top left.
    // Waits for the GPU. The pixels are the sum's and stay until the next call.
    Result<std::span<const glm::vec4>> mean();

    // The mean relative luminance where it is, on the GPU, for passes that read it: of what was added so far.
    LuminanceTexture mean_luminance() const noexcept;

private:
    struct Impl;
    explicit SampleSum(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
