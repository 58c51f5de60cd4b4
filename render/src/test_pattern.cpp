// Checks what is asked for, and hands it to the shader.
#include <unseen/render/internal/test_pattern.h>

#include <cmath>
#include <numbers>

#include <unseen/render/target.h>
#include <unseen/vdtree/internal/errors.h>

#include "context_impl.h"
#include "shaders.h"

namespace unseen::render {
namespace {

constexpr std::size_t code_count = 256, most_marks = 8;

enum UniformLocation {
    kind_location,
    screen_location,
    grating_location,
    place_location,
    overlay_location,
    frame_location,
    marks_location
};

Result<void> check(const TestPattern& p) {
    for (const double value : {p.mean, p.frequency_cpd, p.sigma_deg, p.phase_deg, p.centre.x, p.centre.y, p.mark_code,
                               p.code, p.tangent_per_pixel})
        if (!std::isfinite(value)) return invalid_argument("A test pattern's numbers must be finite.");
    if (!(p.tangent_per_pixel > 0)) return invalid_argument("A test pattern's pixels must have a size above 0.");
    if (!(p.contrast >= 0 && p.contrast <= 1)) return invalid_argument("A test pattern's contrast must lie in 0..1.");
    if (!(p.mean > 0)) return invalid_argument("A test pattern's mean luminance must be above 0.");
    if (!(p.frequency_cpd > 0 && p.sigma_deg > 0))
        return invalid_argument("A grating's frequency and size must be above 0.");
    if (!(p.rows >= 1 && p.white_rows >= 0 && p.white_rows <= p.rows))
        return invalid_argument("White rows must be 0 to all of the rows.");
    if (p.marks.size() > most_marks) return invalid_argument("A test pattern has at most 8 marks.");
    return {};
}

} // namespace

struct TestPatternDrawer::Impl {
    explicit Impl(const Context& context_) : context(context_), guard(context_) {}

    Context context; // first, and so gone last
    const Program* program = nullptr;
    Buffer levels;
    std::optional<Target> target; // made for the first pattern off screen, and for each of another size
    ContextGuard guard;

    void draw(const TestPattern& p, int width, int height, unsigned framebuffer, bool top_first) {
        const auto vec4 = [](double x, double y, double z, double w) {
            return glm::vec4(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z),
                             static_cast<float>(w));
        };
        program->set(kind_location, static_cast<unsigned>(p.kind));
        program->set(screen_location, vec4(width, height, p.tangent_per_pixel, top_first ? 1 : 0));
        program->set(grating_location, vec4(p.mean, p.contrast, p.frequency_cpd, p.sigma_deg));
        program->set(place_location, vec4(p.phase_deg * std::numbers::pi / 180, p.centre.x, p.centre.y, p.code));
        program->set(overlay_location, vec4(static_cast<double>(p.marks.size()), p.mark_code, p.rows, p.white_rows));
        program->set(frame_location, p.frame);
        for (std::size_t i = 0; i < p.marks.size(); ++i)
            program->set(marks_location + static_cast<int>(i),
                         vec4(p.marks[i].x, p.marks[i].y, p.marks[i].z, p.marks[i].w));

        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer);
        glViewport(0, 0, width, height);
        disable(
            {GL_DEPTH_TEST, GL_BLEND, GL_CULL_FACE, GL_SCISSOR_TEST, GL_FRAMEBUFFER_SRGB, GL_MULTISAMPLE, GL_DITHER});
        glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
        glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
        glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, levels.id());
        context.impl().programs.draw_full_screen(*program);
    }
};

Result<TestPatternDrawer> TestPatternDrawer::create(const Context& context, std::span<const double> code_luminances) {
    if (code_luminances.size() != code_count)
        return invalid_argument("A display has 256 codes, not " + std::to_string(code_luminances.size()) + ".");
    std::array<float, code_count> levels;
    for (std::size_t i = 0; i < code_count; ++i) {
        levels[i] = static_cast<float>(code_luminances[i]);
        if (!std::isfinite(levels[i]) || (i > 0 && !(levels[i] >= levels[i - 1])))
            return invalid_argument("The luminances of a display's codes must ascend; that of code " +
                                    std::to_string(i) + " does not.");
    }
    auto impl = std::make_unique<Impl>(context);
    auto made = in_context(context, "Making test patterns", [&]() -> Result<void> {
        const auto program = context.impl().programs.full_screen("test pattern", shaders::test_pattern_frag);
        if (!program) return program.error();
        impl->program = *program;
        impl->levels = Buffer::create("code luminances");
        glNamedBufferStorage(impl->levels.id(), sizeof(levels), levels.data(), 0);
        return {};
    });
    if (!made) return made.error();
    return TestPatternDrawer(std::move(impl));
}

Result<void> TestPatternDrawer::draw_to_window(const TestPattern& pattern, int width, int height) {
    if (auto ok = check(pattern); !ok) return ok;
    return in_context(impl_->context, "Drawing a test pattern", [&] { impl_->draw(pattern, width, height, 0, false); });
}

Result<std::vector<float>> TestPatternDrawer::draw(const TestPattern& pattern, int width, int height) {
    if (auto ok = check(pattern); !ok) return ok.error();
    std::optional<Target>& target = impl_->target;
    if (!target || target->width() != width || target->height() != height) {
        auto made = Target::create(impl_->context, width, height, {.depth = false, .label = "test pattern"});
        if (!made) return made.error();
        target = std::move(*made);
    }
    auto drawn = in_context(impl_->context, "Drawing a test pattern",
                            [&] { impl_->draw(pattern, width, height, target->id(), true); });
    if (!drawn) return drawn.error();
    const auto pixels = read_pixels(*target);
    if (!pixels) return pixels.error();
    std::vector<float> codes;
    codes.reserve(pixels->size());
    for (const glm::vec4& pixel : *pixels) codes.push_back(pixel.r);
    return codes;
}

} // namespace unseen::render
