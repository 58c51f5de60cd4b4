// Which pixels of a picture differ visibly from a reference: the passes of a judge that works by bands of a pyramid. They
// know no display and no observer. Tables say what is seen; perception::judge_tables() of Unseen makes them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/render/context.h>
#include <unseen/vdtree/result.h>

namespace unseen::render {

// The luminance of a picture, cd/m2: offset + scale times a channel of a texture of two dimensions, floats or normalised,
// whose first row is the picture's top. Such as {target.colour_texture(), width, height, 3, peak - black, black}.
struct LuminanceTexture {
    unsigned id = 0; // GL name; stays its owner's
    int width = 0, height = 0;
    int channel = 0; // 0 to 3
    float scale = 1, offset = 0;
};

// A picture in memory that becomes a texture. Move-only; keeps a handle to the context.
class LuminanceImage {
public:
    // Row-major from the top left. Fails on a size below 1x1, on more than this GL takes, on another number of values,
    // and where memory does not suffice. Values are looked at by who uses them.
    static Result<LuminanceImage> create(const Context& context, int width, int height, std::span<const float> cdm2);
    LuminanceImage(LuminanceImage&&) noexcept;
    LuminanceImage& operator=(LuminanceImage&&) noexcept;
    ~LuminanceImage();

    Result<void> set(std::span<const float> cdm2); // of the same size
    LuminanceTexture texture() const noexcept;

private:
    struct Impl;
    explicit LuminanceImage(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

struct LuminanceExtent {
    float least = 0, largest = 0; // cd/m2
};
// Waits for the GPU. Fails on a NaN, infinite or negative luminance, naming the first pixel; `which` is the picture's name
// in the message.
Result<LuminanceExtent> luminance_extent(const Context& context, const LuminanceTexture& picture, const char* which);

// What is seen of pictures of one size. See perception/judge_tables.h, whose fields are these, for what is computed.
struct VisibilityTables {
    struct Node {
        float log2_s = 0, own = 1, smoothed = 0;
    };
    struct Gaussian {
        float weight = 0;
        int halvings = 0;          // 0 to 30
        std::vector<float> kernel; // 1 to 12 values
    };
    struct Band {
        float of_patch = 1;
        std::array<Gaussian, 3> window;
        std::vector<Node> nodes; // luminances x eccentricities
    };
    struct Gaze {
        glm::vec3 direction = {0, 0, 1};
        float tangent_per_pixel = 0;
    };

    int width = 0, height = 0;
    float floor_cdm2 = 0; // above 0
    float beta = 0, most_thresholds = 0;
    std::array<float, 3> kernel = {};
    float masking_power = 0, masking_knee = 0, least_masker = 0, most_masker = 0;
    int luminance_shift = 0, first_luminance = 0;
    int luminances = 0, eccentricities = 0;
    float first_eccentricity = 0, eccentricity_step = 0;
    std::optional<Gaze> gaze = {};
    std::vector<Band> bands; // 1 to 16
};

// Of what the passes keep. With half floats the reference's weights and the energies take half of the memory; V is within
// 1% from 0.1 to 5,000.
enum class VisibilityPrecision { full, half };

struct VisibilitySummary {
    double largest = 0; // V
    std::uint64_t visible_pixels = 0;
};

// By how much a picture raises thresholds, at least, in cells of a grid over it.
struct ElevationGrid {
    int cell_px = 0; // a side; cells at the right and the bottom may reach beyond the picture
    int columns = 0, rows = 0;
    std::vector<float> elevation; // [(band * rows + row) * columns + column], 1 or more; bands as in the tables
};

// Prepares a reference once, and judges any number of pictures by it. What is not called for is not made: the
// reference's weights and planes for judging at the first judge(), the map of thresholds at the first map_thresholds(),
// and without a gaze nothing knows of eccentricity. The same pictures give the same bits on the same GPU. Move-only;
// keeps a handle to the context.
//
// Memory, in bytes a pixel: 4 for the reference; for judging 11 of its weights (half floats: 5), 11 more while it is
// prepared, and some 35 (28); 4 for each map of thresholds and 25 more while it is mapped. From the first
// set_reference() on, what is needed meanwhile is kept for the next one.
class VisibilityPasses {
public:
    // The reference is copied. Fails on tables that contradict themselves or the picture, on more than this GL takes, and
    // where memory does not suffice. The tables' luminances have to span the reference's, which luminance_extent() checks.
    static Result<VisibilityPasses> create(const Context& context, const VisibilityTables& tables,
                                           const LuminanceTexture& reference,
                                           VisibilityPrecision precision = VisibilityPrecision::full);
    VisibilityPasses(VisibilityPasses&&) noexcept;
    VisibilityPasses& operator=(VisibilityPasses&&) noexcept;
    ~VisibilityPasses();

    // Another reference, of the same size and within the tables' luminances; what is judged and mapped from now on goes by
    // it. Waits for nothing, and makes no textures from the second time on. Fails where create() does; then the reference
    // is as before.
    Result<void> set_reference(const LuminanceTexture& reference);

    // Judges a picture of the reference's size. Waits for nothing.
    Result<void> judge(const LuminanceTexture& test);

    // Of the last picture judged; these wait for the GPU. Errors: none was judged; a luminance of it was negative or not
    // finite, and the message names the first such pixel.
    Result<VisibilitySummary> summary() const;
    Result<std::vector<float>> read_visibility() const; // V by pixel, row-major from the top left
    // The same in one channel of 32-bit floats; another picture overwrites it. 0 before the first.
    unsigned visibility_texture() const noexcept;

    // The step of luminance that is just visible, cd/m2, by pixel: of this reference. Maps of several references are kept
    // side by side by number, 0 to most_maps - 1; one of the same number is overwritten.
    static constexpr int most_maps = 16;
    Result<void> map_thresholds(int number = 0);
    Result<std::vector<float>> read_thresholds(int number = 0) const; // fails where there is no map yet
    unsigned thresholds_texture(int number = 0) const noexcept;       // 0 before there is a map

    int full_screen_passes() const noexcept;      // since create()
    std::uint64_t texture_bytes() const noexcept; // of all that is kept but the tables

    // What the reference masks, band by band: the masker of a band is the mean around a sample, by a Gaussian of 1.5
    // samples, and a cell has the least of all samples that stand in it, or around it. So what lies in some cells is
    // masked by no less than the least of theirs. Reading waits for the GPU, but for less than reading a picture would.
    // Fails on cells of less than 1 pixel, and of more than 64.
    Result<void> map_elevations(int cell_px = 8);
    Result<ElevationGrid> read_elevations() const; // fails where there is no map yet

private:
    struct Impl;
    explicit VisibilityPasses(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
