// Threshold maps with elevation by local contrast (Ramasubramanian and others 1999), for comparison with older work. The
// passes know neither display nor observer: perception::rpg99_tables() makes their tables.
#pragma once

#include <unseen/render/internal/visibility_passes.h>

namespace unseen {
struct Rpg99Tables;
}

namespace unseen::render {

// Move-only; keeps a handle to the context. Memory: 108 bytes a pixel, and 4 for each map.
class ElevationPasses {
public:
    // For pictures of one size. Fails beyond this GL's limits, and if memory runs out.
    static Result<ElevationPasses> create(const Context& context, int width, int height, const Rpg99Tables& tables);
    ElevationPasses(ElevationPasses&&) noexcept = default;
    ElevationPasses& operator=(ElevationPasses&&) noexcept = default;

    // Maps the just visible step of luminance, cd/m2, by pixel of the picture. Does not wait. Maps are kept by number as in
    // VisibilityPasses. Fails on a picture of another size.
    Result<void> map_thresholds(const LuminanceTexture& picture, int number = 0);
    Result<std::vector<float>> read_thresholds(int number = 0) const; // waits; fails where there is no map yet
    unsigned thresholds_texture(int number = 0) const noexcept;       // one 32-bit float; 0 before there is a map

    int full_screen_passes() const noexcept; // since create()
    std::uint64_t texture_bytes() const noexcept;

private:
    struct Impl;
    explicit ElevationPasses(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
