// Adds up samples in float, and divides the sum in double.
#include <unseen/render/sample_sum.h>

#include <string>

#include "gl.h"
#include "sample_count.h"
#include "shaders.h"
#include "shadows_impl.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

constexpr int background_location = 0;

Result<void> check(const Sampling& sampling) {
    if (auto valid = check_samples(sampling.samples); !valid) return valid;
    if (!(sampling.background >= 0 && sampling.background <= 1))
        return Error{ErrorCode::invalid_argument, "The background must be a relative luminance from 0 to 1, not " +
                                                      std::to_string(sampling.background) + "."};
    return {};
}

} // namespace

struct SampleSum::Impl {
    Impl(Target sample_, Target sum_) : sample(std::move(sample_)), sum(std::move(sum_)) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() { static_cast<void>(context().make_current()); } // for the objects, which go next

    Result<void> prepare();
    void begin(float background);
    void add(const PixelBox* only);
    const Context& context() const { return sum.impl().context; }

    Target sample, sum;
    const Program* accumulate = nullptr;
    VertexArray no_arrays; // for the full-screen triangle, which comes from nowhere
    float background = default_background;
    int count = 0; // of samples that were added
    std::vector<glm::vec4> pixels;
};

Result<void> SampleSum::Impl::prepare() {
    const ShaderSource sources[] = {{ShaderSource::Stage::vertex, shaders::full_screen_vert},
                                    {ShaderSource::Stage::fragment, shaders::accumulate_frag}};
    const auto program = context().impl().programs.named("accumulate", sources);
    if (!program) return program.error();
    accumulate = *program;
    no_arrays = VertexArray::create("full screen");
    pixels.resize(static_cast<std::size_t>(sum.width()) * static_cast<std::size_t>(sum.height()));
    begin(background);
    return {};
}

void SampleSum::Impl::begin(float background_) {
    background = background_;
    count = 0;
    set_fixed_state(sum.impl());
    const glm::vec4 nothing(0);
    glClearNamedFramebufferfv(sum.id(), GL_COLOR, 0, &nothing.x);
}

void SampleSum::Impl::add(const PixelBox* only) {
    ++count;
    set_fixed_state(sum.impl());
    if (only) set_scissor(*only);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_CULL_FACE);
    glEnable(GL_BLEND);
    glBlendEquation(GL_FUNC_ADD);
    glBlendFunc(GL_ONE, GL_ONE);
    sum.impl().bind(0);
    glBindTextureUnit(0, sample.colour_texture());
    accumulate->set(background_location, background);
    accumulate->use();
    glBindVertexArray(no_arrays.id());
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray(0);
}

Result<SampleSum> SampleSum::create(const Context& context, int width, int height) {
    auto sample = Target::create(context, width, height, {.label = "sample"});
    if (!sample) return sample.error();
    auto sum = Target::create(context, width, height, {.depth = false, .label = "sum of samples"});
    if (!sum) return sum.error();
    auto impl = std::make_unique<Impl>(std::move(*sample), std::move(*sum));
    if (auto made = in_context(context, "Making a sum of samples", [&] { return impl->prepare(); }); !made)
        return made.error();
    return SampleSum(std::move(impl));
}

SampleSum::SampleSum(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SampleSum::SampleSum(SampleSum&&) noexcept = default;
SampleSum& SampleSum::operator=(SampleSum&&) noexcept = default;
SampleSum::~SampleSum() = default;

int SampleSum::width() const noexcept { return impl_->sum.width(); }
int SampleSum::height() const noexcept { return impl_->sum.height(); }
Target& SampleSum::sample() noexcept { return impl_->sample; }

Result<void> SampleSum::draw(std::span<const Item> items, const vdtree::View& view, const Sampling& sampling) {
    if (auto valid = check(sampling); !valid) return valid;
    return in_context(impl_->context(), "Drawing", [&]() -> Result<void> {
        const Target::Impl& sample = impl_->sample.impl();
        const auto pass = SurfacePass::prepare(items, {.view = view, .shadows = sampling.shadows}, sample, 0);
        if (!pass) return pass.error();
        const std::vector<glm::dvec2> points = n_rooks(sampling.samples, sampling.seed);
        const PixelBox used = pass->pixels_of(points); // elsewhere the sum stays 0: the background
        impl_->begin(sampling.background);
        // Another pattern than that of the points, in another order, so that the two do not go together.
        const std::vector<glm::dvec2> texels = n_rooks(sampling.samples, sampling.seed + 1),
                                      order = n_rooks(sampling.samples, sampling.seed + 2);
        const auto turn = [&](std::size_t i) {
            return static_cast<std::size_t>(order[i].y * static_cast<double>(order.size()));
        };
        for (std::size_t i = 0; i < points.size(); ++i) {
            const glm::dvec2 point = points[i];
            if (sampling.shadows && points.size() > 1)
                if (auto shifted = sampling.shadows->impl().shift_texels(texels[turn(i)]); !shifted) return shifted;
            pass->draw(sample, point, {.colour = glm::vec4(sampling.background)}, points.size(), &used);
            impl_->add(&used);
        }
        return {};
    });
}

Result<void> SampleSum::begin(float background) {
    if (auto valid = check({.background = background}); !valid) return valid;
    return in_context(impl_->context(), "Beginning a sum of samples", [&]() -> Result<void> {
        impl_->begin(background);
        return {};
    });
}

Result<void> SampleSum::add() {
    if (impl_->count >= most_samples) return check({.samples = impl_->count + 1});
    return in_context(impl_->context(), "Adding a sample", [&]() -> Result<void> {
        impl_->add(nullptr);
        return {};
    });
}

Result<std::span<const glm::vec4>> SampleSum::mean() {
    auto& pixels = impl_->pixels;
    auto read = in_context(impl_->context(), "Reading the sum of samples",
                           [&] { return impl_->sum.impl().read_colour(0, impl_->sum.impl().whole(), pixels); });
    if (!read) return read.error();
    const double share = 1.0 / std::max(impl_->count, 1);
    for (glm::vec4& pixel : pixels) pixel = glm::vec4(glm::dvec4(pixel) * share + glm::dvec4(impl_->background));
    return std::span<const glm::vec4>(pixels);
}

LuminanceTexture SampleSum::mean_luminance() const noexcept {
    constexpr int luminance = 3;
    const float share = 1 / static_cast<float>(std::max(impl_->count, 1));
    return {impl_->sum.colour_texture(), width(), height(), luminance, share, impl_->background};
}

} // namespace unseen::render
