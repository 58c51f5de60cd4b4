// Patterns for measuring displays and their viewers, exact to a fraction of a code: gratings and brightness
// matches.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/render/context.h>

namespace unseen::render {

// Directions are tangents on the screen from its centre (right, up): pixels from the centre times `tangent_per_pixel`.
struct TestPattern {
    enum class Kind {
        // A Gabor patch: mean (1 + contrast exp(-r^2 / 2 sigma^2) cos(2 pi frequency x + phase)), angles about its
        // centre.
        grating,
        // Left half: rows, `white_rows` of each `rows` white, the others black; right half: the code `code`.
        match,
    };
    Kind kind = Kind::grating;
    double tangent_per_pixel = 0.000508;
    double mean = 50;    // cd/m2
    double contrast = 0; // Michelson, 0..1
    double frequency_cpd = 4;
    double sigma_deg = 0.4;
    double phase_deg = 0;
    glm::dvec2 centre = glm::dvec2(0); // of the patch
    int rows = 2, white_rows = 1;
    double code = 0.5; // 0..1
    // Rectangles over it all: left, top, right, bottom in pixels from the top left. At most 8.
    std::vector<glm::dvec4> marks;
    double mark_code = 0; // 0..1
    unsigned frame = 0;   // picks the dither's noise
};

// Draws patterns for a display of 256 grey levels. A luminance between two codes gets either one at random by pixel and
// frame, so that the mean is right (spatio-temporal dithering); beyond the codes' range it is clipped.
class TestPatternDrawer {
public:
    // `code_luminances`: cd/m2 of the 256 codes, finite and ascending. Keeps a handle to the context.
    static Result<TestPatternDrawer> create(const Context& context, std::span<const double> code_luminances);
    TestPatternDrawer(TestPatternDrawer&&) noexcept = default;
    TestPatternDrawer& operator=(TestPatternDrawer&&) noexcept = default;

    // Draws codes to the window's framebuffer, without conversion.
    Result<void> draw_to_window(const TestPattern& pattern, int width, int height);
    // Off screen: code values 0..1, row-major from the top left.
    Result<std::vector<float>> draw(const TestPattern& pattern, int width, int height);

private:
    struct Impl;
    explicit TestPatternDrawer(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
