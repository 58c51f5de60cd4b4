// Adds up samples in float, and divides the sum in double.
#include <unseen/render/sample_sum.h>

#include <numeric>

#include <unseen/vdtree/internal/random.h>

#include "shaders.h"
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

// The permutation of the columns decides everything.
std::vector<glm::dvec2> n_rooks(int n, std::uint32_t seed) {
    if (n <= 0) return {};
    std::vector<int> row_of_column(static_cast<std::size_t>(n));
    std::iota(row_of_column.begin(), row_of_column.end(), 0);
    // The pattern must be the same everywhere, which std::shuffle does not promise. The bias of the modulus is below
    // 2^-55 for the 256 samples there can be.
    Random random(seed);
    for (std::size_t i = row_of_column.size(); i > 1; --i)
        std::swap(row_of_column[i - 1], row_of_column[random.bits() % i]);

    std::vector<glm::dvec2> points;
    points.reserve(row_of_column.size());
    for (std::size_t column = 0; column < row_of_column.size(); ++column)
        points.emplace_back((static_cast<double>(column) + 0.5) / n, (row_of_column[column] + 0.5) / n);
    return points;
}

struct SampleSum::Impl {
    Impl(Target sample_, Target sum_) : sample(std::move(sample_)), sum(std::move(sum_)) {}

    Result<void> prepare() {
        const auto program = context().impl().programs.full_screen("accumulate", shaders::accumulate_frag);
        if (!program) return program.error();
        accumulate = *program;
        pixels.resize(static_cast<std::size_t>(sum.width()) * static_cast<std::size_t>(sum.height()));
        begin(background);
        return {};
    }

    void begin(float background_) {
        background = background_;
        count = 0;
        set_fixed_state(sum.impl());
        const glm::vec4 nothing(0);
        glClearNamedFramebufferfv(sum.id(), GL_COLOR, 0, &nothing.x);
    }

    void add(const PixelBox& only) {
        ++count;
        set_fixed_state(sum.impl());
        set_scissor(only);
        disable({GL_DEPTH_TEST, GL_CULL_FACE});
        glEnable(GL_BLEND);
        glBlendEquation(GL_FUNC_ADD);
        glBlendFunc(GL_ONE, GL_ONE);
        sum.impl().bind(0);
        glBindTextureUnit(0, sample.colour_texture());
        accumulate->set(background_location, background);
        context().impl().programs.draw_full_screen(*accumulate);
    }

    const Context& context() const { return sum.impl().context; }

    Target sample, sum;
    const Program* accumulate = nullptr;
    float background = default_background;
    int count = 0; // of samples that were added
    std::vector<glm::vec4> pixels;
};

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

int SampleSum::width() const noexcept { return impl_->sum.width(); }
int SampleSum::height() const noexcept { return impl_->sum.height(); }

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
                                      order = n_rooks(sampling.samples, sampling.seed + 2),
                                      shares = n_rooks(sampling.samples, sampling.seed + 3);
        const auto turn = [&](std::size_t i) {
            return static_cast<std::size_t>(order[i].y * static_cast<double>(order.size()));
        };
        for (std::size_t i = 0; i < points.size(); ++i) {
            const glm::dvec2 point = points[i];
            if (sampling.shadows && points.size() > 1)
                if (auto shifted = sampling.shadows->impl().shift_texels(texels[turn(i)]); !shifted) return shifted;
            pass->draw(sample, point, {.colour = glm::vec4(sampling.background)}, points.size(), &used,
                       static_cast<float>(shares[i].x));
            impl_->add(used);
        }
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

} // namespace unseen::render
