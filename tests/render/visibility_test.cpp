// The judge's passes by themselves: what they refuse, and what they make only when it is called for. Whether they judge
// right: tests/apps/gpu_judge_test.cpp.
#include "gl_test.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/render/internal/visibility_passes.h>
#include <unseen/render/target.h>

#include "gpu_plane.h"
#include "one_band.h"

namespace visibility_test {

using namespace unseen::render;
using unseen::render::testing::picture;
using unseen::render::testing::tables;
using VisibilityTest = unseen::render::testing::GlTest;

TEST_F(VisibilityTest, CountsInThresholds) {
    const auto reference = picture(context(), 6, 3, 10), test = picture(context(), 6, 3, 11);
    auto passes = require(VisibilityPasses::create(context(), tables(6, 3), reference.texture()));
    ASSERT_TRUE(passes->judge(test.texture()));
    const float v = std::sqrt(2.f) * 0.8f; // a contrast of 0.1, seen 8 times
    EXPECT_THAT(*require(passes->read_visibility()), Each(FloatNear(v, 1e-5f)));
    const auto summary = require(passes->summary());
    EXPECT_NEAR(summary->largest, v, 1e-5);
    EXPECT_EQ(summary->visible_pixels, 18u);
    ASSERT_TRUE(passes->map_thresholds());
    EXPECT_THAT(*passes->read_thresholds(), Each(FloatNear(10.f / 8, 1e-5f)));
    // Below one threshold nothing counts.
    ASSERT_TRUE(passes->judge(picture(context(), 6, 3, 10.5f).texture()));
    EXPECT_EQ(passes->summary()->visible_pixels, 0u);
}

TEST_F(VisibilityTest, MakesOnlyWhatIsCalledFor) {
    const auto reference = picture(context(), 6, 3, 10);
    auto passes = require(VisibilityPasses::create(context(), tables(6, 3), reference.texture()));
    EXPECT_EQ(passes->thresholds_texture(), 0u);
    EXPECT_FALSE(passes->summary());
    EXPECT_FALSE(passes->read_visibility());
    EXPECT_FALSE(passes->read_thresholds());
    ASSERT_TRUE(passes->judge(reference.texture()));
    EXPECT_EQ(passes->thresholds_texture(), 0u);
    ASSERT_TRUE(passes->map_thresholds());
    EXPECT_NE(passes->thresholds_texture(), 0u);
}

TEST_F(VisibilityTest, RefusesTablesForAnotherSize) {
    EXPECT_THAT(error_in(VisibilityPasses::create(context(), tables(5, 4), picture(context(), 4, 4, 10).texture())),
                HasSubstr("judge: the tables are for pictures of 5x4, not 4x4"));
}

TEST_F(VisibilityTest, RefusesTexturesThatAreNoPictures) {
    const auto reference = picture(context(), 4, 4, 10);
    auto passes = require(VisibilityPasses::create(context(), tables(4, 4), reference.texture()));
    const auto refused = [&](const LuminanceTexture& t, const char* why) {
        EXPECT_THAT(error_in(passes->judge(t)), HasSubstr(why)) << why;
        EXPECT_FALSE(passes->summary()) << "of the picture before";
        EXPECT_FALSE(luminance_extent(context(), t, "test")) << why;
    };
    auto texture = reference.texture();
    refused({.id = 12345, .width = 4, .height = 4}, "no texture");
    texture.width = 5;
    refused(texture, "4x4");
    texture = reference.texture(), texture.channel = 4;
    refused(texture, "channel");
    texture = reference.texture(), texture.scale = std::nanf("");
    refused(texture, "finite");
    GLuint others[3] = {};
    glCreateTextures(GL_TEXTURE_2D, 1, &others[0]);
    glTextureStorage2D(others[0], 1, GL_R32UI, 4, 4);
    refused({.id = others[0], .width = 4, .height = 4}, "floats");
    glCreateTextures(GL_TEXTURE_3D, 1, &others[1]);
    glTextureStorage3D(others[1], 1, GL_R32F, 4, 4, 4);
    refused({.id = others[1], .width = 4, .height = 4}, "two dimensions");
    glCreateTextures(GL_TEXTURE_2D, 1, &others[2]); // of no size
    refused({.id = others[2], .width = 4, .height = 4}, "0x0");
    glDeleteTextures(3, others);
    EXPECT_FALSE(LuminanceImage::create(context(), 4, 4, std::vector<float>(15, 1.f)));
    EXPECT_FALSE(LuminanceImage::create(context(), 0, 4, {}));
    ASSERT_TRUE(passes->judge(reference.texture()));
    EXPECT_EQ(passes->summary()->largest, 0);
}

// Such as lack levels below their first, which an application's own may.
TEST_F(VisibilityTest, ReadsTexturesWithoutMipLevels) {
    GLuint id = 0;
    glGenTextures(1, &id);
    glBindTexture(GL_TEXTURE_2D, id);
    const std::vector<float> values(16 * 4, 7);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, 4, 4, 0, GL_RGBA, GL_FLOAT, values.data());
    const auto extent = require(luminance_extent(context(), {.id = id, .width = 4, .height = 4, .channel = 3}, "test"));
    EXPECT_EQ(extent->least, 7);
    EXPECT_EQ(extent->largest, 7);
    glBindTexture(GL_TEXTURE_2D, 0);
    glDeleteTextures(1, &id);
}

TEST_F(VisibilityTest, FindsTheExtentOfAPicture) {
    std::vector<float> values(100 * 70, 3);
    values[17] = -0.f, values[6999] = 1e5f;
    auto image = require(LuminanceImage::create(context(), 100, 70, values));
    const auto extent = require(luminance_extent(context(), image->texture(), "reference"));
    EXPECT_EQ(extent->least, 0);
    EXPECT_EQ(extent->largest, 1e5f);
    values[201] = -1;
    ASSERT_TRUE(image->set(values));
    EXPECT_THAT(error_in(luminance_extent(context(), image->texture(), "reference")),
                HasSubstr("luminance of the reference at pixel (1, 2)"));
    EXPECT_FALSE(image->set(std::vector<float>(3, 1.f)));
}

TEST_F(VisibilityTest, RefusesPlanesThatCannotBeDrawnTo) {
    EXPECT_THAT(error_in(GpuPlanes().need({4, largest_target_side() + 1}, 1, PlaneFormat::full, "too high")),
                HasSubstr("memory does not suffice"));
    EXPECT_NE(context().take_errors(), ""); // GL says so, too
}

} // namespace visibility_test
