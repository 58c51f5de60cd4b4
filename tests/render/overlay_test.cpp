// Images over pictures: exact pixels, mixed as light is, in place, cut off at the edges, and nothing without an image.
#include "gl_test.h"
#include "scenes.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/render/internal/overlay.h>
#include <unseen/render/renderer.h>

namespace overlay_test {

using namespace unseen::render;
using namespace unseen::render::testing;

constexpr int width = 7, height = 5;
constexpr glm::vec4 below{0.1f, 0.2f, 0.4f, 0.3f}; // what targets hold before; luminance in a

double decoded(int code) {
    const double c = code / 255.0;
    return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}
double encoded(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

class OverlayTest : public GlTest {
protected:
    Target target(const TargetOptions& options = {}, glm::vec4 colour = below) {
        auto made = require(Target::create(context(), width, height, options));
        EXPECT_TRUE(draw({}, {.view = frontal_view(width, height)}, *made, {.colour = colour}));
        return std::move(*made);
    }
    Overlay overlay(int columns, int rows, const std::vector<glm::u8vec4>& pixels) {
        Overlay made(context());
        const auto set = require(made.set_image({columns, rows, pixels}));
        return made;
    }
};

glm::vec4 pixel_of(const Target& target, int x, int y) {
    return read_pixels(target)->at(static_cast<std::size_t>(y * width + x));
}

// What lies over `below` in a target of linear light.
glm::dvec4 mixed(glm::u8vec4 over) {
    const glm::dvec3 rgb(decoded(over.r), decoded(over.g), decoded(over.b));
    const double luminance = glm::dot(rgb, glm::dvec3(0.2126, 0.7152, 0.0722)), share = over.a / 255.0;
    return share * glm::dvec4(rgb, luminance) + (1 - share) * glm::dvec4(below);
}

TEST_F(OverlayTest, LightIsMixedAndNotItsCodes) {
    // Opaque, half, a trace of it, nothing; and codes on both sides of sRGB's linear part.
    const std::vector<glm::u8vec4> pixels = {{255, 255, 255, 255}, {255, 255, 255, 128}, {200, 100, 50, 1},
                                             {255, 0, 255, 0},     {10, 11, 3, 255},     {188, 90, 7, 77}};
    Target to = target();
    ASSERT_TRUE(overlay(3, 2, pixels).draw(to, {2, 1}));
    constexpr double shader_pow = 2e-6; // of a float's, in light of 0 to 1
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const glm::vec4 found = pixel_of(to, x, y);
            const bool is_covered = x >= 2 && x < 5 && y >= 1 && y < 3;
            if (!is_covered) {
                EXPECT_EQ(found, below) << x << ", " << y;
                continue;
            }
            const glm::u8vec4 over = pixels[static_cast<std::size_t>((y - 1) * 3 + x - 2)];
            if (over.a == 0) EXPECT_EQ(found, below);
            const glm::dvec4 expected = mixed(over);
            for (int c = 0; c < 4; ++c) EXPECT_NEAR(found[c], expected[c], shader_pow) << x << ", " << y << ", " << c;
        }
    }
}

TEST_F(OverlayTest, DisplaysGetTheSameLightInCodes) {
    Target to = target({.colours = {ColourFormat::srgb8}}, glm::vec4(0));
    ASSERT_TRUE(overlay(3, 1, {{255, 255, 255, 128}, {255, 255, 255, 255}, {99, 99, 99, 255}}).draw(to, {0, 4}));
    constexpr double code = 1.0 / 255; // drivers round in either direction
    EXPECT_NEAR(pixel_of(to, 0, 4).g, encoded(128 / 255.0), code) << "188, where mixed codes would be 128";
    EXPECT_EQ(pixel_of(to, 1, 4), glm::vec4(1));
    EXPECT_NEAR(pixel_of(to, 2, 4).g, 99 / 255.0, code) << "opaque codes stay what they are";
    for (int x = 0; x < 3; ++x) EXPECT_EQ(pixel_of(to, x, 4).a, 1);
    EXPECT_EQ(pixel_of(to, 0, 3), glm::vec4(0, 0, 0, 1));
}

// Framebuffers of others that do not encode hold codes, which are all that there is to mix; their first row is the
// lowest.
TEST_F(OverlayTest, ForeignFramebuffersAreMixedInWhatTheyHold) {
    Target floats = target();
    auto coded = require(Target::foreign(context(), width, height, {.id = floats.id()}));
    ASSERT_TRUE(draw({}, {.view = frontal_view(width, height)}, *coded, {.colour = glm::vec4(0)}));
    ASSERT_TRUE(overlay(1, 2, {{255, 255, 255, 128}, {51, 102, 255, 255}}).draw(*coded, {6, 0}));
    const auto pixels = *read_pixels(*coded);
    EXPECT_NEAR(pixels[6].g, 128 / 255.0, 1e-6);
    EXPECT_NEAR(pixels[width + 6].r, 0.2, 1e-6);
    EXPECT_NEAR(pixels[width + 6].g, 0.4, 1e-6);
    EXPECT_EQ(pixels[2 * width + 6], glm::vec4(0, 0, 0, 1));
    EXPECT_EQ(pixels[5], glm::vec4(0, 0, 0, 1));
    EXPECT_EQ(pixels[6].a, 1);

    auto linear = require(Target::foreign(context(), width, height, {.id = floats.id(), .is_for_display = false}));
    ASSERT_TRUE(draw({}, {.view = frontal_view(width, height)}, *linear, {.colour = below}));
    ASSERT_TRUE(overlay(1, 1, {{188, 90, 7, 77}}).draw(*linear, {3, 4}));
    EXPECT_NEAR((*read_pixels(*linear))[4 * width + 3].r, mixed({188, 90, 7, 77}).r, 2e-6);
}

TEST_F(OverlayTest, WhatLiesOutsideIsCutOff) {
    // Columns in red, rows in green, so that a shift shows.
    std::vector<glm::u8vec4> pixels;
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x) pixels.push_back({50 + 10 * x, 150 + 10 * y, 0, 255});
    const Overlay image = overlay(4, 4, pixels);
    constexpr int far = 2'000'000'000;
    for (const glm::ivec2 corner : {glm::ivec2(-2, -3), glm::ivec2(5, 3), glm::ivec2(-1, 4), glm::ivec2(4, -3),
                                    glm::ivec2(far, 0), glm::ivec2(-far, -far), glm::ivec2(width, 0)}) {
        Target to = target();
        ASSERT_TRUE(image.draw(to, corner));
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                const glm::vec4 found = pixel_of(to, x, y);
                const glm::dvec2 in = glm::dvec2(x, y) - glm::dvec2(corner);
                if (in.x < 0 || in.y < 0 || in.x > 3 || in.y > 3) {
                    EXPECT_EQ(found, below) << x << ", " << y;
                    continue;
                }
                EXPECT_NEAR(found.r, decoded(50 + 10 * static_cast<int>(in.x)), 2e-6) << x << ", " << y;
                EXPECT_NEAR(found.g, decoded(150 + 10 * static_cast<int>(in.y)), 2e-6) << x << ", " << y;
            }
        }
    }
}

TEST_F(OverlayTest, OneAttachmentIsDrawnTo) {
    Target to = target({.colours = {ColourFormat::rgba32f, ColourFormat::rgba32f}});
    ASSERT_TRUE(draw({}, {.view = frontal_view(width, height)}, to, {.colour = glm::vec4(0)}, 1));
    ASSERT_TRUE(overlay(1, 1, {{255, 255, 255, 255}}).draw(to, {0, 0}, 1));
    EXPECT_THAT(*read_pixels(to, 0), Each(below));
    EXPECT_EQ(read_pixels(to, 1)->front(), glm::vec4(1));
}

TEST_F(OverlayTest, WithoutAnImageNothingIsMadeOrDrawn) {
    const auto living = [] { // GL names are small numbers, given out in turn
        int count = 0;
        for (GLuint name = 1; name < 4096; ++name)
            count += (glIsTexture(name) == GL_TRUE) + (glIsBuffer(name) == GL_TRUE) + (glIsProgram(name) == GL_TRUE) +
                     (glIsVertexArray(name) == GL_TRUE);
        return count;
    };
    Target to = target();
    const int before = living();
    Overlay none(context());
    EXPECT_FALSE(none.has_image());
    ASSERT_TRUE(none.draw(to, {0, 0}));
    ASSERT_TRUE(none.set_image({}));
    ASSERT_TRUE(none.draw(to, {0, 0}));
    EXPECT_THAT(*read_pixels(to), Each(below));
    EXPECT_EQ(living(), before);

    const std::vector<glm::u8vec4> white(1, glm::u8vec4(255));
    ASSERT_TRUE(none.set_image({1, 1, white}));
    EXPECT_TRUE(none.has_image());
    const int with_image = living();
    EXPECT_GT(with_image, before);
    ASSERT_TRUE(none.set_image({}));
    EXPECT_EQ(living(), with_image - 1) << "the texture";
    ASSERT_TRUE(none.draw(to, {0, 0}));
    EXPECT_THAT(*read_pixels(to), Each(below));
}

TEST_F(OverlayTest, ImagesReplaceEachOther) {
    Overlay image = overlay(1, 1, {{255, 0, 0, 255}});
    const std::vector<glm::u8vec4> green(1, {0, 255, 0, 255}), two(2, {0, 0, 255, 255});
    Target to = target({}, glm::vec4(0));
    ASSERT_TRUE(image.set_image({1, 1, green}));
    ASSERT_TRUE(image.draw(to, {0, 0}));
    EXPECT_EQ(glm::vec3(pixel_of(to, 0, 0)), glm::vec3(0, 1, 0));
    ASSERT_TRUE(image.set_image({2, 1, two}));
    ASSERT_TRUE(image.draw(to, {0, 0}));
    EXPECT_EQ(glm::vec3(pixel_of(to, 1, 0)), glm::vec3(0, 0, 1));
}

// What comes after it is drawn as before.
TEST_F(OverlayTest, LeavesTheRendererAlone) {
    const Scene scene(cube());
    auto renderer = require(Renderer::create(context(), scene.tree));
    const auto first = renderer->draw(scene.cut, frontal_view(width, height));
    Target to = target();
    ASSERT_TRUE(overlay(2, 1, {{255, 255, 255, 99}, {0, 0, 0, 255}}).draw(to, {1, 1}));
    const auto second = renderer->draw(scene.cut, frontal_view(width, height));
    ASSERT_TRUE(first && second);
    EXPECT_EQ(first->luminance, second->luminance);
}

TEST_F(OverlayTest, RefusesWhatIsNoImageAndNoPicture) {
    Overlay image(context());
    const std::vector<glm::u8vec4> three(3);
    const auto why_not = [&](int columns, int rows) {
        const auto set = image.set_image({columns, rows, three});
        return set ? "taken" : set.error().message;
    };
    EXPECT_THAT(why_not(2, 2), HasSubstr("2x2 pixels does not come as 3"));
    EXPECT_THAT(why_not(-3, -1), HasSubstr("-3x-1"));
    EXPECT_THAT(why_not(3, 0), HasSubstr("3x0"));
    EXPECT_FALSE(image.has_image());
    EXPECT_EQ(why_not(3, 1), "taken");

    Target depth = target({.colours = {}});
    EXPECT_FALSE(image.draw(depth, {0, 0})) << "no colours";
    Target to = target();
    EXPECT_FALSE(image.draw(to, {0, 0}, 1));
    auto other = require(Context::headless());
    EXPECT_THAT(Overlay(*other).draw(to, {0, 0}).error().message, HasSubstr("another OpenGL context"));
    ASSERT_TRUE(context().make_current());
}

} // namespace overlay_test
