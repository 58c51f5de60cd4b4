// Targets, their limits, and how they are read back.
#include "gl_test.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/render/target.h>

namespace target_test {

using namespace unseen::render;
using TargetTest = unseen::render::testing::GlTest;

void fill(const Target& target, int attachment, glm::vec4 colour) {
    const GLenum drawn = GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(attachment);
    glNamedFramebufferDrawBuffer(target.id(), drawn);
    glClearNamedFramebufferfv(target.id(), GL_COLOR, 0, &colour.x);
}

TEST_F(TargetTest, IsMadeInAnyShape) {
    for (auto [width, height] : {std::pair{1, 1}, {640, 3}, {3, 640}})
        for (bool depth : {true, false}) {
            const auto made = require(Target::create(context(), width, height, {.depth = depth, .label = "test"}));
            EXPECT_EQ(made->width(), width);
            EXPECT_EQ(made->height(), height);
            EXPECT_NE(made->id(), 0u);
            EXPECT_NE(made->colour_texture(), 0u);
            EXPECT_EQ(made->colour_texture(1), 0u);
            EXPECT_EQ(made->depth_texture() != 0, depth);
        }
}

TEST_F(TargetTest, RefusesNoPixels) {
    for (auto [width, height] : {std::pair{0, 1}, {1, 0}, {-5, 5}}) {
        const auto made = Target::create(context(), width, height);
        ASSERT_FALSE(made);
        EXPECT_EQ(made.error().code, unseen::ErrorCode::invalid_argument);
    }
    EXPECT_FALSE(Target::create(context(), 4, 4, {.colours = {}, .depth = false})) << "nothing to draw to";
}

TEST_F(TargetTest, RefusesMoreThanTheDriverCanDraw) {
    const int most = largest_target_side();
    ASSERT_GE(most, 4096) << "OpenGL 4.5 promises 16384, but be patient";
    const auto made = Target::create(context(), most + 1, 1);
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, unseen::ErrorCode::unsupported);
    EXPECT_THAT(made.error().message, HasSubstr(std::to_string(most)));
    EXPECT_FALSE(Target::create(context(), 4, 4, {.colours = std::vector(1000, ColourFormat::rgba32f)}));
}

TEST_F(TargetTest, KeepsItsColoursApart) {
    const auto made =
        require(Target::create(context(), 5, 3, {.colours = {ColourFormat::rgba32f, ColourFormat::rgba32f}}));
    fill(*made, 0, {0.1f, 0.2f, 0.3f, 0.7f});
    fill(*made, 1, {1, 2, 4, 0.5f});
    const auto luminance = read_luminance(*made), colour = read_colour(*made, 1), other = read_luminance(*made, 1);
    ASSERT_TRUE(luminance && colour && other);
    EXPECT_EQ(luminance->size(), 15u);
    EXPECT_THAT(*luminance, Each(0.7f));
    EXPECT_EQ(colour->size(), 45u);
    EXPECT_EQ((*colour)[44], 4);
    EXPECT_THAT(*other, Each(0.5f));
    EXPECT_FALSE(read_pixels(*made, 2));
    EXPECT_FALSE(read_pixels(*made, -1));
}

TEST_F(TargetTest, ReadsDepthOfDepthOnlyTargets) {
    const auto made = require(Target::create(context(), 4, 4, {.colours = {}}));
    const float depth = 0.3f;
    glClearNamedFramebufferfv(made->id(), GL_DEPTH, 0, &depth);
    EXPECT_THAT(*require(read_depth(*made)), Each(FloatEq(depth)));
    EXPECT_FALSE(read_luminance(*made));
    EXPECT_FALSE(read_depth(*require(Target::create(context(), 4, 4, {.depth = false}))));
}

TEST_F(TargetTest, RowsComeFromTheTopAlsoOfForeignFramebuffers) {
    const auto own = require(Target::create(context(), 2, 3));
    for (int row = 0; row < 3; ++row) { // in the order of memory
        const std::array<glm::vec4, 2> values = {glm::vec4(static_cast<float>(row)),
                                                 glm::vec4(static_cast<float>(row))};
        glTextureSubImage2D(own->colour_texture(), 0, 0, row, 2, 1, GL_RGBA, GL_FLOAT, values.data());
    }
    EXPECT_THAT(*read_luminance(*own), ::testing::ElementsAre(0, 0, 1, 1, 2, 2));
    const auto foreign = require(Target::foreign(context(), 2, 3, {.id = own->id(), .is_for_display = false}));
    EXPECT_THAT(*read_luminance(*foreign), ::testing::ElementsAre(2, 2, 1, 1, 0, 0));
    const PixelBox bottom{1, 1, 1, 2};
    EXPECT_THAT(*read_depth(*own, bottom), ::testing::SizeIs(2));
    EXPECT_THAT(*read_pixels(*own, 0, bottom), ::testing::ElementsAre(glm::vec4(1), glm::vec4(2)));
    EXPECT_THAT(*read_pixels(*foreign, 0, bottom), ::testing::ElementsAre(glm::vec4(1), glm::vec4(0)));
    const auto display = require(Target::foreign(context(), 2, 3, {.id = own->id()}));
    EXPECT_FALSE(read_luminance(*display)) << "displays get codes";
}

TEST_F(TargetTest, PartsThatAreReadLieInIt) {
    const auto made = require(Target::create(context(), 5, 3));
    constexpr int most = std::numeric_limits<int>::max();
    for (const PixelBox& part : {PixelBox{0, 0, 6, 3}, PixelBox{0, 1, 5, 3}, PixelBox{-1, 0, 2, 2},
                                 PixelBox{0, 0, 0, 1}, PixelBox{most, 0, most, 1}, PixelBox{0, -most, 1, most}}) {
        EXPECT_THAT(error_in(read_pixels(*made, 0, part)), HasSubstr("5x3"));
        EXPECT_FALSE(read_depth(*made, part));
    }
}

TEST_F(TargetTest, ForeignFramebuffersStayTheirOwners) {
    const auto own = require(Target::create(context(), 2, 2));
    { const auto foreign = Target::foreign(context(), 2, 2, {.id = own->id()}); }
    EXPECT_TRUE(glIsFramebuffer(own->id()));
    EXPECT_THAT(error_in(Target::foreign(context(), 2, 2)), HasSubstr("headless"));
}

TEST_F(TargetTest, IsDeletedInItsOwnContext) {
    auto target = require(Target::create(context(), 2, 2));
    const unsigned id = target->id();
    auto other = require(Context::headless());
    ASSERT_TRUE(other->make_current());
    { const Target gone = std::move(*target); }
    ASSERT_TRUE(context().make_current());
    EXPECT_FALSE(glIsFramebuffer(id));
}

TEST_F(TargetTest, KeepsItsContextAlive) {
    std::optional<Target> target;
    {
        auto other = require(Context::headless());
        auto made = require(Target::create(*other, 2, 2));
        target = std::move(*made);
    }
    EXPECT_TRUE(read_pixels(*target));
    target.reset();
    EXPECT_TRUE(context().make_current());
}

} // namespace target_test
