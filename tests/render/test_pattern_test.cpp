// Test patterns: the luminances that dithered codes come to, against the formulas.
#include "gl_test.h"

#include <unseen/render/internal/test_pattern.h>

namespace test_pattern_test {

using namespace unseen::render;
using namespace unseen::render::testing;

constexpr double degrees = 180 / std::numbers::pi;
constexpr double tangent_per_pixel = 0.000508; // 34.36 pixels per degree

// 0.5 to 100 cd/m2 with a gamma of 2.2.
std::vector<double> levels() {
    std::vector<double> result;
    for (int i = 0; i < 256; ++i) result.push_back(0.5 + 99.5 * std::pow(i / 255.0, 2.2));
    return result;
}

class TestPatternTest : public GlTest {
protected:
    void SetUp() override {
        GlTest::SetUp();
        if (IsSkipped()) return;
        auto made = require(TestPatternDrawer::create(context(), levels()));
        drawer_.emplace(std::move(*made));
    }
    void TearDown() override {
        drawer_.reset();
        GlTest::TearDown();
    }

    std::vector<double> luminances(TestPattern pattern, int width, int height, unsigned frame = 0) {
        pattern.frame = frame;
        const auto codes = drawer_->draw(pattern, width, height);
        EXPECT_TRUE(codes) << codes.error().message;
        std::vector<double> result;
        const auto level = levels();
        for (const float code : *codes) {
            const double number = static_cast<double>(code) * 255;
            EXPECT_NEAR(number, std::round(number), 1e-3);
            result.push_back(level[static_cast<std::size_t>(std::lround(number))]);
        }
        return result;
    }
    TestPatternDrawer& drawer() { return *drawer_; }

private:
    std::optional<TestPatternDrawer> drawer_;
};

// A contrast of a thirtieth of a code's step, found again by correlation with the pattern over many frames.
TEST_F(TestPatternTest, DitheringReachesContrastsFarBelowACode) {
    TestPattern pattern;
    pattern.frequency_cpd = 4;
    pattern.sigma_deg = 1.5 / 4;
    pattern.phase_deg = 30;
    constexpr int size = 128, frames = 60;
    for (const double contrast : {0.0, 0.0005, 0.003, 0.05}) {
        pattern.contrast = contrast;
        double with_template = 0, template_squares = 0, sum = 0;
        for (unsigned frame = 0; frame < frames; ++frame) {
            const auto image = luminances(pattern, size, size, frame);
            for (int y = 0; y < size; ++y)
                for (int x = 0; x < size; ++x) {
                    const double ax = std::atan((x + 0.5 - size / 2.0) * tangent_per_pixel) * degrees;
                    const double ay = std::atan((size / 2.0 - y - 0.5) * tangent_per_pixel) * degrees;
                    const double wave = std::exp(-(ax * ax + ay * ay) / (2 * pattern.sigma_deg * pattern.sigma_deg)) *
                                        std::cos(2 * std::numbers::pi * 4 * ax + pattern.phase_deg / degrees);
                    const double l = image[static_cast<std::size_t>(y * size + x)];
                    with_template += (l / pattern.mean - 1) * wave;
                    template_squares += wave * wave;
                    sum += l;
                }
        }
        // The noise of one code's step, 0.9% of the mean at most: half of it over the root of all weights.
        const double tolerance = 4 * 0.0045 / std::sqrt(template_squares) + 1e-3 * contrast;
        EXPECT_NEAR(with_template / template_squares, contrast, tolerance) << contrast;
        EXPECT_LT(tolerance, 2e-4);
        EXPECT_NEAR(sum / (size * size * frames), pattern.mean, 0.01 * pattern.mean * (contrast + 0.02));
    }
}

TEST_F(TestPatternTest, NoiseChangesFromFrameToFrameAndRepeats) {
    TestPattern pattern;
    pattern.contrast = 0.001;
    EXPECT_EQ(luminances(pattern, 64, 64, 5), luminances(pattern, 64, 64, 5));
    EXPECT_NE(luminances(pattern, 64, 64, 5), luminances(pattern, 64, 64, 6));
}

// Ten degrees aside a pixel is smaller, and the patch lies where it should.
TEST_F(TestPatternTest, PatchesLieAtTheirAngle) {
    TestPattern pattern;
    pattern.contrast = 0.9;
    pattern.frequency_cpd = 2;
    pattern.sigma_deg = 0.75;
    pattern.centre = {std::tan(10 / degrees), 0};
    const int width = 800, height = 200;
    const auto image = luminances(pattern, width, height);
    double energy = 0, first = 0;
    for (int x = 0; x < width; ++x)
        for (int y = 0; y < height; ++y) {
            const double off = std::pow(image[static_cast<std::size_t>(y * width + x)] / pattern.mean - 1, 2);
            if (off < 1e-3) continue; // the dither
            energy += off;
            first += off * std::atan((x + 0.5 - width / 2.0) * tangent_per_pixel) * degrees;
        }
    EXPECT_NEAR(first / energy, 10, 0.05);
}

TEST_F(TestPatternTest, MatchesAndMarks) {
    TestPattern pattern;
    pattern.kind = TestPattern::Kind::match;
    pattern.rows = 4;
    pattern.white_rows = 1;
    pattern.code = 0.4;
    pattern.marks = {{30, 2, 33, 5}};
    pattern.mark_code = 1;
    const auto codes = require(drawer().draw(pattern, 40, 16));
    const auto at = [&](int x, int y) { return (*codes)[static_cast<std::size_t>(y * 40 + x)]; };
    for (int y = 0; y < 16; ++y) EXPECT_EQ(at(5, y), y % 4 == 0 ? 1.0f : 0.0f) << y;
    EXPECT_NEAR(at(35, 9), 0.4, 1e-6);
    EXPECT_EQ(at(30, 2), 1.0f);
    EXPECT_EQ(at(32, 4), 1.0f);
    EXPECT_NE(at(33, 4), 1.0f);
    EXPECT_NE(at(30, 1), 1.0f);
}

TEST_F(TestPatternTest, RefusesWhatCannotBeDrawn) {
    const auto refused = [&](auto change) {
        TestPattern pattern;
        change(pattern);
        return !drawer().draw(pattern, 8, 8);
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(refused([](TestPattern& p) { p.contrast = 1.5; }));
    EXPECT_TRUE(refused([=](TestPattern& p) { p.contrast = nan; }));
    EXPECT_TRUE(refused([=](TestPattern& p) { p.centre.x = nan; }));
    EXPECT_TRUE(refused([](TestPattern& p) { p.sigma_deg = 0; }));
    EXPECT_TRUE(refused([](TestPattern& p) { p.white_rows = 3; }));
    EXPECT_TRUE(refused([](TestPattern& p) { p.marks.resize(9); }));
    EXPECT_FALSE(drawer().draw(TestPattern(), 0, 8));
    auto wrong = levels();
    wrong[7] = 0;
    EXPECT_THAT(error_in(TestPatternDrawer::create(context(), wrong)), HasSubstr("code 7"));
}

} // namespace test_pattern_test
