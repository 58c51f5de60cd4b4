// Numbers, drawings, plots and scales: ink where it belongs, and none outside.

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/number_format.h>

#include "colour_bar.h"
#include "drawing.h"
#include "panel_plot.h"
#include "screen_text.h"
#include "seamed_mesh.h"
#include "temp_folder.h"
#include "testing.h"

namespace support_test {

using namespace unseen;
using namespace unseen::app;
using unseen::perception::Image;

constexpr glm::vec3 black{0.0f}, white{1.0f};

Drawing drawing(int width, int height, glm::vec3 background = black) {
    return std::move(*Drawing::create(width, height, background));
}

Image image_of(const Drawing& drawing) { return std::move(*drawing.image()); }

double ink(const Drawing& drawing) {
    double sum = 0;
    for (const float value : image_of(drawing).values) sum += static_cast<double>(value);
    return sum / 3;
}

// The columns and rows where anything differs from the colour of the corner.
struct Extent {
    int left = std::numeric_limits<int>::max(), top = left, right = -1, bottom = -1;
};
Extent inked(const Image& image) {
    Extent extent;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            if (image.at(x, y, 0) != image.at(0, 0, 0) || image.at(x, y, 1) != image.at(0, 0, 1) ||
                image.at(x, y, 2) != image.at(0, 0, 2))
                extent = {std::min(extent.left, x), std::min(extent.top, y), std::max(extent.right, x),
                          std::max(extent.bottom, y)};
    return extent;
}

// Closed, oriented outward, with vertices that share places; no triangle lies across charts, and no normal is bent far.
TEST(SeamedMeshes, AreWhatTheirNamesSay) {
    for (const auto& [mesh, triangles, has_charts] : {std::tuple{helmet(), 20'840u, true},
                                                      {charted_ball(), 9'024u, true},
                                                      {gear(), 40'320u, false},
                                                      {hard_boxes(), 15'360u, false}}) {
        EXPECT_EQ(mesh.triangles.size(), triangles);
        EXPECT_EQ(mesh.texture.texels.empty(), !has_charts) << triangles;
        const auto tree = require(vdtree::build_tree(mesh.view()));
        EXPECT_EQ(tree->closedness(), vdtree::Closedness::closed_outward) << triangles;
        EXPECT_GT(tree->leaf_count(), tree->place_count()) << triangles;
        EXPECT_EQ(tree->triangle_count(), triangles);
        double widest = 0, least = 1; // of a triangle in the texture; the cosine between a normal and its face
        for (const vdtree::Triangle& t : mesh.triangles) {
            const auto p = [&](std::size_t k) { return mesh.positions[t[k]]; };
            const glm::dvec3 face = glm::normalize(glm::cross(p(1) - p(0), p(2) - p(0)));
            for (std::size_t k = 0; k < 3; ++k) {
                least = std::min(least, glm::dot(face, glm::dvec3(mesh.normals[t[k]])));
                if (!has_charts) continue;
                const glm::dvec2 edge(mesh.uvs[t[(k + 1) % 3]] - mesh.uvs[t[k]]);
                widest = std::max({widest, std::abs(edge.x), std::abs(edge.y)});
            }
        }
        EXPECT_LT(widest, 0.06) << triangles;
        EXPECT_GT(least, 0.6) << triangles;
    }
}

TEST(Numbers, AreWrittenOut) {
    EXPECT_EQ(rounded(8612.3, 3), "8,610");
    EXPECT_EQ(rounded(61.84, 3), "61.8");
    EXPECT_EQ(rounded(6184, 6), "6,184");
    EXPECT_EQ(rounded(0.00061849, 3), "0.000618");
    EXPECT_EQ(rounded(999.96, 4), "1,000") << "rounding adds a digit";
    EXPECT_EQ(rounded(0.5, 4), "0.5") << "no zeros at the end";
    EXPECT_EQ(rounded(1200, 2), "1,200") << "those before the point stay";
    EXPECT_EQ(rounded(-1234567, 3), "-1,230,000");
    EXPECT_EQ(rounded(0, 3), "0");
    EXPECT_EQ(rounded(1.5e-9, 3), "1.5e-09");
    EXPECT_EQ(rounded(NAN, 3), "none");
    EXPECT_EQ(rounded(INFINITY, 3), "infinite");
    EXPECT_EQ(with_decimals(61800.04, 1), "61,800.0");
    EXPECT_EQ(with_decimals(0.6, 0), "1");
    EXPECT_EQ(shortest(1e6), "1000000");
    EXPECT_EQ(shortest(0.1), "0.1");
    EXPECT_EQ(std::stod(shortest(1.0 / 3)), 1.0 / 3);
    EXPECT_EQ(std::stod(shortest(1e300)), 1e300);
    EXPECT_EQ(grouped(69666), "69,666");
    EXPECT_EQ(grouped(999), "999");
}

TEST(Drawing, LinesCoverTheirArea) {
    Drawing canvas = drawing(100, 100);
    canvas.line({20, 50}, {80, 50}, white, 4);
    EXPECT_NEAR(ink(canvas), 60 * 4 + 3.1416 * 4, 3); // with the round ends
    EXPECT_EQ(image_of(canvas).at(50, 40), 0.0f);
    EXPECT_EQ(image_of(canvas).at(50, 50), 1.0f);
    Drawing after_text = drawing(100, 100);
    after_text.text({0, 80}, " ", white, 12);
    after_text.line({20, 50}, {80, 50}, white, 4);
    EXPECT_EQ(ink(after_text), ink(canvas)) << "it begins where it is told to";
    Drawing dashed = drawing(100, 100);
    dashed.line({20, 50}, {80, 50}, white, 4, true);
    EXPECT_LT(ink(dashed), 0.95 * ink(canvas));
}

TEST(Drawing, ClipsEverything) {
    Drawing canvas = drawing(10, 10);
    canvas.fill({-5, -5}, {5, 5}, white);
    canvas.line({-50, -1000}, {-40, 2000}, white, 3);
    canvas.text({11, 0}, "outside", white, 30);
    canvas.text({0, -40}, "outside", white, 30);
    canvas.picture({20, 20}, image_of(canvas));
    EXPECT_EQ(ink(canvas), 0);
    canvas.clip({0, 0}, {4, 4});
    canvas.fill({-5, -5}, {1000, 1000}, white);
    EXPECT_EQ(ink(canvas), 16);
    canvas.end_clip();
    canvas.fill({-5, -5}, {1000, 1000}, white);
    EXPECT_EQ(ink(canvas), 100);
}

// What layouts count on: text is as wide and as high as it says.
TEST(Drawing, TextKeepsWithinItsExtents) {
    for (const std::string text : {"Unseen 1.5", "gjpqy|Ag", "W", "castle, 10 cd/m2"}) {
        const double width = Drawing::text_width(text, 20);
        Drawing level = drawing(400, 60), right = drawing(400, 60);
        level.text({10, 10}, text, white, 20);
        right.text({390, 10}, text, white, 20, Align::right);
        const Extent extent = inked(image_of(level));
        ASSERT_GE(extent.right, 0) << text;
        EXPECT_GE(extent.left, 9) << text;
        EXPECT_LE(extent.right, 10 + width + 1) << text;
        EXPECT_GT(extent.right, 10 + 0.6 * width) << text;
        EXPECT_GE(extent.top, 10) << text;
        EXPECT_LE(extent.bottom, 30) << text;
        EXPECT_NEAR(inked(image_of(right)).right, 390 - (10 + width - extent.right), 1.5) << text;
    }
    const std::string title = "a title that is far too long for so small a picture";
    EXPECT_LE(Drawing::text_width(title, Drawing::fitting_height(title, 20, 100)), 100.01);
    EXPECT_EQ(Drawing::fitting_height("short", 20, 100), 20);
}

// Cairo draws nothing any more once it is given something else than UTF-8: file names may hold anything.
TEST(Drawing, TakesAnyBytesAsText) {
    for (const std::string text :
         {"a\xFF\xFE", "\xC3", "\xE2\x82", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xC0\x80", "tab\t", "new\nline"}) {
        Drawing canvas = drawing(200, 60);
        canvas.text({5, 5}, text, white, 20);
        canvas.fill({190, 50}, {5, 5}, white);
        ASSERT_TRUE(canvas.image()) << canvas.image().error().message;
        EXPECT_GT(ink(canvas), 30) << text;
        EXPECT_GT(Drawing::text_width(text, 20), 0);
    }
    EXPECT_GT(Drawing::text_width("\xC3\xA4", 20), 0) << "an umlaut";
    EXPECT_EQ(Drawing::text_width("\xFF", 20), Drawing::text_width("?", 20));
}

// Light that a pixel of a layer leaves over a background, both as luminance.
double luminance_over(glm::u8vec4 pixel, double background) {
    const auto linear = [](int code) {
        const double c = code / 255.0;
        return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    };
    const double share = pixel.a / 255.0;
    const double own = 0.2126 * linear(pixel.r) + 0.7152 * linear(pixel.g) + 0.0722 * linear(pixel.b);
    return share * own + (1 - share) * background;
}

TEST(ScreenText, IsReadableOverAnything) {
    const std::vector<TextLine> lines = {{"MMMM", "MMMM"}};
    const auto panel = text_panel(lines, 60, {2000, 2000}); // so large that strokes have whole pixels
    ASSERT_TRUE(panel);
    const auto at = [&](int x, int y) {
        return panel->pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(panel->width) +
                             static_cast<std::size_t>(x)];
    };
    const glm::u8vec4 backing = at(panel->width / 2, 5);
    for (const double background : {0.0, 0.2, 1.0}) {
        double leads = 0, letters = 0;
        for (int y = 0; y < panel->height; ++y) {
            for (int x = 0; x < panel->width; ++x) {
                const glm::u8vec4 pixel = at(x, y);
                double& most = pixel.r > pixel.b + 50 ? leads : letters; // leads are yellow
                if (pixel.r > 250) most = std::max(most, luminance_over(pixel, background));
            }
        }
        for (const double ink_luminance : {leads, letters})
            EXPECT_GT((ink_luminance + 0.05) / (luminance_over(backing, background) + 0.05), 4.5) << background;
    }
    EXPECT_LT(backing.a, 250) << "something shines through";
}

TEST(ScreenText, PanelsShrinkIntoTheirRoom) {
    const std::vector<TextLine> lines = {{"a line of some length"}, {"and another", "with a lead"}};
    const auto free = text_panel(lines, 20, {2000, 2000}), narrow = text_panel(lines, 20, {140, 2000}),
               low = text_panel(lines, 20, {2000, 30}), none = text_panel(lines, 20, {2000, 8});
    ASSERT_TRUE(free && narrow && low && none);
    EXPECT_NEAR(free->height, 2 * 20 + 2 * 0.55 * 20, 1.5);
    EXPECT_GT(free->width, 140);
    EXPECT_LE(narrow->width, 141);
    EXPECT_LT(narrow->height, free->height);
    EXPECT_LE(low->height, 31);
    EXPECT_GT(low->height, 0);
    EXPECT_EQ(none->width, 0) << "letters would be specks";
    EXPECT_EQ(text_panel({}, 20, {2000, 2000})->width, 0);
    EXPECT_EQ(text_panel(lines, NAN, {2000, 2000})->width, 0);
    for (const auto& panel : {*free, *narrow, *low, *none})
        EXPECT_EQ(panel.pixels.size(), static_cast<std::size_t>(panel.width) * static_cast<std::size_t>(panel.height));
}

TEST(ScreenText, BreaksLinesAtSpaces) {
    const std::string text = "No screenshot: Cannot create 'a-very-long-name-of-a-file.png': No such file";
    const auto lines = wrapped(text, 20, 200);
    ASSERT_GT(lines.size(), 2u);
    std::string joined;
    for (const std::string& line : lines) {
        joined += (joined.empty() ? "" : " ") + line;
        if (line.find(' ') != std::string::npos) EXPECT_LE(Drawing::text_width(line, 0.84 * 20), 200.0) << line;
    }
    EXPECT_EQ(joined, text);
    EXPECT_TRUE(wrapped("", 20, 200).empty());
    EXPECT_THAT(wrapped("  two   words ", 20, 2000), ::testing::ElementsAre("two words"));
}

TEST(PanelPlot, IsWrittenAsItsNameEnds) {
    const unseen::support::TempFolder folder;
    PanelPlot plot;
    plot.title = "a flight";
    plot.panels = {{"flat", {1, 0, 0}, {30, 30}}};
    ASSERT_TRUE(write_plot(folder / "plot.png", plot));
    const auto png = require(unseen::perception::read_image(folder / "plot.png"));
    EXPECT_EQ(png->image.width, plot.width);
    EXPECT_FALSE(write_plot(folder / "missing" / "plot.png", plot));
    EXPECT_FALSE(write_plot(folder / "plot.gif", plot));
}

std::set<int> rows_with(const Image& image, bool (*is_colour)(float, float, float)) {
    std::set<int> rows;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            if (is_colour(image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2))) rows.insert(y);
    return rows;
}
bool is_red(float r, float g, float b) { return r > 0.9f && g < 0.1f && b < 0.1f; }
bool is_blue(float r, float g, float b) { return b > 0.9f && g < 0.1f && r < 0.1f; }

// A first value a thousand times as large as the others does not press them to the bottom of their panel, nor leave it.
TEST(PanelPlot, ScalesBySettledValues) {
    PanelPlot plot;
    plot.settled_from = 1;
    plot.panels = {{"", {1, 1, 1}, {1, 1, 1}}, {"times", {1, 0, 0}, {5000, 4, 5, 4, 5, 4, 5}}};
    Drawing canvas = drawing(plot.width, height_of(plot), white);
    draw(plot, canvas);
    const Image image = image_of(canvas);
    std::set<int> rows; // of the curve's right half
    for (int y = 0; y < image.height; ++y)
        for (int x = image.width / 2; x < image.width; ++x)
            if (is_red(image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2))) rows.insert(y);
    ASSERT_FALSE(rows.empty());
    EXPECT_GT(*rows.rbegin() - *rows.begin(), 0.15 * plot.panel_height) << "from 4 to 5 of about 5";
    EXPECT_LT(*rows.rbegin() - *rows.begin(), 0.5 * plot.panel_height);
    const auto all = rows_with(image, is_red);
    EXPECT_GT(*all.begin(), 46 + plot.panel_height) << "it does not reach into the panel above";
}

TEST(ColourBar, LiesBelowTheMapWithAllOfItsText) {
    const ColourBar bar = visibility_bar();
    for (const int width : {4, 128, 1024}) {
        Image map{width, 8, 3, {}};
        map.values.assign(map.index(0, map.height, 0), 0.5f);
        const auto whole = require(with_colour_bar(map, bar));
        EXPECT_GE(whole->width, std::max(width, 100));
        for (int y = 0; y < map.height; ++y)
            for (int x = 0; x < map.width; ++x) ASSERT_EQ(whole->at(x, y, 2), 0.5f) << "pixels keep their places";
        // Below the bar itself: numbers and the unit, clear of the edges.
        Image text{whole->width, whole->height - map.height - 24, 3, {}};
        text.values.assign(whole->values.begin() + static_cast<std::ptrdiff_t>(whole->index(0, map.height + 24, 0)),
                           whole->values.end());
        const Extent extent = inked(text);
        EXPECT_GE(extent.left, 1) << width;
        EXPECT_LE(extent.right, whole->width - 2) << width;
        EXPECT_LE(extent.bottom, text.height - 2) << width;
        EXPECT_GT(extent.bottom, 20);
    }
    const glm::vec3 invisible = bar.colour_at(0.1), visible = bar.colour_at(0.5);
    EXPECT_GT(invisible.b, invisible.r);
    EXPECT_GT(visible.r, visible.b);
}

} // namespace support_test
