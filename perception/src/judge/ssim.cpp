#include <unseen/perception/internal/ssim_window.h>
#include <unseen/perception/judge.h>
#include <unseen/vdtree/internal/errors.h>

#include <cmath>

namespace unseen::perception {
namespace {

constexpr double luma_weights[3] = {0.299, 0.587, 0.114}; // ITU-R BT.601

// The code values as they would stand in an 8-bit file; luma itself is not rounded.
std::vector<double> luma_codes(const Image& image) {
    const auto channels = static_cast<std::size_t>(image.channels);
    std::vector<double> luma(image.values.size() / channels);
    for (std::size_t p = 0; p < luma.size(); ++p) {
        for (std::size_t c = 0; c < channels; ++c) {
            const double code =
                std::round(static_cast<double>(image.values[p * channels + c]) * ssim_window::data_range);
            luma[p] += channels == 1 ? code : luma_weights[c] * code;
        }
    }
    return luma;
}

std::string shape_of(const Image& i) {
    return std::to_string(i.width) + "x" + std::to_string(i.height) + "x" + std::to_string(i.channels);
}

Result<void> check(const Image& a, const Image& b) {
    if (a.width != b.width || a.height != b.height || a.channels != b.channels || a.values.size() != b.values.size())
        return invalid_argument("SSIM needs two images of one size and one channel count: the reference is " +
                                shape_of(a) + ", the test " + shape_of(b));
    if (a.width < ssim_window::size || a.height < ssim_window::size || (a.channels != 1 && a.channels != 3))
        return invalid_argument("SSIM needs grey or RGB images of at least 11 x 11 pixels, not " + shape_of(a));
    const std::size_t values = a.index(0, a.height, 0);
    if (a.values.size() != values)
        return invalid_argument("SSIM: an image of " + std::to_string(values) + " values holds " +
                                std::to_string(a.values.size()));
    for (std::size_t i = 0; i < values; ++i)
        if (!std::isfinite(a.values[i]) || !std::isfinite(b.values[i]))
            return invalid_argument("SSIM: value " + std::to_string(i) + " of an image is not finite");
    return {};
}

} // namespace

const std::array<double, ssim_window::size>& ssim_window::weights() {
    static const std::array<double, size> window = [] {
        std::array<double, size> w{};
        double sum = 0;
        for (int i = 0; i < size; ++i) {
            const double x = (i - radius) / sigma;
            sum += w[static_cast<std::size_t>(i)] = std::exp(-0.5 * x * x);
        }
        for (double& v : w) v /= sum;
        return w;
    }();
    return window;
}

Result<double> ssim(const Image& reference_codes, const Image& test_codes) {
    if (auto ok = check(reference_codes, test_codes); !ok) return ok.error();
    const std::vector<double> x = luma_codes(reference_codes);
    const std::vector<double> y = luma_codes(test_codes);
    constexpr std::size_t window_size = ssim_window::size;
    using ssim_window::Moments;
    const auto& window = ssim_window::weights();
    const auto width = static_cast<std::size_t>(reference_codes.width);
    const auto height = static_cast<std::size_t>(reference_codes.height);

    // A row of windows at a time: first down the columns, then along the row. Only windows inside the image are wanted,
    // so there are no edges to treat.
    std::vector<Moments> columns(width);
    double sum = 0;
    for (std::size_t top = 0; top + window_size <= height; ++top) {
        for (std::size_t i = 0; i < width; ++i) {
            Moments m;
            for (std::size_t k = 0; k < window_size; ++k) {
                const double a = x[(top + k) * width + i], b = y[(top + k) * width + i];
                m.add(window[k], {a, b, a * a, b * b, a * b});
            }
            columns[i] = m;
        }
        for (std::size_t left = 0; left + window_size <= width; ++left) {
            Moments m;
            for (std::size_t k = 0; k < window_size; ++k) m.add(window[k], columns[left + k]);
            sum += ssim_window::similarity(m);
        }
    }
    return sum / (static_cast<double>(width - window_size + 1) * static_cast<double>(height - window_size + 1));
}

} // namespace unseen::perception
