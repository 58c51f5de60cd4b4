#include "judge/summation.h"

#include <cmath>

namespace unseen::perception {
namespace {

// A node of the quadrature of the integral of e^-t f(t).
struct Quadrature {
    double t, weight;
};
constexpr std::array<Quadrature, 3> laguerre = {{{0.41577455678347908, 0.71109300992917302},
                                                 {2.2942803602790417, 0.27851773356924085},
                                                 {6.2899450829374792, 0.010389256501586136}}};

// A Gaussian is applied to a plane in which it is no wider than this and no narrower than half of it, where it can be:
// wide enough for samples to tell its form.
constexpr double widest = 3;         // standard deviation, samples
constexpr double kernel_reach = 3.5; // standard deviations

// What halving and doubling a plane's resolution, d times, add to a Gaussian's variance: boxes of 2^d samples, and
// triangles of twice that width. In samples of the full resolution.
double added_variance(int halvings) {
    const double step = std::exp2(halvings);
    return halvings == 0 ? 0 : (step * step - 1) / 12 + step * step / 6;
}

// Means of two by two; what lies outside is 0.
Plane halved(const Plane& in) {
    Plane out((in.width + 1) / 2, (in.height + 1) / 2);
    for (int y = 0; y < out.height; ++y) {
        const float* const above = in.row(2 * y);
        const float* const below = 2 * y + 1 < in.height ? in.row(2 * y + 1) : nullptr;
        float* const to = out.row(y);
        for (int x = 0; x < out.width; ++x) {
            const int left = 2 * x, right = left + 1;
            float sum = above[left] + (right < in.width ? above[right] : 0);
            if (below) sum += below[left] + (right < in.width ? below[right] : 0);
            to[x] = 0.25f * sum;
        }
    }
    return out;
}

// out[i] = sum of kernel[k] (in[i - k step] + in[i + k step]), of `count` samples `step` apart.
void blur_rows(const Plane& in, const std::vector<float>& kernel, Plane& out) {
    const int reach = static_cast<int>(kernel.size()) - 1;
    std::vector<float> padded(static_cast<std::size_t>(in.width + 2 * reach));
    for (int y = 0; y < in.height; ++y) {
        std::copy_n(in.row(y), in.width, padded.begin() + reach);
        const float* const at = padded.data() + reach;
        float* const to = out.row(y);
        for (int x = 0; x < in.width; ++x) to[x] = kernel[0] * at[x];
        for (int k = 1; k <= reach; ++k) {
            const float weight = kernel[static_cast<std::size_t>(k)];
            for (int x = 0; x < in.width; ++x) to[x] += weight * (at[x - k] + at[x + k]);
        }
    }
}
void blur_columns(const Plane& in, const std::vector<float>& kernel, Plane& out) {
    const int reach = static_cast<int>(kernel.size()) - 1;
    for (int y = 0; y < in.height; ++y) {
        float* const to = out.row(y);
        for (int x = 0; x < in.width; ++x) to[x] = kernel[0] * in.row(y)[x];
        for (int k = 1; k <= reach; ++k) {
            const float weight = kernel[static_cast<std::size_t>(k)];
            for (const int from : {y - k, y + k}) {
                if (from < 0 || from >= in.height) continue;
                const float* const at = in.row(from);
                for (int x = 0; x < in.width; ++x) to[x] += weight * at[x];
            }
        }
    }
}

// Adds a plane of lower resolution, linear between its samples.
void add_enlarged(const Plane& low, int halvings, float weight, Plane& to) {
    const float step = std::exp2(static_cast<float>(halvings));
    struct Between {
        int first, second;
        float share;
    };
    const auto between = [&](int place, int count) {
        const float at = (static_cast<float>(place) + 0.5f) / step - 0.5f;
        const int first = static_cast<int>(std::floor(at));
        return Between{std::clamp(first, 0, count - 1), std::clamp(first + 1, 0, count - 1),
                       at - static_cast<float>(first)};
    };
    std::vector<Between> columns;
    for (int x = 0; x < to.width; ++x) columns.push_back(between(x, low.width));
    std::vector<float> line(static_cast<std::size_t>(low.width));
    for (int y = 0; y < to.height; ++y) {
        const Between rows = between(y, low.height);
        const float *const first = low.row(rows.first), *const second = low.row(rows.second);
        for (std::size_t x = 0; x < line.size(); ++x) line[x] = first[x] + rows.share * (second[x] - first[x]);
        float* const out = to.row(y);
        for (int x = 0; x < to.width; ++x) {
            const Between& c = columns[static_cast<std::size_t>(x)];
            const float left = line[static_cast<std::size_t>(c.first)],
                        right = line[static_cast<std::size_t>(c.second)];
            out[x] += weight * (left + c.share * (right - left));
        }
    }
}

} // namespace

SummationWindow::SummationWindow(double area) {
    for (std::size_t i = 0; i < laguerre.size(); ++i) {
        Gaussian& g = gaussians_[i];
        g.weight = laguerre[i].weight;
        const double variance = area / (2 * std::numbers::pi * laguerre[i].t);
        while (std::sqrt(variance) > widest * std::exp2(g.halvings)) ++g.halvings;
        const double step = std::exp2(g.halvings);
        const double sigma = std::sqrt(std::max(variance - added_variance(g.halvings), 0.0)) / step;
        const int reach = static_cast<int>(std::ceil(kernel_reach * sigma));
        double sum = 0;
        std::vector<double> kernel;
        for (int k = 0; k <= reach; ++k) {
            kernel.push_back(sigma > 0 ? std::exp(-k * k / (2 * sigma * sigma)) : 1);
            sum += (k > 0 ? 2 : 1) * kernel.back();
        }
        for (const double k : kernel) g.kernel.push_back(static_cast<float>(k / sum));
    }
}

Plane SummationWindow::sums(const Plane& energy) const {
    Plane all(energy.width, energy.height), at_level = energy;
    int level = 0;
    for (std::size_t i = gaussians_.size(); i-- > 0;) { // from the narrowest on
        const Gaussian& g = gaussians_[i];
        for (; level < g.halvings; ++level) at_level = halved(at_level);
        Plane rows(at_level.width, at_level.height), blurred(at_level.width, at_level.height);
        blur_rows(at_level, g.kernel, rows);
        blur_columns(rows, g.kernel, blurred);
        add_enlarged(blurred, g.halvings, static_cast<float>(g.weight), all);
    }
    return all;
}

} // namespace unseen::perception
