// The judge that sums over space: its window against the law of area, and gratings against closed forms and people.
#include <perception/summing_judge.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "judge/summation.h"

namespace unseen::perception {
namespace {

double default_ppd() { return pixels_per_degree(Display{}).value(); }

Image flat(int side, double value) {
    const auto pixels = static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
    return {side, side, 1, std::vector<float>(pixels, static_cast<float>(value))};
}

// Its envelope's area is pi sigma^2.
Image with_gabor(double cpd, double contrast, double sigma_deg, double luminance, int side, double angle = 0) {
    Image image = flat(side, luminance);
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
            const double dx = (x - side / 2) / default_ppd(), dy = (y - side / 2) / default_ppd();
            const double along = dx * std::cos(angle) + dy * std::sin(angle);
            const double envelope = std::exp(-(dx * dx + dy * dy) / (2 * sigma_deg * sigma_deg));
            image.at(x, y) *=
                static_cast<float>(1 + contrast * envelope * std::cos(2 * std::numbers::pi * cpd * along));
        }
    }
    return image;
}

double largest_ratio(const Image& reference, const Image& test, double gain = 1, const JudgeOptions& options = {}) {
    const auto judge = SummingJudge::create(reference, options, gain);
    EXPECT_TRUE(judge);
    const auto judged = judge->judge(test);
    EXPECT_TRUE(judged);
    return judged ? judged->max_ratio : 0;
}

double closed_form(CsfModel model, double cpd, double luminance, double area) {
    Stimulus s;
    s.frequency = CyclesPerDegree(cpd), s.luminance = Luminance(luminance), s.area = SquareDegrees(area);
    return sensitivity(model, s);
}

// ---- the window

// The mean of w over discs, w = Ac / (Ac + pi r^2)^2, is the law of area.
TEST(SummationWindow, HoldsOfDiscsWhatTheLawOfAreaSays) {
    constexpr int side = 301;
    for (const double area : {20.0, 90.0, 744.0, 3000.0}) {
        const SummationWindow window(area);
        for (const double share_of_area : {0.1, 0.3, 1.0, 2.0}) {
            Plane disc(side, side);
            const double radius = std::sqrt(share_of_area * area / std::numbers::pi);
            double covered = 0;
            for (int y = 0; y < side; ++y) {
                for (int x = 0; x < side; ++x) {
                    const bool is_inside = std::hypot(x - side / 2, y - side / 2) < radius;
                    disc.row(y)[x] = is_inside ? 1 : 0;
                    covered += is_inside;
                }
            }
            const double at_middle = window.sums(disc).row(side / 2)[side / 2];
            EXPECT_NEAR(at_middle / (covered / (covered + area)), 1, 0.12) << area << " samples, " << share_of_area;
        }
    }
}

TEST(SummationWindow, LosesNothingOfAPlane) {
    Plane plane(257, 255);
    std::fill(plane.values.begin(), plane.values.end(), 2.0f);
    EXPECT_NEAR(SummationWindow(300).sums(plane).row(127)[128], 2, 1e-3);
    // Elsewhere it sums to what was there.
    Plane point(257, 255);
    point.row(100)[90] = 1;
    double sum = 0;
    for (const float v : SummationWindow(300).sums(point).values) sum += static_cast<double>(v);
    EXPECT_NEAR(sum, 1, 0.02);
}

// ---- the judge

TEST(SummingJudge, SeesGaborsOfAnyAreaAtTheirThreshold) {
    constexpr double three_decibels = 1.4125375446227544;
    for (const double cpd : {1.0, 2.0, 4.0, 5.5, 8.0, 13.0}) {
        for (const double sigma_cycles : {1.0, 1.5, 3.0, 6.0}) {
            for (const double angle : {0.0, 0.79}) {
                const double sigma = sigma_cycles / cpd, area = std::numbers::pi * sigma * sigma;
                const int side = std::clamp(static_cast<int>(6 * sigma * default_ppd()), 128, 700);
                const double threshold = 1 / closed_form(CsfModel::castle, cpd, 20, area);
                const double v = largest_ratio(flat(side, 20), with_gabor(cpd, threshold, sigma, 20, side, angle));
                EXPECT_GT(v, 1 / three_decibels) << cpd << " cpd, " << sigma_cycles << " cycles, " << angle;
                EXPECT_LT(v, three_decibels) << cpd << " cpd, " << sigma_cycles << " cycles, " << angle;
            }
        }
    }
}

TEST(SummingJudge, SeesMoreOfWhatIsLarger) {
    constexpr int side = 512;
    double last = 0;
    for (const double sigma : {0.1, 0.3, 1.0, 2.0}) {
        const double v = largest_ratio(flat(side, 20), with_gabor(4, 0.02, sigma, 20, side));
        EXPECT_GT(v, 1.1 * last) << sigma;
        last = v;
    }
}

// Barten's law of area and sensitivity, at the fovea.
TEST(SummingJudge, OfBartenSeesWhatBartenSays) {
    JudgeOptions options;
    options.csf = CsfModel::barten_1999;
    for (const double cpd : {2.0, 5.5}) {
        for (const double sigma : {0.5, 1.5}) {
            const double area = std::numbers::pi * sigma * sigma;
            const double threshold = 1 / closed_form(CsfModel::barten_1999, cpd, 20, area);
            const double v = largest_ratio(flat(512, 20), with_gabor(cpd, threshold, sigma, 20, 512), 1, options);
            EXPECT_NEAR(20 * std::log10(v), 0, 3) << cpd << " cpd, " << sigma;
        }
    }
}

TEST(SummingJudge, SeesSoManyTimesAsMuchAsThePerson) {
    const Image reference = flat(128, 20), test = with_gabor(4, 0.01, 0.5, 20, 128);
    const double of_median = largest_ratio(reference, test, median_person.gain);
    EXPECT_NEAR(largest_ratio(reference, test, default_person.gain) / of_median, 2, 1e-4);
    EXPECT_NEAR(largest_ratio(reference, test, strict_person.gain) / of_median, 2.7, 1e-4);
}

TEST(SummingJudge, SeesNothingWhereNothingDiffers) {
    Image image = flat(131, 20);
    for (std::size_t i = 0; i < image.values.size(); ++i) image.values[i] += static_cast<float>(i % 17);
    const auto judged = SummingJudge::create(image, {})->judge(image);
    ASSERT_TRUE(judged);
    EXPECT_EQ(judged->max_ratio, 0);
    EXPECT_EQ(judged->visible_pixels, 0u);
}

// Prepared once, it judges as if it had been made for each picture.
TEST(SummingJudge, MayBeAskedAgain) {
    const Image reference = flat(96, 20), a = with_gabor(4, 0.03, 0.5, 20, 96), b = with_gabor(2, 0.05, 0.5, 20, 96);
    const auto judge = SummingJudge::create(reference, {});
    const double first = judge->judge(a)->max_ratio;
    EXPECT_NE(judge->judge(b)->max_ratio, first);
    EXPECT_EQ(judge->judge(a)->max_ratio, first);
    EXPECT_EQ(SummingJudge::create(reference, {})->judge(b)->max_ratio, judge->judge(b)->max_ratio);
}

TEST(SummingJudge, StaysFiniteInTheDarkAndInFullContrast) {
    const Image black = flat(128, 0);
    Image dots = black;
    for (int y = 0; y < 128; y += 2)
        for (int x = 0; x < 128; x += 2) dots.at(x, y) = 10000;
    for (const auto& [a, b] : {std::pair(black, dots), std::pair(dots, black)}) {
        const auto judged = SummingJudge::create(a, {})->judge(b);
        EXPECT_TRUE(std::isfinite(judged->max_ratio));
        EXPECT_EQ(judged->visible_pixels, judged->pixels);
    }
}

TEST(SummingJudge, RefusesBadInput) {
    const Image good = flat(8, 1);
    for (const float value : {-1.0f, std::nanf(""), HUGE_VALF}) {
        Image bad = good;
        bad.values[3] = value;
        EXPECT_FALSE(SummingJudge::create(bad, {}));
        EXPECT_FALSE(SummingJudge::create(good, {})->judge(bad));
    }
    EXPECT_FALSE(SummingJudge::create(good, {})->judge(flat(9, 1)));
    for (const double gain : {0.0, -1.0, 1e4, std::nan("")}) EXPECT_FALSE(SummingJudge::create(good, {}, gain));
    JudgeOptions options;
    options.beta = 0;
    EXPECT_FALSE(SummingJudge::create(good, options));
}

} // namespace
} // namespace unseen::perception
