// Canvas, font and plot: ink where it belongs, and none outside.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "bitmap_font.h"
#include "canvas.h"
#include "panel_plot.h"
#include "plot.h"

namespace {

using namespace unseen::app;

constexpr glm::vec3 black{0.0f}, white{1.0f};

double ink(const Canvas& canvas) {
    double sum = 0;
    for (const float value : canvas.image().values) sum += static_cast<double>(value);
    return sum / 3;
}

TEST(BitmapFont, GlyphsAreWholeAndDiffer) {
    std::set<std::string_view> shapes;
    for (char c = ' '; c <= '~'; ++c) {
        EXPECT_EQ(glyph(c).size(), static_cast<std::size_t>(glyph_width * glyph_height)) << c;
        shapes.insert(glyph(c));
    }
    EXPECT_EQ(shapes.size(), 95u);
    EXPECT_EQ(glyph('\n'), glyph('?'));
    EXPECT_EQ(glyph(static_cast<char>(200)), glyph('?'));
}

TEST(Canvas, LinesCoverTheirArea) {
    Canvas canvas(100, 100, black);
    canvas.line({20, 50}, {80, 50}, white, 4);
    EXPECT_NEAR(ink(canvas), 60 * 4 + 3.1416 * 4, 3); // with the round ends
    EXPECT_EQ(canvas.image().at(50, 40), 0.0f);
    EXPECT_EQ(canvas.image().at(50, 50), 1.0f);
}

TEST(Canvas, ClipsEverything) {
    Canvas canvas(10, 10, black);
    canvas.fill(-5, -5, 5, 5, white);
    canvas.line({-50, -1000}, {-40, 2000}, white, 3);
    canvas.text(11, 0, "outside", white, 3);
    canvas.text(0, -30, "outside", white, 3);
    canvas.text_upward(-30, 5, "outside", white, 3);
    canvas.picture(20, 20, canvas.image());
    EXPECT_EQ(ink(canvas), 0);
    canvas.fill(-5, -5, 1000, 1000, white);
    EXPECT_EQ(ink(canvas), 100);
}

TEST(Canvas, TextTurnsWithoutLosingInk) {
    Canvas level(200, 200, black), upward(200, 200, black);
    level.text(10, 10, "Unseen 1.5", white, 2);
    upward.text_upward(10, 190, "Unseen 1.5", white, 2);
    EXPECT_GT(ink(level), 0);
    EXPECT_EQ(ink(level), ink(upward));
}

TEST(Canvas, CopiesPictures) {
    Canvas canvas(4, 4, black);
    canvas.picture(1, 2, {2, 1, 1, {0.25f, 2.0f}});
    EXPECT_EQ(canvas.image().at(1, 2, 1), 0.25f);
    EXPECT_EQ(canvas.image().at(2, 2, 0), 1.0f);
    EXPECT_NEAR(ink(canvas), 1.25, 1e-6);
}

TEST(Plot, DrawsACurveWhereItsPointsAre) {
    LogLogPlot plot;
    plot.curves = {{"flat", {1, 0, 0}, false, {{0.1, 31.622777}, {100, 31.622777}}}};
    plot.x_range = {0.1, 100};
    plot.y_range = {1, 1000};
    const auto image = draw(plot);
    int top = image.height, bottom = 0, left = image.width, red = 0;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            if (image.at(x, y, 0) < 0.9f || image.at(x, y, 1) > 0.5f || x > image.width * 2 / 3) continue;
            ++red;
            top = std::min(top, y);
            bottom = std::max(bottom, y);
            left = std::min(left, x);
        }
    }
    ASSERT_GT(red, 500);
    EXPECT_LE(bottom - top, 3) << "a level line";
    EXPECT_LT(left, image.width / 6);
    // The middle of the axis, on a logarithmic scale.
    EXPECT_NEAR((top + bottom) / 2.0, image.height / 2.0, image.height * 0.05);
}

TEST(PanelPlot, PutsCurvesInTheirPanels) {
    PanelPlot plot;
    plot.panels = {{"steady", {1, 0, 0}, {5, 5, 5, 5}}, {"gone", {0, 0, 1}, {0, std::nan(""), 3}}, {"empty", {0, 1, 0}, {}}};
    const auto image = draw(plot);
    EXPECT_EQ(image.width, plot.width);
    const auto rows_with = [&](auto is_colour) {
        std::set<int> rows;
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x)
                if (is_colour(image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2))) rows.insert(y);
        return rows;
    };
    const auto red = rows_with([](float r, float g, float b) { return r > 0.9f && g < 0.1f && b < 0.1f; });
    const auto blue = rows_with([](float r, float g, float b) { return b > 0.9f && g < 0.1f && r < 0.1f; });
    ASSERT_FALSE(red.empty());
    ASSERT_FALSE(blue.empty());
    EXPECT_LT(*red.rbegin(), *blue.begin()) << "one below the other";
    EXPECT_GT(image.height, 3 * plot.panel_height);
}

} // namespace
