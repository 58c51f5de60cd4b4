// SSIM against its definition, written out once more without any short cut, and against a number that was checked
// together with 15 image pairs that scikit-image 0.19 had measured (all within 1e-8).
#include <unseen/perception/judge.h>

#include "testing.h"

namespace unseen::perception::ssim_test {

// Codes n/255 of a fixed pseudo-random sequence over a ramp.
Image noisy_ramp(int width, int height, int channels, std::uint32_t seed, int amplitude) {
    Image image{width, height, channels, {}};
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            for (int c = 0; c < channels; ++c) {
                seed = seed * 1664525U + 1013904223U;
                const int code = 60 + (3 * x + 2 * y + 20 * c) % 120 +
                                 static_cast<int>((seed >> 24) % static_cast<unsigned>(amplitude));
                image.values.push_back(static_cast<float>(code) / 255.0F);
            }
        }
    }
    return image;
}

double luma(const Image& image, int x, int y) {
    const auto code = [&](int c) { return std::round(255.0 * image.at(x, y, c)); };
    return image.channels == 1 ? code(0) : 0.299 * code(0) + 0.587 * code(1) + 0.114 * code(2);
}

double by_definition(const Image& a, const Image& b) {
    double total = 0;
    int count = 0;
    for (int cy = 5; cy + 5 < a.height; ++cy) {
        for (int cx = 5; cx + 5 < a.width; ++cx) {
            double weight = 0, mean_a = 0, mean_b = 0, var_a = 0, var_b = 0, cov = 0;
            const auto over_window = [&](auto use) {
                for (int dy = -5; dy <= 5; ++dy) {
                    for (int dx = -5; dx <= 5; ++dx) {
                        use(std::exp(-(dx * dx + dy * dy) / (2 * 1.5 * 1.5)), luma(a, cx + dx, cy + dy),
                            luma(b, cx + dx, cy + dy));
                    }
                }
            };
            over_window([&](double w, double p, double q) {
                weight += w;
                mean_a += w * p;
                mean_b += w * q;
            });
            mean_a /= weight;
            mean_b /= weight;
            over_window([&](double w, double p, double q) {
                var_a += w / weight * (p - mean_a) * (p - mean_a);
                var_b += w / weight * (q - mean_b) * (q - mean_b);
                cov += w / weight * (p - mean_a) * (q - mean_b);
            });
            const double c1 = 2.55 * 2.55, c2 = 7.65 * 7.65;
            total += (2 * mean_a * mean_b + c1) * (2 * cov + c2) /
                     ((mean_a * mean_a + mean_b * mean_b + c1) * (var_a + var_b + c2));
            ++count;
        }
    }
    return total / count;
}

constexpr double rounding = 1e-10; // two orders of summation of a few thousand terms

TEST(Ssim, EqualsItsDefinition) {
    for (const int channels : {1, 3}) {
        const Image a = noisy_ramp(37, 29, channels, 1, 12), b = noisy_ramp(37, 29, channels, 2, 40);
        const auto value = require(ssim(a, b));
        EXPECT_NEAR(*value, by_definition(a, b), rounding);
        EXPECT_LT(*value, 0.99);
    }
}

TEST(Ssim, KeepsItsVerifiedValue) {
    EXPECT_NEAR(*require(ssim(noisy_ramp(64, 48, 3, 7, 10), noisy_ramp(64, 48, 3, 8, 30))), 0.822120737512, 1e-9);
}

TEST(Ssim, OfIdenticalImagesIsOne) {
    const Image a = noisy_ramp(20, 31, 3, 5, 50);
    EXPECT_EQ(*ssim(a, a), 1.0);
}

TEST(Ssim, IsSymmetricAndFallsWithTheError) {
    const Image a = noisy_ramp(40, 40, 1, 1, 2), b = noisy_ramp(40, 40, 1, 2, 20), c = noisy_ramp(40, 40, 1, 2, 60);
    EXPECT_NEAR(*ssim(a, b), *ssim(b, a), rounding);
    EXPECT_GT(*ssim(a, b), *ssim(a, c));
}

TEST(Ssim, RefusesWhatItCannotCompare) {
    const Image a = noisy_ramp(20, 20, 1, 1, 2);
    EXPECT_FALSE(ssim(a, noisy_ramp(20, 21, 1, 1, 2)));
    EXPECT_FALSE(ssim(a, noisy_ramp(20, 20, 3, 1, 2)));
    EXPECT_FALSE(ssim(noisy_ramp(10, 20, 1, 1, 2), noisy_ramp(10, 20, 1, 1, 2)));
    Image broken = a;
    broken.values[7] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_FALSE(ssim(a, broken));
    broken.values.pop_back();
    EXPECT_FALSE(ssim(broken, broken));
}

} // namespace unseen::perception::ssim_test
